"""A constant of the lever is another one than session.json says."""

from ..scenario import SIZES
from .law import by_torque, constant, drifting, law

CONSTANTS = {"lever_inertia": "inertia_kg_m2", "lever_stiffness": "stiffness_nm_per_rad", "lever_damping": "damping_nm_s_per_rad"}
WAYS = {
    "constant": (constant, "{} = factor times what session.json says", "assumed: a wrong calibration"),
    "drifting": (drifting, "the departure of {} grows by 20 % over the session", "assumed: a screw that works loose, a part that warms"),
    "loaded": (by_torque, "the departure of {} grows by 20 % from the lowest to the highest torque", "assumed: a joint that beds in under load"),
}


def _wrong_lever(mechanism, name, way):
    key = CONSTANTS[mechanism]

    def make(s, size, rng):
        factor = SIZES[mechanism]["factor"] ** size
        own, share = s.lever[key], way(s)
        s.lever[key] = own * factor if way is constant else own * (1 + (factor - 1) * share)
        return {key: own * factor}, [] if way is constant else [key], \
            f"{factor:.3g} times what session.json says" + ("" if way is constant else f", {name}")

    return make


for _mechanism, _key in CONSTANTS.items():
    for _name, (_way, _equation, _source) in WAYS.items():
        law(_mechanism, _name, _equation.format(_key), _source)(_wrong_lever(_mechanism, _name, _way))
