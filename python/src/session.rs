//! Sessions: read, given as arrays or simulated; fitted and diagnosed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use ramphold::app::{AnalysedSession, CheckedSession, Failure, UsedCalibration, with_window};
use ramphold::consistency::{self, SignalCheck};
use ramphold::dataset::{
    Digits, FurtherChannel, PROTOCOL, RIG_CALIBRATION, Record, Session, Status, Subject, Trial, check_given,
    load, stored_protocol, write_session,
};
use ramphold::fit::{self, Model, PreprocessingSettings, Weighting};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::virtual_wrist::{MechanismList, Person, RigFile, Setup};
use ramphold::signal::FilterSpec;
use ramphold::study::{SessionStorage, Unit, UnitSource, simulate_unit};
use ramphold::wrist::Lever;
use serde::{Deserialize, Serialize};

use crate::background;
use crate::errors::{exception, failed_work, wrong_input};
use crate::fitted::NativeFit;
use crate::protocol::NativeProtocol;
use crate::signals::{Signals, TrialSignals, argument, check_rows};

/// A session, its name in messages, its protocol, and the calibration in its folder.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeSession {
    session: Arc<Session>,
    name: String,
    protocol: Option<ValidProtocol>,
    calibration: Option<UsedCalibration>,
}

/// A session as Python describes it, without its signals.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    subject: String,
    sample_rate_hz: f64,
    lever: Option<Lever>,
    recorded_filter: Option<FilterSpec>,
    trials: Vec<GivenTrial>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct GivenTrial {
    trial: u32,
    velocity_rad_s: f64,
    torque_nm: f64,
    repetition: u32,
    condition: Option<String>,
    onset_s: Option<f64>,
    status: Status,
    extra: BTreeMap<String, String>,
}

/// The arguments of `Session.from_arrays` for the further channels.
const FURTHER: [(&str, FurtherChannel); 4] = [
    ("theta_l", FurtherChannel::HandleAngle),
    ("alpha_l", FurtherChannel::HandleAcceleration),
    ("torque_h", FurtherChannel::HandTorque),
    ("theta_j", FurtherChannel::JointAngle),
];

/// The record of a trial, and its times, s; `trial` is its number in messages.
fn record_of(signals: &Signals<'_>, trial: u32) -> PyResult<(Record, Vec<f64>)> {
    let signals = TrialSignals::new(signals, format!("trial {trial}"));
    let times_s = signals.needed("t")?;
    let mut record = Record {
        start_s: times_s.first().copied().unwrap_or(0.0),
        theta_m_rad: signals.needed("theta")?,
        torque_l_nm: signals.needed("torque")?,
        emg_fcr_mvc: signals.optional("emg_fcr")?,
        emg_ecr_mvc: signals.optional("emg_ecr")?,
        ..Record::default()
    };
    for (name, channel) in FURTHER {
        *record.further_mut(channel) = signals.optional(name)?;
    }
    Ok((record, times_s))
}

/// A column, with its name.
type NamedArray<'py> = (&'static str, Bound<'py, PyArray1<f64>>);

fn checks(names: &[String]) -> PyResult<Vec<SignalCheck>> {
    names
        .iter()
        .map(|name| {
            name.parse().map_err(|error: consistency::UnknownCheck| wrong_input(format!("accept: {error}")))
        })
        .collect()
}

/// The model of a text of JSON; without one, the paper's.
fn model(text: Option<&str>) -> PyResult<Model> {
    let Some(text) = text else { return Ok(Model::paper()) };
    Model::parse(text).map_err(|source| exception(Failure::Model { file: "model".into(), source }))
}

