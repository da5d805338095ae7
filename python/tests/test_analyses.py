"""Analyses as functions of a session or of its folder."""

import inspect

import pytest
from conftest import run

import ramphold

PAIRS = [(ramphold.fit, "fit"), (ramphold.diagnose, "diagnose")]


@pytest.mark.parametrize(("function", "verb", "file"), [(ramphold.fit, "fit", "fit.json"), (ramphold.diagnose, "diagnose", "diagnosis.json")])
def test_an_analysis_of_a_session_or_of_its_folder_has_the_bytes_of_the_program(function, verb, file, folder, loaded, tmp_path):
    run(verb, folder, "--window", "0.035", "--out", tmp_path / "out")
    text = (tmp_path / "out" / file).read_text()
    assert getattr(loaded, verb)(window_s=0.035).json == text
    for source in (loaded, folder, str(folder)):
        assert function(source, window_s=0.035).json == text, source


def test_an_analysis_of_arrays_has_the_bits_of_the_method(arrays):
    session = ramphold.Session.from_arrays(**arrays)
    assert ramphold.fit(session, bootstrap=2, seed=7).json == session.fit(bootstrap=2, seed=7).json
    assert ramphold.fit(session, independent=True, plain=True).json == session.fit(independent=True, plain=True).json


@pytest.mark.parametrize(("function", "verb"), PAIRS)
def test_every_option_of_the_method_is_one_of_the_function_and_reaches_it(function, verb, loaded, monkeypatch):
    options = list(inspect.signature(function).parameters.values())
    assert options[1:] == list(inspect.signature(getattr(ramphold.Session, verb)).parameters.values())[1:]
    given = {own.name: object() for own in options[1:]}
    reached = {}
    monkeypatch.setattr(ramphold.Session, verb, lambda self, **own: reached.update(own, session=self))
    function(loaded, **given)
    assert reached == {**given, "session": loaded}


@pytest.mark.parametrize(("function", "verb"), PAIRS)
def test_what_is_neither_a_session_nor_a_folder_is_refused(function, verb, loaded, fitted, tmp_path):
    for source in (None, 3, [], {}, b"S01", fitted, object(), ramphold.Session):
        with pytest.raises(ramphold.InputError, match="expected a Session, or the path"):
            function(source)
    (tmp_path / "file").write_text("")
    for source in ("", "\0", tmp_path, str(tmp_path / "nothing"), tmp_path / "file"):
        with pytest.raises(ramphold.InputError):
            function(source)
    with pytest.raises(ramphold.InputError) as caught:
        function(tmp_path / "nothing")
    assert f"error: {caught.value}" == run(verb, tmp_path / "nothing", code=2).rstrip("\n")
