"""Laboratories: how fast and how finely they measure, on which lever and motor, and what they ask of whom."""

from dataclasses import dataclass

NOMINAL_LEVER = {"inertia_kg_m2": 0.0016, "damping_nm_s_per_rad": 0.4, "stiffness_nm_per_rad": 900.0}


def lever(inertia_kg_m2: float, damping_nm_s_per_rad: float, stiffness_nm_per_rad: float) -> tuple:
    return tuple(zip(NOMINAL_LEVER, (inertia_kg_m2, damping_nm_s_per_rad, stiffness_nm_per_rad)))


RIGID = None  # the torque is measured at a handle that follows the motor


@dataclass(frozen=True)
class Laboratory:
    """The defaults are those of the paper's laboratory. `source` says where the other numbers come from."""

    source: str
    sample_hz: int = 2500
    encoder_bits: int = 17
    lever: tuple | None = tuple(NOMINAL_LEVER.items())
    ramp_profile: str = "raised cosine"  # see ramp.PROFILES
    ramp_rise_factor: float = 1.0  # times the 16 ms of the paper's laboratory
    servo_bandwidth_factor: float = 1.0  # times the 80-105 Hz of the paper's laboratory
    amplitude_rad: float = 0.14
    velocities_rad_s: tuple = (1.3, 1.95, 2.6, 3.25)
    torques_nm: tuple = (0.9, 1.5, 2.1)
    repetitions: int = 3
    longest_hold_s: float = 0.8  # recorded before the onset; the shortest is `hold_spread_s` shorter
    hold_spread_s: float = 0.17
    gate_fraction: float = 0.025  # how far the torque may be from its target before the onset ...
    gate_s: float = 0.5  # ... and for how long
    tremor: float = 1.0  # times the size of the healthy subjects' tremor
    tremor_frequency: float = 1.0  # times its frequency, 8.5-10.5 Hz
    gauge_noise: float = 1.0  # times 6-20 mN m
    gauge_spectrum: str = "white"  # see noise.SPECTRA
    has_emg: bool = True
    onsets: str = "command"  # how trials.csv states them: as commanded, "none", or "2 mrad": where the record has moved so far
    rig_trials: str = "paper"  # see rig.loads.BLOCKS

    @property
    def encoder_counts(self) -> int:
        return 2**self.encoder_bits

    def own_lever(self) -> dict | None:
        """The lever as session.json has it; None where the handle is rigid."""
        return dict(self.lever) if self.lever else None


