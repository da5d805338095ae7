"""What the program may be developed with, and what only reports on it.

Whoever changes the program may look at its answers to sessions of the first kind as often as they like, and at none of the second.
A law, laboratory or alien that is looked at during development moves to `DEVELOPMENT` for good.
"""

from ..aliens import ALIENS
from ..catalogue import EFFECTS
from ..laboratories import LABORATORIES

PURPOSES = ("development", "reporting")

REPORTING = {
    "laboratories": {"logger", "threshold", "fieldbus", "precise", "shaky"},
    "laws": {"joint_damping@quadratic", "joint_friction@dahl", "interface_hardening@exponential", "interface_hardening@bottoming",
             "interface_slack@backlash", "stretch_reflex@burst", "stress_relaxation@power_law", "post_yield_viscosity@growing",
             "gradual_yield@uniform", "stiffening@exponential", "timed_yield@loaded", "lever_inertia@loaded", "lever_stiffness@loaded",
             "lever_damping@loaded", "servo_following@third_order", "channel_skew@by_trial", "torque_lag@moving_average",
             "torque_lag@bessel", "torque_gain@loaded", "angle_gain@by_velocity", "torque_saturation@tanh", "torque_saturation@latching",
             "mains_hum@flat_topped", "torque_drift@swing", "fatigue@recovering", "thixotropy@power", "thixotropy@previous_size",
             "cocontraction@quadratic", "outlier_trial@yielding", "activation_scaling@saturating"},
    "aliens": {"snapping_tendon", "second_grip", "squelching_foam", "cable_pull", "bent_amplifier", "eccentric_encoder",
               "tendon_whip", "motor_crosstalk", "slipping_strap", "echo", "wandering_axis", "baseline_jumps"},
}
DEVELOPMENT = {
    "laboratories": {"paper", "slow", "stiff", "rigid", "clinic", "soft", "coarse", "flicker", "direct", "child", "interpolated", "resolver",
                     "essential", "geared", "kilohertz", "drifting", "many", "ward", "capacitive", "belt", "athlete", "handheld", "unmarked",
                     "triggered"},
    "laws": {"joint_damping@linear", "joint_damping@shear_thinning", "joint_friction@lugre", "joint_friction@speed",
             "interface_hardening@sinh", "interface_hardening@cubic", "interface_slack@hyperbolic", "interface_slack@dead_zone",
             "stretch_reflex@gamma", "stretch_reflex@lag", "stress_relaxation@two_branches", "stress_relaxation@maxwell",
             "post_yield_viscosity@linear", "post_yield_viscosity@hill", "gradual_yield@normal", "gradual_yield@hyperbolic",
             "stiffening@levelling", "stiffening@linear", "timed_yield@proportional", "timed_yield@drifting", "lever_inertia@constant",
             "lever_inertia@drifting", "lever_stiffness@constant", "lever_stiffness@drifting", "lever_damping@constant",
             "lever_damping@drifting", "servo_following@cascade", "servo_following@resonant", "channel_skew@constant",
             "channel_skew@drifting", "torque_lag@two_poles", "torque_lag@one_pole", "torque_gain@constant", "torque_gain@drifting",
             "angle_gain@constant", "angle_gain@drifting", "torque_saturation@algebraic", "torque_saturation@hard",
             "mains_hum@third_harmonic", "mains_hum@sine", "torque_drift@line", "torque_drift@exponential", "fatigue@exponential",
             "fatigue@linear", "thixotropy@hyperbolic", "thixotropy@exponential", "cocontraction@saturating", "cocontraction@linear",
             "outlier_trial@both", "outlier_trial@stiffness", "activation_scaling@power", "activation_scaling@linear"},
    "aliens": {"loose_mass", "gauge_hysteresis", "speed_dependent_gain", "torque_burst", "oscillating_stiffness", "yield_catch",
               "emg_crosstalk", "jittered_clock", "frozen_torque", "coarse_converter", "handle_recoil", "rebound_wall",
               "sticky_film", "startle", "rough_bearing", "ringing_amplifier"},
}
_EVERYTHING = {"laboratories": LABORATORIES, "laws": EFFECTS, "aliens": ALIENS}


def of(purpose: str, kind: str) -> list[str]:
    """The laboratories, laws or aliens for `purpose`, in the order in which they are declared."""
    chosen = {"development": DEVELOPMENT, "reporting": REPORTING}[purpose][kind]
    return [name for name in _EVERYTHING[kind] if name in chosen]


def purpose_of(kind: str, name: str) -> str:
    return next(p for p in PURPOSES if name in of(p, kind))
