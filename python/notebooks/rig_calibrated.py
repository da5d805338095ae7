# %% [markdown]
# # A rig calibrated
#
# The lever of this rig is softer than its drawing says, and nobody knows. Trials without a person tell: with the empty handle, with
# weights, with a bar of known inertia, and with the handle clamped.

# %%
import json
import subprocess
import sys
from pathlib import Path

import pandas as pd

import ramphold

protocols = ramphold.write_examples("protocols")
soft = {"mechanism": "lever_stiffness", "parameters": {"stiffness_nm_per_rad": 600.0}}
rig = {**json.loads((protocols / "de-vlugt-2011-rig.json").read_text()), "mechanisms": [soft]}
Path("rig.json").write_text(json.dumps(rig))

# %% [markdown]
# Rig trials are part of a protocol. The command that came with the package runs it on the virtual rig; on a real rig, `ramphold run`
# does the same, and says what to mount.

# %%
protocol = {**ramphold.Protocol(protocols / "de-vlugt-2011-rig-trials.json").dict, "torques_nm": [0.9, 2.1], "repetitions": 2}
Path("protocol.json").write_text(json.dumps(protocol))
command = [sys.executable, "-m", "ramphold", "run", "protocol.json", "--rig", "rig.json", "--seed", "5", "--out", "S01", "--quiet"]
subprocess.run(command, check=True, capture_output=True)
calibration = ramphold.calibrate("S01")
calibration.to_frame()[["name", "value", "se", "stated"]]

# %%
calibration.plot()

# %% [markdown]
# A constant without a value is one that these loads do not tell; `reason` says why. The stiffness is what the rig has, not what its
# drawing says.

# %%
stiffness = calibration.to_frame().set_index("name").loc["lever_stiffness_nm_per_rad"]
print(f"lever stiffness: {stiffness['value']:.0f} +- {stiffness['se']:.0f} N m/rad, stated {stiffness['stated']:.0f}")
assert abs(stiffness["value"] - 600.0) < 4 * stiffness["se"]
assert not calibration.warnings

# %% [markdown]
# The person who was measured on this rig: the fit with the stated constants, and with the measured ones. The last column is the same
# person on a rig whose drawing is right.

# %%
session = ramphold.Session.load("S01")
right = {**rig, "mechanisms": [], "lever": {**session.lever, "stiffness_nm_per_rad": 600.0}}
fits = {
    "stated": session.fit(calibration="none"),
    "calibrated": session.fit(calibration=calibration),
    "a right drawing": ramphold.Session.simulate(protocol, 5, rig=right).fit(),
}
columns = ["i_j_kg_m2", "k_h_nm_per_rad", "k_srs_nm_per_rad", "x_e_rad"]
means = pd.DataFrame({name: fit.to_frame("conditions")[columns].mean() for name, fit in fits.items()})
means.round(4)

# %%
error = means.loc["k_srs_nm_per_rad"] / means.loc["k_srs_nm_per_rad", "a right drawing"] - 1.0
print(f"k_srs is wrong by {error['stated']:.1%} with the stated constants, and by {error['calibrated']:.1%} with the measured ones")
assert abs(error["calibrated"]) < 0.1 * abs(error["stated"])

# %% [markdown]
# A calibration is kept as a file. A copy in the session's folder is used without being asked for, by the program as well.

# %%
calibration.save("S01/rig-calibration.json")
assert ramphold.Session.load("S01").fit().json == session.fit(calibration="S01/rig-calibration.json").json

# %% [markdown]
# On another day, a few ramps with the empty handle say whether the rig is still the same: `calibration.compare(folder)`. Trials that another
# program recorded are given as arrays: `ramphold.RigTrials.from_arrays(...)` stands for the folder in both calls.
