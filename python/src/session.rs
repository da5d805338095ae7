//! Sessions: read, given as arrays or simulated; fitted and diagnosed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use ramphold::app::{
    CheckedSession, Failure, FitRequest, diagnose_session, fit_session, prepare_diagnosis,
    preprocessing_settings, with_window,
};
use ramphold::consistency::{self, SignalCheck};
use ramphold::dataset::{Record, Session, Status, Subject, Trial, check_given, load, write_session};
use ramphold::fit::{self, Model, PreprocessingSettings, Weighting};
use ramphold::rig::virtual_wrist::{MechanismList, Person, RigFile, Setup};
use ramphold::signal::FilterSpec;
use ramphold::study::{SessionStorage, Unit, UnitSource, simulate_unit};
use ramphold::wrist::Lever;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::arrays::vector;
use crate::background;
use crate::errors::{exception, failed_work, wrong_input};
use crate::fitted::NativeFit;
use crate::protocol::NativeProtocol;

/// A session, its name in messages, and its protocol's window and filter.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeSession {
    session: Arc<Session>,
    name: String,
    settings: PreprocessingSettings,
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

/// The signals of a trial as they come: time, angle, torque, EMG of FCR and ECR.
type Signals<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Option<Bound<'py, PyAny>>,
    Option<Bound<'py, PyAny>>,
);

/// The signals of a trial as they go: time, angle, torque, EMG of FCR and ECR.
type Record5<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Option<Bound<'py, PyArray1<f64>>>,
    Option<Bound<'py, PyArray1<f64>>>,
);

