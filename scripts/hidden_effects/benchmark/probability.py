"""The probabilities of the answers against what was hidden: log score and reliability."""

from dataclasses import dataclass
from math import log

NOTHING, ALIEN = "none", "none_of_these"
LEAST = 1e-6  # a probability of 0 for what is true costs as much as this one


@dataclass
class Decile:
    """Statements whose probability lies in one tenth of 0 to 1."""

    stated: float  # mean probability
    true: int
    of: int


def stated(outcome) -> dict:
    """Cause to probability; empty where the program states none."""
    diagnosis = outcome.diagnosis or {}
    whole = diagnosis.get("probabilities")
    if isinstance(whole, dict):
        return {name: float(p) for name, p in whole.items() if _is_number(p)}
    found = {}
    for cause in diagnosis.get("causes", []):
        for said in [cause, *(a for a in cause.get("alternatives") or [] if isinstance(a, dict))]:
            name = said.get("mechanism")
            if name and _is_number(said.get("probability")):
                found[name] = max(found.get(name, 0.0), float(said["probability"]))
    return found


def true_names(outcome) -> set:
    return {"none": {NOTHING}, "alien": {ALIEN}}.get(outcome.case.kind) or set(outcome.case.causes)


def log_score(outcomes) -> tuple[float, int] | None:
    """Mean of -log p of what is true, and over how many answers; None where no answer states probabilities.

    Sessions with two causes are left out, since their probabilities add up to more than 1.
    """
    costs = [-log(max(p.get(next(iter(true_names(o))), 0.0), LEAST)) for o in outcomes if o.case.kind != "pair" and (p := stated(o))]
    return (sum(costs) / len(costs), len(costs)) if costs else None


def reliability(outcomes) -> list[Decile]:
    """How often what is stated with a probability is true, by tenths of the probability; empty where none is stated."""
    tenths = [[] for _ in range(10)]
    for o in outcomes:
        for name, p in stated(o).items():
            tenths[min(int(p * 10), 9)].append((p, name in true_names(o)))
    return [Decile(sum(p for p, _ in t) / len(t), sum(hit for _, hit in t), len(t)) for t in tenths if t]


def _is_number(x):
    return isinstance(x, (int, float)) and not isinstance(x, bool) and 0 <= x <= 1
