"""Which rig trials a laboratory runs: loads, motions, and what is stated of each load."""

from dataclasses import dataclass, replace

import numpy as np

GRAVITY_M_S2 = 9.80665
LOADS = ("empty_handle", "known_weight", "known_inertia", "clamped_handle", "known_spring")

# The property by which a load is known, as a field of `RigTrial`.
PROPERTY = {"known_weight": "mass_kg", "known_inertia": "inertia_kg_m2", "known_spring": "stiffness_nm_per_rad"}


@dataclass(frozen=True)
class Block:
    """An entry of a protocol's `rig_trials`. The fields that do not apply are None."""

    load: str
    motion: str  # still, ramps or multisine
    repetitions: int = 2
    amplitude_rad: float | None = None
    lowest_hz: float | None = None
    highest_hz: float | None = None
    duration_s: float | None = None
    mass_kg: float | None = None
    arm_m: float | None = None
    inertia_kg_m2: float | None = None
    stiffness_nm_per_rad: float | None = None
    relative_error: float | None = None  # standard deviation of the stated property


@dataclass(frozen=True)
class RigTrial:
    """One trial: a block's load and motion, at one velocity or sign. Masses and so on are as stated."""

    block: Block
    repetition: int
    velocity_rad_s: float | None = None
    sign: int | None = None
    true_over_stated: float = 1.0  # of the load's property

    @property
    def load(self) -> str:
        return self.block.load

    @property
    def motion(self) -> str:
        return "ramp" if self.block.motion == "ramps" else self.block.motion

    @property
    def true_inertia_kg_m2(self) -> float:
        return (self.block.inertia_kg_m2 or 0.0) * self.true_over_stated

    @property
    def true_stiffness_nm_per_rad(self) -> float:
        return (self.block.stiffness_nm_per_rad or 0.0) * self.true_over_stated

    @property
    def true_torque_nm(self) -> float:
        """Of a weight; positive resists the ramp."""
        if self.load != "known_weight":
            return 0.0
        return self.sign * self.block.mass_kg * GRAVITY_M_S2 * self.block.arm_m * self.true_over_stated


def ramps(repetitions=2) -> Block:
    return Block("empty_handle", "ramps", repetitions)


def multisine(load="empty_handle", repetitions=2, amplitude_rad=0.01, lowest_hz=1.0, highest_hz=60.0, duration_s=3.0, **load_values) -> Block:
    return Block(load, "multisine", repetitions, amplitude_rad, lowest_hz, highest_hz, duration_s, **load_values)


def weight(mass_kg, arm_m=0.10, relative_error=0.002, repetitions=2, duration_s=2.0) -> Block:
    return Block("known_weight", "still", repetitions, duration_s=duration_s, mass_kg=mass_kg, arm_m=arm_m, relative_error=relative_error)


def bar(inertia_kg_m2, relative_error=0.01, **motion) -> Block:
    return multisine("known_inertia", inertia_kg_m2=inertia_kg_m2, relative_error=relative_error, **motion)


def spring(stiffness_nm_per_rad, relative_error=0.01, **motion) -> Block:
    return multisine("known_spring", stiffness_nm_per_rad=stiffness_nm_per_rad, relative_error=relative_error, **motion)


def clamp(amplitude_rad=0.002, **motion) -> Block:
    return multisine("clamped_handle", amplitude_rad=amplitude_rad, **motion)


