//! The input of a report, read from a session's folder.

use std::io::ErrorKind;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::belonging::{foreign_diagnosis, foreign_fit};
use super::bias::Biases;
use super::diagnosed::Diagnosed;
use super::error::ReportError;
use super::fitted::Fitted;
use super::journal::{SessionTimes, times};
use super::traces::{Trace, traces};
use crate::attach::attached_emg;
use crate::dataset::{
    self, Amendments, JOURNAL, RecordedRig, Session, SessionCard, every_trial_is_done, recorded_rig,
};
use crate::files::{Folder, is_refusal, limits};
use crate::fit::{DESCRIBING_VAF, ExcludedTrial, FIT_FORMAT, PreprocessingSettings};
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
    /// Whether trials of the protocol are left to do.
    pub is_unfinished: bool,
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
    /// The attachment that the EMG is from; `None` for the EMG of the session's own records.
    pub emg_from: Option<EmgSource>,
    /// A second fit to lay beside the first, with its name.
    pub beside: Option<(String, Fitted)>,
    /// The diagnosis.
    pub diagnosis: Option<Diagnosed>,
    /// The numbers that it found biased.
    pub biases: Biases,
    /// Judgements on trials after the session.
    pub amendments: Amendments,
    /// The trials that the analysis leaves out, with the reasons.
    pub excluded: Vec<ExcludedTrial>,
    /// What is missing from this report, the reasons, and how to get it.
    pub missing: Vec<String>,
}

/// The attachment that the EMG of a report is from.
#[derive(Debug)]
pub struct EmgSource {
    /// Its name.
    pub name: String,
    /// Its samples a second.
    pub rate_hz: f64,
    /// Names of the other attachments with EMG, which are not shown.
    pub others: Vec<String>,
}

impl EmgSource {
    /// The sentence of the report that names it.
    pub fn sentence(&self) -> String {
        let Self { name, rate_hz, others } = self;
        let own = format!("The EMG is that of the attachment {name}, {rate_hz:.0} samples a second.");
        if others.is_empty() {
            return own;
        }
        format!(
            "{own} The session has other attachments with EMG, which are not shown: {}. Of those with a value at maximal effort the first \
             by name is shown.",
            others.join(", ")
        )
    }
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
    /// Reads what else there is of `session` in its `folder`, and its results in `results`.
    ///
    /// # Errors
    /// If the folder or a result file that is there cannot be read.
    pub fn read(
        folder: &Path,
        session: Session,
        results: &Folder,
        beside: Option<&Folder>,
    ) -> Result<Self, ReportError> {
        let card = SessionCard::read(folder)?;
        let mut missing = Vec::new();
        let protocol = protocol(folder, &mut missing);
        let opened = open(folder)?;
        let is_virtual = recorded_rig(folder)? == Some(RecordedRig::VirtualWrist);
        let journal = text(&opened, JOURNAL, limits::JOURNAL_BYTES)?;
        // A journal that cannot be followed is reported by `resume` and `replay`.
        let is_unfinished = journal.is_some() && every_trial_is_done(folder).is_ok_and(|done| !done);
        if is_unfinished {
            missing.push(
                "The session is unfinished: trials of its protocol are left to do, and all that is here is of the trials so far. Go on \
                 with: ramphold resume SESSION"
                    .into(),
            );
        }
        let times = journal.map(|text| times(&text, session.sample_rate_hz));
        let lateness = lateness(&opened, &mut missing)?;
        let mut fitted = read_fit(results)?;
        let mut diagnosis = diagnosis(results)?;
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
                folder.path().file_name().unwrap_or_default().to_string_lossy().into_owned(),
                read_fit(folder)?.ok_or_else(|| ReportError::NoFit { folder: folder.path().into() })?,
            )),
            None => None,
        };
        if !has_results.0 {
            missing.push("There is no fit yet, so there are no parameters and no fitted torque. Run: ramphold fit SESSION".into());
        }
        if !has_results.1 {
            missing.push("There is no diagnosis yet. Run: ramphold diagnose SESSION".into());
        }
        let attached = attached_emg(folder).unwrap_or_else(|error| {
            missing.push(format!("The attached EMG cannot be read: {error}."));
            None
        });
        for left in attached.iter().flat_map(|own| &own.left_out) {
            missing.push(format!("Trial {} has no attached EMG: {}.", left.trial, left.because));
        }
        for frozen in attached.iter().flat_map(|own| &own.frozen) {
            missing.push(format!("Do not trust the attached {frozen}"));
        }
        for warning in attached.iter().flat_map(|own| &own.warnings) {
            missing.push(format!("Of the attached EMG: {warning}."));
        }
        let (traces, excluded) =
            traces(&session, fitted.as_ref(), protocol.as_ref(), attached.as_ref(), &mut missing);
        let diagnosis = diagnosis.as_ref().map(Diagnosed::of);
        Ok(Self {
            biases: Biases::of(diagnosis.as_ref(), fitted.as_ref()),
            amendments: Amendments::read(folder)?,
            excluded,
            session,
            card,
            is_virtual,
            is_unfinished,
            protocol,
            times,
            lateness,
            fitted,
            traces,
            emg_from: attached.map(|own| EmgSource {
                name: own.name,
                rate_hz: own.rate_hz,
                others: own.others,
            }),
            beside,
            diagnosis,
            missing,
        })
    }

    /// The analysed window, s: that of the fit, or else of the protocol, or else what a fit would take.
    pub fn window_s(&self) -> f64 {
        let of_fit = self.fitted.as_ref().map(|fitted| fitted.settings.window_s);
        let of_protocol = self.protocol.as_ref().map(|protocol| protocol.window_s);
        of_fit.or(of_protocol).unwrap_or(PreprocessingSettings::default().window_s)
    }
}

