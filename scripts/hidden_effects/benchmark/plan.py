"""Which sessions the benchmark is made of. Every session has a person and a noise of its own."""

from dataclasses import dataclass, replace
from itertools import cycle

from ..catalogue import MECHANISMS, mechanism_of, shows
from ..laboratories import LABORATORIES, Laboratory
from ..rig.traps import TRAPS
from ..rig.trials import is_of_the_rig
from . import purpose

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

# No cause of the rig is named behind so coarse an encoder: docs/explanation/decisions/49-answers-to-the-load.md.
TOO_COARSE = {"coarse"}

# Two mechanisms of the catalogue together come within 3.5 standard deviations of it: to say so would not be wrong.
TOO_NEAR_THE_CATALOGUE = {"loose_mass"}

# Those of the paper's plan, in the order that numbers its sessions.
PAPER_ALIENS = ("gauge_hysteresis", "speed_dependent_gain", "torque_burst", "oscillating_stiffness", "yield_catch", "emg_crosstalk",
                "jittered_clock", "frozen_torque", "coarse_converter", "handle_recoil", "rebound_wall")

# The seeds of each plan, which no other plan uses. Those of the paper's plan and of the quick part lie below.
SEEDS = {"development": range(2_000_000, 3_000_000), "reporting": range(5_000_000, 6_000_000)}
PAPER_START = 1000


@dataclass(frozen=True)
class Case:
    effect: str
    seed: int
    size: float = 1.0
    repetitions: int | None = None  # the laboratory's own
    laboratory: str = "paper"
    rig_trials: bool = False
    trap: str | None = None  # what is wrong with the rig trials themselves, see rig.traps

    @property
    def group(self) -> str:
        """Cases of a trap are a group of their own, whatever is hidden."""
        return f"trap:{self.trap}" if self.trap else self.kind

    @property
    def kind(self) -> str:
        """Of what is hidden."""
        if self.effect == "none":
            return "none"
        if self.effect.startswith("alien:"):
            return "alien"
        return "pair" if "+" in self.effect else "mechanism"

    @property
    def causes(self) -> list[str]:
        """The mechanisms or the alien that are hidden, without their laws."""
        return [] if self.effect == "none" else [mechanism_of(name) for name in self.effect.split("+")]

    def where(self) -> Laboratory:
        laboratory = LABORATORIES[self.laboratory]
        return laboratory if self.repetitions is None else replace(laboratory, repetitions=self.repetitions)


@dataclass(frozen=True)
class Counts:
    per_mechanism: int
    none: int
    alien: int
    pair: int


FULL = Counts(per_mechanism=10, none=100, alien=30, pair=20)
VARIED = {  # per_mechanism: of each of its laws
    "development": Counts(per_mechanism=4, none=100, alien=45, pair=46),
    "reporting": Counts(per_mechanism=8, none=120, alien=60, pair=20),
}

# Asked alone where there are rig trials.
TOLD_BY_RIG_TRIALS = ("lever_inertia", "lever_stiffness", "lever_damping", "torque_gain", "angle_gain", "channel_skew", "torque_lag",
                      "servo_following")

# What is hidden behind a trap, in turn: nothing, faults of the rig, faults of the wrist. A fault that comes only with the person is one
# of the rig.
BEHIND_TRAPS = ("none", "torque_gain", "interface_slack", "none", "lever_stiffness", "joint_friction", "none", "channel_skew",
                "stretch_reflex", "none", "lever_inertia", "interface_hardening")

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
    """The paper's plan: its laboratory and the first law of each mechanism."""
    effects = [m for m in MECHANISMS for _ in range(counts.per_mechanism)]
    effects += ["none"] * counts.none
    effects += [f"alien:{PAPER_ALIENS[i % len(PAPER_ALIENS)]}" for i in range(counts.alien)]
    effects += [PAIRS[i % len(PAIRS)] for i in range(counts.pair)]
    return [Case(e, first_seed + i, size) for i, e in enumerate(effects)]


