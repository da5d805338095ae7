"""An answer is right, missed, left open or wrong, and its probabilities are judged."""

from math import log

import pytest

from hidden_effects.benchmark import plan, probability, score, table, verdict
from hidden_effects.benchmark.run import Outcome


def outcome(effect, said, *sets, place=None, laboratory="paper", oracle=None, **answer):
    hidden = [{"mechanism": m, "class": "sensor", "parameters": {}, "place": place} for m in effect.split("+") if m != "none"]
    causes = [{"mechanism": s[0], "indistinguishable": list(s[1:]), "parameters": {}} for s in sets]
    truth = {"hidden": hidden, "means": {}}
    return Outcome(plan.Case(effect, 1, laboratory=laboratory), truth, {"verdict": said, "causes": causes, **answer}, None, 1.0, oracle)


TWINS = ("torque_lag", "servo_following", "channel_skew", "lever_damping")


@pytest.mark.parametrize("effect, said, sets, kind", [
    ("fatigue", "named", [("fatigue",)], "right"),
    ("fatigue@recovering", "named", [("fatigue",)], "right"),
    ("channel_skew", "ambiguous", [TWINS[:3]], "right"),
    ("channel_skew", "ambiguous", [TWINS], "left open"),
    ("channel_skew", "unexplained", [("channel_skew",)], "left open"),
    ("channel_skew", "unexplained", [], "left open"),
    ("channel_skew", "adequate", [], "missed"),
    ("fatigue", "named", [("mains_hum",)], "wrong"),
    ("fatigue", "named", [("fatigue",), ("mains_hum",)], "wrong"),
    ("fatigue", "ambiguous", [TWINS], "wrong"),
    ("fatigue+channel_skew", "named", [("fatigue",), ("channel_skew",)], "right"),
    ("fatigue+channel_skew", "ambiguous", [("fatigue",), TWINS], "left open"),
    ("fatigue+channel_skew", "named", [("fatigue",)], "missed"),
    ("fatigue+channel_skew", "named", [("fatigue",), ("mains_hum",)], "wrong"),
    ("none", "adequate", [], "right"),
    ("none", "named", [("fatigue",)], "wrong"),
    ("none", "unexplained", [], "left open"),
    ("alien:echo", "unexplained", [("fatigue",)], "right"),
    ("alien:echo", "named", [("fatigue",)], "wrong"),
    ("alien:echo", "adequate", [], "missed"),
])
def test_an_answer_is_of_one_kind(effect, said, sets, kind):
    assert verdict.of(outcome(effect, said, *sets)) == kind


def test_a_program_that_failed_gave_no_answer():
    failed = outcome("fatigue", "named")
    failed.diagnosis = None
    assert verdict.of(failed) is None


def test_only_an_empty_session_gives_a_false_alarm():
    assert verdict.is_false_alarm(outcome("none", "unexplained")) and not verdict.is_false_alarm(outcome("none", "adequate"))
    assert not verdict.is_false_alarm(outcome("fatigue", "named", ("mains_hum",)))


def test_a_law_of_the_elastic_limit_is_right_where_it_is_told():
    law = {"laws": {"elastic_limit": {"law": "timed_yield"}}}
    assert verdict.of(outcome("timed_yield@loaded", "adequate", **law)) == "right"
    assert verdict.of(outcome("timed_yield", "adequate")) == "missed"
    assert verdict.of(outcome("timed_yield", "named", ("fatigue",), **law)) == "wrong"
    assert verdict.of(outcome("timed_yield", "unexplained", **law)) == "left open"
    assert verdict.of(outcome("timed_yield+fatigue", "named", ("fatigue",), **law)) == "right"


