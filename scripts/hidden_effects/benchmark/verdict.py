"""Each answer as right, missed, left open or wrong.

docs/benchmarks/generator.md states the definitions for readers; they are these functions, in this order.
"""

from . import score

RIGHT, MISSED, LEFT_OPEN, WRONG = ("right", "missed", "left open", "wrong")
KINDS = (RIGHT, MISSED, LEFT_OPEN, WRONG)


def of(outcome) -> str | None:
    """None where the program failed and there is no answer to judge."""
    if outcome.diagnosis is None:
        return None
    return {"none": _of_nothing, "alien": _of_alien}.get(outcome.case.kind, _of_causes)(outcome)


def _of_nothing(outcome):
    said = score.verdict(outcome)
    return RIGHT if said == "adequate" else LEFT_OPEN if said == "unexplained" else WRONG


def _of_alien(outcome):
    place = place_is_right(outcome)
    if place is not None:
        return RIGHT if place else WRONG
    return {"unexplained": RIGHT, "adequate": MISSED}.get(score.verdict(outcome), WRONG)


def _of_causes(outcome):
    hidden = set(outcome.case.causes)
    laws = hidden & score.LAWS
    told = {m for m in laws if score.found(outcome, m)}
    if hidden == told and score.verdict(outcome) == "adequate":
        return RIGHT
    return _of_sets(outcome, hidden - told)


def _of_sets(outcome, hidden):
    said = score.verdict(outcome)
    if said == "adequate":
        return MISSED
    if said == "unexplained" or free_law(outcome):
        return LEFT_OPEN
    named = [score.named_set(c) for c in score.causes(outcome)]
    if any(not names & hidden for names in named):
        return WRONG
    if any(not any(m in names for names in named) for m in hidden):
        return MISSED
    return RIGHT if all(score.found(outcome, m) for m in hidden) else LEFT_OPEN


def is_false_alarm(outcome) -> bool:
    """Anything but `adequate` where nothing is hidden."""
    return outcome.case.kind == "none" and score.verdict(outcome) != "adequate"


def free_law(outcome) -> dict | None:
    """The unknown law that the program reports, from the top level or from a cause."""
    answers = [outcome.diagnosis or {}, *score.causes(outcome)]
    return next((a["free_law"] for a in answers if isinstance(a.get("free_law"), dict)), None)


def place_is_right(outcome) -> bool | None:
    """Whether the place of an alien that is a function at a place is in what the program says of the place; None where it says
    nothing, or the alien has no such place."""
    place, said = outcome.truth["hidden"][0].get("place"), free_law(outcome)
    if place is None or said is None or "place" not in said:
        return None
    return place in {said["place"], *(a.get("place") for a in said.get("alternatives", []) if isinstance(a, dict))}
