//! The operator beside a motor, without a console: confirms arming at the terminal, ends the session on Ctrl-C.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::console::{CommandQuestions, SETS_ORIGIN_HERE};
use crate::rig::{Fault, MOTOR_MAY_HAVE_POWER};
use crate::session::{Event, Machine, MotionDeviation, Operator, Phase};

use super::Console;
use super::background_messages::BackgroundMessages;
use super::question::ask;

/// Asks at the terminal before the motor is armed.
pub struct MotorOperator {
    stop: Arc<AtomicBool>,
    /// Arming was confirmed on the command line (`--yes`).
    is_confirmed: bool,
    questions: CommandQuestions,
    messages: BackgroundMessages,
}

impl MotorOperator {
    /// Ends the session when `stop` is set. With `is_confirmed` the first arming needs no answer, and a message says if the
    /// present place of the handle becomes the start position (`sets_origin_here`). `questions` are those of the motor.
    pub fn new(
        stop: Arc<AtomicBool>,
        is_confirmed: bool,
        sets_origin_here: bool,
        questions: CommandQuestions,
        console: &Console,
    ) -> Self {
        let messages = BackgroundMessages::start(*console);
        if is_confirmed && sets_origin_here {
            messages.note(SETS_ORIGIN_HERE.to_owned());
        }
        Self { stop, is_confirmed, questions, messages }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Whether the operator agrees; without a question there is nothing to agree to.
    fn answers_yes(&self, question: Option<&str>) -> bool {
        let Some(question) = question else { return true };
        io::stdin().is_terminal()
            && ask(&format!("{question} Type yes: "), &self.stop).is_some_and(|answer| answer == "yes")
    }
}

impl Operator for MotorOperator {
    // Called at every sample: must not block, write or allocate.
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if self.is_stopped() {
            return Some(Event::Abort);
        }
        // The operator confirmed the homing after a fault; at the start position the session goes on.
        (machine.phase() == Phase::Paused).then_some(Event::Resume)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        self.messages.flush();
        let consents = !self.is_stopped()
            && match machine.phase() {
                Phase::Ready => self.is_confirmed || self.answers_yes(self.questions.start()),
                // `--yes` confirms one arming; after a fault somebody must look at the motor.
                Phase::Faulted => !self.is_confirmed && self.answers_yes(self.questions.rearm()),
                _ => false,
            };
        match machine.phase() {
            // Ctrl-C at the question is an answer, too.
            _ if !consents || self.is_stopped() => Event::Abort,
            Phase::Faulted => Event::Rearm,
            _ => Event::Start,
        }
    }

    fn command_refused(&mut self, command: Event, phase: Phase) {
        self.messages.note(format!("{} is not possible in phase {}", command.name(), phase.name()));
    }

    fn arming_failed(&mut self, fault: Fault) {
        self.messages.error(fault.told_when_not_armed());
        self.stop.store(true, Ordering::Relaxed);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.messages.error(fault.told_when_armed());
    }

    fn power_not_confirmed(&mut self) {
        self.messages.error(MOTOR_MAY_HAVE_POWER.to_owned());
    }

    fn motion_deviated(&mut self, deviation: &MotionDeviation) {
        self.messages.note(format!("the trial is rejected and will be run again: {deviation}"));
    }
}
