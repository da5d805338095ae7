//! What the journal says of each step of the state machine.

use crate::dataset::journal::JournalEntry;
use crate::session::{Event, Phase, TransitionRecord};

/// What the journal says of one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExpectedStep {
    pub(super) sample: u64,
    pub(super) record: StepEntry,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum StepEntry {
    Transition(TransitionRecord),
    Refused(Event),
}

impl ExpectedStep {
    pub(super) fn of(record: &JournalEntry) -> Option<Self> {
        match record {
            JournalEntry::Transition(transition) => {
                Some(Self { sample: transition.sample, record: StepEntry::Transition(*transition) })
            }
            // It was noted after the step was counted.
            JournalEntry::Refused { sample, command } => {
                Some(Self { sample: sample.saturating_sub(1), record: StepEntry::Refused(*command) })
            }
            JournalEntry::Session { .. }
            | JournalEntry::Resumed { .. }
            | JournalEntry::Console(_)
            | JournalEntry::Recorded(_)
            | JournalEntry::Origin { .. }
            | JournalEntry::Clock { .. } => None,
        }
    }
}

/// Whether the last thing that a journal tells leaves the session going on: the program did not live to end it.
pub(super) fn is_under_way(lines: &[ExpectedStep]) -> bool {
    let last = lines.iter().rev().find_map(|line| match line.record {
        StepEntry::Transition(transition) => Some(transition.to),
        StepEntry::Refused(_) => None,
    });
    last.is_none_or(Phase::is_armed)
}

/// The transition and the refused command of one step.
pub(super) fn expected(due: &[ExpectedStep]) -> (Option<TransitionRecord>, Option<Event>) {
    let mut step = (None, None);
    for line in due {
        match line.record {
            StepEntry::Transition(transition) => step.0 = Some(transition),
            StepEntry::Refused(command) => step.1 = Some(command),
        }
    }
    step
}

pub(super) fn describe_line(record: &StepEntry) -> String {
    match record {
        StepEntry::Transition(transition) => describe_step(Some(*transition), None),
        StepEntry::Refused(command) => describe_step(None, Some(*command)),
    }
}

pub(super) fn describe_step(transition: Option<TransitionRecord>, refused: Option<Event>) -> String {
    match (transition, refused) {
        (None, None) => "nothing".to_owned(),
        (Some(transition), None) => describe(&transition),
        (None, Some(command)) => format!("{} refused", command.name()),
        (Some(transition), Some(command)) => format!("{}, {} refused", describe(&transition), command.name()),
    }
}

pub(super) fn describe(transition: &TransitionRecord) -> String {
    let mut text = format!("{} to {}", transition.event.name(), transition.to.name());
    if let Some(detail) = transition.detail {
        // Made by this program, so it has a JSON form.
        text += &format!(" {}", serde_json::to_string(&detail).unwrap_or_default());
    }
    text
}