/// Why results in the folder `results/` of a session do not belong to the session as it is now, or to each other.
///
/// # Errors
/// If the session or a result file that is there cannot be read.
pub fn foreign_results(folder: &Path) -> Result<Vec<String>, ReportError> {
    let results = match open(folder)?.folder("results") {
        // What a link leads to is no result of the session.
        Err(error) if error.kind() == ErrorKind::NotFound || is_refusal(&error) => return Ok(Vec::new()),
        opened => {
            opened.map_err(|source| ReportError::Unreadable { path: folder.join("results"), source })?
        }
    };
    let fitted = read_fit(&results)?;
    let diagnosis = diagnosis(&results)?;
    let digest = dataset::load(folder)?.digest();
    let of_fit = fitted.as_ref().and_then(|fit| foreign_fit(fit, &digest));
    let of_diagnosis = diagnosis.and_then(|own| foreign_diagnosis(&own, fitted.as_ref(), &digest));
    Ok(of_fit.into_iter().chain(of_diagnosis).collect())
}

/// That the fit of the session in `folder` describes none of its trials, if it does not.
///
/// # Errors
/// If a result file that is there cannot be read.
pub fn undescribed(folder: &Path) -> Result<Option<String>, ReportError> {
    let results = match open(folder)?.folder("results") {
        Err(error) if error.kind() == ErrorKind::NotFound || is_refusal(&error) => return Ok(None),
        opened => {
            opened.map_err(|source| ReportError::Unreadable { path: folder.join("results"), source })?
        }
    };
    let best = read_fit(&results)?.and_then(|fit| fit.best_vaf()).filter(|best| *best < DESCRIBING_VAF);
    Ok(best.map(|best| format!("the model does not describe these data: the best VAF of any trial is {best:.2}, below {DESCRIBING_VAF}")))
}

fn open(folder: &Path) -> Result<Folder, ReportError> {
    Folder::open(folder).map_err(|source| ReportError::Unreadable { path: folder.into(), source })
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

#[cfg(test)]
mod tests {
    use super::EmgSource;

    #[test]
    fn a_report_says_which_of_several_attachments_it_shows() {
        let source = |others: &[&str]| EmgSource {
            name: "a".into(),
            rate_hz: 2000.0,
            others: others.iter().map(|own| (*own).into()).collect(),
        };
        assert_eq!(source(&[]).sentence(), "The EMG is that of the attachment a, 2000 samples a second.");
        let several = source(&["b", "c"]).sentence();
        assert!(several.contains("attachment a,") && several.contains("not shown: b, c."), "{several}");
    }
}
