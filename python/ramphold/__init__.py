"""Ramp-and-hold experiments on the human wrist: the engine of the program `ramphold`, on NumPy arrays and data frames.

Results have the same bits as the program's. All values are in SI units, and the name of a field contains its unit. The ramp is
positive, and a torque that resists the ramp is positive.

    import ramphold
    session = ramphold.Session.from_arrays(t, theta, torque, trials=frame, lever=None)
    session.fit().plot()
    session.diagnose().plot()
"""

from ._analyses import diagnose, fit
from ._calibration import Calibration, RigComparison, calibrate
from ._errors import InputError, RampholdError, WorkError
from ._law import OwnLaw
from ._native import BASE_PARAMETERS, VERSION
from ._protocol import Protocol, schedule, write_examples
from ._results import Diagnosis, Fit
from ._rig_trials import RigTrials
from ._session import Session
from ._simulate import Motion, Simulation, mechanisms, simulate
from ._study import Study

__all__ = [
    "BASE_PARAMETERS",
    "VERSION",
    "Calibration",
    "Diagnosis",
    "Fit",
    "InputError",
    "Motion",
    "OwnLaw",
    "Protocol",
    "RampholdError",
    "RigComparison",
    "RigTrials",
    "Session",
    "Simulation",
    "Study",
    "WorkError",
    "calibrate",
    "diagnose",
    "fit",
    "mechanisms",
    "schedule",
    "simulate",
    "write_examples",
]

__version__: str = VERSION.split()[0]
