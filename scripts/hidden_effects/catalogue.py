"""What can be hidden: the catalogue's mechanisms with their class and laws, and the aliens."""

from .aliens import ALIENS
from .laboratories import Laboratory
from .laws import LAWS
from .scenario import Hidden
from .streams import stream

# In this order, which numbers the sessions of the benchmark.
CLASSES = {
    "plant": ("joint_damping", "joint_friction", "interface_hardening", "interface_slack", "stretch_reflex", "stress_relaxation",
              "post_yield_viscosity", "gradual_yield", "stiffening", "timed_yield"),
    "rig": ("lever_inertia", "lever_stiffness", "lever_damping", "servo_following"),
    "sensor": ("channel_skew", "torque_lag", "torque_gain", "angle_gain", "torque_saturation", "mains_hum"),
    "trial": ("torque_drift", "fatigue", "thixotropy", "cocontraction", "outlier_trial", "activation_scaling"),
}
MECHANISMS = {mechanism: kind for kind, mechanisms in CLASSES.items() for mechanism in mechanisms}
EFFECTS = {f"{m}@{name}": law for m in MECHANISMS for name, law in LAWS[m].items()}  # every law by its full name

NEEDS_LEVER = {"lever_inertia", "lever_stiffness", "lever_damping"}
NEEDS_EMG = {"cocontraction", "activation_scaling"}


def parse(effect: str, laboratory: Laboratory | None = None) -> list[str]:
    """`none`, `MECHANISM`, `MECHANISM@LAW`, `alien:KIND` or `A+B` to the names of what is hidden.

    Raises ValueError on an unknown name, and on one that cannot be seen in `laboratory`.
    """
    if effect == "none":
        return []
    names = effect.split("+")
    for name in names:
        mechanism = mechanism_of(name)
        if mechanism not in MECHANISMS and name.removeprefix("alien:") not in ALIENS:
            raise ValueError(f"unknown effect {name!r}; known: none, {', '.join(MECHANISMS)}, "
                             + ", ".join(f"alien:{k}" for k in ALIENS))
        if "@" in name and name not in EFFECTS:
            raise ValueError(f"unknown law {name!r}; known: {', '.join(e for e in EFFECTS if mechanism_of(e) == mechanism)}")
        if laboratory and not shows(laboratory, mechanism):
            raise ValueError(f"{mechanism} cannot be seen in this laboratory: it has no "
                             + ("lever" if mechanism in NEEDS_LEVER else "EMG"))
    return names


def mechanism_of(name: str) -> str:
    """The name without its law."""
    return name.partition("@")[0]


def shows(laboratory: Laboratory, mechanism: str) -> bool:
    """Whether the laboratory has what the mechanism acts on, or shows it by."""
    return not (mechanism in NEEDS_LEVER and laboratory.lever is None) and not (mechanism in NEEDS_EMG and not laboratory.has_emg)


def hide(scenario, name: str, size: float) -> Hidden:
    mechanism, _, law = name.partition("@")
    rng = stream(scenario.seed, f"effect {mechanism}")
    if mechanism in MECHANISMS:
        law = law or next(iter(LAWS[mechanism]))
        parameters, nominal, note = LAWS[mechanism][law].make(scenario, size, rng)
        return Hidden(mechanism, MECHANISMS[mechanism], size, parameters, nominal, note, law=law)
    alien = ALIENS[name.removeprefix("alien:")]
    parameters, nominal, note = alien.make(scenario, size, rng)
    return Hidden(name, "alien", size, parameters, nominal, note, place=alien.place, argument=alien.argument)
