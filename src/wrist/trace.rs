//! One simulated trial with all angles, speeds and torques, for figures and for quantities derived from the motion.

use super::batch::{Batch, corrected_motion, recorded};
use super::history::History;
use super::integrate::{HermiteSegment, Integrator};
use super::mechanics::{AddedDynamics, Kinematics, Mechanics, State, Torques};
use super::mechanisms::ActiveMechanisms;
use super::plant::{BASE_PARAMETERS, Plant};
use super::simulation::{SimulationSettings, TrialInput};

/// The wrist at one sample.
#[derive(Debug, Clone, Copy)]
pub struct TraceSample {
    /// Time since the onset, s.
    pub time_s: f64,
    /// The motor.
    pub motor: Kinematics<f64>,
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
/// If `parameters` has not the length of [`SimulationSettings::parameter_count`].
pub fn trace(settings: &SimulationSettings, trial: &TrialInput, parameters: &[f64]) -> Vec<TraceSample> {
    assert_eq!(parameters.len(), settings.parameter_count(), "one parameter vector");
    let batch = Batch { settings, trials: &[trial], parameters, first: 0, wanted: 0..0 };
    let start_s = -(settings.lead_samples as f64) * settings.period_s;
    let mut history =
        History::new(start_s, settings.period_s, settings.kinds.iter().map(|kind| kind.state_count()).sum());
    let mut plant = Plant::base(settings.lever, parameters);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let active = ActiveMechanisms {
        kinds: settings.kinds,
        parameters: added,
        trial: &trial.covariates,
        history: &history,
    };
    active.alter_plant(&mut plant);
    let channels = active.channels();
    let mechanics = Mechanics::new(plant);
    let motion = match settings.kinds.iter().any(|kind| kind.alters_angle()) {
        true => corrected_motion::<f64, f64>(&batch, &channels),
        false => (0..=settings.lead_samples + settings.samples)
            .map(|sample| recorded::<f64>(&batch, sample))
            .collect(),
    };
    let mut integrator = Integrator::at_rest();
    let mut instants = Vec::with_capacity(settings.samples);
    for sample in 0..settings.lead_samples + settings.samples {
        let time_s = start_s + sample as f64 * settings.period_s;
        let added_dynamics = ActiveMechanisms {
            kinds: settings.kinds,
            parameters: added,
            trial: &trial.covariates,
            history: &history,
        };
        if sample >= settings.lead_samples {
            instants.push(instant(&mechanics, &added_dynamics, &integrator, motion[sample], time_s));
        }
        let segment = HermiteSegment::new(motion[sample], motion[sample + 1], settings.period_s);
        integrator.advance(
            &mechanics,
            &added_dynamics,
            &segment,
            time_s,
            settings.period_s,
            settings.substeps,
        );
        let (added, rates) = integrator.sampled();
        history.push(added, rates);
    }
    instants
}

fn instant<X: AddedDynamics<f64>>(
    mechanics: &Mechanics<f64>,
    added_dynamics: &X,
    integrator: &Integrator<f64>,
    motor: Kinematics<f64>,
    time_s: f64,
) -> TraceSample {
    let (torques, rates) = integrator.torques(mechanics, added_dynamics, motor, time_s);
    let state = integrator.state();
    TraceSample {
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
pub fn srs_period_s(instants: &[TraceSample], elastic_limit_rad: f64) -> Option<f64> {
    instants.windows(2).find(|pair| pair[1].state.theta_j >= elastic_limit_rad).map(|pair| {
        let (from, to) = (pair[0].state.theta_j, pair[1].state.theta_j);
        let fraction =
            if to > from { ((elastic_limit_rad - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        pair[0].time_s + fraction * (pair[1].time_s - pair[0].time_s)
    })
}
