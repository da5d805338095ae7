//! The operator of a session that was started from a shell: starts it, and ends it on Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ramphold::rig::Fault;
use ramphold::session::{Event, Machine, Operator, Phase, Status};

use super::live::stop_on_signals;
use super::{Console, Failure};

/// Samples between two looks at the progress.
const PROGRESS_EVERY: u64 = 1024;

/// Speaks for the person at the shell.
pub struct CommandLineOperator {
    stop: Arc<AtomicBool>,
    bar: ProgressBar,
    console: Console,
}

impl CommandLineOperator {
    /// Listens to Ctrl-C and to the request to end; shows progress where someone can see it.
    pub fn new(machine: &Machine, console: &Console) -> Result<Self, Failure> {
        let stop = stop_on_signals()?;
        let target =
            if console.is_quiet() { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let planned = machine.progress().queue().len() as u64;
        let bar = ProgressBar::with_draw_target(Some(planned), target);
        let style = ProgressStyle::with_template("{bar:30} trial {pos} of {len}, {eta} left: {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Ok(Self { stop, bar, console: *console })
    }

    /// Takes the progress off the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn wants_to_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl Operator for CommandLineOperator {
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if machine.sample().is_multiple_of(PROGRESS_EVERY) {
            let ended = machine.progress().attempts().iter().filter_map(|attempt| attempt.ended);
            let ok = ended.filter(|(status, _)| *status == Status::Ok).count();
            self.bar.set_position(ok as u64);
            self.bar.set_message(machine.phase().name());
        }
        self.wants_to_stop().then_some(Event::Abort)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        match machine.phase() {
            Phase::Ready if !self.wants_to_stop() => Event::Start,
            // There is nobody here who could mend a fault.
            _ => Event::Abort,
        }
    }

    fn command_refused(&mut self, word: Event, phase: Phase) {
        self.console.message(format_args!("{} is not possible in phase {}", word.name(), phase.name()));
    }

    fn arming_failed(&mut self, fault: Fault) {
        self.console.error(format_args!("the rig could not be armed: {fault}"));
        self.stop.store(true, Ordering::Relaxed);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.console.error(format_args!("fault, the motor is safe: {fault}"));
    }
}
