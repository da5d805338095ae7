"""The examples do what they say."""

import sys

import numpy as np
from conftest import ROOT

import ramphold

sys.path.insert(0, str(ROOT / "python/examples"))

from four_lines import analyse  # noqa: E402
from scipy_fit import parameters_of_trial  # noqa: E402


def test_arrays_are_diagnosed_in_four_lines(arrays, loaded):
    rigid = ramphold.Session.simulate(
        ramphold.Protocol(dict(ramphold.Protocol(ROOT / "protocols/quick.json").dict)), 6, rig={"kind": "virtual", "lever": None}
    )
    table = rigid.to_frame()
    rate = rigid.sample_rate_hz
    around = {name: [] for name in ("theta_m_rad", "torque_l_nm")}
    for trial, onset in zip(table["trial"], table["onset_s"], strict=True):
        record = rigid.record(trial)
        start = round((onset - record["t_s"][0]) * rate) - 2000
        for name, own in around.items():
            own.append(record[name].to_numpy()[start : start + 2300])
    frame = table[["velocity_rad_s", "torque_nm"]].assign(onset_s=0.0)
    time = (np.arange(2300) - 2000) / rate
    verdict = analyse(time, np.stack(around["theta_m_rad"]), np.stack(around["torque_l_nm"]), frame)
    assert verdict in {"adequate", "named", "ambiguous", "unexplained"}


def test_scipy_finds_the_optimum_of_the_fit(loaded):
    model = {"format": "ramphold-model/1", "parameters": {"i_j_kg_m2": {"scope": "trial"}}}
    fit = loaded.fit(model=model, independent=True)
    errors = fit.to_frame().set_index("trial")[[f"se_{name}" for name in ramphold.BASE_PARAMETERS]]
    trial = int(errors.max(axis=1).idxmin())
    best = fit.parameters().loc[trial].to_numpy()
    found = parameters_of_trial(fit, trial, best * 1.05)
    assert np.abs(np.log(found / best) / errors.loc[trial].to_numpy()).max() < 0.1
