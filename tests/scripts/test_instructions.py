"""What scripts/instructions says of counts that were not counted here."""

import json
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KEPT = {"build": "0123456", "parts": "with all", "tools": "rustc 1, valgrind 1",
        "counts": {"dry run": 3_000_000, "diagnosis of a cause": 2_000_000, "diagnosis of nothing": 1_500_000, "fit": 1_000_000},
        "shares": {name: {"`ramphold::wrist`": 0.6, "`sha2`": 0.4} for name in ["dry run", "diagnosis of a cause", "diagnosis of nothing", "fit"]}}


@pytest.fixture(scope="module")
def instructions():
    loader = SourceFileLoader("instructions", str(ROOT / "scripts/instructions"))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def count_as(instructions, monkeypatch, tmp_path):
    """Runs the script as if it had counted so many times what is kept, and gives its exit code."""
    monkeypatch.setattr(instructions, "KEPT", tmp_path / "kept.json")
    monkeypatch.setattr(instructions, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(instructions, "build", lambda: {**KEPT, "build": "89abcde"})
    monkeypatch.setattr(instructions, "prepare", lambda folder: None)
    instructions.KEPT.write_text(json.dumps(KEPT))

    def run(*arguments, **times):
        factors = {name.replace("_", " "): factor for name, factor in times.items()}
        monkeypatch.setattr(instructions, "counted", lambda _, name: round(KEPT["counts"][name] * factors.get(name, 1)))
        monkeypatch.setattr(instructions, "shares", lambda _: KEPT["shares"]["fit"])
        monkeypatch.setattr(instructions.sys, "argv", ["instructions", *arguments])
        return instructions.main()

    return run


@pytest.mark.parametrize("name", ["diagnosis_of_a_cause", "diagnosis_of_nothing", "dry_run", "fit"])
def test_six_percent_more_is_a_regression_and_five_is_not(count_as, capsys, name):
    assert count_as(**{name: 1.06}) == 1
    assert "6.0% more than" in capsys.readouterr().out
    assert count_as(**{name: 1.05}) == 0


def test_much_less_is_to_be_written_anew(count_as, capsys):
    assert count_as(fit=0.94) == 0
    assert "6.0% less" in (said := capsys.readouterr().out) and "write the file anew" in said
    count_as(fit=0.96)
    assert "anew" not in capsys.readouterr().out


def test_what_was_written_is_what_the_next_counts_are_held_against(instructions, count_as):
    assert count_as("--write", fit=1.06) == 0
    kept = json.loads(instructions.KEPT.read_text())
    assert kept["counts"]["fit"] == 1_060_000
    assert instructions.PAGE.read_text() == instructions.page(kept)
    assert count_as(fit=1.11) == 0
    assert count_as(fit=1.12) == 1


def test_a_count_with_nothing_to_compare_it_with_is_a_failure(instructions):
    good, said = instructions.compare("fit", 1, {})
    assert not good and "--write" in said


def test_the_count_is_read_from_what_valgrind_says(instructions):
    assert instructions.read_count("==1== \n==1== I   refs:      6,076,215,360\n") == 6_076_215_360
    with pytest.raises(SystemExit, match="counted nothing"):
        instructions.read_count("==1== error\n")


def test_instructions_are_shared_among_the_parts_that_execute_them(instructions, tmp_path):
    (tmp_path / "functions").write_text("fl=a\nfn=<ramphold::fit::Fit as core::fmt::Debug>::fmt\n0 10\n3 50\nfn=<&mut core::slice::Iter as X>::next\n0 30\n"
                                        "fn=memcpy\n0 10\nsummary: 100\n")
    assert instructions.shares(tmp_path / "functions") == {"`ramphold::fit`": 0.6, "`core`": 0.3, "the C library": 0.1}


def test_a_part_that_is_small_in_every_command_is_not_in_the_table(instructions):
    table = instructions.share_table({"fit": {"`sha2`": 0.9, "`core`": 0.019}, "dry run": {"`csv`": 0.5}})
    assert table.splitlines()[2:] == ["| `sha2` | 90.0% | 0.0% |", "| `csv` | 0.0% | 50.0% |"]


def test_the_page_has_the_counts_of_the_file(instructions):
    assert instructions.PAGE.read_text() == instructions.page(json.loads(instructions.KEPT.read_text()))
