# %% [markdown]
# # The real ankle
#
# Two recordings of a real ankle, if they are there: in a folder `shared/data` above this one, or in the one that the environment
# variable `RAMPHOLD_ANKLES` names.

# %%
import os
from pathlib import Path

import ramphold

named = os.environ.get("RAMPHOLD_ANKLES")
places = [Path(named)] if named else [own / "shared/data" for own in Path.cwd().resolve().parents]
sessions = sorted(folder for place in places for folder in place.glob("ankle-*"))
print("recordings:", ", ".join(own.name for own in sessions) if sessions else "not on this machine; the rest shows nothing")

# %% [markdown]
# The ramps of these recordings take 180 ms, so that is what is analysed.

# %%
fits = {}
for folder in sessions:
    session = ramphold.Session.load(folder)
    fits[folder.name] = session.fit(window_s=0.180)
    frame = fits[folder.name].to_frame("conditions")
    print(folder.name, session, "median variance accounted for:", round(fits[folder.name].to_frame()["vaf"].median(), 3))
    print(frame[["velocity_rad_s", "torque_nm", "repetitions", "k_srs_nm_per_rad"]].round(2).to_string(index=False))

# %%
fits["ankle-0"].plot() if "ankle-0" in fits else None
