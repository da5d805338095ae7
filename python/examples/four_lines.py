"""From a laboratory's own arrays to a diagnosis."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import ramphold


def analyse(t: NDArray[np.float64], theta: NDArray[np.float64], torque: NDArray[np.float64], frame: pd.DataFrame) -> str:
    """The verdict on a session with a rigid lever; arrays of shape (samples,) and (trials, samples)."""
    session = ramphold.Session.from_arrays(t, theta, torque, trials=frame, lever=None)
    fit = session.fit()
    diagnosis = session.diagnose()
    print(fit.to_frame("conditions"))
    return diagnosis.verdict
