"""Frames of pandas and polars, figures, and what a notebook shows."""

import numpy as np
import pandas as pd
import polars
import pytest

import ramphold


def ink(figure, tmp_path):
    """How many pixels of a figure are not white."""
    from matplotlib.image import imread

    figure.savefig(tmp_path / "figure.png", dpi=80)
    return int((imread(tmp_path / "figure.png")[:, :, :3] < 0.99).any(axis=2).sum())


def test_a_table_may_be_of_pandas_polars_or_python(arrays):
    table = arrays["trials"]
    records = table.to_dict("records")
    forms = [table, polars.from_dicts(records), {name: list(table[name]) for name in table}, records]
    digests = {ramphold.Session.from_arrays(**{**arrays, "trials": own}).digest for own in forms}
    assert len(digests) == 1


def test_an_empty_cell_of_a_frame_may_be_any_that_pandas_has(arrays):
    table = arrays["trials"].drop(columns="onset_s").assign(
        onset_s=[None, *arrays["trials"]["onset_s"][1:]], condition=[None] + ["rested"] * (len(arrays["trials"]) - 1)
    )
    forms = [table, table.convert_dtypes(), table.astype(object).where(table.notna(), pd.NA)]
    forms.append(polars.from_dicts(table.astype(object).where(table.notna(), None).to_dict("records")))
    records = table.astype(object).where(table.notna(), pd.NA)
    forms.append([{name: records[name].iloc[row] for name in records} for row in range(len(records))])
    assert forms[-1][0]["condition"] is forms[-1][0]["onset_s"] is pd.NA
    digests = {ramphold.Session.from_arrays(**{**arrays, "trials": own}).digest for own in forms}
    assert len(digests) == 1


def test_signals_may_be_one_matrix_or_columns_of_a_frame(arrays):
    rate = arrays["sample_rate_hz"]
    onsets = [round((onset - own[0]) * rate) for onset, own in zip(arrays["trials"]["onset_s"], arrays["t"], strict=True)]
    around = [slice(onset - 1000, onset + 250) for onset in onsets]
    cut = {
        name: [own[part].copy() for own, part in zip(arrays[name], around, strict=True)] for name in ("t", "theta", "torque")
    }
    rest = {key: arrays[key] for key in ("trials", "lever", "sample_rate_hz")}
    listed = ramphold.Session.from_arrays(**cut, **rest)
    matrices = ramphold.Session.from_arrays(**{name: np.stack(own) for name, own in cut.items()}, **rest)
    for column in (pd.Series, polars.Series):
        series = {name: [column(own) for own in values] for name, values in cut.items()}
        assert listed.digest == matrices.digest == ramphold.Session.from_arrays(**series, **rest).digest


def test_repetitions_numbers_and_rate_are_counted_where_they_are_not_given(arrays):
    table = arrays["trials"][["velocity_rad_s", "torque_nm"]]
    session = ramphold.Session.from_arrays(
        arrays["t"], arrays["theta"], arrays["torque"], trials=table, lever=arrays["lever"]
    )
    own = session.to_frame()
    assert session.sample_rate_hz == arrays["sample_rate_hz"]
    assert list(own["trial"]) == list(range(1, len(table) + 1))
    for _, of_condition in own.groupby(["velocity_rad_s", "torque_nm"]):
        assert list(of_condition["repetition"]) == list(range(1, len(of_condition) + 1))
    # Without onsets in the table the analysis finds them.
    assert session.fit().to_frame()["vaf"].min() > 0.9


def test_every_figure_shows_something(loaded, fitted, tmp_path):
    diagnosis = loaded.diagnose()
    for figure in (loaded.plot(), fitted.plot(), fitted.plot(independent=True), diagnosis.plot()):
        assert ink(figure, tmp_path) > 5_000
    for shown in (loaded, fitted, diagnosis):
        html = shown._repr_html_()
        assert "data:image/png;base64," in html
    assert "<table" in fitted._repr_html_() and diagnosis.verdict in diagnosis._repr_html_()


def test_results_are_written_but_never_over_others(fitted, tmp_path):
    fitted.save(tmp_path / "fit.json")
    assert (tmp_path / "fit.json").read_text() == fitted.json
    with pytest.raises(ramphold.InputError, match="cannot be written"):
        fitted.save(tmp_path / "fit.json")