LABORATORIES = {
    "paper": Laboratory("de Vlugt et al. 2011, and the assumptions of the virtual wrist"),
    "slow": Laboratory("assumed: a common rate of converters", sample_hz=1000, rig_trials="slow"),
    "stiff": Laboratory("assumed: a lever of solid steel", sample_hz=5000, velocities_rad_s=(1.5, 2.25, 3.0), torques_nm=(1.0, 2.0),
                        repetitions=5, tremor=1.5, gauge_noise=1.5, lever=lever(0.0012, 0.6, 2500.0), rig_trials="stiff"),
    "rigid": Laboratory("assumed: a torque sensor in the handle, and a trapezoid of speed as drives offer it", sample_hz=2000,
                        encoder_bits=19, lever=RIGID, ramp_profile="trapezoid", velocities_rad_s=(1.2, 1.8, 2.4, 3.0),
                        torques_nm=(1.0, 1.6, 2.2), rig_trials="rigid"),
    "clinic": Laboratory("Deuschl et al. 1998: Parkinsonian tremor has 4-6 Hz; its size, the wider gate and the rest are assumed",
                         encoder_bits=16, torques_nm=(0.6, 1.0, 1.4), velocities_rad_s=(1.5, 2.25, 3.0), repetitions=4,
                         longest_hold_s=0.5, hold_spread_s=0.08, gate_fraction=0.05, gate_s=0.4, tremor=3.0, tremor_frequency=0.5,
                         has_emg=False, rig_trials="clinic"),
    "soft": Laboratory("Flash and Hogan 1985: minimum jerk; the soft lever and the rest are assumed", sample_hz=2000, encoder_bits=18,
                       lever=lever(0.0020, 0.25, 450.0), ramp_profile="minimum jerk", velocities_rad_s=(1.4, 2.0, 2.6, 3.2),
                       torques_nm=(0.8, 1.4, 2.0), rig_trials="soft"),
    "coarse": Laboratory("assumed: an absolute encoder without interpolation, and a drive that follows slowly", sample_hz=1250,
                         encoder_bits=13, servo_bandwidth_factor=0.6, ramp_rise_factor=0.8, gauge_noise=0.7, repetitions=4,
                         velocities_rad_s=(1.5, 2.3, 3.1), rig_trials="coarse"),
    "flicker": Laboratory("assumed: a gauge without chopper, half of whose noise is 1/f; short holds", sample_hz=2000,
                          encoder_bits=20, ramp_profile="trapezoid", ramp_rise_factor=1.2, gauge_spectrum="1/f", gauge_noise=0.6,
                          amplitude_rad=0.16, velocities_rad_s=(1.6, 2.4, 3.3), torques_nm=(0.9, 1.7, 2.5), repetitions=4,
                          longest_hold_s=0.5, hold_spread_s=0.05, gate_fraction=0.04, gate_s=0.45, rig_trials="flicker"),
    "direct": Laboratory("assumed: a direct drive of high bandwidth with a rigid handle", sample_hz=5000, encoder_bits=20, lever=RIGID,
                         ramp_profile="minimum jerk", servo_bandwidth_factor=2.0, velocities_rad_s=(1.3, 2.2, 3.1), repetitions=4,
                         gauge_noise=1.3, has_emg=False, rig_trials="direct"),
    "child": Laboratory("assumed: a child's wrist, with small torques and unsteady holds; an integrated servo of 1 kHz", sample_hz=1000,
                        encoder_bits=16, lever=lever(0.0011, 0.3, 700.0), ramp_profile="minimum jerk", ramp_rise_factor=1.2,
                        velocities_rad_s=(1.4, 2.1, 2.8), torques_nm=(0.7, 1.1, 1.5), repetitions=4, gate_fraction=0.05, tremor=1.5,
                        servo_bandwidth_factor=0.8, has_emg=False, rig_trials="child"),
    "interpolated": Laboratory("assumed: a sine encoder with interpolation, a quiet gauge and a long lever", sample_hz=5000,
                               encoder_bits=22, lever=lever(0.0024, 0.5, 1400.0), ramp_rise_factor=0.7, servo_bandwidth_factor=1.5,
                               amplitude_rad=0.15, velocities_rad_s=(1.5, 2.0, 2.5, 3.0), torques_nm=(1.0, 2.0), repetitions=4,
                               gauge_noise=0.5, rig_trials="interpolated"),
    "resolver": Laboratory("assumed: a resolver of 15 bits on a rigid handle, with a drive's trapezoid", sample_hz=2000,
                           encoder_bits=15, lever=RIGID, ramp_profile="trapezoid", velocities_rad_s=(1.3, 1.9, 2.5, 3.1),
                           torques_nm=(0.8, 1.4, 2.0), gauge_noise=1.2, longest_hold_s=0.6, hold_spread_s=0.1, rig_trials="resolver"),
    "essential": Laboratory("Deuschl et al. 1998: essential tremor has 4-12 Hz; its size, the wider gate and the rest are assumed",
                            sample_hz=1250, encoder_bits=18, lever=lever(0.0018, 0.45, 1100.0), tremor=2.5, tremor_frequency=0.75,
                            gate_fraction=0.05, velocities_rad_s=(1.3, 2.0, 2.7), torques_nm=(0.7, 1.1, 1.5), repetitions=4,
                            longest_hold_s=0.7, hold_spread_s=0.1, rig_trials="essential"),
    "geared": Laboratory("assumed: an industrial drive with a short stiff lever", sample_hz=5000, encoder_bits=18,
                         lever=lever(0.0013, 0.5, 1700.0), ramp_profile="trapezoid", ramp_rise_factor=0.8, servo_bandwidth_factor=1.2,
                         velocities_rad_s=(1.2, 1.7, 2.3, 3.0), torques_nm=(0.8, 1.6), repetitions=4, rig_trials="geared"),
    "kilohertz": Laboratory("assumed: a rigid handle on a servo that is sampled over a field bus", sample_hz=1000, encoder_bits=18,
                            lever=RIGID, ramp_profile="minimum jerk", velocities_rad_s=(1.4, 2.2, 3.0), torques_nm=(1.0, 1.5, 2.0),
                            repetitions=4, gauge_noise=0.8, has_emg=False, rig_trials="kilohertz"),
    "drifting": Laboratory("assumed: a slower servo and an old bridge amplifier, half of whose noise is 1/f", lever=lever(0.0017, 0.35, 750.0),
                           servo_bandwidth_factor=0.9, velocities_rad_s=(1.2, 1.6, 2.1, 2.7), gauge_noise=0.8, gauge_spectrum="1/f",
                           rig_trials="drifting"),
    "many": Laboratory("assumed: more velocities, of which each is seen less often", encoder_bits=20, lever=lever(0.0015, 0.4, 1000.0),
                       velocities_rad_s=(1.2, 1.6, 2.0, 2.4, 2.8, 3.2), torques_nm=(1.0, 1.8), gauge_noise=1.2, rig_trials="many"),
    "ward": Laboratory("assumed: older persons with small torques and a larger tremor, on a light lever", sample_hz=2000,
                       encoder_bits=17, lever=lever(0.0010, 0.35, 800.0), velocities_rad_s=(1.2, 1.8, 2.4), torques_nm=(0.6, 1.0, 1.4),
                       repetitions=4, tremor=1.8, gate_fraction=0.04, longest_hold_s=0.7, hold_spread_s=0.12, rig_trials="ward"),
    "capacitive": Laboratory("assumed: a capacitive encoder of 19 bits and a fast acquisition", sample_hz=5000, encoder_bits=19,
                             lever=lever(0.0014, 0.45, 1250.0), ramp_rise_factor=0.9, velocities_rad_s=(1.4, 2.0, 2.6, 3.2),
                             torques_nm=(0.9, 1.4, 1.9), gauge_noise=1.1, rig_trials="capacitive"),
    "belt": Laboratory("assumed: a belt between motor and lever, that a slow drive follows", encoder_bits=16,
                       lever=lever(0.0019, 0.55, 850.0), servo_bandwidth_factor=0.75, ramp_rise_factor=1.1,
                       velocities_rad_s=(1.3, 1.9, 2.5, 3.1), torques_nm=(0.8, 1.3, 1.8), gauge_noise=0.9, has_emg=False, rig_trials="belt"),
    "athlete": Laboratory("assumed: strong persons on a stiff lever with two torques", sample_hz=2500, encoder_bits=18,
                          lever=lever(0.0015, 0.6, 2000.0), ramp_profile="minimum jerk", velocities_rad_s=(1.3, 1.7, 2.1, 2.6, 3.1),
                          torques_nm=(1.5, 2.8), gauge_noise=1.4, amplitude_rad=0.15, rig_trials="athlete"),
    "handheld": Laboratory("assumed: a rigid handle with a torque sensor of low noise, and short trials of two velocities", sample_hz=1250,
                           encoder_bits=19, lever=RIGID, ramp_profile="trapezoid", ramp_rise_factor=1.1, velocities_rad_s=(1.5, 2.8),
                           torques_nm=(0.8, 1.2, 1.6, 2.0), repetitions=4, gauge_noise=0.6, longest_hold_s=0.6, hold_spread_s=0.08,
                           gate_fraction=0.03, rig_trials="handheld"),
    "unmarked": Laboratory("assumed: a data logger of 1 kHz that does not record when the ramp was commanded", sample_hz=1000,
                           encoder_bits=16, lever=lever(0.0018, 0.5, 1000.0), ramp_profile="minimum jerk",
                           velocities_rad_s=(1.4, 2.2, 3.0), torques_nm=(0.9, 1.7), repetitions=4, has_emg=False, onsets="none",
                           rig_trials="unmarked"),
    "triggered": Laboratory("assumed: onsets where the record has moved by 2 mrad", encoder_bits=18, lever=lever(0.0016, 0.45, 1100.0),
                            velocities_rad_s=(1.3, 1.9, 2.6, 3.2), torques_nm=(0.9, 1.6), onsets="2 mrad", rig_trials="triggered"),
    "logger": Laboratory("assumed: a data logger without the command, and a rigid handle", sample_hz=2000, encoder_bits=18, lever=RIGID,
                         velocities_rad_s=(1.4, 2.1, 2.8), torques_nm=(0.8, 1.3, 1.8), gauge_noise=0.9, has_emg=False, onsets="none",
                         rig_trials="logger"),
    "threshold": Laboratory("assumed: onsets where the record has moved by 2 mrad, on a light lever", encoder_bits=20,
                            lever=lever(0.0012, 0.4, 750.0), ramp_profile="trapezoid", velocities_rad_s=(1.5, 2.2, 2.9),
                            torques_nm=(0.7, 1.3, 1.9), gauge_noise=1.2, onsets="2 mrad", rig_trials="threshold"),
    "fieldbus": Laboratory("assumed: an integrated servo of 1 kHz and 17 bits, whose bus does not carry the command", sample_hz=1000,
                           encoder_bits=17, lever=lever(0.0019, 0.5, 950.0), ramp_profile="minimum jerk", ramp_rise_factor=1.1,
                           velocities_rad_s=(1.5, 2.2, 2.9), torques_nm=(1.0, 1.6, 2.2), repetitions=4, onsets="none",
                           rig_trials="fieldbus"),
    "precise": Laboratory("assumed: a quiet gauge on a lever of solid steel", sample_hz=5000, encoder_bits=20,
                          lever=lever(0.0013, 0.55, 1800.0), ramp_rise_factor=0.9, velocities_rad_s=(1.2, 1.8, 2.4, 3.0),
                          torques_nm=(0.9, 1.8), gauge_noise=0.7, rig_trials="precise"),
    "shaky": Laboratory("Deuschl et al. 1998: essential tremor has 4-12 Hz; its size, the wider gate and the rest are assumed",
                        sample_hz=2000, lever=lever(0.0015, 0.4, 900.0), ramp_profile="trapezoid", tremor=2.2, tremor_frequency=0.8,
                        gate_fraction=0.05, velocities_rad_s=(1.4, 2.1, 2.8), torques_nm=(0.8, 1.4, 2.0), repetitions=4,
                        rig_trials="shaky"),
}
