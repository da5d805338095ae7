# %% [markdown]
# # The posterior of a trial, by emcee
#
# `fit.log_likelihood` is the model as a function with the noise that the holds show. Any sampler can use it. Here emcee samples the
# six parameters of one trial, and its intervals are held against those of the fit, which come from the curvature at the optimum
# (Laplace's approximation).

# %%
import emcee
import numpy as np
import pandas as pd

import ramphold

protocols = ramphold.write_examples("protocols")
session = ramphold.Session.simulate(protocols / "quick.json", seed=4)
# The inertia is one value a trial here, so that a trial has a posterior of its own.
model = {"format": "ramphold-model/1", "parameters": {"i_j_kg_m2": {"scope": "trial"}}}
fit = session.fit(model=model, independent=True)
errors = fit.to_frame().set_index("trial")[[f"se_{name}" for name in ramphold.BASE_PARAMETERS]]
# The trial that determines all its parameters best.
trial = int(errors.max(axis=1).idxmin())
best = fit.parameters().loc[trial].to_numpy()
laplace = errors.loc[trial].to_numpy()

# %% [markdown]
# The logarithms of the parameters are sampled, with a flat prior in them, as the fit has it. Many points are computed in one call.


# %%
def log_posterior(points):
    """Log-likelihood at logarithms of parameters, shape (points, 6)."""
    result = np.full(len(points), -np.inf)
    near = (np.abs(points - np.log(best)) < 3.0).all(axis=1)
    if near.any():
        result[near] = fit.log_likelihood(trial, np.exp(points[near]))
    return result


generator = np.random.default_rng(1)
walkers = np.log(best) + 0.3 * laplace * generator.standard_normal((64, 6))
sampler = emcee.EnsembleSampler(64, 6, log_posterior, vectorize=True)
sampler.random_state = np.random.RandomState(1).get_state()
sampler.run_mcmc(walkers, 2500, progress=False)
chain = sampler.get_chain(discard=700, flat=True)
steps = sampler.get_autocorr_time(tol=0).max()
independent = chain.shape[0] / steps
print(f"trial {trial}: {chain.shape[0]} samples, about {independent:.0f} independent ones")

# %%
table = pd.DataFrame(
    {"Laplace": laplace, "emcee": chain.std(axis=0), "shift": (chain.mean(axis=0) - np.log(best)) / laplace},
    index=ramphold.BASE_PARAMETERS,
)
table.round(4)

# %% [markdown]
# Columns: the relative standard error of the fit, the standard deviation of the sampled logarithm, and how far the posterior's mean
# is from the optimum, in standard errors. The posterior is not exactly normal, so they agree to some ten per cent and not to a digit.

# %%
ratio = table["emcee"] / table["Laplace"]
print(ratio.round(3).to_dict())
assert ((ratio > 0.8) & (ratio < 1.25)).all()
assert (table["shift"].abs() < 0.5).all()

# %%
from matplotlib.figure import Figure  # noqa: E402

figure = Figure(figsize=(8, 4.2), layout="constrained")
for panel, name, own, centre, se in zip(
    figure.subplots(2, 3).flat, ramphold.BASE_PARAMETERS, chain.T, np.log(best), laplace, strict=True
):
    panel.hist(own, bins=60, density=True, color="#7a8a99", label="emcee")
    u = np.linspace(centre - 4 * se, centre + 4 * se, 200)
    panel.plot(u, np.exp(-0.5 * ((u - centre) / se) ** 2) / (se * np.sqrt(2 * np.pi)), color="#c0392b", label="Laplace")
    panel.set_xlabel(f"log {name}", fontsize="small")
    panel.set_yticks([])
figure.axes[0].legend(frameon=False, fontsize="small")
figure
