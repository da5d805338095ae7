"""What is required of the diagnosis, counted over the outcomes."""

from collections import Counter, defaultdict
from dataclasses import dataclass
from math import inf
from statistics import median

from ..catalogue import CLASSES
from ..rig.traps import TRAPS
from .plan import LAWS, TOLD_APART, TOLD_BY_RIG_TRIALS

LARGEST_SET = 3
MATERIAL_BIAS = 0.02  # of the true value: less than this needs no mending


@dataclass
class Rate:
    name: str
    hits: int
    of: int
    required: float
    at_most: bool = False

    @property
    def value(self):
        return self.hits / self.of if self.of else None

    @property
    def met(self):
        """A rate without a case is not met by default: it is not part of this run."""
        if self.of == 0:
            return None
        return self.value <= self.required if self.at_most else self.value >= self.required


def named_set(cause) -> set:
    return {cause["mechanism"], *cause["indistinguishable"]}


def cause(outcome) -> str:
    """The one mechanism or alien that is hidden."""
    return outcome.case.causes[0]


def causes(outcome) -> list:
    return outcome.diagnosis["causes"] if outcome.diagnosis else []


def verdict(outcome) -> str:
    return outcome.diagnosis["verdict"] if outcome.diagnosis else "failed"


def law(outcome) -> dict:
    """The law of the elastic limit, with its values."""
    return ((outcome.diagnosis or {}).get("laws") or {}).get("elastic_limit") or {}


def found(outcome, mechanism, largest_set=LARGEST_SET) -> bool:
    if mechanism in LAWS:
        return law(outcome).get("law") == mechanism
    return any(mechanism in named_set(c) and len(named_set(c)) <= largest_set for c in causes(outcome))


def alone(outcome, mechanism) -> bool:
    if mechanism in LAWS:
        return found(outcome, mechanism) and not causes(outcome)
    return [named_set(c) for c in causes(outcome)] == [{mechanism}]


def rates(outcomes) -> list[Rate]:
    by = defaultdict(list)
    for o in outcomes:
        by[o.case.group].append(o)
    single = by["mechanism"]
    apart = [o for o in single if cause(o) in TOLD_APART]
    covered = [hit for o in single for _, hit in coverage(o)]
    every = defaultdict(list)
    for o in single:
        every[cause(o)].append(found(o, cause(o)))
    count = lambda xs: sum(map(bool, xs))
    others = [o for o in outcomes if not LAWS & set(o.case.causes) and law(o)]
    return [
        Rate("named, or in a named set of at most 3", count(found(o, cause(o)) for o in single), len(single),
             0.95),
        Rate("mechanisms found in at least half of their sessions",
             count(sum(v) * 2 >= len(v) for v in every.values()), len(every), 1.0),
        Rate("named alone, where it can be told apart", count(alone(o, cause(o)) for o in apart), len(apart),
             0.80),
        Rate("false alarms with nothing hidden", count(verdict(o) != "adequate" for o in by["none"]), len(by["none"]),
             0.05, at_most=True),
        Rate("`unexplained` for a cause in no catalogue", count(verdict(o) == "unexplained" for o in by["alien"]),
             len(by["alien"]), 0.90),
        Rate("both of two", count(all(found(o, m) for m in o.case.causes) for o in by["pair"]),
             len(by["pair"]), 0.80),
        Rate("a limit that is not a time said to be one", count(found(o, m) for o in others for m in LAWS), len(others),
             0.05, at_most=True),
        Rate("values whose interval covers the truth", count(covered), len(covered), 0.90),
        *(bias_rate(single, name) for name in ("k_srs_nm_per_rad", "x_e_rad")),
    ]


RIG = frozenset({*CLASSES["rig"], *CLASSES["sensor"]})
LARGEST_BIAS = 0.02  # of k_srs by a lever constant that is off, where rig trials measured it


def rig_rates(outcomes) -> list[Rate]:
    """What is required where sessions have rig trials; traps are counted each by itself.

    Behind a trap a fault of the rig may be left open or in a larger set, but nothing else may be named in its place: sets hold 95 %.
    """
    plain = [o for o in outcomes if not o.case.trap]
    single = [o for o in plain if o.case.kind == "mechanism"]
    empty = lambda group: [o for o in group if o.case.kind == "none"]
    wrist = lambda group: [o for o in group if o.case.kind == "mechanism" and cause(o) not in RIG]
    rig = lambda group: [o for o in group if o.case.kind == "mechanism" and cause(o) in RIG]
    out = [Rate(f"{m} named alone", sum(alone(o, m) for o in single if cause(o) == m), sum(cause(o) == m for o in single), 0.80)
           for m in TOLD_BY_RIG_TRIALS]
    out += [_false_alarms("false alarms with nothing hidden", empty(plain)), _no_rig_cause("", wrist(plain))]
    out.append(_small_biases([o for o in single if cause(o).startswith("lever_")]))
    for trap in TRAPS:
        group = [o for o in outcomes if o.case.trap == trap]
        name = f"trap:{trap}, "
        out += [_false_alarms(f"{name}false alarms with nothing hidden", empty(group)), _no_rig_cause(name, wrist(group)),
                Rate(f"{name}nothing else named for a fault of the rig", sum(not _names_another(o) for o in rig(group)), len(rig(group)), 0.95)]
    return out


