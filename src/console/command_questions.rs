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

const START_SEARCH: &str = "The motor will be given power and will SEARCH its home: it may move the handle over its whole range, and then moves \
                            it to the start position. Is NO hand in the handle, is one emergency switch in your hand, and is \
                            everyone clear of handle and lever? Once the motor holds the handle, pause the session, and fix the \
                            subject's hand in place.";

const REARM_SEARCH: &str = "The motor will SEARCH its home again: it may move the handle over its whole range, and then moves it to the \
                            start position. Has the fault been fixed, is NO hand in the handle, and is everyone clear of handle and \
                            lever? Fix the subject's hand in place once the motor holds the handle.";

const GO_ON_AFTER_SEARCH: &str = "The motor has power and holds the handle; the session goes on. Is the subject's hand fixed in place, is \
                                  one emergency switch in the subject's other hand and one in yours, and is everyone else clear of \
                                  the lever?";

/// Told before rig trials with a motor that searches its home.
const SEARCHES_HOME: &str =
    "The motor SEARCHES its home first, and may move the handle over its whole range.";

/// Told before a motor is armed again that cannot show that it was not restarted.
const REARMS_AT_START: &str = "The motor cannot show that it was not switched off meanwhile: put the handle where it stood when the \
                               session began. Elsewhere, all movements and limits may be shifted. Does the handle stand at the start \
                               position?";

const START_RIG_TRIALS: &str = "The motor will be given power and will hold the handle for the rig trials. Is no hand in the handle, \
                                is one emergency switch in your hand, and is everyone clear of the lever?";

const REARM_RIG_TRIALS: &str = "The motor will move the handle, with what is mounted on it, to the start position. Has the fault been \
                                fixed, is no hand in the handle, and is everyone clear of handle and load?";

const BEGIN_RIG_TRIAL: &str =
    "The motor will move the handle. Is the load mounted as told, and is everyone clear of handle and load?";

const SUBJECT_SEATED: &str = "The rig trials are over; the motor has power and holds the handle. Is every load off the handle, is the \
                              subject's hand fixed in place, is one emergency switch in the subject's other hand and one in yours, \
                              and is everyone else clear of the lever?";

/// The questions that depend on the rig. A virtual wrist can be hurt by nobody, and is armed without a question.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommandQuestions {
    start: Option<String>,
    start_rig_trials: Option<String>,
    begin_rig_trial: Option<&'static str>,
    subject_seated: Option<&'static str>,
    go_on: Option<&'static str>,
    rearm: Option<String>,
    rearm_rig_trials: Option<String>,
}

impl CommandQuestions {
    /// Questions for a virtual wrist.
    pub fn for_virtual_wrist() -> Self {
        Self::default()
    }

    /// Questions for a motor, with a hand in its handle. With `sets_origin_here` the first arming takes the present place of the
    /// handle for the start position; with `rearms_at_start` every later one needs the operator's word that the handle stands there.
    /// With `homes_by_moving` the motor searches its home at every arming, with no hand in the handle.
    pub fn for_motor(sets_origin_here: bool, rearms_at_start: bool, homes_by_moving: bool) -> Self {
        let (first, later) = if homes_by_moving { (START_SEARCH, REARM_SEARCH) } else { (START, REARM) };
        let search = if homes_by_moving { format!("{SEARCHES_HOME} ") } else { String::new() };
        let again = if rearms_at_start { format!("{REARMS_AT_START} ") } else { String::new() };
        let origin = if sets_origin_here { format!("{SETS_ORIGIN_HERE} ") } else { String::new() };
        Self {
            start: Some(format!("{origin}{first}")),
            start_rig_trials: Some(format!("{origin}{search}{START_RIG_TRIALS}")),
            begin_rig_trial: Some(BEGIN_RIG_TRIAL),
            subject_seated: Some(SUBJECT_SEATED),
            go_on: homes_by_moving.then_some(GO_ON_AFTER_SEARCH),
            rearm: Some(format!("{again}{later}")),
            rearm_rig_trials: Some(format!("{again}{search}{REARM_RIG_TRIALS}")),
        }
    }

    /// The question before the motor is armed for the first time.
    pub fn start(&self) -> Option<&str> {
        self.start.as_deref()
    }

