"""Laboratories: how fast and how finely they measure, on which lever, and what they ask of a person."""

from dataclasses import dataclass

VELOCITIES_RAD_S = (1.3, 1.95, 2.6, 3.25)
TORQUES_NM = (0.9, 1.5, 2.1)
NOMINAL_LEVER = {"inertia_kg_m2": 0.0016, "damping_nm_s_per_rad": 0.4, "stiffness_nm_per_rad": 900.0}


@dataclass(frozen=True)
class Laboratory:
    sample_hz: int = 2500
    encoder_counts: int = 2**17
    lever: tuple = tuple(NOMINAL_LEVER.items())
    velocities_rad_s: tuple = VELOCITIES_RAD_S
    torques_nm: tuple = TORQUES_NM
    repetitions: int = 3
    tremor: float = 1.0  # times that of the others' persons
    gauge_noise: float = 1.0

    def own_lever(self) -> dict:
        return dict(self.lever)


LABORATORIES = {
    "paper": Laboratory(),
    "slow": Laboratory(sample_hz=1000),
    "stiff": Laboratory(sample_hz=5000, velocities_rad_s=(1.5, 2.25, 3.0), torques_nm=(1.0, 2.0), repetitions=5, tremor=1.5,
                        gauge_noise=1.5, lever=(("inertia_kg_m2", 0.0012), ("damping_nm_s_per_rad", 0.6),
                                                ("stiffness_nm_per_rad", 2500.0))),
}
