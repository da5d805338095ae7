//! The operator's commands on their way to the control loop, and the notices on their way back.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::step_feed::SampleCounter;
use crate::dataset::{ActionOrigin, AuditEntry, AuditSender, OperatorAction};
use crate::rig::{Fault, MOTOR_MAY_HAVE_POWER, Vitals};
use crate::session::{Event, Machine, MotionDeviation, Operator, Phase};

/// Number of commands that can wait for the control loop.
const COMMAND_CAPACITY: usize = 64;
/// Time between two checks for a command while the rig is disarmed.
const COMMAND_POLL: Duration = Duration::from_millis(2);

/// Whether a command moves the motor or cannot be undone; the operator must confirm it.
pub fn needs_confirmation(command: Event) -> bool {
    matches!(command, Event::Start | Event::Rearm | Event::Abort | Event::Skip | Event::Repeat)
}

/// Sends the operator's commands to the control loop and writes them into the journal.
#[derive(Debug, Clone)]
pub struct CommandSender(Arc<SharedCommands>);

#[derive(Debug)]
struct SharedCommands {
    commands: Mutex<Producer<Event>>,
    pause_after_trial: AtomicBool,
    journal: AuditSender,
    notices: Mutex<mpsc::Sender<OperatorNotice>>,
    counter: SampleCounter,
    vitals: SharedVitals,
    /// Ends the session at once.
    stop: Arc<AtomicBool>,
}

/// A notice for the operator to read.
#[derive(Debug, Clone, PartialEq)]
pub enum OperatorNotice {
    /// An action at a console was written into the journal.
    Action(AuditEntry),
    /// A fault, or an action that was not kept.
    Alarm(String),
    /// What happened and asks for nothing.
    Message(String),
}

/// The latest [`Vitals`] of the control loop.
#[derive(Debug, Default)]
struct SharedVitals {
    periods: AtomicU64,
    late_p99_us: AtomicU64,
    latest_us: AtomicU64,
    missed: AtomicU64,
    /// Bits of the bus load as `f64`; NaN without a bus.
    bus_load: AtomicU64,
    bus_errors: AtomicU64,
}

impl CommandSender {
    /// Makes the operator's end, the control loop's end and the receiver of notices. When `stop` is set, the control loop
    /// receives an abort. With `starts_at_once` the first command is a start that needs no operator.
    pub fn new(
        journal: AuditSender,
        counter: SampleCounter,
        stop: Arc<AtomicBool>,
        starts_at_once: bool,
    ) -> (Self, CommandReceiver, mpsc::Receiver<OperatorNotice>) {
        let (commands, received) = RingBuffer::new(COMMAND_CAPACITY);
        let (notices, notices_received) = mpsc::channel();
        let vitals = SharedVitals { bus_load: AtomicU64::new(f64::NAN.to_bits()), ..SharedVitals::default() };
        let shared = Arc::new(SharedCommands {
            commands: Mutex::new(commands),
            pause_after_trial: AtomicBool::new(false),
            journal,
            notices: Mutex::new(notices),
            counter,
            vitals,
            stop: stop.clone(),
        });
        let receiver = CommandReceiver { shared: shared.clone(), commands: received, stop, starts_at_once };
        (Self(shared), receiver, notices_received)
    }

    /// Sends a command. The session decides whether it is possible.
    pub fn send(&self, command: Event, origin: ActionOrigin) {
        self.record(OperatorAction::Commanded { command }, origin);
        if command == Event::Abort {
            // Heard even while the motor is being armed, when no command is taken from the queue.
            self.0.stop.store(true, Ordering::Relaxed);
        }
        // If the control loop has not yet taken the last 64 commands, this one is only journaled.
        let _ = self.0.commands.lock().unwrap_or_else(PoisonError::into_inner).push(command);
    }

    /// Asks for a pause as soon as it interrupts no trial; `action` is the reason for the journal.
    pub fn pause_after_trial(&self, action: OperatorAction, origin: ActionOrigin) {
        self.record(action, origin);
        self.0.pause_after_trial.store(true, Ordering::Release);
    }

    /// Writes an action into the journal.
    pub fn record(&self, action: OperatorAction, origin: ActionOrigin) {
        let entry = AuditEntry { sample: self.0.counter.sample(), origin, action };
        if self.0.journal.send(entry.clone()) {
            self.notify(OperatorNotice::Action(entry));
        } else if !matches!(entry.action, OperatorAction::Joined | OperatorAction::Left) {
            self.notify(OperatorNotice::Alarm("the session is over: this was not kept".to_owned()));
        }
    }

