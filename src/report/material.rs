//! Everything that a report is made of, read from a session's folder; what is not there is noted.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::error::ReportError;
use super::fitted::Fitted;
use super::journal::{Times, times};
use super::traces::{Trace, traces};
use crate::dataset::{self, JOURNAL, Session};
use crate::fit::FIT_FORMAT;
use crate::protocol::ValidProtocol;

/// The material of a report.
#[derive(Debug)]
pub struct Material {
    /// The session.
    pub session: Session,
    /// Its protocol.
    pub protocol: Option<ValidProtocol>,
    /// How long things took.
    pub times: Option<Times>,
    /// How late the cycle of a real rig woke up, and how often.
    pub lateness: Option<Lateness>,
    /// The fit.
    pub fitted: Option<Fitted>,
    /// Trials with what was measured and fitted.
    pub traces: Vec<Trace>,
    /// `diagnosis.json` as it is.
    pub diagnosis: Option<Value>,
    /// What is missing from this report, why, and how to get it.
    pub missing: Vec<String>,
}

/// How late the cycle of a real rig woke up.
#[derive(Debug, Clone, Deserialize)]
pub struct Lateness {
    /// Median, us.
    pub p50_us: u64,
    /// 99 %, us.
    pub p99_us: u64,
    /// Longest, us.
    pub longest_us: u64,
    /// Upper end in us and count of each bucket that is not empty.
    pub buckets: Vec<(u64, u64)>,
}

impl Material {
    /// Reads the session in `folder` and its results in `results`.
    ///
    /// # Errors
    /// If the session or a result file that is there cannot be read.
    pub fn read(folder: &Path, results: &Path) -> Result<Self, ReportError> {
        let session = dataset::load(folder)?;
        let mut missing = Vec::new();
        let protocol = protocol(folder, &mut missing);
        let times = text(&folder.join(JOURNAL))?.map(|text| times(&text, session.sample_rate_hz));
        let lateness = lateness(folder, &mut missing)?;
        let fitted = fitted(&results.join("fit.json"))?;
        let diagnosis = diagnosis(&results.join("diagnosis.json"))?;
        if fitted.is_none() {
            missing.push("There is no fit yet, so no parameters and no fitted torque. Get it with: ramphold fit SESSION".into());
        }
        if diagnosis.is_none() {
            missing.push("There is no diagnosis yet. Get it with: ramphold diagnose SESSION".into());
        }
        let traces = traces(&session, fitted.as_ref(), protocol.as_ref(), &mut missing);
        Ok(Self { session, protocol, times, lateness, fitted, traces, diagnosis, missing })
    }

    /// The analysed window, s.
    pub fn window_s(&self) -> f64 {
        let of_fit = self.fitted.as_ref().map(|fitted| fitted.settings.window_s);
        of_fit.or(self.protocol.as_ref().map(|protocol| protocol.window_s)).unwrap_or(0.040)
    }
}

/// The text of a file, or `None` if there is no such file.
fn text(path: &Path) -> Result<Option<String>, ReportError> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(ReportError::Unreadable { path: path.into(), source }),
    }
}

fn protocol(folder: &Path, missing: &mut Vec<String>) -> Option<ValidProtocol> {
    let path = folder.join("protocol.json");
    if !path.exists() {
        missing.push("The session has no protocol.json: it was not run by this program.".into());
        return None;
    }
    ValidProtocol::read(&path)
        .map_err(|error| missing.push(format!("The protocol cannot be read: {error}")))
        .ok()
}

fn lateness(folder: &Path, missing: &mut Vec<String>) -> Result<Option<Lateness>, ReportError> {
    #[derive(Deserialize)]
    struct Bus {
        lateness: Lateness,
    }
    let Some(text) = text(&folder.join("bus.json"))? else { return Ok(None) };
    let bus: Result<Bus, _> = serde_json::from_str(&text);
    Ok(bus
        .map(|bus| bus.lateness)
        .map_err(|error| missing.push(format!("bus.json holds no lateness that can be read: {error}")))
        .ok())
}

fn fitted(path: &Path) -> Result<Option<Fitted>, ReportError> {
    let Some(text) = text(path)? else { return Ok(None) };
    let form = |(line, field, message): (usize, String, String)| ReportError::Form {
        path: PathBuf::from(path),
        line,
        field,
        message,
        expected: FIT_FORMAT,
        verb: "fit",
    };
    Fitted::parse(&text).map(Some).map_err(form)
}

fn diagnosis(path: &Path) -> Result<Option<Value>, ReportError> {
    let Some(text) = text(path)? else { return Ok(None) };
    serde_json::from_str(&text).map(Some).map_err(|error| ReportError::Form {
        path: PathBuf::from(path),
        line: error.line(),
        field: ".".into(),
        message: error.to_string(),
        expected: "ramphold-diagnosis/1",
        verb: "diagnose",
    })
}
