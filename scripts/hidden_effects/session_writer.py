"""Writes a session folder in the published format, and its truth somewhere else."""

import json
from pathlib import Path

import numpy as np

from .generator import Session
from .rig.writer import write_rig_trials

COLUMNS = {"t_s": "%.4f", "theta_m_rad": "%.7f", "torque_l_nm": "%.5f"}
EMG_COLUMNS = {"emg_fcr_mvc": "%.4f", "emg_ecr_mvc": "%.4f"}

NOTICED_RAD = 0.002  # where the onset is stated when the record has moved


def write_session(session: Session, folder: Path) -> None:
    """Nothing in the folder tells what is hidden, not even the order of the files or the number of digits."""
    (folder / "trials").mkdir(parents=True)
    laboratory = session.scenario.laboratory
    description = {"format": "ramphold-session/1", "subject": {"id": f"S{session.seed}"}, "sample_rate_hz": laboratory.sample_hz,
                   "rig": {"lever": laboratory.own_lever()}, "recorded_filter": None}
    (folder / "session.json").write_text(json.dumps(description, indent=2) + "\n")

    t = session.trials
    rows = ["trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status,amplitude_rad,rest_s"]
    for i in range(len(t)):
        name = f"trials/trial-{i + 1:03d}.csv"
        rows.append(f"{i + 1},{name},{t.velocity_rad_s[i]:g},{t.torque_nm[i]:g},{t.repetition[i]},{_onset(session, i)},ok,"
                    f"{laboratory.amplitude_rad:g},{t.rest_s[i]:.2f}")
        _write_trial(session, i, folder / name)
    (folder / "trials.csv").write_text("\n".join(rows) + "\n")
    if session.rig:
        write_rig_trials(session.rig.recordings, folder)


def _onset(session, i) -> str:
    laboratory = session.scenario.laboratory
    commanded_s = -session.t_s[session.first[i]]
    match laboratory.onsets:
        case "command":
            return f"{commanded_s:.4f}"
        case "none":
            return ""
        case "2 mrad":
            angle = session.theta_m_rad[i, session.first[i]:]
            rest = angle[:round(0.5 * commanded_s * laboratory.sample_hz)].mean()
            noticed = int(np.argmax(np.abs(angle - rest) > NOTICED_RAD))
            return f"{noticed / laboratory.sample_hz:.4f}"
        case other:
            raise ValueError(f"onsets {other!r}: expected command, none or 2 mrad")


def _write_trial(session, i, path):
    kept = slice(session.first[i], None)
    time = session.t_s[kept] - session.t_s[session.first[i]]
    columns, formats = [time, session.theta_m_rad[i, kept], session.torque_l_nm[i, kept]], COLUMNS
    if session.scenario.laboratory.has_emg:
        columns += [session.emg_fcr_mvc[i, kept], session.emg_ecr_mvc[i, kept]]
        formats = COLUMNS | EMG_COLUMNS
    row = ",".join(formats.values()) + "\n"
    path.write_text(",".join(formats) + "\n" + (row * len(time)) % tuple(np.column_stack(columns).ravel().tolist()))


def truth_of(session: Session, effect: str, laboratory: str = "paper") -> dict:
    t, x_t = session.trials, session.x_t_s()
    trials = [{"trial": i + 1, "i_j_kg_m2": t.i_j[i], "b_h_nm_s_per_rad": t.b_h[i], "k_h_nm_per_rad": t.k_h[i],
               "k_srs_nm_per_rad": t.k_srs[i], "k_dec_nm_per_rad": t.k_dec[i], "x_e_rad": t.x_e[i],
               "x_t_s": None if np.isnan(x_t[i]) else x_t[i]} for i in range(len(t))]
    mean = lambda key: float(np.mean([row[key] for row in trials]))
    rig = {"rig_trials": session.rig.as_json()} if session.rig else {}
    return {"format": "ramphold-hidden-truth/1", "effect": effect, "seed": session.seed, "laboratory": laboratory,
            "hidden": [h.as_json() for h in session.hidden], "trials": trials,
            "means": {key: mean(key) for key in ("k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad")}, **rig}


def write_truth(session: Session, effect: str, path: Path, laboratory: str = "paper") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(truth_of(session, effect, laboratory), indent=1, default=float) + "\n")
