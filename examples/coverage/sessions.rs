//! Sessions with known truth, fitted in both ways.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use ramphold::dataset::{self, RigCalibration, Session};
use ramphold::fit::{
    AskedFit, ConditionEstimate, ConstantEffects, Fit, Model, Observations, PreprocessingSettings,
    RigConstants, SessionFit, TrialEstimate, Weighting, by_condition, estimates_without_profiles,
    predictions, session_estimates, with_rig_errors,
};
use ramphold::protocol::Protocol;
use ramphold::rig::TrialKey;
use ramphold::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use ramphold::study::{SessionStorage, Unit, UnitSource, simulate_unit};
use ramphold::wrist::{BASE_PARAMETERS, Lever};
use serde_json::{Value, json};

use super::calibrated_rig::{RigErrors, calibration_of, drawn_constants, with_constants};

/// An error that a thread may return.
type Failed = Box<dyn Error + Send + Sync>;

/// True parameters of the trials of a session, by number.
pub type Truth = BTreeMap<u32, [f64; 6]>;

/// A session as one kind of fit sees it.
pub struct Fitted {
    pub name: String,
    pub estimates: Vec<TrialEstimate>,
    pub conditions: Vec<ConditionEstimate>,
    pub truth: Truth,
    /// Measured and predicted torque of each trial, N m, and the sample period, s.
    pub torques_nm: Vec<[Vec<f64>; 2]>,
    pub period_s: f64,
}

/// A session of another program, in its folder.
pub fn fit_folder(folder: &Path, path: &Path) -> Result<[Fitted; 2], Failed> {
    let name = path.file_name().unwrap_or_default();
    let file = folder.join("truth").join(name).with_extension("json");
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    let of_trial = |own: &Value| {
        let value = |name: &str| own[name].as_f64().unwrap_or(f64::NAN);
        (own["trial"].as_u64().unwrap_or(0) as u32, BASE_PARAMETERS.map(value))
    };
    let truth = truth["trials"].as_array().into_iter().flatten().map(of_trial).collect();
    fit(name.display().to_string(), &dataset::load(path)?, PreprocessingSettings::default(), truth, None)
}

/// A session of the virtual wrist: a person of its own for each seed, with the spread of trials that the average person has.
///
/// With `errors` the rig differs from its calibration as the calibration's covariance says.
pub fn fit_own_wrist(
    laboratory: &str,
    seed: u64,
    errors: Option<RigErrors>,
) -> Result<Option<[Fitted; 2]>, Failed> {
    let (protocol, mut setup) = own_laboratory(laboratory)?;
    let stated = setup.lever;
    let calibration = calibration_of(stated);
    if errors.is_some() {
        let constants = drawn_constants(&calibration, stated, seed)?;
        setup = with_constants(setup, &constants);
    }
    let person = Person::drawn(&format!("coverage {seed}"));
    let source = UnitSource::Virtual {
        protocol: &protocol,
        setup: &setup,
        person: Box::new(person.clone()),
        seed,
        order_number: 1,
    };
    let unit = Unit { index: 0, subject: format!("V{seed}"), session: 1, is_excluded: false, source };
    let mut session = simulate_unit(&unit, SessionStorage::Memory)?.ok_or("the unit is virtual")?;
    session.lever = stated;
    let wrist = VirtualWrist::new(person, setup, seed, protocol.signal.sample_rate_hz);
    // Where no trial was rejected, a trial's number is its position. The few other sessions are passed over.
    if session.trials.len() != protocol.trial_count() {
        return Ok(None);
    }
    let of_trial = |trial: &dataset::Trial| {
        let key = TrialKey { practice: false, position: trial.number, rejections: 0 };
        (trial.number, wrist.trial_parameters(key, trial.velocity_rad_s, trial.torque_nm))
    };
    let truth = session.trials.iter().map(of_trial).collect();
    let settings = PreprocessingSettings::of(&protocol);
    let rig = errors.map(|errors| (&calibration, errors));
    fit(format!("seed {seed}"), &session, settings, truth, rig).map(Some)
}

/// The laboratories of `hidden_effects`, with the same names.
fn own_laboratory(name: &str) -> Result<(ramphold::protocol::ValidProtocol, Setup), Failed> {
    let mut protocol: Value = serde_json::from_str(include_str!("../../protocols/de-vlugt-2011.json"))?;
    protocol["before"] = json!({});
    protocol["rest_s"] = json!(1);
    let mut setup = Setup::default();
    match name {
        "paper" => {}
        "slow" => protocol["signal"]["sample_rate_hz"] = json!(1000),
        "stiff" => {
            protocol["signal"]["sample_rate_hz"] = json!(5000);
            protocol["velocities_rad_s"] = json!([1.5, 2.25, 3.0]);
            protocol["torques_nm"] = json!([1.0, 2.0]);
            protocol["repetitions"] = json!(5);
            setup.gauge_noise_nm *= 1.5;
            setup.lever = Some(Lever {
                inertia_kg_m2: 0.0012,
                damping_nm_s_per_rad: 0.6,
                stiffness_nm_per_rad: 2500.0,
            });
        }
        _ => return Err(format!("{name}: paper, slow or stiff?").into()),
    }
    Ok((Protocol::parse(&protocol.to_string(), name)?, setup))
}

/// Both fits of a session.
fn fit(
    name: String,
    session: &Session,
    settings: PreprocessingSettings,
    truth: Truth,
    rig: Option<(&RigCalibration, RigErrors)>,
) -> Result<[Fitted; 2], Failed> {
    let constants = match rig {
        Some((calibration, _)) => RigConstants::calibrated(calibration, session.lever)?,
        None => RigConstants::stated(session.lever),
    };
    let known = rig.filter(|(_, errors)| *errors == RigErrors::Known).map(|(calibration, _)| calibration);
    let observations = Observations::of_rig(session, settings, constants)?;
    let independent = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let of_session = SessionFit::new(&observations, &independent);
    let own = estimates_without_profiles(&observations, &independent);
    let means = by_condition(&own);
    let (own, means) = match known {
        Some(known) => {
            let effects = ConstantEffects::new(&observations, AskedFit::Trials(&independent), known);
            with_rig_errors((own, means), Some(&effects.ok_or("the session has no model of its own")?))
        }
        None => (own, means),
    };
    // Without a model of the session the program gives the independent fit.
    let (estimates, conditions) = match &of_session {
        Ok(session) => {
            let found = session_estimates(&observations, session);
            match known {
                Some(known) => {
                    let effects = ConstantEffects::new(&observations, AskedFit::Session(session), known);
                    with_rig_errors(found, Some(&effects.ok_or("the session has no model of its own")?))
                }
                None => found,
            }
        }
        Err(reason) => {
            eprintln!("{name}: {reason}");
            (own.clone(), means.clone())
        }
    };
    let torques_nm = |fit: &Fit| {
        let both = predictions(&observations, fit).into_iter().zip(&observations.trials);
        both.map(|(own, trial)| [trial.measured_nm.clone(), own.torque_nm]).collect::<Vec<_>>()
    };
    let period_s = observations.period_s;
    let alone = torques_nm(&independent);
    let together = of_session.as_ref().map_or_else(|_| alone.clone(), |session| torques_nm(&session.fit));
    Ok([
        Fitted {
            name: name.clone(),
            conditions: means,
            estimates: own,
            truth: truth.clone(),
            torques_nm: alone,
            period_s,
        },
        Fitted { name, estimates, conditions, truth, torques_nm: together, period_s },
    ])
}
