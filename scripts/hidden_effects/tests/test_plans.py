"""What the program is developed with and what reports on it do not meet."""

from pathlib import Path

import pytest

from hidden_effects import catalogue
from hidden_effects.aliens import ALIENS
from hidden_effects.benchmark import plan, purpose, reference
from hidden_effects.laboratories import LABORATORIES

KINDS = {"laboratories": LABORATORIES, "laws": catalogue.EFFECTS, "aliens": ALIENS}


@pytest.mark.parametrize("kind", KINDS)
def test_everything_is_for_development_or_for_reporting_and_not_for_both(kind):
    development, reporting = (set(purpose.of(p, kind)) for p in purpose.PURPOSES)
    assert development | reporting == set(KINDS[kind]) and not development & reporting
    assert development == purpose.DEVELOPMENT[kind] and reporting == purpose.REPORTING[kind]  # no name that is nothing


@pytest.mark.parametrize("whose", purpose.PURPOSES)
def test_each_plan_has_a_law_of_every_mechanism_and_all_its_laboratories_and_aliens(whose):
    cases = plan.varied_cases(whose, plan.VARIED[whose])
    by = lambda group: [c for c in cases if c.group == group]
    assert {c.causes[0] for c in by("mechanism")} == set(catalogue.MECHANISMS)
    assert {c.effect for c in by("mechanism")} == set(purpose.of(whose, "laws"))
    assert {c.effect.removeprefix("alien:") for c in by("alien")} == set(purpose.of(whose, "aliens")) - plan.TOO_NEAR_THE_CATALOGUE
    for group in ("mechanism", "none", "alien", "pair"):
        assert {c.laboratory for c in by(group)} == set(plan.fine_enough(whose))
    assert len({c.seed for c in cases}) == len(cases) and all(c.seed in plan.SEEDS[whose] for c in cases)
    for c in cases:
        catalogue.parse(c.effect, c.where())


def test_the_plans_share_no_seed():
    development, reporting = (plan.SEEDS[p] for p in purpose.PURPOSES)
    assert development.stop <= reporting.start
    assert max(c.seed for c in plan.cases(plan.FULL, plan.PAPER_START)) < development.start
    with pytest.raises(ValueError, match="the seeds of reporting are"):
        plan.varied_cases("reporting", plan.VARIED["reporting"], first_seed=development.start)


def test_the_papers_plan_is_what_it_was():
    cases = plan.cases(plan.FULL, 1000)
    assert len(cases) == 410 and {c.laboratory for c in cases} == {"paper"}
    assert cases[0] == plan.Case("joint_damping", 1000) and cases[10].effect == "joint_friction"
    assert cases[360].effect == "alien:gauge_hysteresis" and cases[390].effect == "channel_skew+fatigue"
    assert all(c.seed == 1000 + i for i, c in enumerate(cases))


def test_the_quick_part_has_every_mechanism_and_in_each_laboratory_something_and_nothing():
    cases = plan.quick_cases(1000)
    assert {c.causes[0] for c in cases if c.group == "mechanism"} == set(catalogue.MECHANISMS) - plan.NEVER_NAMED
    laboratories = set(plan.QUICK_LABORATORIES)
    assert laboratories <= set(purpose.of("development", "laboratories"))
    assert {c.laboratory for c in cases} == laboratories
    for laboratory in laboratories:
        assert {"none", "mechanism"} <= {c.group for c in cases if c.laboratory == laboratory}
    assert len({c.seed for c in cases}) == len(cases) <= 44  # what 4 minutes hold


@pytest.mark.parametrize("part", [reference.laboratories, reference.laws, reference.aliens])
def test_the_docs_have_the_tables_of_the_code(part):
    page = (Path(__file__).resolve().parents[3] / "docs/benchmarks/generator.md").read_text()
    assert part() in page, "paste the output of python -m hidden_effects.benchmark.reference"
