//! The transition table of the state machine. `ramphold states` prints it; the docs draw it.

use super::event::Event;
use super::phase::Phase;

/// One line of the table. Of several lines with the same phase and event, the first whose guard holds is taken; where
/// there is none, the event is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// Phase that the transition leaves.
    pub from: Phase,
    /// Event that causes the transition.
    pub event: Event,
    /// Condition of the transition.
    pub guard: Guard,
    /// The phase it enters; the same one if the phase goes on.
    pub to: Phase,
    /// Effect on the trials.
    pub effect: Effect,
}

/// A condition on the trials done and the trials left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Guard {
    /// Nothing in particular.
    Always,
    /// The protocol has rig trials, and the subject is not seated yet.
    RigTrialsDue,
    /// The load of the next rig trial is mounted.
    LoadMounted,
    /// The protocol asks for an offset and it has not been measured.
    OffsetDue,
    /// The protocol asks for maximal efforts and some are left.
    EffortsDue,
    /// A maximal effort has been done and can be repeated: no trial was prepared since.
    EffortRepeatable,
    /// Trials are left to do.
    TrialsLeft,
    /// The next trial is the last one left.
    OneTrialLeft,
    /// The operator has asked for a pause.
    PauseAsked,
    /// The last trial, or rig trial, counts, and is one of the measured ones.
    LastTrialCounts,
}

/// What a transition does to the trials and measurements of the session. Until the subject is seated, the trials are rig trials;
/// of those, one that is put back comes next again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// Nothing.
    None,
    /// The offset is known.
    KeepOffset,
    /// An effort is done.
    KeepEffort,
    /// The last effort is done once more, in the same direction; the best one counts.
    RepeatEffort,
    /// The next trial begins.
    Begin,
    /// The trial is complete and counts.
    Ok,
    /// The trial is rejected, kept, and put back at a random later place.
    Reject,
    /// The trial is aborted, kept, and put back at a random later place.
    Abort,
    /// The trial is aborted, kept, and left out.
    LeaveOut,
    /// The next trial is left out.
    LeaveOutNext,
    /// The last trial is rejected after all, and comes next again.
    TakeBack,
    /// The pause requested by the operator is noted.
    NotePause,
    /// The rig trials are over: the subject is seated.
    SeatSubject,
}

impl Guard {
    /// Text of the printed table.
    pub fn text(self) -> &'static str {
        match self {
            Self::Always => "",
            Self::RigTrialsDue => "subject not seated after rig trials",
            Self::LoadMounted => "load is mounted",
            Self::OffsetDue => "offset still to be measured",
            Self::EffortsDue => "maximal efforts left",
            Self::EffortRepeatable => "an effort was done",
            Self::TrialsLeft => "trials left",
            Self::OneTrialLeft => "one trial left",
            Self::PauseAsked => "pause asked for",
            Self::LastTrialCounts => "last trial ok",
        }
    }
}

impl Effect {
    /// Text of the printed table.
    pub fn text(self) -> &'static str {
        match self {
            Self::None => "",
            Self::KeepOffset => "offset kept",
            Self::KeepEffort => "effort kept",
            Self::RepeatEffort => "one more effort, best counts",
            Self::Begin => "trial begins",
            Self::Ok => "trial ok",
            Self::Reject => "trial rejected, put back",
            Self::Abort => "trial aborted, put back",
            Self::LeaveOut => "trial aborted, left out",
            Self::LeaveOutNext => "next trial left out",
            Self::TakeBack => "last trial rejected, comes next",
            Self::NotePause => "pause when the motor is home",
            Self::SeatSubject => "rig trials over",
        }
    }
}

const fn row(from: Phase, event: Event, guard: Guard, to: Phase, effect: Effect) -> Transition {
    Transition { from, event, guard, to, effect }
}

