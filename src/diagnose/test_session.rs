//! Sessions for tests: three velocities with four repetitions each, of a wrist that hides a mechanism; and what rig trials say of its rig.

use std::collections::BTreeMap;

use super::RigKnowledge;
use super::evidence::session_prior::SessionPrior;
use super::within_trial::score_test::probe_context;
use crate::dataset::{
    CalibratedQuantity, Record, RigCalibration, RigQuantity, Session, Status, Subject, Trial,
};
use crate::fit::{Fit, Model, Observations, RigConstants, Weighting};
use crate::random::Stream;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{self, Lever, SimulationSettings, TrialInput, VectorWidth};

/// The lever of the rig.
pub const LEVER: Lever =
    Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

/// Seed of the noise of the torque.
const SEED: u64 = 1;

const PERIOD_S: f64 = 4e-4;
const SUBJECT: [f64; 6] = [0.005, 1.2, 300.0, 20.0, 13.0, 0.04];
const HOLD_SAMPLES: usize = 1250;
const RAMP: usize = 150;
const REPETITIONS: u32 = 4;
const VELOCITIES_RAD_S: [f64; 3] = [1.95, 2.6, 3.25];

fn trial(
    (number, repetition, velocity_rad_s): (u32, u32, f64),
    (kind, values): (MechanismKind, &[f64]),
    stream: &mut Stream,
) -> Trial {
    let sweep = crate::protocol::Sweep::new(0.14, velocity_rad_s, 0.018).unwrap();
    let angle = |sample: usize| sweep.at((sample as f64 - HOLD_SAMPLES as f64).max(0.0) * PERIOD_S).angle_rad;
    let theta_m_rad: Vec<f64> = (0..HOLD_SAMPLES + RAMP).map(angle).collect();
    let input = TrialInput {
        motion: wrist::motor_motion(&theta_m_rad, PERIOD_S),
        onset: HOLD_SAMPLES,
        covariates: Default::default(),
    };
    let settings = SimulationSettings {
        lever: Some(LEVER),
        kinds: &[kind],
        period_s: PERIOD_S,
        samples: RAMP,
        lead_samples: 10,
        baseline_samples: 0,
        substeps: 8,
        filter: &[],
        further: &[],
        derivatives: &[],
        width: VectorWidth::One,
    };
    let parameters: Vec<f64> = SUBJECT.iter().chain(values).copied().collect();
    let ramp = wrist::trace(&settings, &input, &parameters);
    let changes =
        std::iter::repeat_n(0.0, HOLD_SAMPLES).chain(ramp.iter().map(|sample| sample.torques.measured));
    Trial {
        number,
        file: format!("trials/trial-{number:03}.csv"),
        velocity_rad_s,
        torque_nm: 1.5,
        repetition,
        condition: None,
        onset_s: Some(0.0),
        status: Status::Ok,
        extra: BTreeMap::new(),
        record: Record {
            start_s: -(HOLD_SAMPLES as f64) * PERIOD_S,
            torque_l_nm: changes.map(|change| 1.5 + change + 0.01 * stream.normal()).collect(),
            theta_m_rad,
            ..Record::default()
        },
    }
}

/// The session of a wrist with the mechanism `kind`, whose parameters are `values` of the order of a trial, from -1 to 1 over the session.
pub fn session(kind: MechanismKind, values: impl Fn(f64) -> Vec<f64>) -> Session {
    let mut stream = Stream::new(SEED, "example mechanism");
    let last = f64::from(REPETITIONS) * VELOCITIES_RAD_S.len() as f64 - 1.0;
    let mut trials = Vec::new();
    for repetition in 1..=REPETITIONS {
        for velocity_rad_s in VELOCITIES_RAD_S {
            let order = 2.0 * trials.len() as f64 / last - 1.0;
            let number = trials.len() as u32 + 1;
            trials.push(trial((number, repetition, velocity_rad_s), (kind, &values(order)), &mut stream));
        }
    }
    Session {
        subject: Subject { id: "T".into() },
        sample_rate_hz: 1.0 / PERIOD_S,
        lever: Some(LEVER),
        recorded_filter: None,
        channel_ranges: Default::default(),
        trials,
    }
}

/// The fit of the paper's model, and the priors about it where the rig is as stated.
pub fn fit_and_prior(observations: &Observations) -> (Fit, SessionPrior) {
    let before = Fit::new(observations, &Model::paper(), Weighting::MeasuredNoise);
    let rig = RigKnowledge::stated(Some(LEVER));
    let prior = SessionPrior::new(observations, &before, probe_context(observations), rig);
    (before, prior)
}

/// What a calibration with these values and standard errors, uncorrelated, says of the rig. A low-pass may lie above a frequency, Hz.
pub fn measured_rig(told: &[(RigQuantity, f64, f64)], above_hz: Option<f64>) -> RigKnowledge {
    let quantity = |name: RigQuantity| {
        let own = told.iter().find(|(quantity, ..)| *quantity == name);
        CalibratedQuantity {
            name,
            value: own.map(|(_, value, _)| *value),
            se: own.map(|(.., se)| *se),
            stated: RigConstants::stated(Some(LEVER)).value(name),
            reason: own.is_none().then(|| "no load tells it".to_owned()),
            above: above_hz.filter(|_| name == RigQuantity::TorqueCutoff),
        }
    };
    let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(quantity).to_vec();
    let variances: Vec<f64> = quantities.iter().filter_map(|own| own.se).map(|se| se * se).collect();
    let row = |i: usize| (0..variances.len()).map(|j| if i == j { variances[i] } else { 0.0 }).collect();
    let covariance = (0..variances.len()).map(row).collect();
    let calibration = RigCalibration::new("test".into(), "rig".into(), quantities, covariance);
    RigKnowledge::measured(&calibration, Some(LEVER)).unwrap()
}
