//! The input of a report, read from a session's folder.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::belonging::{foreign_diagnosis, foreign_fit};
use super::error::ReportError;
use super::fitted::Fitted;
use super::journal::{SessionTimes, times};
use super::traces::{Trace, traces};
use crate::dataset::{self, JOURNAL, Session, SessionCard};
use crate::fit::FIT_FORMAT;
use crate::json_file;
use crate::protocol::ValidProtocol;

/// The input of a report: a session and its results.
#[derive(Debug)]
pub struct ReportInput {
    /// The session.
    pub session: Session,
    /// When, who and what.
    pub card: SessionCard,
    /// Whether nobody was measured: the wrist is a virtual one.
    pub is_virtual: bool,
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
    /// A second fit to lay beside the first, with its name.
    pub beside: Option<(String, Fitted)>,
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
    pub fn read(folder: &Path, results: &Path, beside: Option<&Path>) -> Result<Self, ReportError> {
        let session = dataset::load(folder)?;
        let card = SessionCard::read(folder)?;
        let is_virtual = ran_on_virtual_wrist(folder);
        let mut missing = Vec::new();
        let protocol = protocol(folder, &mut missing);
        let times = text(&folder.join(JOURNAL))?.map(|text| times(&text, session.sample_rate_hz));
        let lateness = lateness(folder, &mut missing)?;
        let mut fitted = read_fit(&results.join("fit.json"))?;
        let mut diagnosis = diagnosis(&results.join("diagnosis.json"))?;
        let digest = session.digest();
        let has_results = (fitted.is_some(), diagnosis.is_some());
        if let Some(reason) = fitted.as_ref().and_then(|fit| foreign_fit(fit, &digest)) {
            missing.push(format!("{reason} It is not shown."));
            fitted = None;
        }
        if let Some(reason) =
            diagnosis.as_ref().and_then(|own| foreign_diagnosis(own, fitted.as_ref(), &digest))
        {
            missing.push(format!("{reason} It is not shown."));
            diagnosis = None;
        }
        let beside = match beside {
            Some(folder) => Some((
                folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                read_fit(&folder.join("fit.json"))?
                    .ok_or_else(|| ReportError::NoFit { folder: folder.into() })?,
            )),
            None => None,
        };
        if !has_results.0 {
            missing.push("There is no fit yet, so there are no parameters and no fitted torque. Run: ramphold fit SESSION".into());
        }
        if !has_results.1 {
            missing.push("There is no diagnosis yet. Run: ramphold diagnose SESSION".into());
        }
        let traces = traces(&session, fitted.as_ref(), protocol.as_ref(), &mut missing);
        Ok(Self {
            session,
            card,
            is_virtual,
            protocol,
            times,
            lateness,
            fitted,
            traces,
            beside,
            diagnosis,
            missing,
        })
    }

    /// The analysed window, s.
    pub fn window_s(&self) -> f64 {
        let of_fit = self.fitted.as_ref().map(|fitted| fitted.settings.window_s);
        of_fit.or(self.protocol.as_ref().map(|protocol| protocol.window_s)).unwrap_or(0.040)
    }
}

/// Why results in the folder `results/` of a session do not belong to the session as it is now, or to each other.
///
/// # Errors
/// If the session or a result file that is there cannot be read.
pub fn foreign_results(folder: &Path) -> Result<Vec<String>, ReportError> {
    let results = folder.join("results");
    let fitted = read_fit(&results.join("fit.json"))?;
    let diagnosis = diagnosis(&results.join("diagnosis.json"))?;
    let digest = dataset::load(folder)?.digest();
    let of_fit = fitted.as_ref().and_then(|fit| foreign_fit(fit, &digest));
    let of_diagnosis = diagnosis.and_then(|own| foreign_diagnosis(&own, fitted.as_ref(), &digest));
    Ok(of_fit.into_iter().chain(of_diagnosis).collect())
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

/// Whether `rig.json` describes a virtual wrist.
fn ran_on_virtual_wrist(folder: &Path) -> bool {
    let rig =
        fs::read(folder.join("rig.json")).ok().and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
    rig.is_some_and(|rig| rig.pointer("/rig/kind").and_then(Value::as_str) == Some("virtual"))
}

fn lateness(folder: &Path, missing: &mut Vec<String>) -> Result<Option<LatenessSummary>, ReportError> {
    #[derive(Deserialize)]
    struct Bus {
        lateness: LatenessSummary,
    }
    let path = folder.join("bus.json");
    let Some(text) = text(&path)? else { return Ok(None) };
    let bus: Result<Bus, _> = json_file::parse(&text, &path, "the summary of a CAN session");
    Ok(bus
        .map(|bus| bus.lateness)
        .map_err(|error| missing.push(format!("The lateness cannot be read: {error}")))
        .ok())
}

fn read_fit(path: &Path) -> Result<Option<Fitted>, ReportError> {
    let Some(text) = text(path)? else { return Ok(None) };
    let fitted: Fitted = json_file::parse(&text, path, FIT_FORMAT)
        .map_err(|source| ReportError::Content { source, verb: "fit" })?;
    fitted.check_format(path)?;
    Ok(Some(fitted))
}

fn diagnosis(path: &Path) -> Result<Option<Value>, ReportError> {
    let Some(text) = text(path)? else { return Ok(None) };
    let diagnosis = json_file::parse(&text, path, "ramphold-diagnosis/1");
    diagnosis.map(Some).map_err(|source| ReportError::Content { source, verb: "diagnose" })
}
