//! SessionHistory of the session for the operator: trials with status and fit, means by condition, the log.

use std::collections::{BTreeMap, VecDeque};

use serde::Serialize;
use serde_json::{Value, json};

use super::display_latency::DisplayLatency;
use super::fitter::{TrialFit, TrialFitOutcome};
use crate::dataset::{ActionOrigin, AuditEntry, OperatorAction};
use crate::fit::{ConditionEstimate, QUANTITIES, TrialEstimate, by_condition};
use crate::rig::Vitals;
use crate::session::{
    Attempt, Event, Phase, PlannedTrial, Progress, Settings, Source, TransitionDetail, TransitionRecord,
};

/// Number of log lines that are shown; the journal keeps all.
const LOG_LINES: usize = 200;

/// Log and system status; trials come from the progress of the session.
#[derive(Debug, Default)]
pub struct SessionHistory {
    log: VecDeque<LogLine>,
    status: SystemStatus,
}

/// Timing of the loop, free disk space and display latency.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SystemStatus {
    /// Timing of the loop and load of the bus.
    #[serde(flatten)]
    pub vitals: Vitals,
    /// Free space on the session's disk, bytes.
    pub disk_free_bytes: Option<u64>,
    /// Latency from a sample to the subject's screen.
    #[serde(rename = "screen")]
    pub display_latency: Option<DisplayLatency>,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct LogLine {
    t_s: f64,
    #[serde(flatten)]
    entry: LogEntry,
}

/// Text of a log line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LogEntry {
    /// Kind of the line; the page colours it accordingly.
    kind: LogKind,
    text: String,
    /// Time of day on the operator's screen, with a note.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum LogKind {
    Plain,
    #[serde(rename = "said")]
    Command,
    Note,
    Refused,
    Alarm,
}

impl LogEntry {
    /// A command that was not possible.
    pub fn refused(command: Event, phase: Phase) -> Self {
        Self::new(LogKind::Refused, format!("{} is not possible in phase {}", command.name(), phase.name()))
    }

    /// An alarm.
    pub fn alarm(text: &str) -> Self {
        Self::new(LogKind::Alarm, text.to_owned())
    }

    /// A plain message.
    pub fn plain(text: &str) -> Self {
        Self::new(LogKind::Plain, text.to_owned())
    }

    /// An operator's action.
    pub fn of_action(entry: &AuditEntry) -> Self {
        let by = match entry.origin {
            ActionOrigin::Page => "",
            ActionOrigin::Terminal => " (terminal)",
            ActionOrigin::Program => " (program)",
        };
        match &entry.action {
            OperatorAction::Opened { .. } => Self::plain("the console is open"),
            OperatorAction::Joined => Self::plain("an operator's page was opened"),
            OperatorAction::Left => Self::plain("an operator's page was closed"),
            OperatorAction::Missed { after_s } => {
                Self::new(LogKind::Alarm, format!("no operator for {after_s} s: pause after the trial"))
            }
            OperatorAction::Commanded { command } => {
                Self::new(LogKind::Command, format!("{}{by}", command.name()))
            }
            OperatorAction::RequestedPauseAfterTrial => {
                Self::new(LogKind::Command, format!("pause after the trial{by}"))
            }
            OperatorAction::Noted { text, clock } => {
                Self { clock: clock.clone(), ..Self::new(LogKind::Note, format!("{text}{by}")) }
            }
        }
    }

    fn new(kind: LogKind, text: String) -> Self {
        Self { kind, text, clock: None }
    }
}

impl SessionHistory {
    /// Adds a line.
    pub fn add(&mut self, t_s: f64, entry: LogEntry) {
        self.log.push_back(LogLine { t_s, entry });
        if self.log.len() > LOG_LINES {
            self.log.pop_front();
        }
    }

    /// Adds a line for a transition, if it is worth one. Commands have lines of their own.
    pub fn add_transition(&mut self, t_s: f64, transition: &TransitionRecord) {
        let entry = match transition.detail {
            Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => {
                LogEntry::new(LogKind::Alarm, format!("fault: {fault}"))
            }
            Some(TransitionDetail::Ended { number, status, .. }) => {
                let why = transition.event.name();
                LogEntry::new(LogKind::Plain, format!("trial {number} {} ({why})", status.name()))
            }
            Some(TransitionDetail::OffsetNm(offset_nm)) => {
                LogEntry::new(LogKind::Plain, format!("offset {offset_nm:.3} N m"))
            }
            _ if transition.to == Phase::Finished => LogEntry::plain("every trial is done"),
            _ if transition.event.source() == Source::Operator && transition.to != transition.from => {
                LogEntry::new(
                    LogKind::Plain,
                    format!("{}: now {}", transition.event.name(), transition.to.name()),
                )
            }
            _ => return,
        };
        self.add(t_s, entry);
    }