/// Reads the JSON text of an argument.
pub fn argument<T: DeserializeOwned>(text: &str, name: &str) -> PyResult<T> {
    ramphold::json_file::parse(text, Path::new(name), "what the documentation describes")
        .map_err(|error| wrong_input(error.to_string()))
}

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
            Ok((load(&path)?, preprocessing_settings(&path, None)?))
        })?;
        let (session, settings) = read.map_err(exception)?;
        Ok(Self { session: Arc::new(session), name, settings })
    }

    /// Makes a session of a description and the signals of its trials.
    #[staticmethod]
    fn from_arrays(description: &str, signals: Vec<Signals<'_>>) -> PyResult<Self> {
        let given: Given = argument(description, "session")?;
        if given.trials.len() != signals.len() {
            return Err(wrong_input(format!(
                "trials: {} rows; expected {}, one for each record",
                given.trials.len(),
                signals.len()
            )));
        }
        let (mut trials, mut times_s) = (Vec::new(), Vec::new());
        for (about, (time, theta, torque, fcr, ecr)) in given.trials.into_iter().zip(&signals) {
            let read = |value: &Bound<'_, PyAny>, channel: &str| -> PyResult<Vec<f64>> {
                let name = format!("trial {}, {channel}", about.trial);
                Ok(vector(value, &name)?
                    .as_slice()
                    .map_err(|error| wrong_input(format!("{name}: {error}")))?
                    .to_vec())
            };
            let emg = |value: &Option<Bound<'_, PyAny>>, channel: &str| {
                value.as_ref().map(|value| read(value, channel)).transpose()
            };
            let own_s = read(time, "t")?;
            let record = Record {
                start_s: own_s.first().copied().unwrap_or(0.0),
                theta_m_rad: read(theta, "theta")?,
                torque_l_nm: read(torque, "torque")?,
                emg_fcr_mvc: emg(fcr, "emg_fcr")?,
                emg_ecr_mvc: emg(ecr, "emg_ecr")?,
            };
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
            trials,
        };
        check_given(&session, &times_s).map_err(exception)?;
        Ok(Self {
            session: Arc::new(session),
            name: "session".into(),
            settings: PreprocessingSettings::default(),
        })
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
        let settings = PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter };
        let simulated = background::run(py, None, move |_| {
            let source = UnitSource::Virtual {
                protocol: &protocol,
                setup: &setup,
                person: Box::new(person),
                seed,
                order_number,
            };
            simulate_unit(&Unit { index: 0, subject, session: 1, source }, SessionStorage::Memory)
        })?;
        match simulated {
            Ok(Some(session)) => Ok(Self { session: Arc::new(session), name: "session".into(), settings }),
            Ok(None) => Err(failed_work("the simulation gave no session")),
            Err(error) => Err(exception(Failure::Unit(error))),
        }
    }

    /// Writes the session into a new folder.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let session = self.session.clone();
        let name = path.display().to_string();
        background::run(py, None, move |_| write_session(&session, &path))?
            .map_err(|error| wrong_input(format!("{name}: {error}")))
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

    /// The signals of the trial at `index`.
    fn record<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Record5<'py>> {
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
        let array = |values: &[f64]| PyArray1::from_slice(py, values);
        Ok((
            array(&times_s),
            array(&record.theta_m_rad),
            array(&record.torque_l_nm),
            record.emg_fcr_mvc.as_deref().map(array),
            record.emg_ecr_mvc.as_deref().map(array),
        ))
    }

    /// What the signals say against the table, as JSON.
    fn contradictions(&self, py: Python<'_>) -> PyResult<String> {
        let session = self.session.clone();
        let found = background::run(py, None, move |_| consistency::contradictions(&session))?;
        serde_json::to_string(&found).map_err(|error| failed_work(error.to_string()))
    }

    /// Fits the session.
    #[pyo3(signature = (model_text, window_s, plain, independent, accept, bootstrap, seed))]
    #[allow(clippy::too_many_arguments)]
    fn fit(
        &self,
        py: Python<'_>,
        model_text: Option<&str>,
        window_s: Option<f64>,
        plain: bool,
        independent: bool,
        accept: Vec<String>,
        bootstrap: Option<u32>,
        seed: u64,
    ) -> PyResult<NativeFit> {
        let asked = FitRequest {
            model: model(model_text)?,
            window_s,
            weighting: if plain { Weighting::Plain } else { Weighting::MeasuredNoise },
            independent,
            accept: checks(&accept)?,
        };
        if bootstrap.is_some_and(|refits| !(2..=1_000_000).contains(&refits)) {
            return Err(wrong_input("bootstrap: expected 2 to 1000000 refits"));
        }
        let settings = with_window(self.settings, window_s).map_err(exception)?;
        let (session, name) = (self.session.clone(), self.name.clone());
        let fitted = background::run(py, None, move |progress| -> Result<_, Failure> {
            let checked = check(&session, &name, &asked.accept)?;
            let mut fitted = fit_session(checked, &name, settings, &asked)?;
            if let Some(refits) = bootstrap {
                let (observations, fit) = (&fitted.observations, &fitted.independent);
                let go_on = || progress.check();
                let scatter = fit::bootstrap_watched(observations, fit, refits as usize, seed, go_on);
                fitted.results.add_bootstrap(refits as usize, seed, &scatter);
            }
            Ok(fitted)
        })?;
        NativeFit::new(fitted.map_err(exception)?)
    }

    /// Diagnoses the session; returns the text of diagnosis.json. `listener` is called with the name of each stage.
    #[pyo3(signature = (model_text, window_s, accept, seed, listener))]
    fn diagnose(
        &self,
        py: Python<'_>,
        model_text: Option<&str>,
        window_s: Option<f64>,
        accept: Vec<String>,
        seed: u64,
        listener: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let (model, accept) = (model(model_text)?, checks(&accept)?);
        let settings = with_window(self.settings, window_s).map_err(exception)?;
        let (session, name) = (self.session.clone(), self.name.clone());
        let found = background::run(py, listener, move |progress| -> Result<_, Failure> {
            let checked = check(&session, &name, &accept)?;
            let input = prepare_diagnosis(&checked.session, &name, settings, &model)?;
            let stage = |name: &'static str| progress.stage(name);
            Ok(diagnose_session(&checked, input, settings, &model, seed, &stage).json)
        })?;
        let text = serde_json::to_string_pretty(&found.map_err(exception)?);
        text.map(|text| text + "\n").map_err(|error| failed_work(error.to_string()))
    }
}

/// Holds a session against its own table, as the program does before every analysis.
fn check(session: &Session, name: &str, accept: &[SignalCheck]) -> Result<CheckedSession, Failure> {
    let accepted = consistency::check(session, accept)
        .map_err(|found| Failure::Contradicts { session: name.to_owned(), found })?;
    Ok(CheckedSession { session: session.clone(), accepted })
}