@pytest.mark.parametrize("law, right, kind", [
    ({"place": "handle", "argument": "angle"}, True, "right"),
    ({"place": "joint", "alternatives": [{"place": "handle"}]}, True, "right"),
    ({"place": "joint"}, False, "wrong"),
])
def test_a_free_law_is_right_where_it_states_the_place(law, right, kind):
    o = outcome("alien:cable_pull", "unexplained", place="handle", free_law=law)
    assert (verdict.place_is_right(o), verdict.of(o)) == (right, kind)


def test_an_alien_without_a_place_or_an_answer_without_one_is_judged_by_its_verdict():
    assert verdict.place_is_right(outcome("alien:cable_pull", "unexplained", place="handle")) is None
    assert verdict.place_is_right(outcome("alien:echo", "unexplained", free_law={"place": "joint"})) is None


def test_the_log_score_is_the_mean_cost_of_what_is_true():
    asked = [outcome("fatigue", "named", probabilities={"fatigue": 0.5, "none": 0.5}), outcome("none", "adequate", probabilities={"none": 1.0}),
             outcome("alien:echo", "unexplained", probabilities={"none_of_these": 0.25}), outcome("fatigue+mains_hum", "named", probabilities={})]
    mean, count = probability.log_score(asked)
    assert count == 3 and mean == pytest.approx((log(2) + 0 + log(4)) / 3)


def test_probability_zero_of_the_truth_costs_much_and_not_everything():
    [mean, _] = probability.log_score([outcome("fatigue", "named", probabilities={"mains_hum": 1.0})])
    assert mean == pytest.approx(-log(probability.LEAST))


def test_probabilities_of_causes_and_their_alternatives_are_read_where_there_is_no_list_of_all():
    o = outcome("channel_skew", "ambiguous", ("channel_skew",))
    o.diagnosis["causes"][0] |= {"probability": 0.7, "alternatives": [{"mechanism": "torque_lag", "probability": 0.25}, {"mechanism": "x"}]}
    assert probability.stated(o) == {"channel_skew": 0.7, "torque_lag": 0.25}
    assert probability.stated(outcome("fatigue", "named", ("fatigue",))) == {}


def test_reliability_counts_each_statement_in_its_tenth():
    tenths = probability.reliability([outcome("fatigue", "named", probabilities={"fatigue": 0.92, "mains_hum": 0.08}),
                                      outcome("fatigue", "named", probabilities={"fatigue": 0.02, "mains_hum": 0.98}),
                                      outcome("none", "adequate", probabilities={"none": 1.0})])
    assert [(round(t.stated, 3), t.true, t.of) for t in tenths] == [(0.05, 1, 2), (0.967, 2, 3)]


def test_the_table_of_laboratories_counts_by_laboratory_and_tells_what_could_be_found():
    can = {"findable": True, "told_apart": False}
    outcomes = [outcome("fatigue", "named", ("fatigue",), laboratory="slow", oracle=can), outcome("none", "named", ("fatigue",), laboratory="slow"),
                outcome("none", "adequate"), outcome("alien:cable_pull", "unexplained", place="handle", free_law={"place": "handle"})]
    text = table.markdown(outcomes, score.rates(outcomes[:1] + outcomes[2:3]))
    assert "| slow | 2 | 1 | 0 | 0 | 1 | 1/1 | 1/1 | 1/1 | 0/1 |  |  |" in text
    assert "| paper | 2 | 2 | 0 | 0 | 0 | 0/1 |  |  |  |  | 1/1 |" in text
    assert "The program states none" in text
    assert "| all | 4 | 3 | 0 | 0 | 1 |" in text


def test_a_laboratory_in_which_nothing_is_named_fails_the_quick_part():
    good = [outcome("fatigue", "named", ("fatigue",), laboratory="slow"), outcome("none", "adequate", laboratory="slow")]
    lost = [outcome("fatigue", "adequate", laboratory="clinic"), outcome("none", "adequate", laboratory="clinic")]
    [laboratories] = [r for r in score.quick_rates(good + lost) if r.name.startswith("laboratories")]
    assert (laboratories.hits, laboratories.of, laboratories.met) == (1, 2, False)
