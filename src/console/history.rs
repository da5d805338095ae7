//! History of the session for the operator: maximal efforts, trials with status and fit, means by condition, the log.

use std::collections::VecDeque;

use serde::Serialize;
use serde_json::{Value, json};

use super::display_latency::DisplayLatency;
use super::fitter::TrialFit;
use super::reflexes::Reflexes;
use super::trial_fits::TrialFits;
use crate::dataset::{ActionOrigin, AuditEntry, OperatorAction, stamps_from_clock};
use crate::fit::{ConditionEstimate, QUANTITIES, TrialEstimate};
use crate::report::SHOWN;
use crate::rig::{Direction, Vitals};
use crate::session::{
    Attempt, Event, MaximalEffort, Phase, PlannedTrial, Progress, Settings, Source, Status, TransitionDetail,
    TransitionRecord,
};

/// Number of log lines that are shown; the journal keeps all.
const LOG_LINES: usize = 200;
/// Time between two alarms about missed cycles, s.
const MISSED_ALARM_PERIOD_S: f64 = 30.0;

/// Log and system status; trials come from the progress of the session.
#[derive(Debug, Default)]
pub struct SessionHistory {
    log: VecDeque<LogLine>,
    status: SystemStatus,
    /// Number of alarms, without those about missed cycles.
    alarms: u64,
    /// Missed cycles that an alarm has told of, and when.
    missed_told: Option<(u64, f64)>,
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
            OperatorAction::StreamSilent { stream, for_s } => {
                Self::new(LogKind::Alarm, format!("stream {stream:?} silent for {for_s:.2} s"))
            }
            OperatorAction::StreamBack { stream, after_s } => {
                Self::plain(&format!("stream {stream:?} back after {after_s:.2} s"))
            }
            OperatorAction::StreamFrozen { stream, channel, value, for_s } => {
                let text = format!("stream {stream:?}: {channel} stands at {value} for {for_s:.2} s");
                Self::new(LogKind::Alarm, text)
            }
            OperatorAction::StreamLive { stream, channel, after_s } => {
                Self::plain(&format!("stream {stream:?}: {channel} changes again after {after_s:.2} s"))
            }
            OperatorAction::StreamStampsOff { stream, late_s, .. } => {
                let text = format!("stream {stream:?}: time stamps {} the clock", stamps_from_clock(*late_s));
                Self::new(LogKind::Alarm, text)
            }
            OperatorAction::StreamStampsRight { stream, .. } => {
                Self::plain(&format!("stream {stream:?}: time stamps right again"))
            }
            OperatorAction::StreamNotRecorded { stream, because } => {
                Self::new(LogKind::Alarm, format!("stream {stream:?} not recorded: {because}"))
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
        self.alarms += u64::from(entry.kind == LogKind::Alarm);
        self.keep(t_s, entry);
    }

    fn keep(&mut self, t_s: f64, entry: LogEntry) {
        self.log.push_back(LogLine { t_s, entry });
        if self.log.len() > LOG_LINES {
            self.log.pop_front();
        }
    }

