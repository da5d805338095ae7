//! One trial with everything that moves, for pictures and for what is derived from the motion.

use super::group::{Job, motion};
use super::integrate::{Glide, Varied, Walk};
use super::mechanisms::{Extension, Mechanisms, Past};
use super::plant::{BASE_PARAMETERS, Knot, Mechanics, Plant, State, Torques};
use super::simulate::{Request, Trial};

/// The wrist at one sample.
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    /// Time since the onset, s.
    pub time_s: f64,
    /// The motor.
    pub motor: Knot<f64>,
    /// Angles and speeds of handle and joint.
    pub state: State<f64>,
    /// Torques, unfiltered.
    pub torques: Torques<f64>,
    /// T_j,elas of Eq. 2, N m.
    pub elastic_nm: f64,
    /// I_j times the acceleration of the joint, N m: the inertial part of T_h.
    pub inertial_nm: f64,
}

/// Simulates `trial` from the onset on and keeps every sample.
///
/// # Panics
/// If `parameters` has not the length of [`Request::parameter_count`].
pub fn trace(request: &Request, trial: &Trial, parameters: &[f64]) -> Vec<Instant> {
    assert_eq!(parameters.len(), request.parameter_count(), "one parameter vector");
    let job = Job { request, trials: &[trial], parameters, first: 0, wanted: 0..0 };
    let start_s = -(request.lead as f64) * request.period_s;
    let mut past = Past::new(start_s, request.period_s);
    let mut plant = Plant::base(request.lever, parameters);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let switched_on =
        Mechanisms { kinds: request.kinds, parameters: added, trial: &trial.covariates, past: &past };
    switched_on.shape(&mut plant);
    let channels = switched_on.channels();
    let mechanics = Mechanics::new(plant);
    let knots = motion::<f64, f64>(&job, &channels);
    let mut walk = Walk::at_rest();
    let mut instants = Vec::with_capacity(request.samples);
    for sample in 0..request.lead + request.samples {
        let time_s = start_s + sample as f64 * request.period_s;
        let extension =
            Mechanisms { kinds: request.kinds, parameters: added, trial: &trial.covariates, past: &past };
        if sample >= request.lead {
            instants.push(instant(&mechanics, &extension, &walk.state, knots[sample], time_s));
        }
        let glide = Varied(Glide::new(knots[sample], knots[sample + 1], request.period_s));
        walk.advance(&mechanics, &extension, &glide, time_s, request.period_s, request.substeps);
        past.push(walk.memory);
    }
    instants
}

fn instant<X: Extension<f64>>(
    mechanics: &Mechanics<f64>,
    extension: &X,
    state: &State<f64>,
    motor: Knot<f64>,
    time_s: f64,
) -> Instant {
    let mut rates = State::rest();
    let torques = mechanics.rates(extension, state, motor, time_s, &mut rates);
    Instant {
        time_s,
        motor,
        state: *state,
        torques,
        elastic_nm: mechanics.elastic_torque(state.theta_j).0,
        inertial_nm: mechanics.plant.joint_inertia * rates.omega_j,
    }
}

/// The SRS period x_t: time from the onset to where the joint angle equals the elastic limit (section 2.3 of the paper), by
/// straight interpolation between samples. `None` if it is not reached.
pub fn srs_period_s(instants: &[Instant], elastic_limit_rad: f64) -> Option<f64> {
    instants.windows(2).find(|pair| pair[1].state.theta_j >= elastic_limit_rad).map(|pair| {
        let (from, to) = (pair[0].state.theta_j, pair[1].state.theta_j);
        let fraction =
            if to > from { ((elastic_limit_rad - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        pair[0].time_s + fraction * (pair[1].time_s - pair[0].time_s)
    })
}
