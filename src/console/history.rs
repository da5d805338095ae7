//! What has happened so far, for the operator to read: trials with their outcomes and fits, the conditions, the log.

use std::collections::{BTreeMap, VecDeque};

use serde::Serialize;
use serde_json::{Value, json};

use super::DisplayLatency;
use super::fitter::{TrialFit, TrialFitOutcome};
use crate::dataset::{ActionOrigin, AuditEntry, OperatorAction};
use crate::fit::{ConditionEstimate, QUANTITIES, TrialEstimate, by_condition};
use crate::rig::Vitals;
use crate::session::{
    Attempt, Event, Phase, PlannedTrial, Progress, Settings, Source, TransitionDetail, TransitionRecord,
};

/// Lines of the log that are kept for reading; the journal has them all.
const KEPT: usize = 200;

/// The story apart from what the progress tells.
#[derive(Debug, Default)]
pub struct History {
    log: VecDeque<LogLine>,
    gauges: SystemStatus,
}

/// How everything fares.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SystemStatus {
    /// The loop and the bus.
    #[serde(flatten)]
    pub vitals: Vitals,
    /// Room on the session's disk, bytes.
    pub disk_free_bytes: Option<u64>,
    /// How long torque takes to the person's screen.
    pub screen: Option<DisplayLatency>,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct LogLine {
    t_s: f64,
    #[serde(flatten)]
    entry: LogEntry,
}

/// What a line says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LogEntry {
    /// What sort of line it is.
    kind: LogKind,
    text: String,
    /// The time on the operator's clock, with a note.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum LogKind {
    Plain,
    Said,
    Note,
    Refused,
    Alarm,
}

impl LogEntry {
    /// A word that was not possible.
    pub fn refused(word: Event, phase: Phase) -> Self {
        Self::new(LogKind::Refused, format!("{} is not possible in phase {}", word.name(), phase.name()))
    }

    /// Something to be alarmed at.
    pub fn alarm(text: &str) -> Self {
        Self::new(LogKind::Alarm, text.to_owned())
    }

    /// Something to know.
    pub fn plain(text: &str) -> Self {
        Self::new(LogKind::Plain, text.to_owned())
    }

    /// What was done at a console.
    pub fn of(remark: &AuditEntry) -> Self {
        let by = match remark.desk {
            ActionOrigin::Page => "",
            ActionOrigin::Terminal => " (terminal)",
            ActionOrigin::Program => " (program)",
        };
        match &remark.deed {
            OperatorAction::Opened { .. } => Self::plain("the console is open"),
            OperatorAction::Joined => Self::plain("an operator is here"),
            OperatorAction::Left => Self::plain("an operator left"),
            OperatorAction::Missed { after_s } => {
                Self::new(LogKind::Alarm, format!("no operator for {after_s} s: pause after the trial"))
            }
            OperatorAction::Said { word } => Self::new(LogKind::Said, format!("{}{by}", word.name())),
            OperatorAction::AskedForPauseAfterTrial => {
                Self::new(LogKind::Said, format!("pause after the trial{by}"))
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

impl History {
    /// Adds a line.
    pub fn tell(&mut self, t_s: f64, entry: LogEntry) {
        self.log.push_back(LogLine { t_s, entry });
        if self.log.len() > KEPT {
            self.log.pop_front();
        }
    }

    /// Adds what is worth a line of what happened. The operator's words are told as they are said.
    pub fn happened(&mut self, t_s: f64, happening: &TransitionRecord) {
        let entry = match happening.detail {
            Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => {
                LogEntry::new(LogKind::Alarm, format!("fault: {fault}"))
            }
            Some(TransitionDetail::Ended { number, status, .. }) => {
                let why = happening.event.name();
                LogEntry::new(LogKind::Plain, format!("trial {number} {} ({why})", status.name()))
            }
            Some(TransitionDetail::OffsetNm(offset_nm)) => {
                LogEntry::new(LogKind::Plain, format!("offset {offset_nm:.3} N m"))
            }
            _ if happening.to == Phase::Finished => LogEntry::plain("every trial is done"),
            _ if happening.event.source() == Source::Operator && happening.to != happening.from => {
                LogEntry::new(
                    LogKind::Plain,
                    format!("{}: now {}", happening.event.name(), happening.to.name()),
                )
            }
            _ => return,
        };
        self.tell(t_s, entry);
    }

    /// How everything fares; whether that is news.
    pub fn gauge(&mut self, gauges: SystemStatus) -> bool {
        let is_news = gauges != self.gauges;
        self.gauges = gauges;
        is_news
    }

    /// The story as JSON.
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
            "gauges": self.gauges,
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

/// Values by name.
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
