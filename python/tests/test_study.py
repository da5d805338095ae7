"""Studies, here and on Dask."""

import json
from pathlib import Path

import pytest
from conftest import ROOT, run

import ramphold

FILES = ("study.csv", "study.json", "means.csv", "anova.csv", "trends.csv", "contrasts.csv")


@pytest.fixture(scope="module")
def study_file(tmp_path_factory):
    """The study of the protocols, with few subjects of a short protocol."""
    folder = tmp_path_factory.mktemp("study")
    about = json.loads((ROOT / "protocols/de-vlugt-2011-study.json").read_text())
    about["units_per_part"] = 1
    persons = about["persons"]
    persons.update(count=3, protocol=str(ROOT / "protocols/quick.json"))
    for name in ("person", "rig"):
        persons[name] = str(ROOT / "protocols" / persons[name])
    del about["$schema"]
    file = folder / "study.json"
    file.write_text(json.dumps(about))
    return file


@pytest.fixture(scope="module")
def by_the_program(study_file, tmp_path_factory):
    out = tmp_path_factory.mktemp("program") / "out"
    run("cohort", study_file, "--seed", 5, "--out", out, "--quiet")
    return out


def same(folder: Path, other: Path):
    return all((folder / name).read_bytes() == (other / name).read_bytes() for name in FILES)


def test_a_study_has_the_bytes_of_the_program(study_file, by_the_program, tmp_path):
    told = []
    study = ramphold.Study(study_file, 5).compute(out=tmp_path / "out", progress=lambda *own: told.append(own))
    assert same(tmp_path / "out", by_the_program)
    assert told[-1] == (3, 3) and study.sessions == 3
    assert len(study.to_frame()["subject"].unique()) == 3 and len(study.effects()) > 0
    with pytest.raises(ramphold.InputError, match="resume"):
        ramphold.Study(study_file, 5).compute(out=tmp_path / "out")
    ramphold.Study(study_file, 5).compute(out=tmp_path / "out", resume=True)
    assert same(tmp_path / "out", by_the_program)


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"client": 3}, "a distributed.Client or None"),
        ({"progress": 3}, "expected a function"),
        ({"resume": "yes"}, "True or False"),
        ({"out": 3}, "expected a path"),
    ],
)
def test_a_study_with_a_wrong_argument_begins_nothing(study_file, tmp_path, wrong, word):
    with pytest.raises(ramphold.InputError, match=word):
        ramphold.Study(study_file, 5).compute(**{"out": tmp_path / "out", **wrong})
    assert not (tmp_path / "out").exists()


def test_a_study_on_dask_has_the_same_bytes(study_file, by_the_program, tmp_path):
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster, Client(cluster) as client:
        ramphold.Study(study_file, 5).compute(client, out=tmp_path / "out")
        without_a_folder = ramphold.Study(study_file, 5).compute(client)
        assert same(without_a_folder.folder, by_the_program)
    assert same(tmp_path / "out", by_the_program)


def test_a_study_without_a_folder_keeps_its_tables_as_long_as_it_lives(study_file, by_the_program):
    study = ramphold.Study(study_file, 5).compute()
    folder = study.folder
    assert same(folder, by_the_program)
    with pytest.raises(ramphold.InputError, match="without out"):
        ramphold.Study(study_file, 5).compute(resume=True)
    del study
    assert not folder.exists()
