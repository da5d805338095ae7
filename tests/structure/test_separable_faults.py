"""What the structure of Eq. 3-7 lets sensors separate, by the fault diagnosis toolbox of Frisk and Krysander."""

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def faults():
    loader = SourceFileLoader("separable_faults", str(ROOT / "scripts/separable-faults"))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def sets(groups):
    return {frozenset(g) for g in groups}


def test_with_motor_angle_and_handle_torque_alone_no_fault_is_separable(faults):
    assert faults.redundancy() == 1
    assert sets(faults.groups()) == {frozenset(faults.FAULTS)}
    assert sets(faults.groups((), faults.WITH_HANDLE)) == {frozenset(faults.WITH_HANDLE)}


@pytest.mark.parametrize("sensor", ["theta_l_rad", "alpha_l_rad_s2", "torque_h_nm"])
def test_one_sensor_at_the_handle_makes_three_groups(faults, sensor):
    assert faults.redundancy((sensor,)) == 2
    assert sets(faults.groups((sensor,))) == sets([("wrist", "interface"), ("lever", "angle channel"), ("torque channel",)])


@pytest.mark.parametrize("added", [("theta_j_rad",), ("theta_l_rad", "theta_j_rad")])
def test_the_angle_of_the_joint_parts_the_interface_from_the_joint(faults, added):
    assert sets(faults.groups(added)) == sets([("wrist",), ("interface",), ("lever", "angle channel"), ("torque channel",)])


def test_a_second_sensor_at_the_handle_separates_nothing_more(faults):
    assert sets(faults.groups(("theta_l_rad", "torque_h_nm"))) == sets(faults.groups(("torque_h_nm",)))


def test_only_a_load_cell_at_the_hand_parts_the_inertia_of_the_handle_from_wrist_and_interface(faults):
    for sensor in ("theta_l_rad", "alpha_l_rad_s2"):
        assert ("wrist", "interface", "handle") in faults.groups((sensor,), faults.WITH_HANDLE)
    assert ("handle",) in faults.groups(("torque_h_nm",), faults.WITH_HANDLE)


def test_a_fault_that_no_sensor_shows_is_an_error(faults, monkeypatch):
    monkeypatch.setattr(faults, "ALWAYS", ("theta_m_rad",))
    with pytest.raises(ValueError, match="no sensor shows"):
        faults.groups()


@pytest.mark.parametrize("which", ["FAULTS", "WITH_HANDLE"])
def test_the_page_has_the_tables_of_the_script(faults, which):
    page = (ROOT / "docs/explanation/separable-faults.md").read_text()
    assert faults.table(getattr(faults, which)) in page, "paste the output of scripts/separable-faults"