#[pymethods]
impl NativeSession {
    /// Reads a session's folder.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let name = path.display().to_string();
        let read = background::run(py, None, move |_| -> Result<_, Failure> {
            Ok((load(&path)?, stored_protocol(&path)?, UsedCalibration::of_session(None, &path)?))
        })?;
        let (session, protocol, calibration) = read.map_err(exception)?;
        Ok(Self { session: Arc::new(session), name, protocol, calibration })
    }

    /// Makes a session of a description and the signals of its trials.
    #[staticmethod]
    fn from_arrays(description: &str, signals: Vec<Signals<'_>>) -> PyResult<Self> {
        let given: Given = argument(description, "session")?;
        check_rows(given.trials.len(), signals.len())?;
        let (mut trials, mut times_s) = (Vec::new(), Vec::new());
        for (about, own) in given.trials.into_iter().zip(&signals) {
            let (record, own_s) = record_of(own, about.trial)?;
            times_s.push(own_s);
            trials.push(Trial {
                number: about.trial,
                file: format!("trials/trial-{:03}.csv", about.trial),
                velocity_rad_s: about.velocity_rad_s,
                torque_nm: about.torque_nm,
                repetition: about.repetition,
                condition: about.condition,
                onset_s: about.onset_s,
                status: about.status,
                extra: about.extra,
                record,
            });
        }
        let session = Session {
            subject: Subject { id: given.subject },
            sample_rate_hz: given.sample_rate_hz,
            lever: given.lever,
            recorded_filter: given.recorded_filter,
            channel_ranges: Default::default(),
            trials,
        };
        check_given(&session, &times_s).map_err(exception)?;
        Ok(Self { session: Arc::new(session), name: "session".into(), protocol: None, calibration: None })
    }

    /// Simulates the session of a virtual subject.
    #[staticmethod]
    #[pyo3(signature = (protocol, seed, person, rig, mechanisms, subject, order_number))]
    #[allow(clippy::too_many_arguments)]
    fn simulate(
        py: Python<'_>,
        protocol: &NativeProtocol,
        seed: u64,
        person: Option<&str>,
        rig: Option<&str>,
        mechanisms: Option<&str>,
        subject: &str,
        order_number: u32,
    ) -> PyResult<Self> {
        let person = match person {
            Some(text) => Person::parse(text, Path::new("person")).map_err(exception)?,
            None => Person::default(),
        };
        let mut setup = match rig {
            Some(text) => match RigFile::parse(text, Path::new("rig")).map_err(exception)? {
                RigFile::Virtual(setup) => setup,
            },
            None => Setup::default(),
        };
        if let Some(text) = mechanisms {
            let added: MechanismList = argument(text, "mechanisms")?;
            let there = person.mechanisms.and(&setup.mechanisms).kinds;
            if let Some(kind) = added.kinds.iter().find(|kind| there.contains(kind)) {
                let id = kind.id();
                return Err(wrong_input(format!(
                    "mechanisms: {id} is already in person or rig; expected it once"
                )));
            }
            setup.mechanisms = setup.mechanisms.and(&added);
        }
        let (protocol, subject) = (protocol.0.clone(), subject.to_owned());
        let kept = protocol.clone();
        let simulated = background::run(py, None, move |_| {
            let source = UnitSource::Virtual {
                protocol: &protocol,
                setup: &setup,
                person: Box::new(person),
                seed,
                order_number,
            };
            simulate_unit(
                &Unit { index: 0, subject, session: 1, is_excluded: false, source },
                SessionStorage::Memory,
            )
        })?;
        match simulated {
            Ok(Some(session)) => Ok(Self {
                session: Arc::new(session),
                name: "session".into(),
                protocol: Some(kept),
                calibration: None,
            }),
            Ok(None) => Err(failed_work("the simulation gave no session")),
            Err(error) => Err(exception(Failure::Unit(error))),
        }
    }

    /// Writes the session into a new folder, with its protocol and calibration.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let session = self.session.clone();
        let name = path.display().to_string();
        let protocol = self.protocol.as_ref().map(|protocol| protocol.text().to_owned());
        let calibration = self.calibration.as_ref().map(|used| used.bytes.clone());
        let write = move |_: &_| {
            let protocol = protocol.iter().map(|text| (PROTOCOL, text.as_bytes()));
            let calibration = calibration.iter().map(|bytes| (RIG_CALIBRATION, bytes.as_ref()));
            let beside: Vec<(&str, &[u8])> = protocol.chain(calibration).collect();
            write_session(&session, Digits::All, &beside, &path)
        };
        background::run(py, None, write)?.map_err(|error| wrong_input(format!("{name}: {error}")))
    }

    /// Subject, rate, lever, filter and table, as JSON.
    #[getter]
    fn description(&self) -> String {
        let session = &self.session;
        let trials: Vec<GivenTrial> = session
            .trials
            .iter()
            .map(|trial| GivenTrial {
                trial: trial.number,
                velocity_rad_s: trial.velocity_rad_s,
                torque_nm: trial.torque_nm,
                repetition: trial.repetition,
                condition: trial.condition.clone(),
                onset_s: trial.onset_s,
                status: trial.status,
                extra: trial.extra.clone(),
            })
            .collect();
        serde_json::json!({
            "subject": session.subject.id,
            "sample_rate_hz": session.sample_rate_hz,
            "lever": session.lever,
            "recorded_filter": session.recorded_filter,
            "trials": trials,
        })
        .to_string()
    }

    /// SHA-256 over all that an analysis reads.
    #[getter]
    fn digest(&self) -> String {
        self.session.digest()
    }

    /// The signals of the trial at `index`, with the names of their columns.
    fn record<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Vec<NamedArray<'py>>> {
        let Some(trial) = self.session.trials.get(index) else {
            return Err(wrong_input(format!(
                "trial at {index}: expected less than {}",
                self.session.trials.len()
            )));
        };
        let record = &trial.record;
        let times_s: Vec<f64> = (0..record.theta_m_rad.len())
            .map(|sample| record.start_s + sample as f64 / self.session.sample_rate_hz)
            .collect();
        let columns = std::iter::once(("t_s", times_s.as_slice())).chain(record.channels());
        Ok(columns.map(|(name, values)| (name, PyArray1::from_slice(py, values))).collect())
    }

    /// What the signals say against the table, as JSON.
    fn contradictions(&self, py: Python<'_>) -> PyResult<String> {
        let session = self.session.clone();
        let found = background::run(py, None, move |_| consistency::contradictions(&session))?;
        serde_json::to_string(&found).map_err(|error| failed_work(error.to_string()))
    }

    /// Fits the session. `listener` is called before each refit of a bootstrap.
    ///
    /// `calibration` is the file of the rig's constants or `none`, `calibration_text` the text of such a file; without both that of the
    /// session's folder is used.
    #[pyo3(signature = (model_text, window_s, calibration, calibration_text, plain, independent, accept, bootstrap, seed, listener))]
    #[allow(clippy::too_many_arguments)]
    fn fit(
        &self,
        py: Python<'_>,
        model_text: Option<&str>,
        window_s: Option<f64>,
        calibration: Option<PathBuf>,
        calibration_text: Option<String>,
        plain: bool,
        independent: bool,
        accept: Vec<String>,
        bootstrap: Option<u32>,
        seed: u64,
        listener: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<NativeFit> {
        let (model, accept) = (model(model_text)?, checks(&accept)?);
        if bootstrap.is_some_and(|refits| !(2..=1_000_000).contains(&refits)) {
            return Err(wrong_input("bootstrap: expected 2 to 1000000 refits"));
        }
        let weighting = if plain { Weighting::Plain } else { Weighting::MeasuredNoise };
        let prepare = self.preparation(window_s, calibration, calibration_text, accept);
        let fitted = background::run(py, listener, move |progress| -> Result<_, Failure> {
            let mut fitted = prepare()?.fit(&model, weighting, independent)?;
            if let Some(refits) = bootstrap {
                let (observations, fit) = (&fitted.observations, &fitted.independent);
                let go_on = || progress.stage("refit");
                let scatter = fit::bootstrap_watched(observations, fit, refits as usize, seed, go_on);
                fitted.results.add_bootstrap(refits as usize, seed, &scatter);
            }
            Ok(fitted)
        })?;
        NativeFit::new(fitted.map_err(exception)?)
    }

    /// Diagnoses the session; returns the text of diagnosis.json. `listener` is called with the name of each stage. Calibrations are given
    /// as for `fit`.
    #[pyo3(signature = (model_text, window_s, calibration, calibration_text, accept, seed, listener))]
    #[allow(clippy::too_many_arguments)]
    fn diagnose(
        &self,
        py: Python<'_>,
        model_text: Option<&str>,
        window_s: Option<f64>,
        calibration: Option<PathBuf>,
        calibration_text: Option<String>,
        accept: Vec<String>,
        seed: u64,
        listener: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let (model, accept) = (model(model_text)?, checks(&accept)?);
        let prepare = self.preparation(window_s, calibration, calibration_text, accept);
        let found = background::run(py, listener, move |progress| -> Result<_, Failure> {
            let session = prepare()?;
            let input = session.prepare_diagnosis(&model)?;
            Ok(session.diagnose(input, &model, seed, &|name| progress.stage(name)).json)
        })?;
        let text = serde_json::to_string_pretty(&found.map_err(exception)?);
        text.map(|text| text + "\n").map_err(|error| failed_work(error.to_string()))
    }
}

impl NativeSession {
    /// What makes the session ready to be analysed, as the program does: it is held against its table, and its window and calibration
    /// are found.
    fn preparation(
        &self,
        window_s: Option<f64>,
        calibration: Option<PathBuf>,
        calibration_text: Option<String>,
        accept: Vec<SignalCheck>,
    ) -> impl FnOnce() -> Result<AnalysedSession, Failure> + Send + 'static {
        let (session, name) = (self.session.clone(), self.name.clone());
        let settings = self.protocol.as_deref().map(PreprocessingSettings::of).unwrap_or_default();
        let own = self.calibration.clone();
        move || {
            let accepted = consistency::check(&session, &accept)
                .map_err(|found| Failure::Contradicts { session: name.clone(), found })?;
            let settings = with_window(settings, window_s)?;
            let calibration = match (calibration_text, calibration) {
                (Some(text), _) => {
                    Some(UsedCalibration::parse(text.into_bytes(), PathBuf::from("calibration"))?)
                }
                (None, Some(file)) => UsedCalibration::given(&file)?,
                (None, None) => own,
            };
            let checked = CheckedSession { session: (*session).clone(), accepted };
            Ok(AnalysedSession { checked, name, settings, calibration })
        }
    }
}
