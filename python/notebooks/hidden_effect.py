# %% [markdown]
# # A hidden effect found
#
# The torque channel is late by 0.8 ms, and nobody knows. The fit looks fine, and its stiffness is wrong.

# %%
import pandas as pd

import ramphold

protocols = ramphold.write_examples("protocols")
late = [{"mechanism": "channel_skew", "parameters": {"delay_s": 0.0008}}]
session = ramphold.Session.simulate(protocols / "quick.json", seed=2, mechanisms=late)
truth = ramphold.Session.simulate(protocols / "quick.json", seed=2)

# %%
fit = session.fit()
print("variance accounted for:", round(fit.to_frame()["vaf"].mean(), 4))
columns = ["velocity_rad_s", "torque_nm", "k_srs_nm_per_rad"]
pd.merge(
    fit.to_frame("conditions")[columns],
    truth.fit().to_frame("conditions")[columns],
    on=columns[:2],
    suffixes=("_late", "_in_time"),
).round(2)

# %% [markdown]
# The diagnosis tests the residual against the noise of the holds, compares the mechanisms of its catalogue, and says which one it is.

# %%
stages: list[str] = []
diagnosis = session.diagnose(progress=stages.append)
diagnosis.to_frame()[["mechanism", "probability", "parameters", "k_srs_before_nm_per_rad", "k_srs_after_nm_per_rad"]]

# %%
diagnosis.plot()

# %%
assert "channel_skew" in {own for cause in diagnosis.dict["causes"] for own in [cause["mechanism"], *cause["indistinguishable"]]}

# %% [markdown]
# With the delay in the model, the stiffness is right again.

# %%
again = session.fit(mechanisms=late).to_frame("conditions")["k_srs_nm_per_rad"].mean()
of_truth = truth.fit().to_frame("conditions")["k_srs_nm_per_rad"].mean()
print(f"mean k_srs: {fit.to_frame('conditions')['k_srs_nm_per_rad'].mean():.2f} late, {again:.2f} corrected, {of_truth:.2f} N m/rad in time")
assert abs(again - of_truth) < 0.05 * of_truth
