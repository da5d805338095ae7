# %% [markdown]
# # Own data in ten minutes
#
# A laboratory has arrays: time, angle and torque of each trial, and a table that says what each trial was. That is all it takes
# to a fit and a diagnosis. Here the arrays come from a virtual wrist, so that the notebook runs anywhere; put your own in their place.

# %%
import numpy as np

import ramphold

protocols = ramphold.write_examples("protocols")
protocol = ramphold.Protocol(protocols / "quick.json")
measured = ramphold.Session.simulate(protocol, seed=4)
table = measured.to_frame()[["velocity_rad_s", "torque_nm", "onset_s"]]
records = [measured.record(trial) for trial in measured.to_frame()["trial"]]
t = [record["t_s"].to_numpy() for record in records]
theta = [record["theta_m_rad"].to_numpy() for record in records]
torque = [record["torque_l_nm"].to_numpy() for record in records]
table

# %% [markdown]
# `theta` is the angle of the motor in rad and `torque` the torque in the lever in N m, one array of float64 a trial; neither is
# filtered, and offsets stay in. `lever` is None for a rigid one. Numbers of the repetitions are counted where the table has none.

# %%
session = ramphold.Session.from_arrays(t, theta, torque, trials=table, lever=measured.lever)
session.plot()

# %% [markdown]
# What if the angle was in degrees? The signals are held against the table before anything is fitted:

# %%
in_degrees = ramphold.Session.from_arrays(
    t, [np.degrees(own) for own in theta], torque, trials=table, lever=measured.lever
)
try:
    in_degrees.fit()
except ramphold.InputError as error:
    print(error)

# %% [markdown]
# The fit. Its contents are those of the program's fit.json, to the last bit.

# %%
fit = session.fit()
fit.to_frame("conditions")[["velocity_rad_s", "torque_nm", *ramphold.BASE_PARAMETERS, "vaf"]].round(4)

# %%
fit.plot()

# %%
diagnosis = session.diagnose()
diagnosis.plot()

# %%
print(diagnosis)
assert diagnosis.verdict == "adequate"

# %% [markdown]
# Keep the session as a folder; the program `ramphold`, which came with the package, reads it: `ramphold report S01`.

# %%
session.save("S01")
assert ramphold.Session.load("S01").digest == session.digest
