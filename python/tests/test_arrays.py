"""Arrays and tables of a laboratory, as `Session.from_arrays` takes them."""

import warnings

import numpy as np
import pytest
from conftest import LEVER

import ramphold


def resampled(session, rate_hz, hold_s):
    """A trial of a session at another rate, after `hold_s` more of the hold before the ramp."""
    table = session.to_frame().iloc[[1]]
    t, theta, torque, onsets = [], [], [], []
    for trial, onset_s in zip(table["trial"], table["onset_s"], strict=True):
        own = session.record(trial)
        ends_s = own["t_s"].iloc[-1]
        begins_s = onset_s - 0.3
        time = begins_s + np.arange(int((ends_s - begins_s) * rate_hz)) / rate_hz
        # A hold that is mirrored again and again has the noise of the hold.
        padding = int(hold_s * rate_hz)
        known = {name: np.interp(time, own["t_s"], own[name]) for name in ("theta_m_rad", "torque_l_nm")}
        held = int(0.2 * rate_hz)
        padded = {name: np.concatenate([np.resize(np.r_[values[:held], values[:held][::-1]], padding)[::-1], values])
                  for name, values in known.items()}
        onsets.append(onset_s - begins_s + padding / rate_hz)
        t.append(np.arange(padding + time.size) / rate_hz)
        theta.append(padded["theta_m_rad"])
        torque.append(padded["torque_l_nm"])
    return t, theta, torque, table.assign(onset_s=onsets)


@pytest.mark.parametrize("rate_hz", [2148.148, 2499.6])
def test_a_long_hold_does_not_change_what_is_fitted(loaded, rate_hz):
    """A rate rounded to a whole number put the ramp some samples beside its place in a long record."""
    values = []
    for hold_s in (0.0, 10.0):
        t, theta, torque, table = resampled(loaded, rate_hz, hold_s)
        session = ramphold.Session.from_arrays(t, theta, torque, trials=table, lever=LEVER)
        if hold_s:
            assert session.sample_rate_hz == pytest.approx(rate_hz, rel=1e-9)
        values.append(session.fit(plain=True, independent=True).parameters(independent=True).to_numpy())
    assert values[1] == pytest.approx(values[0], rel=1e-3)


def test_a_rate_is_a_whole_number_where_times_are_rounded():
    t = np.round(np.arange(2000) / 2500.0, 6)
    session = ramphold.Session.from_arrays(
        t, np.zeros((1, 2000)), np.ones((1, 2000)), trials=[{"velocity_rad_s": 1.0, "torque_nm": 1.0, "onset_s": 0.4}], lever=None
    )
    assert session.sample_rate_hz == 2500.0


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"file": "a.csv"}, "column 'file'"),
        ({" file": "a.csv"}, "column ' file'"),
        ({"note": "a", " note": "b"}, "columns 'note' and ' note'"),
        ({"onset_s ": 0.4}, "columns 'onset_s' and 'onset_s '"),
        ({"rest_s": "long"}, "row 0, rest_s: 'long'"),
        ({"rest_s": float("inf")}, "row 0, rest_s: inf"),
        ({"rest_s": True}, "row 0, rest_s: True"),
    ],
)
def test_columns_that_a_saved_folder_cannot_be_read_with_are_refused(arrays, columns, words):
    with pytest.raises(ramphold.InputError, match=words):
        ramphold.Session.from_arrays(**{**arrays, "trials": arrays["trials"].assign(**columns)})


def test_further_columns_are_read_back_from_the_saved_folder(arrays, tmp_path):
    """Spaces around names are not read back, so a session has none from the beginning."""
    table = arrays["trials"].drop(columns="rest_s", errors="ignore").assign(**{" rest_s ": 5.0, "a, note": "x, y", "Ort\u00e4": "z"})
    table.loc[0, " rest_s "] = None
    session = ramphold.Session.from_arrays(**{**arrays, "trials": table})
    session.save(tmp_path / "S01")
    again = ramphold.Session.load(tmp_path / "S01")
    assert again.digest == session.digest and sorted(again.to_frame()) == sorted(session.to_frame())
    assert session.to_frame()["rest_s"].tolist() == again.to_frame()["rest_s"].tolist()


@pytest.mark.parametrize("name", ["onset", "Onset_s", "onset_ms", "onest_s"])
def test_a_misspelt_column_of_onsets_is_warned_of(arrays, name):
    with pytest.warns(UserWarning, match=f"'{name}' is kept as text and not used.*onset_s"):
        ramphold.Session.from_arrays(**{**arrays, "trials": arrays["trials"].rename(columns={"onset_s": name})})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ramphold.Session.from_arrays(**arrays)
        ramphold.Session.from_arrays(**{**arrays, "trials": arrays["trials"].drop(columns="onset_s")})
