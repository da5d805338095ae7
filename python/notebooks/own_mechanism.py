# %% [markdown]
# # An own mechanism without Rust
#
# A function of one argument at a place of the model: as points, or as a Python function. It is turned into the spline of the crate's
# free laws, so that simulations, fits and diagnoses use it without calling Python.

# %%
import numpy as np
import pandas as pd

import ramphold

protocols = ramphold.write_examples("protocols")
pd.DataFrame(ramphold.OwnLaw.places(), columns=["place", "argument", "equation"])

# %% [markdown]
# Say, a friction in the joint that saturates with speed. The spline is at most `deviation` from the function; `tolerance` is what
# you accept.


# %%
def friction(omega):
    """N m at a speed in rad/s."""
    return 0.15 * np.tanh(omega / 0.8)


law = ramphold.OwnLaw.from_function("joint", "speed", friction, -1.0, 4.0, tolerance=0.01)
print(f"the spline is within {1e3 * law.deviation:.1f} mN m of the function")

# %%
session = ramphold.Session.simulate(protocols / "quick.json", seed=3, mechanisms=[law])
without, whole = session.fit(), session.fit(mechanisms=[law])
pd.DataFrame({
    "without the law": without.to_frame("conditions")[["k_srs_nm_per_rad", "x_e_rad", "vaf"]].mean(),
    "with it": whole.to_frame("conditions")[["k_srs_nm_per_rad", "x_e_rad", "vaf"]].mean(),
}).round(4)

# %%
print(session.diagnose())
print(session.diagnose(mechanisms=[law]))

# %% [markdown]
# What a law costs is measured, not promised: a simulation with derivatives, with the law and without it.

# %%
trial = without.trials[0]
parameters = without.parameters().loc[trial].to_numpy()[:6]
print(f"{law.slowdown(without.motion(trial), parameters):.1f} times as long on this machine")
