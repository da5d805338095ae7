//! The wrist model: Eq. 1-7 of de Vlugt et al. 2011, and mechanisms that the model lacks.
//!
//! The model is written once, over any [`Number`](crate::number::Number): a plain number, a number with derivatives, several
//! trials at once. The virtual wrist integrates it sample by sample; the fit and the diagnosis run whole trials through
//! [`simulate`].

pub mod mechanisms;

mod base_trials;
mod batch;
mod channel_states;
mod compiled;
mod exact_steps;
mod extended;
mod further_channel;
mod history;
mod integrate;
mod interpolation;
mod linear_response;
mod mechanics;
mod motion;
mod passes;
mod past_values;
mod plant;
mod presliding;
mod propagator;
mod simulate;
mod simulation;
#[cfg(test)]
mod tests;
mod torque_channel;
mod trace;
mod yield_loss;

pub use exact_steps::steps_per_sample;
pub use further_channel::{FurtherChannel, FurtherValues, ScaledChannel};
pub use history::History;
pub use integrate::{HermiteSegment, Integrator, LONGEST_STEP, substeps};
pub use mechanics::{AddedDynamics, Context, Kinematics, Mechanics, NoAddedDynamics, State, Torques};
pub use motion::{Smoothing, delayed_motion, motor_motion, servo_response, through};
pub use plant::{
    BASE_PARAMETERS, JOINT_DAMPING_NM_S_PER_RAD, Lever, LeverCoefficients, Plant, YIELD_SMOOTHNESS_PER_NM,
};
pub use presliding::built_up_friction;
pub use simulate::{simulate, simulate_over};
pub use simulation::{SimulatedTorque, SimulationSettings, TrialInput, VectorWidth, runge_kutta_steps};
pub use trace::{TraceSample, srs_period_s, trace};
