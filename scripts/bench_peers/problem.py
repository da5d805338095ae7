"""The numbers that everybody fits, as our side wrote them, and the least squares over them."""

import json
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from . import plain, wrist


class Windows:
    """A session's prepared windows."""

    def __init__(self, file: Path):
        self.given = json.loads(file.read_text())
        own = self.given["windows"]
        self.lever = np.array(own["lever"])
        self.fixed = np.array([own["joint_damping"], own["smoothness"]])
        self.sections = np.array(own["sections"])
        self.theta, self.omega = np.array(own["theta_rad"]), np.array(own["omega_rad_s"])
        self.period_s, self.lead, self.samples = own["period_s"], own["lead"], own["samples"]
        self.substeps = own["substeps"]
        self.repetition_of = np.array(own["repetitions"])
        # What ours predicts at the start.
        self.parameters = np.array(own["parameters"])
        self.torque = np.array(own["torque_nm"]).reshape(-1, self.samples)
        self.slopes = np.array(own["slopes"]).reshape(-1, self.samples, wrist.SLOPES)

    @property
    def constants(self):
        """What every simulation is given, trial by trial alike."""
        return self.lever, self.fixed, self.sections, self.period_s, self.lead, self.substeps

    def parts(self, name: str) -> list["Part"]:
        """A problem, as one least squares a repetition, which is what it falls into."""
        own = self.given[name]
        return self._parts(own, own["measured_nm"], own["start"], [ours["cost"] for ours in own["ours"]])

    def refits(self) -> list[list["Part"]]:
        """Sessions of the bootstrap."""
        own, refits = self.given["weighed_session"], self.given["refits"]
        return [self._parts(own, one["measured_nm"], refits["start"], one["costs"]) for one in refits["drawn"]]

    def _parts(self, own, measured, start, costs):
        numbers, places, measured = np.array(own["repetitions"]), np.array(own["coordinate_of"]), np.array(measured)
        parts = []
        for cost, number in zip(costs, np.unique(numbers), strict=True):
            trials = np.flatnonzero(numbers == number)
            used, local = np.unique(places[trials], return_inverse=True)
            low, high, first = (np.array(values)[used] for values in (own["low"], own["high"], start))
            whiteners = None if own["whiteners"] is None else np.array([own["whiteners"][t] for t in trials])
            # Where the problem is a single repetition, its trials are numbered anew.
            at = np.flatnonzero(self.repetition_of == number)
            of = (local.reshape(len(trials), wrist.SLOPES), low, high, first)
            parts.append(Part(self, at, measured[trials], whiteners, *of, cost))
            parts[-1].used = used  # which of the problem's coordinates it has
        return parts


class Part:
    """Least squares over the trials of a repetition; the coordinates are logarithms, as ours are."""

    def __init__(self, windows: Windows, trials, measured, whiteners, places, low, high, start, ours: float):
        self.windows, self.places, self.low, self.high = windows, places, low, high
        self.theta, self.omega = windows.theta[trials], windows.omega[trials]
        self.measured, self.whiteners = measured, whiteners
        # trf wants a start inside of its bounds.
        margin = 1e-6 * (high - low)
        self.start = np.clip(start, low + margin, high - margin)
        self.ours = ours
        self.torque = np.empty(measured.shape)
        self.slopes = np.empty((*measured.shape, wrist.SLOPES))
        outputs = measured.shape[1] if whiteners is None else whiteners.shape[1]
        shape = (len(trials), outputs, wrist.SLOPES)
        self.size = len(trials) * outputs
        self.rows = np.broadcast_to(np.arange(self.size).reshape(len(trials), outputs, 1), shape).ravel()
        self.columns = np.broadcast_to(places[:, None, :], shape).ravel()
        self.calls = 0

    def residuals(self, x):
        """Predicted less measured, with the compiled model."""
        self.calls += 1
        wrist.simulate_all(self.theta, self.omega, np.exp(x[self.places]), *self.windows.constants, self.torque)
        return self._weighed()

    def residuals_of_solve_ivp(self, x):
        """The same with solve_ivp."""
        self.calls += 1
        for trial, p in enumerate(np.exp(x[self.places])):
            self.torque[trial] = plain.simulate(self.windows, self.theta[trial], self.omega[trial], p)
        return self._weighed()

    def _weighed(self):
        residuals = self.torque - self.measured
        if self.whiteners is not None:
            residuals = np.matmul(self.whiteners, residuals[:, :, None])
        return residuals.ravel()

    def _scaled_slopes(self, x):
        """Derivatives of the residuals by the coordinates of their own trials."""
        p = np.exp(x[self.places])
        wrist.simulate_all_with_slopes(self.theta, self.omega, p, *self.windows.constants, self.torque, self.slopes)
        slopes = self.slopes * p[:, None, :]
        return (slopes if self.whiteners is None else np.matmul(self.whiteners, slopes)).ravel()

    def jacobian(self, x):
        """Dense."""
        jacobian = np.zeros((self.size, len(x)))
        jacobian[self.rows, self.columns] = self._scaled_slopes(x)
        return jacobian

    def sparse_jacobian(self, x):
        """As a sparse matrix."""
        return csr_matrix((self._scaled_slopes(x), (self.rows, self.columns)), (self.size, len(x)))

    def sparsity(self):
        """Where derivatives can be."""
        return csr_matrix((np.ones(len(self.rows)), (self.rows, self.columns)), (self.size, len(self.start)))

    def cost(self, x) -> float:
        """Half the sum of squares, by the compiled model, whoever found `x`."""
        residuals = self.residuals(x)
        return 0.5 * float(residuals @ residuals)