    /// Adds a line for a transition, if it is worth one; `progress` is that after it. Commands have lines of their own.
    pub fn add_transition(&mut self, t_s: f64, transition: &TransitionRecord, progress: &Progress) {
        let entry = match transition.detail {
            Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => {
                LogEntry::new(LogKind::Alarm, format!("fault: {fault}"))
            }
            Some(TransitionDetail::Ended { number, status, .. }) => {
                let kind = if transition.from.in_rig_trial() { "rig trial" } else { "trial" };
                let why = transition.event.name();
                LogEntry::new(LogKind::Plain, format!("{kind} {number} {} ({why})", status.name()))
            }
            Some(TransitionDetail::OffsetNm(offset_nm)) => {
                LogEntry::new(LogKind::Plain, format!("offset {offset_nm:.3} N m"))
            }
            Some(TransitionDetail::Effort { .. }) => {
                let Some(effort) = progress.efforts().last() else { return };
                let (number, torque_nm) = (progress.efforts().len(), torque_of(effort, progress));
                let name = direction_name(effort.direction);
                let text = format!(
                    "maximal effort {number}, {name}: {torque_nm:.2} N m, EMG {:.2}",
                    agonist_of(effort)
                );
                LogEntry::new(LogKind::Plain, text)
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

    /// Sets the system status; returns whether it changed. An alarm tells of missed cycles.
    pub fn set_status(&mut self, t_s: f64, status: SystemStatus) -> bool {
        let changed = status != self.status;
        self.status = status;
        let missed = status.vitals.missed;
        let (told, told_at_s) = self.missed_told.unwrap_or((0, f64::NEG_INFINITY));
        if missed > told && t_s - told_at_s >= MISSED_ALARM_PERIOD_S {
            let more = missed - told;
            let text = format!("missed cycles of the control loop: {more} more, {missed} in all");
            self.keep(t_s, LogEntry::alarm(&text));
            self.missed_told = Some((missed, t_s));
        }
        changed
    }

    /// Alarms so far; each missed cycle counts.
    fn alarms(&self) -> u64 {
        self.alarms + self.status.vitals.missed
    }

    /// The history as JSON.
    pub fn json(
        &self,
        progress: &Progress,
        settings: &Settings,
        fits: &TrialFits,
        reflexes: &Reflexes,
    ) -> String {
        let counts = |attempt: &&Attempt| {
            matches!(attempt.ended, Some((Status::Ok, _))) && !attempt.planned.key.practice
        };
        let counting: Vec<u32> =
            progress.attempts().iter().filter(counts).map(|attempt| attempt.number).collect();
        let conditions = fits.conditions(counting.iter().copied());
        let last = counting.iter().rev().find_map(|number| Some((number, fits.outcome(*number)?)));
        let trials = progress
            .attempts()
            .iter()
            .map(|attempt| trial(attempt, counts(&attempt).then_some((fits, reflexes))));
        let mut gauges = json!(self.status);
        gauges["alarms"] = self.alarms().into();
        json!({
            "kind": "story",
            "efforts": efforts(progress),
            "efforts_left": progress.efforts_left(),
            "trials": trials.collect::<Vec<_>>(),
            "queue": progress.queue().map(planned).collect::<Vec<_>>(),
            "offset_nm": progress.offset_nm(),
            "fitted_together": fits.are_together(),
            "conditions": conditions.iter().map(|own| condition(own, fits.are_together())).collect::<Vec<_>>(),
            "last_fit": last.map(|(number, fit)| match fit {
                Ok(fitted) => curve(*number, fitted, settings),
                Err(reason) => json!({ "trial": number, "reason": reason }),
            }),
            "log": self.log,
            "gauges": gauges,
        })
        .to_string()
    }
}

/// Name of a direction.
fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Flexion => "flexion",
        Direction::Extension => "extension",
    }
}

/// Torque of an effort without the offset, N m.
fn torque_of(effort: &MaximalEffort, progress: &Progress) -> f64 {
    effort.peak_torque_nm - progress.offset_nm()
}

/// Highest EMG of the muscle that made an effort.
fn agonist_of(effort: &MaximalEffort) -> f64 {
    match effort.direction {
        Direction::Flexion => effort.peak_fcr,
        Direction::Extension => effort.peak_ecr,
    }
}

/// The maximal efforts. The best of each direction is that with the highest EMG, which becomes the unit.
fn efforts(progress: &Progress) -> Vec<Value> {
    let all = progress.efforts();
    let best = |direction| {
        let own = (0..all.len()).filter(|place| all[*place].direction == direction);
        own.max_by(|a, b| agonist_of(&all[*a]).total_cmp(&agonist_of(&all[*b])))
    };
    let effort = |(place, effort): (usize, &MaximalEffort)| {
        json!({
            "number": place + 1,
            "direction": effort.direction,
            "peak_torque_nm": torque_of(effort, progress),
            "peak_emg": agonist_of(effort),
            "is_best": best(effort.direction) == Some(place),
        })
    };
    all.iter().enumerate().map(effort).collect()
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

/// A trial, with its fit and the latency of its reflex response if it counts.
fn trial(attempt: &Attempt, counting: Option<(&TrialFits, &Reflexes)>) -> Value {
    let mut trial = planned(&attempt.planned);
    trial["number"] = attempt.number.into();
    if let Some((status, event)) = attempt.ended {
        trial["status"] = status.name().into();
        trial["reason"] = event.name().into();
    }
    if let Some((fits, reflexes)) = counting {
        if reflexes.has(attempt.number) {
            trial["response_s"] = json!(reflexes.latency_s(attempt.number));
        }
        if let Some(Err(reason)) = fits.outcome(attempt.number) {
            trial["no_fit"] = reason.into();
        } else if let Some(estimate) = fits.estimate(attempt.number) {
            trial["fit"] = values(&estimate.quantities());
            trial["shown"] = shown(estimate);
        }
    }
    trial
}

/// The fitted quantities by name.
fn values(quantities: &[Option<f64>; 9]) -> Value {
    QUANTITIES.iter().zip(quantities).map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
}

/// The values of a trial by name, as text with uncertainty and marks.
fn shown(estimate: &TrialEstimate) -> Value {
    SHOWN.iter().map(|shown| (shown.name.to_owned(), json!(shown.text_of_trial(estimate)))).collect()
}

fn condition(condition: &ConditionEstimate, is_together: bool) -> Value {
    let text = |shown: &crate::report::Shown| shown.text_of_condition(condition, is_together);
    json!({
        "velocity_rad_s": condition.velocity_rad_s,
        "torque_nm": condition.torque_nm,
        "repetitions": condition.repetitions,
        "shown": SHOWN.iter().map(|own| (own.name.to_owned(), json!(text(own)))).collect::<Value>(),
    })
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
        "shown": shown(&fitted.estimate),
        "converged": fitted.estimate.converged,
        "remarks": fitted.estimate.remarks,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(missed: u64) -> SystemStatus {
        SystemStatus { vitals: Vitals { missed, ..Vitals::default() }, ..SystemStatus::default() }
    }

    /// Missed cycles stood among the gauges, and no alarm told of them.
    #[test]
    fn each_missed_cycle_is_an_alarm_and_the_log_tells_of_them_now_and_then() {
        let mut history = SessionHistory::default();
        history.add(0.5, LogEntry::alarm("the drive is hot"));
        assert_eq!(history.alarms(), 1);
        for (t_s, missed) in [(1.0, 2), (2.0, 5), (31.0, 5), (32.0, 6)] {
            history.set_status(t_s, status(missed));
        }
        assert_eq!(history.alarms(), 7);
        let told: Vec<&str> = history.log.iter().skip(1).map(|line| line.entry.text.as_str()).collect();
        assert_eq!(
            told,
            [
                "missed cycles of the control loop: 2 more, 2 in all",
                "missed cycles of the control loop: 3 more, 5 in all",
            ]
        );
        // Lines that the log keeps no more count as well.
        (0..300).for_each(|_| history.add(40.0, LogEntry::alarm("again")));
        assert_eq!(history.alarms(), 307);
    }
}
