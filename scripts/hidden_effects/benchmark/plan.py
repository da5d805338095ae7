"""Which sessions the benchmark is made of. Every session has a person and a noise of its own."""

from dataclasses import dataclass

from ..catalogue import ALIEN_KINDS, MECHANISMS
from ..laboratory import LABORATORIES

# Two causes that leave different traces; a pair of near twins would test nothing but luck.
PAIRS = ("channel_skew+fatigue", "interface_slack+cocontraction", "lever_stiffness+activation_scaling",
         "mains_hum+joint_friction", "torque_saturation+fatigue", "torque_lag+outlier_trial",
         "interface_hardening+channel_skew", "stretch_reflex+mains_hum", "joint_damping+cocontraction",
         "servo_following+interface_slack")

# Within a group 40 ms cannot always tell one from another, as `sensitivity.py` computes: |cosine| of what the free
# parameters leave is above 0.9. Being in a set of at most three is what is asked of these; the others are asked alone.
NEAR_TWINS = (
    {"channel_skew", "servo_following", "lever_damping", "torque_lag", "torque_gain", "lever_stiffness",
     "lever_inertia", "angle_gain"},
    {"post_yield_viscosity", "stretch_reflex"},
    {"joint_damping", "stress_relaxation", "gradual_yield"},
)
TOLD_APART = frozenset(MECHANISMS) - frozenset().union(*NEAR_TWINS)

# Two mechanisms of the catalogue together come within 3.5 standard deviations of it: to say so would not be wrong.
TOO_NEAR_THE_CATALOGUE = {"loose_mass"}


@dataclass(frozen=True)
class Case:
    effect: str
    seed: int
    size: float = 1.0
    repetitions: int = LABORATORIES["paper"].repetitions

    @property
    def group(self) -> str:
        if self.effect == "none":
            return "none"
        if self.effect.startswith("alien:"):
            return "alien"
        return "pair" if "+" in self.effect else "mechanism"


@dataclass(frozen=True)
class Counts:
    per_mechanism: int
    none: int
    alien: int
    pair: int


FULL = Counts(per_mechanism=10, none=100, alien=30, pair=20)

# What a session of this kind does not show at any size: docs/explanation/diagnosis.md says why.
NEVER_NAMED = {"gradual_yield"}

# No misfit, since the elastic limit is free in every condition, but a law over the velocities: told as such.
LAWS = {"timed_yield"}

# Found by comparing repetitions or in the holds, which takes a whole session and little time; or taken for a near twin in a third
# of one.
NEEDS_REPETITIONS = {"fatigue", "thixotropy", "cocontraction", "outlier_trial", "activation_scaling", "mains_hum",
                     "stiffening", "lever_damping", "torque_gain", *LAWS}

# Larger than in the full run, since a third of the trials must show it.
QUICK_SIZE = 1.5


def cases(counts: Counts, first_seed: int, size: float = 1.0) -> list[Case]:
    effects = [m for m in MECHANISMS for _ in range(counts.per_mechanism)]
    effects += ["none"] * counts.none
    aliens = [f"alien:{k}" for k in ALIEN_KINDS if k not in TOO_NEAR_THE_CATALOGUE]
    effects += [aliens[i % len(aliens)] for i in range(counts.alien)]
    effects += [PAIRS[i % len(PAIRS)] for i in range(counts.pair)]
    return [Case(e, first_seed + i, size) for i, e in enumerate(effects)]


def quick_cases(first_seed: int) -> list[Case]:
    """One session for each mechanism that can be found, one whose clock is unsteady, and two without anything: one repetition
    where that is enough."""
    effects = [m for m in MECHANISMS if m not in NEVER_NAMED]
    short = {e: {} if e in NEEDS_REPETITIONS else {"size": QUICK_SIZE, "repetitions": 1} for e in effects}
    singles = [Case(e, first_seed + i, **short[e]) for i, e in enumerate(effects)]
    others = ["alien:jittered_clock", "none", "none"]
    return singles + [Case(e, first_seed + len(singles) + i) for i, e in enumerate(others)]
