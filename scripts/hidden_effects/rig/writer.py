"""Writes rig trials into a session folder."""

from pathlib import Path

import numpy as np

from .loads import RigTrial
from .trials import RigRecording

TABLE = "trial,file,load,motion,velocity_rad_s,repetition,sign,mass_kg,arm_m,inertia_kg_m2,stiffness_nm_per_rad,relative_error,status"
COLUMNS = {"t_s": "%.4f", "target_rad": "%.7f", "theta_m_rad": "%.7f", "torque_l_nm": "%.5f"}


def write_rig_trials(recordings: list[RigRecording], folder: Path) -> None:
    """`folder` is that of a session. Nothing tells what is hidden in them."""
    (folder / "rig-trials").mkdir(parents=True)
    rows = [TABLE]
    for number, recording in enumerate(recordings, 1):
        name = f"rig-trials/rig-trial-{number:03d}.csv"
        rows.append(_row(number, name, recording.trial))
        _write(recording, folder / name)
    (folder / "rig-trials.csv").write_text("\n".join(rows) + "\n")


def _row(number, name, trial: RigTrial):
    block = trial.block
    cells = [number, name, trial.load, trial.motion, trial.velocity_rad_s, trial.repetition, trial.sign, block.mass_kg, block.arm_m,
             block.inertia_kg_m2, block.stiffness_nm_per_rad, block.relative_error, "ok"]
    return ",".join("" if cell is None else f"{cell:g}" if isinstance(cell, float) else str(cell) for cell in cells)


def _write(recording, path):
    columns = [recording.t_s, recording.target_rad, recording.theta_m_rad, recording.torque_l_nm]
    row = ",".join(COLUMNS.values()) + "\n"
    path.write_text(",".join(COLUMNS) + "\n" + (row * len(recording.t_s)) % tuple(np.column_stack(columns).ravel().tolist()))