/// Every transition there is.
pub const TRANSITIONS: &[Transition] = {
    use self::Effect as Do;
    use self::Guard as If;
    use Event as On;
    use Phase::*;
    &[
        row(Ready, On::Start, If::RigTrialsDue, RigSetup, Do::None),
        row(Ready, On::Start, If::OffsetDue, Offset, Do::None),
        row(Ready, On::Start, If::EffortsDue, MvcEffort, Do::None),
        row(Ready, On::Start, If::TrialsLeft, Rest, Do::None),
        row(Ready, On::Start, If::Always, Finished, Do::None),
        row(Ready, On::Abort, If::Always, Aborted, Do::None),
        row(Ready, On::Fault, If::Always, Faulted, Do::None),
        row(RigSetup, On::RestOver, If::LoadMounted, RigSettle, Do::Begin),
        row(RigSetup, On::Resume, If::TrialsLeft, RigSettle, Do::Begin),
        row(RigSetup, On::Resume, If::OffsetDue, Offset, Do::SeatSubject),
        row(RigSetup, On::Resume, If::EffortsDue, MvcEffort, Do::SeatSubject),
        row(RigSetup, On::Resume, If::Always, Rest, Do::SeatSubject),
        row(RigSetup, On::Pause, If::Always, Paused, Do::None),
        row(RigSetup, On::Skip, If::TrialsLeft, RigSetup, Do::LeaveOutNext),
        row(RigSetup, On::Repeat, If::LastTrialCounts, RigSetup, Do::TakeBack),
        row(RigSetup, On::Abort, If::Always, Aborted, Do::None),
        row(RigSetup, On::Fault, If::Always, Faulted, Do::None),
        row(RigSettle, On::Onset, If::Always, RigMotion, Do::None),
        row(RigSettle, On::Pause, If::Always, Paused, Do::Abort),
        row(RigSettle, On::Skip, If::Always, RigSetup, Do::LeaveOut),
        row(RigSettle, On::Abort, If::Always, Aborted, Do::Abort),
        row(RigSettle, On::Fault, If::Always, Faulted, Do::Abort),
        row(RigMotion, On::Home, If::PauseAsked, Paused, Do::Ok),
        row(RigMotion, On::Home, If::Always, RigSetup, Do::Ok),
        row(RigMotion, On::MotionDeviated, If::PauseAsked, Paused, Do::Reject),
        row(RigMotion, On::MotionDeviated, If::Always, RigSetup, Do::Reject),
        row(RigMotion, On::Pause, If::Always, RigMotion, Do::NotePause),
        row(RigMotion, On::Abort, If::Always, Aborted, Do::Abort),
        row(RigMotion, On::Fault, If::Always, Faulted, Do::Abort),
        row(Offset, On::OffsetMeasured, If::EffortsDue, MvcEffort, Do::KeepOffset),
        row(Offset, On::OffsetMeasured, If::Always, Rest, Do::KeepOffset),
        row(Offset, On::Pause, If::Always, Paused, Do::None),
        row(Offset, On::Abort, If::Always, Aborted, Do::None),
        row(Offset, On::Fault, If::Always, Faulted, Do::None),
        row(MvcEffort, On::EffortOver, If::Always, MvcRest, Do::KeepEffort),
        row(MvcEffort, On::Pause, If::Always, Paused, Do::None),
        row(MvcEffort, On::Abort, If::Always, Aborted, Do::None),
        row(MvcEffort, On::Fault, If::Always, Faulted, Do::None),
        row(MvcRest, On::RestOver, If::EffortsDue, MvcEffort, Do::None),
        row(MvcRest, On::RestOver, If::Always, Rest, Do::None),
        row(MvcRest, On::RepeatEffort, If::EffortRepeatable, MvcRest, Do::RepeatEffort),
        row(MvcRest, On::Pause, If::Always, Paused, Do::None),
        row(MvcRest, On::Abort, If::Always, Aborted, Do::None),
        row(MvcRest, On::Fault, If::Always, Faulted, Do::None),
        row(Rest, On::RestOver, If::Always, Hold, Do::Begin),
        row(Rest, On::Pause, If::Always, Paused, Do::None),
        row(Rest, On::Skip, If::OneTrialLeft, Finished, Do::LeaveOutNext),
        row(Rest, On::Skip, If::Always, Rest, Do::LeaveOutNext),
        row(Rest, On::Repeat, If::LastTrialCounts, Rest, Do::TakeBack),
        row(Rest, On::Abort, If::Always, Aborted, Do::None),
        row(Rest, On::Fault, If::Always, Faulted, Do::None),
        row(Hold, On::GateOpened, If::Always, Delay, Do::None),
        row(Hold, On::GateTimedOut, If::Always, Rest, Do::Reject),
        row(Hold, On::AntagonistActive, If::Always, Rest, Do::Reject),
        row(Hold, On::Pause, If::Always, Paused, Do::Abort),
        row(Hold, On::Skip, If::TrialsLeft, Rest, Do::LeaveOut),
        row(Hold, On::Skip, If::Always, Finished, Do::LeaveOut),
        row(Hold, On::Abort, If::Always, Aborted, Do::Abort),
        row(Hold, On::Fault, If::Always, Faulted, Do::Abort),
        row(Delay, On::Onset, If::Always, Ramp, Do::None),
        row(Delay, On::LeftBand, If::Always, Rest, Do::Reject),
        row(Delay, On::AntagonistActive, If::Always, Rest, Do::Reject),
        row(Delay, On::Pause, If::Always, Paused, Do::Abort),
        row(Delay, On::Skip, If::TrialsLeft, Rest, Do::LeaveOut),
        row(Delay, On::Skip, If::Always, Finished, Do::LeaveOut),
        row(Delay, On::Abort, If::Always, Aborted, Do::Abort),
        row(Delay, On::Fault, If::Always, Faulted, Do::Abort),
        row(Ramp, On::RampOver, If::Always, RampHold, Do::None),
        row(Ramp, On::Pause, If::Always, Ramp, Do::NotePause),
        row(Ramp, On::Abort, If::Always, Aborted, Do::Abort),
        row(Ramp, On::Fault, If::Always, Faulted, Do::Abort),
        row(RampHold, On::HoldOver, If::Always, Return, Do::Ok),
        row(RampHold, On::MotionDeviated, If::Always, Return, Do::Reject),
        row(RampHold, On::Pause, If::Always, RampHold, Do::NotePause),
        row(RampHold, On::Abort, If::Always, Aborted, Do::Abort),
        row(RampHold, On::Fault, If::Always, Faulted, Do::Abort),
        row(Return, On::Home, If::PauseAsked, Paused, Do::None),
        row(Return, On::Home, If::TrialsLeft, Rest, Do::None),
        row(Return, On::Home, If::Always, Finished, Do::None),
        row(Return, On::Pause, If::Always, Return, Do::NotePause),
        row(Return, On::Repeat, If::LastTrialCounts, Return, Do::TakeBack),
        row(Return, On::Abort, If::Always, Aborted, Do::None),
        row(Return, On::Fault, If::Always, Faulted, Do::None),
        row(Homing, On::Home, If::Always, Paused, Do::None),
        row(Homing, On::Abort, If::Always, Aborted, Do::None),
        row(Homing, On::Fault, If::Always, Faulted, Do::None),
        row(Paused, On::Resume, If::RigTrialsDue, RigSetup, Do::None),
        row(Paused, On::Resume, If::OffsetDue, Offset, Do::None),
        row(Paused, On::Resume, If::EffortsDue, MvcEffort, Do::None),
        row(Paused, On::Resume, If::TrialsLeft, Rest, Do::None),
        row(Paused, On::Resume, If::Always, Finished, Do::None),
        row(Paused, On::Skip, If::TrialsLeft, Paused, Do::LeaveOutNext),
        row(Paused, On::RepeatEffort, If::EffortRepeatable, Paused, Do::RepeatEffort),
        row(Paused, On::Repeat, If::LastTrialCounts, Paused, Do::TakeBack),
        row(Paused, On::Abort, If::Always, Aborted, Do::None),
        row(Paused, On::Fault, If::Always, Faulted, Do::None),
        row(Faulted, On::Rearm, If::Always, Homing, Do::None),
        row(Faulted, On::Abort, If::Always, Aborted, Do::None),
    ]
};