def _false_alarms(name, empty):
    return Rate(name, sum(verdict(o) != "adequate" for o in empty), len(empty), 0.05, at_most=True)


def _no_rig_cause(name, wrist):
    """A cause that failed to be told counts against it: no answer is no right answer."""
    spared = sum(o.diagnosis is not None and not any(c["mechanism"] in RIG for c in causes(o)) for o in wrist)
    return Rate(f"{name}no rig cause named for a fault of the wrist", spared, len(wrist), 0.97)


def _names_another(outcome):
    """A named set without the true cause, or no answer at all."""
    return outcome.diagnosis is None or any(cause(outcome) not in named_set(c) for c in causes(outcome))


def _small_biases(of_lever):
    medians = bias_table(of_lever, "k_srs_nm_per_rad")
    return Rate(f"median bias on k_srs under {LARGEST_BIAS:.0%} (lever constants that are off)", sum(a < LARGEST_BIAS for _, a in medians.values()),
                len({cause(o) for o in of_lever}), 1.0)


def quick_rates(outcomes) -> list[Rate]:
    """Of one session each: the mechanism is in what is named, however many are with it, as often as sets of 95 % probability hold it
    (of 29, two misses are no surprise, four are); what is in no catalogue is unexplained, nothing is found in nothing, and no
    laboratory is without a right answer to either question."""
    single = [o for o in outcomes if o.case.group == "mechanism"]
    empty = [o for o in outcomes if o.case.group == "none"]
    alien = [o for o in outcomes if o.case.group == "alien"]
    is_in = sum(found(o, cause(o), largest_set=inf) for o in single)
    works = _laboratories_that_work(single + empty)
    return [
        Rate("in what is named", is_in, len(single), 0.9),
        Rate("`unexplained` for a cause in no catalogue", sum(verdict(o) == "unexplained" for o in alien), len(alien), 1.0),
        Rate("false alarms with nothing hidden", sum(verdict(o) != "adequate" for o in empty), len(empty), 0.0, at_most=True),
        Rate("laboratories in which something is named, and nothing in nothing", sum(works), len(works), 1.0),
    ]


def _laboratories_that_work(outcomes) -> list[bool]:
    """For each laboratory: is one hidden mechanism named, and one empty session adequate?"""
    each = defaultdict(lambda: defaultdict(list))
    for o in outcomes:
        answered = verdict(o) == "adequate" if o.case.group == "none" else found(o, cause(o), largest_set=inf)
        each[o.case.laboratory][o.case.group].append(answered)
    return [all(any(answers) for answers in groups.values()) for groups in each.values()]


def coverage(outcome, nominal=False) -> list[tuple[str, bool]]:
    """Parameter and whether its interval covers the truth, for a mechanism that was named itself.

    Parameters whose hidden form has no exact counterpart (`nominal`) are counted apart.
    """
    hidden = outcome.truth["hidden"][0]
    if hidden["mechanism"] in LAWS:
        values = law(outcome) if found(outcome, hidden["mechanism"]) else None
    else:
        values = next((c["parameters"] for c in causes(outcome) if c["mechanism"] == hidden["mechanism"]), None)
    if values is None:
        return []
    return [(name, _covers(values.get(name), true["value"]))
            for name, true in hidden["parameters"].items() if true["nominal"] == nominal]


def _covers(estimate, true):
    if not isinstance(estimate, dict):
        return False
    if isinstance(true, list):
        return sorted(estimate.get("value") or []) == true
    low, high = estimate.get("low"), estimate.get("high")
    return low is not None and high is not None and low <= true <= high


def biases(outcome, parameter):
    """Relative bias of the session's mean without and with the added mechanisms, or None where it was not found or told."""
    shifts = [c.get("parameter_shift", {}).get(parameter) for c in causes(outcome)]
    shifts = [s for s in shifts if s]
    if not shifts or not found(outcome, cause(outcome)) or outcome.truth["hidden"][0]["class"] == "trial":
        return None
    true = outcome.truth["means"][parameter]
    return shifts[0]["before"] / true - 1, shifts[-1]["after"] / true - 1


def bias_rate(single, parameter) -> Rate:
    """Of the mechanisms that bias the parameter materially: those whose median bias is at least halved."""
    told = bias_table(single, parameter)
    material = [(b, a) for b, a in told.values() if b > MATERIAL_BIAS]
    return Rate(f"bias on {parameter} at least halved (mechanisms where it is over {MATERIAL_BIAS:.0%})",
                sum(a <= b / 2 for b, a in material), len(material), 1.0)


def bias_table(single, parameter) -> dict:
    each = defaultdict(list)
    for o in single:
        b = biases(o, parameter)
        if b:
            each[cause(o)].append(b)
    return {m: (median(abs(b) for b, _ in v), median(abs(a) for _, a in v)) for m, v in each.items()}


def answers(outcomes) -> Counter:
    """What was said, as one short phrase a session."""
    def phrase(o):
        sets = " & ".join("/".join(sorted(named_set(c), key=lambda m: (m != c["mechanism"], m))) for c in causes(o))
        said = verdict(o)
        said = sets if said in ("named", "ambiguous") else f"{said}" + (f" ({sets})" if sets else "")
        return f"{said}, law: {law(o).get('law')}" if LAWS & set(o.case.causes) else said
    return Counter(phrase(o) for o in outcomes)