    /// Sets the system status; returns whether it changed.
    pub fn set_status(&mut self, status: SystemStatus) -> bool {
        let changed = status != self.status;
        self.status = status;
        changed
    }

    /// The history as JSON.
    pub fn json(
        &self,
        progress: &Progress,
        settings: &Settings,
        fits: &BTreeMap<u32, TrialFitOutcome>,
    ) -> String {
        let fit_of = |attempt: &Attempt| {
            let counts = matches!(attempt.ended, Some((crate::session::Status::Ok, _)));
            fits.get(&attempt.number).filter(|_| counts && !attempt.planned.key.practice)
        };
        let estimates =
            progress.attempts().iter().filter_map(fit_of).filter_map(|(_, fit)| fit.as_ref().ok());
        let conditions = conditions(estimates.map(|fitted| fitted.estimate.clone()).collect());
        let last = progress.attempts().iter().rev().find_map(fit_of);
        json!({
            "kind": "story",
            "trials": progress.attempts().iter().map(|attempt| trial(attempt, fit_of(attempt))).collect::<Vec<_>>(),
            "queue": progress.queue().map(planned).collect::<Vec<_>>(),
            "offset_nm": progress.offset_nm(),
            "conditions": conditions.iter().map(condition).collect::<Vec<_>>(),
            "last_fit": last.map(|(number, fit)| match fit {
                Ok(fitted) => curve(*number, fitted, settings),
                Err(reason) => json!({ "trial": number, "reason": reason }),
            }),
            "log": self.log,
            "gauges": self.status,
        })
        .to_string()
    }
}

fn planned(planned: &PlannedTrial) -> Value {
    json!({
        "practice": planned.key.practice,
        "position": planned.key.position,
        "rejections": planned.key.rejections,
        "velocity_rad_s": planned.velocity_rad_s,
        "torque_nm": planned.torque_nm,
        "repetition": planned.repetition,
    })
}

fn trial(attempt: &Attempt, outcome: Option<&TrialFitOutcome>) -> Value {
    let mut trial = planned(&attempt.planned);
    trial["number"] = attempt.number.into();
    if let Some((status, event)) = attempt.ended {
        trial["status"] = status.name().into();
        trial["reason"] = event.name().into();
    }
    match outcome {
        Some((_, Ok(fitted))) => trial["fit"] = values(&fitted.estimate.quantities()),
        Some((_, Err(reason))) => trial["no_fit"] = reason.as_str().into(),
        None => {}
    }
    trial
}

/// The fitted quantities by name.
fn values(quantities: &[Option<f64>; 9]) -> Value {
    QUANTITIES.iter().zip(quantities).map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
}

fn condition(condition: &ConditionEstimate) -> Value {
    json!({
        "velocity_rad_s": condition.velocity_rad_s,
        "torque_nm": condition.torque_nm,
        "repetitions": condition.repetitions,
        "mean": values(&condition.mean),
        "sd": values(&condition.sd),
    })
}

fn conditions(mut estimates: Vec<TrialEstimate>) -> Vec<ConditionEstimate> {
    let key = |estimate: &TrialEstimate| (estimate.torque_nm, estimate.velocity_rad_s);
    estimates.sort_by(|a, b| {
        let ((torque_a, velocity_a), (torque_b, velocity_b)) = (key(a), key(b));
        torque_a.total_cmp(&torque_b).then(velocity_a.total_cmp(&velocity_b))
    });
    by_condition(&estimates)
}

fn curve(number: u32, fitted: &TrialFit, settings: &Settings) -> Value {
    let rounded = |values: &[f64]| values.iter().map(|value| (value * 1e5).round() / 1e5).collect::<Vec<_>>();
    json!({
        "trial": number,
        "velocity_rad_s": fitted.estimate.velocity_rad_s,
        "torque_nm": fitted.estimate.torque_nm,
        "period_s": 1.0 / settings.sample_rate_hz,
        "measured_nm": rounded(&fitted.measured_nm),
        "predicted_nm": rounded(&fitted.predicted_nm),
        "values": values(&fitted.estimate.quantities()),
        "se": QUANTITIES.iter().zip(fitted.estimate.se).map(|(name, se)| ((*name).to_owned(), json!(se))).collect::<Value>(),
        "converged": fitted.estimate.converged,
        "remarks": fitted.estimate.remarks,
    })
}
