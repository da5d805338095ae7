//! The operator of a virtual session without a console: starts the session, ends it on Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::rig::virtual_wrist::LOAD_CHANGE_S;
use crate::rig::{Fault, MOTOR_MAY_HAVE_POWER};
use crate::session::{Event, Machine, MotionDeviation, Operator, Phase, Status};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::Console;

/// Samples between two updates of the progress bar.
const PROGRESS_PERIOD_SAMPLES: u64 = 1024;

/// Starts the session at once and shows its progress.
pub struct CommandLineOperator {
    stop: Arc<AtomicBool>,
    bar: ProgressBar,
    console: Console,
    /// Attempts that were made before this run of the program.
    earlier: usize,
}

impl CommandLineOperator {
    /// Ends the session when `stop` is set; shows a progress bar if standard error is a terminal.
    pub fn new(stop: Arc<AtomicBool>, machine: &Machine, console: &Console) -> Self {
        let target =
            if console.is_quiet() { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let planned = (ok_trials(machine) + machine.progress().queue().len()) as u64;
        let bar = ProgressBar::with_draw_target(Some(planned), target);
        let style = ProgressStyle::with_template("{bar:30} trial {pos} of {len}, {eta} left: {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self { stop, bar, console: *console, earlier: machine.progress().attempts().len() }
    }

    /// Removes the progress bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Measured trials that are done, those before a resume included.
fn ok_trials(machine: &Machine) -> usize {
    let measured = machine.progress().attempts().iter().filter(|attempt| !attempt.planned.key.practice);
    measured.filter(|attempt| matches!(attempt.ended, Some((Status::Ok, _)))).count()
}

impl Operator for CommandLineOperator {
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if machine.sample().is_multiple_of(PROGRESS_PERIOD_SAMPLES) {
            self.bar.set_position(ok_trials(machine) as u64);
            self.bar.set_message(machine.phase().name());
        }
        if !self.is_stopped()
            && let Some(failing) = machine.progress().every_trial_fails(self.earlier)
        {
            self.console.error(failing);
            self.stop.store(true, Ordering::Relaxed);
        }
        if self.is_stopped() {
            return Some(Event::Abort);
        }
        // A virtual rig mounts its loads by itself, in some time.
        (machine.awaits_mounting() && machine.in_phase_s() >= LOAD_CHANGE_S).then_some(Event::Resume)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        match machine.phase() {
            Phase::Ready if !self.is_stopped() => Event::Start,
            // Without a console nobody can say that a fault has been fixed.
            _ => Event::Abort,
        }
    }

    fn command_refused(&mut self, command: Event, phase: Phase) {
        self.console.message(format_args!("{} is not possible in phase {}", command.name(), phase.name()));
    }

    fn arming_failed(&mut self, fault: Fault) {
        self.console.error(fault.told_when_not_armed());
        self.stop.store(true, Ordering::Relaxed);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.console.error(fault.told_when_armed());
    }

    fn power_not_confirmed(&mut self) {
        self.console.error(MOTOR_MAY_HAVE_POWER);
    }

    // The motor of a virtual wrist harms nobody while this is written.
    fn motion_deviated(&mut self, deviation: &MotionDeviation) {
        self.console.message(format_args!("the trial is rejected and will be run again: {deviation}"));
    }
}