def varied_cases(whose: str, counts: Counts, first_seed: int | None = None, size: float = 1.0) -> list[Case]:
    """The plan for `development` or `reporting`: its laws and aliens, each in another of its laboratories from session to session.

    The counts are those of each law, of empty sessions over all laboratories, and so on.
    """
    seeds = SEEDS[whose]
    first_seed = seeds.start if first_seed is None else first_seed
    laws, aliens = purpose.of(whose, "laws"), [a for a in purpose.of(whose, "aliens") if a not in TOO_NEAR_THE_CATALOGUE]
    law_of = {mechanism_of(law): law for law in laws}  # the last of each mechanism
    effects = [law for law in laws for _ in range(counts.per_mechanism)]
    effects += ["none"] * counts.none
    effects += [f"alien:{aliens[i % len(aliens)]}" for i in range(counts.alien)]
    # Two further in each round, so that no pair meets the same few laboratories again and again.
    pairs = (PAIRS[(i + 2 * (i // len(PAIRS))) % len(PAIRS)] for i in range(counts.pair))
    effects += ["+".join(law_of[m] for m in pair.split("+")) for pair in pairs]
    if first_seed not in seeds or first_seed + len(effects) - 1 not in seeds:
        raise ValueError(f"the seeds of {whose} are {seeds.start} to {seeds.stop - 1}")
    turn = cycle(fine_enough(whose))
    return [Case(e, first_seed + i, size, laboratory=_next_that_shows(turn, e)) for i, e in enumerate(effects)]


def fine_enough(whose: str) -> list[str]:
    """The laboratories for `whose` in which a cause is looked for."""
    return [name for name in purpose.of(whose, "laboratories") if name not in TOO_COARSE]


def _next_that_shows(turn, effect: str) -> str:
    causes = Case(effect, 0).causes
    return next(name for name in turn if all(shows(LABORATORIES[name], m) for m in causes))


def with_rig_trials(cases: list[Case], traps_each: int) -> list[Case]:
    """The same sessions with rig trials, and `traps_each` more for each trap, in the laboratories of `cases` in turn."""
    laboratories = cycle(dict.fromkeys(c.laboratory for c in cases))
    size = cases[0].size if cases else 1.0
    with_trap = []
    for trap in TRAPS:
        effects = [e for e in BEHIND_TRAPS if is_of_the_rig(e)] if trap == "person_only" else BEHIND_TRAPS
        with_trap += [(effects[i % len(effects)], trap) for i in range(traps_each)]
    first_seed = max(c.seed for c in cases) + 1
    out = [replace(c, rig_trials=True) for c in cases]
    for i, (effect, trap) in enumerate(with_trap):
        out.append(Case(effect, first_seed + i, size, laboratory=_next_that_shows(laboratories, effect), rig_trials=True, trap=trap))
    return out


# Those of which the quick part asks that nothing is found in nothing. In `child` and `resolver` it is not so yet.
QUICK_LABORATORIES = ("paper", "slow", "stiff", "rigid", "clinic", "soft", "flicker", "direct")

# Shows in every laboratory: its trace is unlike any other's.
SHOWS_EVERYWHERE = "torque_drift"


def quick_cases(first_seed: int) -> list[Case]:
    """In the paper's laboratory one session for each mechanism that can be found, by its first law, with one repetition where that is
    enough, one whose clock is unsteady and two without anything; in each other of its laboratories an empty one and one with an effect
    that shows everywhere."""
    effects = [m for m in MECHANISMS if m not in NEVER_NAMED]
    short = {e: {} if e in NEEDS_REPETITIONS else {"size": QUICK_SIZE, "repetitions": 1} for e in effects}
    singles = [Case(e, first_seed + i, **short[e]) for i, e in enumerate(effects)]
    others = [(e, "paper") for e in ("alien:jittered_clock", "none", "none")]
    others += [(e, l) for l in QUICK_LABORATORIES if l != "paper" for e in ("none", SHOWS_EVERYWHERE)]
    return singles + [Case(e, first_seed + len(singles) + i, laboratory=l) for i, (e, l) in enumerate(others)]
