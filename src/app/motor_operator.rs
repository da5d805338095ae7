//! The operator beside a motor, without a console: confirms arming at the terminal, ends the session on Ctrl-C.

use std::io::{self, BufRead, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::rig::Fault;
use crate::session::{Event, Machine, Operator, Phase};

use super::signals::stop_on_signals;
use super::{Console, Failure};

/// Asks at the terminal before the motor is armed.
pub struct MotorOperator {
    stop: Arc<AtomicBool>,
    /// Arming was confirmed on the command line (`--yes`).
    is_confirmed: bool,
    console: Console,
}

impl MotorOperator {
    /// Listens to SIGINT and SIGTERM. With `is_confirmed` the first arming needs no answer.
    pub fn new(is_confirmed: bool, console: &Console) -> Result<Self, Failure> {
        Ok(Self { stop: stop_on_signals()?, is_confirmed, console: *console })
    }

    fn answers_yes(&self, question: &str) -> bool {
        if !io::stdin().is_terminal() {
            return false;
        }
        self.console.message(format_args!("{question} Type yes:"));
        let mut answer = String::new();
        io::stdin().lock().read_line(&mut answer).is_ok() && answer.trim() == "yes"
    }
}

impl Operator for MotorOperator {
    // Called at every sample: must not block, write or allocate.
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if self.stop.load(Ordering::Relaxed) {
            return Some(Event::Abort);
        }
        // The operator confirmed the homing after a fault; at the start position the session goes on.
        (machine.phase() == Phase::Paused).then_some(Event::Resume)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if self.stop.load(Ordering::Relaxed) {
            return Event::Abort;
        }
        match machine.phase() {
            Phase::Ready
                if self.is_confirmed
                    || self.answers_yes("The motor will be given power. Is everyone clear of it?") =>
            {
                Event::Start
            }
            // `--yes` confirms one arming; after a fault somebody must look at the motor.
            Phase::Faulted
                if !self.is_confirmed
                    && self.answers_yes(
                        "Has the fault been fixed? The motor will move to the start position.",
                    ) =>
            {
                Event::Rearm
            }
            _ => Event::Abort,
        }
    }

    fn command_refused(&mut self, command: Event, phase: Phase) {
        self.console.message(format_args!("{} is not possible in phase {}", command.name(), phase.name()));
    }

    fn arming_failed(&mut self, fault: Fault) {
        self.console.error(format_args!("the motor was not armed: {fault}"));
        self.stop.store(true, Ordering::Relaxed);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.console.error(format_args!("fault, the motor was made safe: {fault}"));
    }
}
