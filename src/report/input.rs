//! The input of a report, read from a session's folder.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::error::ReportError;
use super::fitted::Fitted;
use super::journal::{SessionTimes, times};
use super::traces::{Trace, traces};
use crate::dataset::{self, JOURNAL, Session};
use crate::files::{Folder, limits};
use crate::fit::FIT_FORMAT;
use crate::json_file;
use crate::protocol::ValidProtocol;

/// The input of a report: a session and its results.
#[derive(Debug)]
pub struct ReportInput {
    /// The session.
    pub session: Session,
    /// Its protocol.
    pub protocol: Option<ValidProtocol>,
    /// Gate times, duration and incidents, from the journal.
    pub times: Option<SessionTimes>,
    /// Lateness of the control cycle of a motor.
    pub lateness: Option<LatenessSummary>,
    /// The fit.
    pub fitted: Option<Fitted>,
    /// The measured and fitted traces of the trials.
    pub traces: Vec<Trace>,
    /// The content of `diagnosis.json`.
    pub diagnosis: Option<Value>,
    /// What is missing from this report, the reasons, and how to get it.
    pub missing: Vec<String>,
}

/// Lateness of the control cycle of a motor: delay between the scheduled and the actual start.
#[derive(Debug, Clone, Deserialize)]
pub struct LatenessSummary {
    /// Median, us.
    pub p50_us: u64,
    /// 99th percentile, us.
    pub p99_us: u64,
    /// Maximum, us.
    pub longest_us: u64,
    /// Upper end, us, and count of each bucket that is not empty.
    pub buckets: Vec<(u64, u64)>,
}

impl ReportInput {
    /// Reads the session in `folder` and its results in `results`.
    ///
    /// # Errors
    /// If the session or a result file that is there cannot be read.
    pub fn read(folder: &Path, results: &Folder) -> Result<Self, ReportError> {
        let session = dataset::load(folder)?;
        let mut missing = Vec::new();
        let protocol = protocol(folder, &mut missing);
        let opened =
            Folder::open(folder).map_err(|source| ReportError::Unreadable { path: folder.into(), source })?;
        let journal = text(&opened, JOURNAL, limits::JOURNAL_BYTES)?;
        let times = journal.map(|text| times(&text, session.sample_rate_hz));
        let lateness = lateness(&opened, &mut missing)?;
        let fitted = read_fit(results)?;
        let diagnosis = diagnosis(results)?;
        if fitted.is_none() {
            missing.push("There is no fit yet, so there are no parameters and no fitted torque. Run: ramphold fit SESSION".into());
        }
        if diagnosis.is_none() {
            missing.push("There is no diagnosis yet. Run: ramphold diagnose SESSION".into());
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
fn text(folder: &Folder, name: &str, limit: u64) -> Result<Option<String>, ReportError> {
    let bytes = folder.read_if_there(name, limit);
    let bytes = bytes.map_err(|source| ReportError::Unreadable { path: folder.path_of(name), source })?;
    Ok(bytes.map(|bytes| String::from_utf8_lossy(&bytes).into_owned()))
}

fn protocol(folder: &Path, missing: &mut Vec<String>) -> Option<ValidProtocol> {
    match dataset::stored_protocol(folder) {
        Ok(Some(protocol)) => return Some(protocol),
        Ok(None) => missing.push("The session has no protocol.json: it was not run by this program.".into()),
        Err(error) => missing.push(format!("The protocol cannot be read: {error}")),
    }
    None
}

fn lateness(folder: &Folder, missing: &mut Vec<String>) -> Result<Option<LatenessSummary>, ReportError> {
    #[derive(Deserialize)]
    struct Bus {
        lateness: LatenessSummary,
    }
    let Some(text) = text(folder, "bus.json", limits::BUS_BYTES)? else { return Ok(None) };
    let path = folder.path_of("bus.json");
    let bus: Result<Bus, _> = json_file::parse(&text, &path, "the summary of a CAN session");
    Ok(bus
        .map(|bus| bus.lateness)
        .map_err(|error| missing.push(format!("The lateness cannot be read: {error}")))
        .ok())
}

/// Reads `fit.json` of a folder of results, if there is one.
pub fn read_fit(results: &Folder) -> Result<Option<Fitted>, ReportError> {
    let Some(text) = text(results, "fit.json", limits::FIT_BYTES)? else { return Ok(None) };
    parse_fit(&text, &results.path_of("fit.json")).map(Some)
}

/// Parses and checks the text of `fit.json`; `path` is its name for messages.
pub fn parse_fit(text: &str, path: &Path) -> Result<Fitted, ReportError> {
    let fitted: Fitted = json_file::parse(text, path, FIT_FORMAT)
        .map_err(|source| ReportError::Content { source, verb: "fit" })?;
    fitted.check(path)?;
    Ok(fitted)
}

fn diagnosis(results: &Folder) -> Result<Option<Value>, ReportError> {
    let Some(text) = text(results, "diagnosis.json", limits::DIAGNOSIS_BYTES)? else { return Ok(None) };
    let diagnosis = json_file::parse(&text, &results.path_of("diagnosis.json"), "ramphold-diagnosis/1");
    diagnosis.map(Some).map_err(|source| ReportError::Content { source, verb: "diagnose" })
}