# By laboratory: some have everything, some a weight alone. A rigid handle shows a load beyond its sensor, and cannot be clamped.
BLOCKS: dict[str, tuple[Block, ...]] = {
    "paper": (ramps(), multisine(), weight(1.0), bar(0.004), clamp()),
    "slow": (ramps(), weight(1.0)),
    "stiff": (ramps(), multisine(duration_s=2.0), weight(2.0), bar(0.006, duration_s=2.0), spring(40.0, duration_s=2.0)),
    "rigid": (multisine(duration_s=2.0), weight(1.5), bar(0.003, duration_s=2.0)),
    "clinic": (ramps(1), weight(0.5, 0.08, 0.005), bar(0.003, 0.02)),
    "soft": (ramps(), multisine(), weight(0.5), weight(2.0, 0.12), clamp(0.003), spring(20.0)),
    "coarse": (ramps(), multisine(amplitude_rad=0.02, highest_hz=40.0), weight(1.0), clamp(0.004, highest_hz=40.0)),
    "flicker": (ramps(), multisine(), weight(1.0), weight(2.5, 0.12), bar(0.004), clamp(), spring(20.0)),
    "direct": (multisine(duration_s=2.0), weight(1.0), spring(20.0, duration_s=2.0)),
    "child": (ramps(), weight(0.5), bar(0.002, 0.02), clamp()),
    "interpolated": (multisine(), weight(1.0), weight(2.0, 0.15), bar(0.005), clamp(), spring(30.0)),
    "resolver": (ramps(), multisine(duration_s=2.0), weight(1.0), bar(0.003, duration_s=2.0)),
    "essential": (ramps(), weight(0.8), bar(0.003, 0.02)),
    "geared": (ramps(), multisine(duration_s=2.0), weight(1.5), bar(0.005, duration_s=2.0), clamp()),
    "kilohertz": (multisine(duration_s=2.0), weight(1.5), bar(0.003, duration_s=2.0)),
    "drifting": (ramps(), multisine(), weight(1.0), clamp()),
    "many": (ramps(), multisine(), weight(1.0), bar(0.004), spring(20.0)),
    "ward": (ramps(), weight(0.7), bar(0.003, 0.02), clamp()),
    "capacitive": (ramps(), multisine(duration_s=2.0), weight(1.0), bar(0.004, duration_s=2.0)),
    "belt": (ramps(), multisine(), weight(1.0), spring(20.0)),
    "athlete": (ramps(), multisine(), weight(2.5), bar(0.005), clamp()),
    "handheld": (multisine(), weight(1.0), bar(0.003)),
    "unmarked": (ramps(), weight(1.0), clamp()),
    "triggered": (ramps(), multisine(), weight(1.0), bar(0.004)),
    "logger": (multisine(duration_s=2.0), weight(1.0), bar(0.003, duration_s=2.0)),
    "threshold": (ramps(), multisine(), weight(0.8), spring(20.0)),
    "fieldbus": (ramps(), weight(1.0), bar(0.004, 0.02)),
    "precise": (ramps(), multisine(duration_s=2.0), weight(1.5), bar(0.004, duration_s=2.0), clamp()),
    "shaky": (ramps(), weight(0.8), bar(0.003, 0.02), clamp()),
}


def expanded(blocks, velocities_rad_s) -> list[RigTrial]:
    """The trials of the blocks in the order in which they are run."""
    trials = []
    for block in blocks:
        for repetition in range(1, block.repetitions + 1):
            if block.motion == "ramps":
                trials += [RigTrial(block, repetition, velocity_rad_s=v) for v in velocities_rad_s]
            elif block.load == "known_weight":
                trials += [RigTrial(block, repetition, sign=sign) for sign in (1, -1)]
            else:
                trials.append(RigTrial(block, repetition))
    return trials


def with_true_values(trials: list[RigTrial], rng: np.random.Generator, wrong: dict[Block, float] | None = None) -> list[RigTrial]:
    """Each load departs from what is stated by its stated error; those in `wrong` also by that factor, stated over true."""
    factor = {}
    for block in dict.fromkeys(t.block for t in trials):
        error = (block.relative_error or 0.0) * float(np.clip(rng.standard_normal(), -2.5, 2.5))
        factor[block] = (1 + error) / (wrong or {}).get(block, 1.0)
    return [replace(t, true_over_stated=factor[t.block]) for t in trials]
