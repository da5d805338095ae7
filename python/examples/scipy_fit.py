"""The model as a function for SciPy: the parameters of one trial by least squares, with the exact Jacobian."""

import numpy as np
from numpy.typing import NDArray

import ramphold

Array = NDArray[np.float64]


def parameters_of_trial(fit: ramphold.Fit, trial: int, start: Array) -> Array:
    """The parameters, in the order of the columns of `fit.parameters()`, that fit trial number `trial` best, from `start` on."""
    from scipy.optimize import least_squares

    def residuals(logarithms: Array) -> Array:
        return fit.residuals(trial, np.exp(logarithms))

    def jacobian(logarithms: Array) -> Array:
        _, slopes = fit.residuals(trial, np.exp(logarithms), derivatives=True)
        return np.asarray(slopes * np.exp(logarithms))

    # SciPy does not say in its types that a function may give the Jacobian.
    found = least_squares(residuals, np.log(start), jacobian)  # pyright: ignore[reportArgumentType]
    return np.asarray(np.exp(found.x))
