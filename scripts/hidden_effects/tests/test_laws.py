"""Each mechanism has several laws, and each law and alien shows."""

import re
from pathlib import Path

import numpy as np
import pytest

from hidden_effects import catalogue, oracle
from hidden_effects.aliens import ALIENS
from hidden_effects.benchmark import score
from hidden_effects.generator import generate
from hidden_effects.laboratories import LABORATORIES
from hidden_effects.laws import LAWS
from hidden_effects.laws.law import law
from hidden_effects.session_writer import truth_of

PAPER = LABORATORIES["paper"]
REFERENCE = Path(__file__).resolve().parents[3] / "docs/reference"


def test_every_mechanism_has_at_least_three_laws_with_equation_and_source():
    assert len(catalogue.MECHANISMS) == 26 and set(LAWS) == set(catalogue.MECHANISMS)
    assert min(len(laws) for laws in LAWS.values()) >= 3
    assert all(own.equation and own.source for laws in LAWS.values() for own in laws.values())


def test_a_law_cannot_be_declared_twice():
    with pytest.raises(ValueError, match="has a law 'linear' already"):
        law("joint_damping", "linear", "")(lambda *_: None)


@pytest.mark.parametrize("mechanism", catalogue.MECHANISMS)
def test_the_laws_of_a_mechanism_are_about_as_easy_to_find_as_its_first(mechanism):
    """In the paper's laboratory, by who knows the law: otherwise no answer to it could be called missed."""
    found = {name: oracle.finding(1, f"{mechanism}@{name}", PAPER, with_rivals=False) for name in LAWS[mechanism]}
    first = next(iter(found.values())).distance
    assert all(f.findable for f in found.values())
    assert all(first / 2 < f.distance < 2 * first for f in found.values()), found


@pytest.mark.parametrize("kind", ALIENS)
def test_an_alien_of_usual_size_can_be_found(kind):
    assert oracle.finding(1, f"alien:{kind}", PAPER, with_rivals=False).findable


@pytest.mark.parametrize("mechanism", catalogue.MECHANISMS)
def test_what_is_hidden_is_called_as_the_program_calls_it(mechanism):
    """A slope that the program had renamed was counted as a value that is never covered."""
    truth = truth_of(generate(1, mechanism, repetitions=1), mechanism, "paper")
    if mechanism in score.LAWS:
        rows = (REFERENCE / "session-folder.md").read_text().splitlines()
        told = next(row for row in rows if row.startswith("| `laws.elastic_limit`"))
    else:
        told = (REFERENCE / "mechanisms" / f"{mechanism}.md").read_text()
    assert [name for name in truth["hidden"][0]["parameters"] if f"`{name}`" not in told] == []


def test_a_law_by_name_is_the_same_as_by_default():
    default, named = (generate(5, e, repetitions=1) for e in ("joint_friction", "joint_friction@lugre"))
    assert np.array_equal(default.torque_l_nm, named.torque_l_nm)
    assert default.hidden == named.hidden and named.hidden[0].law == "lugre"
    other = generate(5, "joint_friction@speed", repetitions=1)
    assert other.hidden[0].mechanism == "joint_friction" and not np.array_equal(other.torque_l_nm, named.torque_l_nm)


def test_an_unknown_law_is_refused_with_those_that_are_known():
    with pytest.raises(ValueError, match=re.escape("unknown law 'joint_friction@magic'; known: joint_friction@lugre")):
        catalogue.parse("joint_friction@magic")


def test_a_mechanism_that_a_laboratory_cannot_show_is_refused():
    for effect, laboratory in (("lever_damping@drifting", "rigid"), ("fatigue+cocontraction", "clinic")):
        with pytest.raises(ValueError, match="cannot be seen in this laboratory"):
            catalogue.parse(effect, LABORATORIES[laboratory])
    assert catalogue.parse("fatigue+channel_skew@drifting", LABORATORIES["rigid"]) == ["fatigue", "channel_skew@drifting"]


def test_a_drifting_constant_ends_above_where_it_began_and_has_the_stated_mean():
    s = generate(5, "lever_inertia@drifting", repetitions=1)
    inertia = s.scenario.lever["inertia_kg_m2"]
    assert inertia[0] < inertia[-1] and inertia.mean() == pytest.approx(s.hidden[0].parameters["inertia_kg_m2"])


def test_aliens_are_many_and_half_of_them_are_functions_at_a_place():
    functions = [a for a in ALIENS.values() if a.place]
    assert len(functions) >= 10 and len(ALIENS) - len(functions) >= 10
    assert {a.place for a in functions} == {"joint", "interface", "handle", "torque_channel", "angle_channel"}
    truth = generate(5, "alien:second_grip", repetitions=1).hidden[0].as_json()
    assert (truth["place"], truth["argument"]) == ("joint", "angle_beyond_yield")
    assert "place" not in generate(5, "alien:echo", repetitions=1).hidden[0].as_json()


def test_backlash_is_taken_up_again_on_the_way_back():
    """A deflection that goes out by 5 mrad and back by 0.1 mrad: the spring keeps its torque, unlike that of a dead zone."""
    scenario = generate(5, "interface_slack@backlash", repetitions=1).scenario
    play, k_h = scenario.forces[-1], scenario.trials.k_h
    state, torques = np.zeros((1, len(k_h))), []
    step = 1e-6
    path = [(x, 1.0) for x in np.arange(0.0, 0.005, step)] + [(x, -1.0) for x in np.arange(0.005, 0.0049, -step)]
    for deflection, speed in path:
        torque, rate = play.law(0.0, deflection, speed, state, None)
        state = state + rate * step
        torques.append((k_h * deflection + torque)[0])
    assert torques[-1] == pytest.approx(torques[4999], rel=0.01)
    assert torques[4999] < k_h[0] * 0.005
