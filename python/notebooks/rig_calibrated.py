# %% [markdown]
# # A rig calibrated
#
# The lever of this rig is softer than its drawing says, and nobody knows. Trials without a person tell: with the empty handle, with
# weights, with a bar of known inertia, and with the handle clamped.

# %%
import json
import subprocess
from pathlib import Path

import pandas as pd

import ramphold

protocols = ramphold.write_examples("protocols")
soft = {"mechanism": "lever_stiffness", "parameters": {"stiffness_nm_per_rad": 600.0}}
rig = {**json.loads((protocols / "de-vlugt-2011-rig.json").read_text()), "mechanisms": [soft]}
Path("rig.json").write_text(json.dumps(rig))

# %% [markdown]
# Rig trials are part of a protocol. Here they are added to the short one, and the command that came with the package runs it on the
# virtual rig; on a real rig, `ramphold run` does the same.

# %%
whole = ramphold.Protocol(protocols / "de-vlugt-2011-rig-trials.json").dict
protocol = {**ramphold.Protocol(protocols / "quick.json").dict, "rig_trials": whole["rig_trials"]}
Path("protocol.json").write_text(json.dumps(protocol))
command = ["ramphold", "run", "protocol.json", "--rig", "rig.json", "--seed", "5", "--out", "S01", "--quiet"]
subprocess.run(command, check=True, capture_output=True)
calibration = ramphold.calibrate("S01")
calibration.to_frame()[["name", "value", "se", "stated"]]

# %%
calibration.plot()

# %% [markdown]
# Two constants have no value: their reason says what they are known together with. The stiffness is what the rig has, not what its
# drawing says.

# %%
stiffness = calibration.to_frame().set_index("name").loc["lever_stiffness_nm_per_rad"]
print(f"lever stiffness: {stiffness['value']:.0f} +- {stiffness['se']:.0f} N m/rad, stated {stiffness['stated']:.0f}")
assert abs(stiffness["value"] - 600.0) < 4 * stiffness["se"]
assert not calibration.warnings

# %% [markdown]
# The person who was measured on this rig: the fit with the stated constants, with the measured ones, and the truth.

# %%
session = ramphold.Session.load("S01")
known = {name: json.loads((protocols / "de-vlugt-2011-rig.json").read_text()) for name in ["truth"]}
fits = {"stated": session.fit(calibration="none"), "calibrated": session.fit(calibration=calibration)}
columns = ["i_j_kg_m2", "k_h_nm_per_rad", "k_srs_nm_per_rad", "x_e_rad"]
pd.DataFrame({name: fit.to_frame("conditions")[columns].mean() for name, fit in fits.items()}).round(4)

# %% [markdown]
# A calibration is kept as a file. A copy in the session's folder is used without being asked for, by the program as well.

# %%
calibration.save("S01/rig-calibration.json")
assert ramphold.Session.load("S01").fit().json == session.fit(calibration="S01/rig-calibration.json").json

# %% [markdown]
# And on another day, a few ramps with the empty handle say whether the rig is still the same.

# %%
calibration.compare("S01")
