"""What may be wrong with rig trials themselves.

person_only: the rig's fault comes only with the person; it arose after the rig trials.
wrong_load: a load has another mass, inertia or stiffness than is stated, by 10 to 20 %.
another_day: the rig trials are of another day; since then constants of the rig have drifted by a few per cent.
"""

import numpy as np

from ..scenario import Scenario
from .loads import PROPERTY, Block

TRAPS = ("person_only", "wrong_load", "another_day")

WRONG_BY = (0.10, 0.20)
DRIFT = 0.03  # standard deviation of the change of each constant; at most twice that
DRIFTING_LEVER = ("inertia_kg_m2", "damping_nm_s_per_rad", "stiffness_nm_per_rad")


def wrong_load(blocks: tuple[Block, ...], rng: np.random.Generator) -> dict[Block, float]:
    """One of the loads that have a property, and its stated value over the true one."""
    known = [b for b in dict.fromkeys(blocks) if b.load in PROPERTY]
    if not known:
        raise ValueError("no load of this laboratory has a stated property that could be wrong")
    return {known[rng.integers(len(known))]: 1 + float(rng.choice([-1, 1]) * rng.uniform(*WRONG_BY))}


def another_day(s: Scenario, rng: np.random.Generator) -> dict[str, float]:
    """Changes the rig of these trials to that of the other day. Returns each constant of that day over today's."""
    drifted = lambda: float(1 + DRIFT * np.clip(rng.standard_normal(), -2, 2))
    then = {}
    if s.lever:
        for name in DRIFTING_LEVER:
            then[name] = drifted()
            s.lever[name] = s.lever[name] * then[name]
    gain = then["torque_gain"] = drifted()
    s.torque_chain.append(lambda t, torque, *_: gain * torque)
    return then
