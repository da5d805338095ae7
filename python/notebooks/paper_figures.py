# %% [markdown]
# # The paper's figures
#
# de Vlugt et al. 2011 show torque and fit of single trials, and the parameters over velocity and torque. The same figures of a
# virtual person whose parameters are those that the paper prints, measured with the paper's protocol.

# %%
import numpy as np
from matplotlib.figure import Figure

import ramphold

protocols = ramphold.write_examples("protocols")
session = ramphold.Session.simulate(
    protocols / "de-vlugt-2011.json",
    seed=1,
    person=protocols / "de-vlugt-2011-person.json",
    rig=protocols / "de-vlugt-2011-rig.json",
)
fit = session.fit(independent=True)
fit.plot()

# %% [markdown]
# Parameters over velocity, one line a torque; bars are standard deviations over the repetitions.

# %%
conditions = fit.to_frame("conditions")
shown = {"k_h_nm_per_rad": "k_h (N m/rad)", "k_srs_nm_per_rad": "k_srs (N m/rad)", "k_dec_nm_per_rad": "k_dec (N m/rad)",
         "x_e_rad": "x_e (rad)"}
figure = Figure(figsize=(9, 5.6), layout="constrained")
for panel, (name, label) in zip(figure.subplots(2, 2, sharex=True).flat, shown.items(), strict=True):
    for torque, own in conditions.groupby("torque_nm"):
        panel.errorbar(own["velocity_rad_s"], own[name], own[f"sd_{name}"], marker="o", ms=4, capsize=3, label=f"{torque:g} N m")
    panel.set_ylabel(label)
    panel.set_ylim(bottom=0)
    panel.spines[["top", "right"]].set_visible(False)
figure.axes[0].legend(frameon=False)
figure.supxlabel("ramp velocity (rad/s)", fontsize="medium")
figure

# %% [markdown]
# The paper's finding: the elastic limit grows with the velocity as x_e = x_0 + x_t v, a time and not an angle.

# %%
slope, offset = np.polyfit(conditions["velocity_rad_s"], conditions["x_e_rad"], 1)
print(f"x_e = {1e3 * offset:.1f} mrad + {1e3 * slope:.2f} ms v")
assert slope > 0
assert fit.to_frame()["vaf"].median() > 0.95