    /// The question before the motor is armed again after a fault.
    pub fn rearm(&self) -> Option<&str> {
        self.rearm.as_deref()
    }

    /// The question before `command`, as the session stands, in which nobody's hand is in the handle as long as rig trials are
    /// due; `None` if it is carried out at once.
    fn before(&self, command: Event, effect: Effect, rig_trials_due: bool) -> Option<&str> {
        match (command, effect) {
            (Event::Start, _) if rig_trials_due => self.start_rig_trials.as_deref(),
            (Event::Rearm, _) if rig_trials_due => self.rearm_rig_trials.as_deref(),
            (Event::Start, _) => self.start(),
            (Event::Resume, Effect::Begin) => self.begin_rig_trial,
            (Event::Resume, Effect::SeatSubject) => self.subject_seated,
            (Event::Resume, _) if !rig_trials_due => self.go_on,
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
            Some((command.name(), self.before(*command, line.effect, progress.rig_trials_due())?.to_owned()))
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
        let motor = CommandQuestions::for_motor(false, false, false);
        for question in [motor.start().unwrap(), motor.rearm().unwrap()] {
            assert!(question.contains("the subject's hand in it"), "{question}");
        }
        assert!(!motor.start().unwrap().contains(SETS_ORIGIN_HERE));
        assert!(
            CommandQuestions::for_motor(true, false, false).start().unwrap().starts_with(SETS_ORIGIN_HERE)
        );
        let wrist = CommandQuestions::for_virtual_wrist();
        assert_eq!((wrist.start(), wrist.rearm()), (None, None));
        assert_eq!(wrist.before(Event::RepeatEffort, Effect::RepeatEffort, false), None);
        assert!(wrist.before(Event::Repeat, Effect::TakeBack, false).is_some());
        assert_eq!(wrist.before(Event::Resume, Effect::Begin, true), None);
    }

    /// The operator was told that such a motor holds the handle, with the subject's hand in it.
    #[test]
    fn a_motor_that_searches_its_home_is_armed_with_no_hand_in_the_handle() {
        let motor = CommandQuestions::for_motor(false, false, true);
        for question in [motor.start().unwrap(), motor.rearm().unwrap()] {
            assert!(question.contains("SEARCH its home"), "{question}");
            assert!(question.contains("NO hand in the handle"), "{question}");
            assert!(!question.contains("with the subject's hand in it"), "{question}");
        }
        let goes_on = motor.before(Event::Resume, Effect::None, false).unwrap();
        assert!(goes_on.contains("subject's hand fixed in place"), "{goes_on}");
        for command in [Event::Start, Event::Rearm] {
            assert!(motor.before(command, Effect::None, true).unwrap().contains(SEARCHES_HOME));
        }
        let holds = CommandQuestions::for_motor(false, false, false);
        assert_eq!(holds.before(Event::Resume, Effect::None, false), None);
    }

    #[test]
    fn motor_that_cannot_show_its_origin_is_armed_again_on_the_word_that_the_handle_stands_at_the_start() {
        let asked = |rearms_at_start, rig_trials_due| {
            let motor = CommandQuestions::for_motor(true, rearms_at_start, false);
            motor.before(Event::Rearm, Effect::None, rig_trials_due).unwrap().to_owned()
        };
        for rig_trials_due in [false, true] {
            assert!(asked(true, rig_trials_due).starts_with(REARMS_AT_START));
            assert!(!asked(false, rig_trials_due).contains(REARMS_AT_START));
        }
    }

    #[test]
    fn a_motor_asks_about_the_load_before_a_rig_trial_and_about_the_hand_only_after_them() {
        let motor = CommandQuestions::for_motor(false, false, false);
        for command in [Event::Start, Event::Rearm] {
            let question = motor.before(command, Effect::None, true).unwrap();
            assert!(
                !question.contains("subject's hand") && question.contains("hand in the handle"),
                "{question}"
            );
        }
        assert!(motor.before(Event::Resume, Effect::Begin, true).unwrap().contains("load mounted"));
        assert!(motor.before(Event::Resume, Effect::SeatSubject, true).unwrap().contains("subject's hand"));
        assert_eq!(motor.before(Event::Resume, Effect::None, true), None, "after a pause nothing moves yet");
    }
}
