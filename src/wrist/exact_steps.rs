//! How many steps a simulation takes.

use super::linear_response::LONGEST_LINEAR_STEP;
use super::mechanisms::MechanismKind;
use super::plant::{BASE_PARAMETERS, Lever, Plant};
use super::simulation::{TrialInput, altered_plant};

/// How a yield limits the steps.
struct YieldSteps {
    /// Greatest change of a_s k_dec (theta_j - x_e) over a step.
    widest: f64,
    /// Shortest step that it asks for, s. A search tries yields far sharper than those of persons, and need not follow them exactly to turn
    /// back.
    shortest_s: f64,
}

/// Over a step the torque that the yield takes away is a cubic. Its error grows with the fourth power of the change; the tests hold it below
/// 1e-5 N m.
const OF_BASE_MODEL: YieldSteps = YieldSteps { widest: 1.75, shortest_s: 0.0 };

/// With mechanisms, whose own errors are larger: 4e-5 N m.
const WITH_MECHANISMS: YieldSteps = YieldSteps { widest: 2.5, shortest_s: 2e-4 };

/// Where a mechanism's torque sets in as sharply as the yield, which is known by its values alone.
const FOLLOWED_YIELD: YieldSteps = YieldSteps { widest: 0.6, shortest_s: 1e-4 };

/// Longest step over which the torque of a mechanism is a cubic, s.
const LONGEST_STEP_OF_TORQUES_S: f64 = 4.1e-4;

/// Longest step over which the torque in the lever is a cubic, as states of the torque channel see it, s.
const LONGEST_STEP_OF_CHANNEL_S: f64 = 2.5e-4;

/// Most steps per sample.
const MOST_STEPS: usize = 64;

/// Steps per sample that the model needs at these `parameters` for [`simulate`](super::simulate): their error is below 1e-5 N m in the base
/// model, below 2e-4 N m with a mechanism of a plausible size, and below 1e-3 N m with a slack, which has corners.
/// A power of two: a small step of the parameters seldom changes it, and few trials of a session have steps of their own.
pub fn steps_per_sample(
    lever: Option<Lever>,
    kinds: &[MechanismKind],
    trial: &TrialInput,
    parameters: &[f64],
    period_s: f64,
) -> usize {
    let plant = altered_plant(lever, kinds, trial, parameters);
    let speed_rad_s = trial.highest_speed_rad_s();
    let yield_steps = match kinds {
        [] => OF_BASE_MODEL,
        _ if kinds.iter().any(|kind| kind.follows_yield()) => FOLLOWED_YIELD,
        _ => WITH_MECHANISMS,
    };
    let steepness_per_s = plant.smoothness * plant.stiffness_decrement * speed_rad_s;
    let of_yield = (steepness_per_s / yield_steps.widest).min(1.0 / yield_steps.shortest_s);
    let mut rate = of_yield.max(fastest_rate(&plant) / LONGEST_LINEAR_STEP);
    let mut first = BASE_PARAMETERS.len();
    for kind in kinds {
        let own = first..first + kind.parameter_count();
        first = own.end;
        if kind.adds_torque() {
            let longest_s = kind.longest_step_s(&parameters[own], speed_rad_s);
            rate = rate.max(1.0 / longest_s.min(LONGEST_STEP_OF_TORQUES_S));
        } else if kind.channel_state_count() > 0 {
            rate = rate.max(1.0 / LONGEST_STEP_OF_CHANNEL_S);
        }
    }
    let wanted = libm::ceil(period_s * rate);
    if wanted.is_finite() { (wanted as usize).clamp(1, MOST_STEPS).next_power_of_two() } else { MOST_STEPS }
}

/// The fastest rate of the linear part, 1/s.
fn fastest_rate(plant: &Plant<f64>) -> f64 {
    let (inertia, damping, stiffness) =
        (plant.joint_inertia, plant.interface_damping, plant.interface_stiffness);
    let joint = (damping + plant.joint_damping) / inertia;
    let swing = libm::sqrt((stiffness + plant.short_range_stiffness) / inertia);
    let Some(lever) = plant.lever else { return joint.max(swing) };
    let handle = (damping + lever.damping) / lever.inertia;
    let handle_swing = libm::sqrt((stiffness + lever.stiffness) / lever.inertia);
    (joint + handle).max(swing).max(handle_swing)
}
