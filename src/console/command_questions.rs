//! What the operator is asked before a command is carried out.

use std::collections::BTreeMap;

use crate::session::transitions::Effect;
use crate::session::{Event, Phase, Progress};

/// Told before the present place of the handle becomes the start position.
pub const SETS_ORIGIN_HERE: &str =
    "The present place of the handle becomes the start position (0 rad) of all movements and limits.";

const START: &str = "The motor will be given power and will hold the handle, with the subject's hand in it. Is the hand fixed in \
                     place, is one emergency switch in the subject's other hand and one in yours, and is everyone else clear of the \
                     lever?";

const REARM: &str = "The motor will move the handle, with the subject's hand in it, to the start position. Has the fault been fixed, \
                     and does the subject know that the handle will move?";

/// The questions that depend on the rig. A virtual wrist can be hurt by nobody, and is armed without a question.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommandQuestions {
    start: Option<String>,
    rearm: Option<String>,
}

impl CommandQuestions {
    /// Questions for a virtual wrist.
    pub fn for_virtual_wrist() -> Self {
        Self::default()
    }

    /// Questions for a motor, with a hand in its handle. With `sets_origin_here` the first arming takes the present place of the
    /// handle for the start position.
    pub fn for_motor(sets_origin_here: bool) -> Self {
        let origin = if sets_origin_here { format!("{SETS_ORIGIN_HERE} ") } else { String::new() };
        Self { start: Some(format!("{origin}{START}")), rearm: Some(REARM.to_owned()) }
    }

    /// The question before the motor is armed for the first time.
    pub fn start(&self) -> Option<&str> {
        self.start.as_deref()
    }

    /// The question before the motor is armed again after a fault.
    pub fn rearm(&self) -> Option<&str> {
        self.rearm.as_deref()
    }

    /// The question before `command`, as the session stands; `None` if it is carried out at once.
    fn before(&self, command: Event, effect: Effect) -> Option<&str> {
        match (command, effect) {
            (Event::Start, _) => self.start(),
            (Event::Rearm, _) => self.rearm(),
            (Event::Abort, Effect::Abort) => {
                Some("End the session now? The trial under way is aborted; the session can be resumed.")
            }
            (Event::Abort, _) => Some("End the session now? It can be resumed."),
            (_, Effect::LeaveOut) => Some("Abort this trial and leave it out?"),
            (_, Effect::LeaveOutNext) => Some("Leave out the next trial?"),
            (_, Effect::TakeBack) => Some("Reject the last trial and run it again?"),
            _ => None,
        }
    }

    /// The questions before those of `commands` that are possible in a phase and ask one, by the command's name.
    pub fn now(&self, phase: Phase, progress: &Progress) -> BTreeMap<&'static str, String> {
        let question = |command: &Event| {
            let line = progress.line(phase, *command)?;
            Some((command.name(), self.before(*command, line.effect)?.to_owned()))
        };
        Event::COMMANDS.iter().filter_map(question).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "Is everyone clear of it?" was asked of a subject whose hand is in the handle, and of a simulation.
    #[test]
    fn arming_asks_about_the_hand_in_the_handle_and_a_virtual_wrist_asks_nothing() {
        let motor = CommandQuestions::for_motor(false);
        for question in [motor.start().unwrap(), motor.rearm().unwrap()] {
            assert!(question.contains("the subject's hand in it"), "{question}");
        }
        assert!(!motor.start().unwrap().contains(SETS_ORIGIN_HERE));
        assert!(CommandQuestions::for_motor(true).start().unwrap().starts_with(SETS_ORIGIN_HERE));
        let wrist = CommandQuestions::for_virtual_wrist();
        assert_eq!((wrist.start(), wrist.rearm()), (None, None));
        assert_eq!(wrist.before(Event::RepeatEffort, Effect::RepeatEffort), None);
        assert!(wrist.before(Event::Repeat, Effect::TakeBack).is_some());
    }
}
