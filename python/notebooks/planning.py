# %% [markdown]
# # Planning a study
#
# How large is an effect of torque and velocity in a study of a few persons? A study is simulated: persons that differ as the study
# file says, each through the protocol, every session fitted, and the repeated-measures analysis.

# %%
import json
from pathlib import Path

import ramphold

protocols = ramphold.write_examples("protocols")
about = json.loads((protocols / "de-vlugt-2011-study.json").read_text())
del about["$schema"]
about["name"] = "six persons, the short protocol"
persons = about["persons"]
persons.update(count=6, protocol=str(protocols / "quick.json"))
for name in ("person", "rig"):
    persons[name] = str(protocols / persons[name])
Path("study.json").write_text(json.dumps(about))

# %%
study = ramphold.Study("study.json", seed=1)
study.compute(out="six", progress=lambda done, of: print(f"{done} of {of} parts"))
print(study)
study.effects()

# %%
frame = study.to_frame()
means = frame.groupby(["subject", "velocity_rad_s", "torque_nm"])["x_e_rad"].mean().unstack("velocity_rad_s")
means.round(4)

# %%
from matplotlib.figure import Figure  # noqa: E402

figure = Figure(figsize=(6, 3.6), layout="constrained")
panel = figure.subplots()
for _, own in means.iterrows():
    panel.plot(own.index, 1e3 * own, marker="o", color="#1f77b4", alpha=0.5)
panel.set_xlabel("ramp velocity (rad/s)")
panel.set_ylabel("elastic limit (mrad)")
panel.set_ylim(bottom=0)
panel.spines[["top", "right"]].set_visible(False)
figure

# %% [markdown]
# On a cluster, `study.compute(client, out=...)` gives the parts to the workers of a `distributed.Client`; the tables are the same
# bytes. How many subjects a given difference needs is what `ramphold power` computes; the program came with this package.