/// The lines for a phase and an event, in the order in which they are tried.
pub fn lines(from: Phase, event: Event) -> impl Iterator<Item = &'static Transition> {
    TRANSITIONS.iter().filter(move |line| line.from == from && line.event == event)
}

/// The table as text, one line a transition, columns lined up.
pub fn text() -> String {
    let cells = std::iter::once(["from", "event", "by", "if", "to", "does"])
        .chain(TRANSITIONS.iter().map(|line| {
            [
                line.from.name(),
                line.event.name(),
                line.event.source().name(),
                line.guard.text(),
                line.to.name(),
                line.effect.text(),
            ]
        }))
        .collect::<Vec<_>>();
    let mut widths = [0; 6];
    for row in &cells {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.len().max(*width);
        }
    }
    let mut text = String::new();
    for row in &cells {
        let padded: Vec<String> =
            row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        text += padded.join("  ").trim_end();
        text.push('\n');
    }
    text
}

/// The table as a Mermaid state diagram. Faults and the operator's abort, which lead out of everywhere, are left to
/// the table so that the way of a trial can be seen.
pub fn mermaid() -> String {
    let mut text = String::from("stateDiagram-v2\n    [*] --> ready\n");
    for line in TRANSITIONS.iter().filter(|line| !matches!(line.event, Event::Fault | Event::Abort)) {
        let guard =
            if line.guard == Guard::Always { String::new() } else { format!(" [{}]", line.guard.text()) };
        text += &format!("    {} --> {}: {}{guard}\n", line.from.name(), line.to.name(), line.event.name());
    }
    text += "    finished --> [*]\n";
    text
}

/// The whole table as a graph in the language of Graphviz.
pub fn dot() -> String {
    let mut text = String::from("digraph session {\n    rankdir=LR;\n    node [shape=box, style=rounded];\n");
    for line in TRANSITIONS {
        let style = match line.event {
            Event::Fault => ", color=red, fontcolor=red",
            Event::Abort => ", color=gray, fontcolor=gray",
            _ => "",
        };
        let guard =
            if line.guard == Guard::Always { String::new() } else { format!("\\n[{}]", line.guard.text()) };
        text += &format!(
            "    {} -> {} [label=\"{}{guard}\"{style}];\n",
            line.from.name(),
            line.to.name(),
            line.event.name()
        );
    }
    text + "}\n"
}
