"""The catalogue's ids with their class and how each is made."""

from .aliens import ALIENS
from .effects_plant import ACROSS_TRIALS, PLANT
from .effects_rig import HAND, RIG, SENSOR
from .scenario import Hidden
from .streams import stream

CLASSES = {"plant": PLANT, "rig": RIG, "sensor": SENSOR, "trial": HAND + ACROSS_TRIALS}
MECHANISMS = {f.__name__: (f, kind) for kind, fs in CLASSES.items() for f in fs}
ALIEN_KINDS = {f.__name__: f for f in ALIENS}


def parse(effect: str) -> list[str]:
    """`none`, an id, `alien:KIND` or `A+B` to the names of what is hidden; raises ValueError on an unknown one."""
    if effect == "none":
        return []
    names = effect.split("+")
    for name in names:
        known = ALIEN_KINDS if name.startswith("alien:") else MECHANISMS
        if name.removeprefix("alien:") not in known:
            raise ValueError(f"unknown effect {name!r}; known: none, {', '.join(MECHANISMS)}, "
                             + ", ".join(f"alien:{k}" for k in ALIEN_KINDS))
    return names


def hide(scenario, name: str, size: float) -> Hidden:
    rng = stream(scenario.seed, f"effect {name}")
    if name.startswith("alien:"):
        make, kind = ALIEN_KINDS[name.removeprefix("alien:")], "alien"
    else:
        make, kind = MECHANISMS[name]
    parameters, nominal, note = make(scenario, size, rng)
    return Hidden(name, kind, size, parameters, nominal, note)
