//! Rig trials that are given as arrays.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use ramphold::app::{calibrate_given_rig, compare_given_rig};
use ramphold::dataset::{
    GivenRigTrial, RigCalibration, RigTrialSignals, RigTrials, Status, given_rig_trials, write_rig_trials,
};
use ramphold::wrist::Lever;
use serde::Deserialize;

use crate::background;
use crate::calibration::texts;
use crate::errors::{exception, wrong_input};
use crate::signals::{Signals, TrialSignals, argument, check_rows};

/// Rig trials, and the name that a calibration gets.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeRigTrials {
    trials: Arc<RigTrials>,
    name: String,
}

/// Rig trials as Python describes them, without their signals.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    name: String,
    sample_rate_hz: f64,
    lever: Option<Lever>,
    started_utc: Option<String>,
    trials: Vec<GivenRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenRow {
    trial: u32,
    repetition: u32,
    status: Status,
    cells: BTreeMap<String, String>,
}

fn given_trial(row: GivenRow, signals: &Signals<'_>) -> PyResult<GivenRigTrial> {
    let signals = TrialSignals::new(signals, format!("rig trial {}", row.trial));
    Ok(GivenRigTrial {
        number: row.trial,
        repetition: row.repetition,
        status: row.status,
        cells: row.cells,
        times_s: signals.needed("t")?,
        record: RigTrialSignals {
            target_rad: signals.needed("target")?,
            theta_m_rad: signals.needed("theta")?,
            torque_l_nm: signals.needed("torque")?,
            theta_l_rad: signals.optional("theta_l")?,
            alpha_l_rad_s2: signals.optional("alpha_l")?,
            torque_h_nm: signals.optional("torque_h")?,
        },
    })
}

#[pymethods]
impl NativeRigTrials {
    /// Makes rig trials of a description and the signals of the trials.
    #[staticmethod]
    fn from_arrays(py: Python<'_>, description: &str, signals: Vec<Signals<'_>>) -> PyResult<Self> {
        let given: Given = argument(description, "rig trials")?;
        check_rows(given.trials.len(), signals.len())?;
        let rows = given.trials.into_iter().zip(&signals);
        let trials = rows.map(|(row, own)| given_trial(row, own)).collect::<PyResult<Vec<_>>>()?;
        let (rate, lever, started) = (given.sample_rate_hz, given.lever, given.started_utc);
        let made = background::run(py, None, move |_| given_rig_trials(rate, lever, started, trials))?;
        Ok(Self { trials: Arc::new(made.map_err(exception)?), name: given.name })
    }

    /// What a calibration says of the session.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Number of trials.
    #[getter]
    fn trial_count(&self) -> usize {
        self.trials.trials.len()
    }

    /// The text of rig-trials.csv.
    #[getter]
    fn table(&self) -> String {
        self.trials.table_text()
    }

    /// Calibrates the rig: the text of rig-calibration.json, and as JSON what `ramphold calibrate --json` prints.
    fn calibrate(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let (trials, name) = (self.trials.clone(), self.name.clone());
        let outcome = background::run(py, None, move |_| calibrate_given_rig(&trials, &name))?;
        Ok(texts(&outcome.map_err(exception)?))
    }

    /// Compares the empty-handle trials with a calibration: what `ramphold calibrate --compare --json` prints.
    fn compare(&self, py: Python<'_>, text: &str) -> PyResult<String> {
        let earlier = RigCalibration::parse(text, Path::new("calibration")).map_err(exception)?;
        let (trials, name) = (self.trials.clone(), self.name.clone());
        let comparison = background::run(py, None, move |_| compare_given_rig(&trials, &name, &earlier))?;
        Ok(comparison.map_err(exception)?.to_json().to_string())
    }

    /// Writes a new session folder with the rig trials.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (trials, name) = (self.trials.clone(), path.display().to_string());
        background::run(py, None, move |_| write_rig_trials(&trials, &path))?
            .map_err(|error| wrong_input(format!("{name}: {error}")))
    }
}
