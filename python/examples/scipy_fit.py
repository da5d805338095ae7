"""The model as a function for SciPy: the parameters of one trial by least squares, with the exact Jacobian."""

import numpy as np
from numpy.typing import NDArray

import ramphold

Array = NDArray[np.float64]


def parameters_of_trial(fit: ramphold.Fit, trial: int, start: Array) -> Array:
    """The six parameters, in the order of `ramphold.BASE_PARAMETERS`, that fit trial number `trial` best, from `start` on."""
    from scipy.optimize import least_squares

    motion, whitening = fit.motion(trial), fit.whitening(trial)
    measured = fit.measured_nm[fit.trials.index(trial)]
    weights = np.eye(measured.size) if whitening is None else whitening

    def residual(logarithms: Array) -> Array:
        return np.asarray(weights @ (measured - ramphold.simulate(np.exp(logarithms), motion).torque_nm))

    def jacobian(logarithms: Array) -> Array:
        own = ramphold.simulate(np.exp(logarithms), motion, derivatives=True)
        assert own.jacobian is not None
        return np.asarray(-weights @ (own.jacobian * np.exp(logarithms)))

    # SciPy does not say in its types that a function may give the Jacobian.
    found = least_squares(residual, np.log(start), jacobian)  # pyright: ignore[reportArgumentType]
    return np.asarray(np.exp(found.x))