    /// The latest timing and bus load of the control loop.
    pub fn vitals(&self) -> Vitals {
        let vitals = &self.0.vitals;
        let read = |value: &AtomicU64| value.load(Ordering::Relaxed);
        Vitals {
            periods: read(&vitals.periods),
            late_p99_us: read(&vitals.late_p99_us),
            latest_us: read(&vitals.latest_us),
            missed: read(&vitals.missed),
            bus_load: Some(f64::from_bits(read(&vitals.bus_load))).filter(|load| load.is_finite()),
            bus_errors: read(&vitals.bus_errors),
        }
    }

    /// Shows the operator something that needs attention.
    pub fn alarm(&self, text: &str) {
        self.notify(OperatorNotice::Alarm(text.to_owned()));
    }

    /// Shows the operator a notice.
    pub fn notify(&self, notice: OperatorNotice) {
        // The receiver is gone once the console is closed.
        let _ = self.0.notices.lock().unwrap_or_else(PoisonError::into_inner).send(notice);
    }
}

/// The control loop's end: receives the operator's commands.
#[derive(Debug)]
pub struct CommandReceiver {
    shared: Arc<SharedCommands>,
    commands: Consumer<Event>,
    stop: Arc<AtomicBool>,
    starts_at_once: bool,
}

impl CommandReceiver {
    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Turns a requested pause into a command once the pause interrupts no measurement: during a ramp the session notes
    /// it, during a rest the session pauses at once.
    fn due_pause(&mut self, phase: Phase) -> Option<Event> {
        if !self.shared.pause_after_trial.load(Ordering::Acquire) {
            return None;
        }
        match phase {
            Phase::RigSettle
            | Phase::Offset
            | Phase::MvcEffort
            | Phase::Hold
            | Phase::Delay
            | Phase::Homing => None,
            Phase::Ready | Phase::Paused | Phase::Faulted | Phase::Finished | Phase::Aborted => {
                self.shared.pause_after_trial.store(false, Ordering::Release);
                None
            }
            _ => {
                self.shared.pause_after_trial.store(false, Ordering::Release);
                Some(Event::Pause)
            }
        }
    }
}

impl Operator for CommandReceiver {
    // Called at every sample: must not block, write or allocate.
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if self.is_stopped() {
            return Some(Event::Abort);
        }
        self.commands.pop().ok().or_else(|| self.due_pause(machine.phase()))
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if std::mem::take(&mut self.starts_at_once) && machine.phase() == Phase::Ready {
            return Event::Start;
        }
        loop {
            if self.is_stopped() {
                return Event::Abort;
            }
            if let Ok(command) = self.commands.pop() {
                return command;
            }
            self.due_pause(machine.phase());
            thread::sleep(COMMAND_POLL);
        }
    }

    // The console shows refused commands from the steps.
    fn command_refused(&mut self, _: Event, _: Phase) {}

    fn arming_failed(&mut self, fault: Fault) {
        let notice = OperatorNotice::Alarm(fault.told_when_not_armed());
        CommandSender(self.shared.clone()).notify(notice);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        let notice = OperatorNotice::Alarm(fault.told_when_armed());
        CommandSender(self.shared.clone()).notify(notice);
    }

    fn power_not_confirmed(&mut self) {
        CommandSender(self.shared.clone()).notify(OperatorNotice::Alarm(MOTOR_MAY_HAVE_POWER.to_owned()));
    }

    fn motion_deviated(&mut self, deviation: &MotionDeviation) {
        let notice =
            OperatorNotice::Alarm(format!("the trial is rejected and will be run again: {deviation}"));
        CommandSender(self.shared.clone()).notify(notice);
    }

    fn vitals(&mut self, vitals: Vitals) {
        let shared = &self.shared.vitals;
        let write = |target: &AtomicU64, value: u64| target.store(value, Ordering::Relaxed);
        write(&shared.periods, vitals.periods);
        write(&shared.late_p99_us, vitals.late_p99_us);
        write(&shared.latest_us, vitals.latest_us);
        write(&shared.missed, vitals.missed);
        write(&shared.bus_load, vitals.bus_load.unwrap_or(f64::NAN).to_bits());
        write(&shared.bus_errors, vitals.bus_errors);
    }
}
