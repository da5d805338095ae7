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
# The ramps of these recordings take 180 ms, so that is what is analysed. Five repetitions of each condition are enough for a look.

# %%
fits = {}
for folder in sessions:
    session = ramphold.Session.load(folder)
    table = session.to_frame()
    table = table[table["repetition"] <= 5]
    records = [session.record(trial) for trial in table["trial"]]
    part = ramphold.Session.from_arrays(
        *([record[column].to_numpy() for record in records] for column in ("t_s", "theta_m_rad", "torque_l_nm")),
        trials=table,
        lever=session.lever,
        recorded_filter=session.recorded_filter,
        subject=session.subject,
    )
    fits[folder.name] = part.fit(window_s=0.180)
    frame = fits[folder.name].to_frame("conditions")
    print(folder.name, part, "median variance accounted for:", round(fits[folder.name].to_frame()["vaf"].median(), 3))
    print(frame[["velocity_rad_s", "torque_nm", "repetitions", "k_srs_nm_per_rad"]].round(2).to_string(index=False))

# %%
fits["ankle-0"].plot() if "ankle-0" in fits else None
