//! What goes into the loop: the operator's words, through a ring, and how the loop hears them.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::step_feed::SampleCounter;
use crate::dataset::{ActionOrigin, AuditEntry, AuditSender, OperatorAction};
use crate::rig::{Fault, Vitals};
use crate::session::{Event, Machine, Operator, Phase};

/// Words that may wait for the loop.
const ROOM: usize = 64;
/// How often a session that waits for a word looks for one.
const IDLE: Duration = Duration::from_millis(2);

/// The operator's end: whatever console it is, what is said goes this way, and into the journal.
#[derive(Debug, Clone)]
pub struct CommandSender(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    words: Mutex<Producer<Event>>,
    pause_after_trial: AtomicBool,
    remarks: AuditSender,
    told: Mutex<mpsc::Sender<OperatorNotice>>,
    place: SampleCounter,
    gauges: SharedVitals,
}

/// Something for the operator to read.
#[derive(Debug, Clone, PartialEq)]
pub enum OperatorNotice {
    /// Done at a console.
    Did(AuditEntry),
    /// Gone wrong.
    Alarm(String),
}

/// The last [`Vitals`] of the loop.
#[derive(Debug, Default)]
struct SharedVitals {
    periods: AtomicU64,
    late_p99_us: AtomicU64,
    latest_us: AtomicU64,
    missed: AtomicU64,
    /// The bits of the load as a floating-point number; that of no bus is not a number.
    bus_load: AtomicU64,
    bus_errors: AtomicU64,
}

impl CommandSender {
    /// The two ends, and what the operator is told. `stop` is set where the session is to end at once.
    pub fn new(
        remarks: AuditSender,
        place: SampleCounter,
        stop: Arc<AtomicBool>,
        starts_at_once: bool,
    ) -> (Self, CommandReceiver, mpsc::Receiver<OperatorNotice>) {
        let (words, heard) = RingBuffer::new(ROOM);
        let (told, telling) = mpsc::channel();
        let gauges = SharedVitals { bus_load: AtomicU64::new(f64::NAN.to_bits()), ..SharedVitals::default() };
        let shared = Arc::new(Shared {
            words: Mutex::new(words),
            pause_after_trial: AtomicBool::new(false),
            remarks,
            told: Mutex::new(told),
            place,
            gauges,
        });
        let listener = CommandReceiver { shared: shared.clone(), words: heard, stop, starts_at_once };
        (Self(shared), listener, telling)
    }

    /// A word for the session. Whether it is possible is the session's to say.
    pub fn say(&self, word: Event, desk: ActionOrigin) {
        self.note(OperatorAction::Said { word }, desk);
        // Sixty words that the loop did not hear yet say enough; more of them are in the journal alone.
        let _ = self.0.words.lock().unwrap_or_else(PoisonError::into_inner).push(word);
    }

    /// The session is to pause as soon as no trial is broken off by it.
    pub fn pause_after_trial(&self, deed: OperatorAction, desk: ActionOrigin) {
        self.note(deed, desk);
        self.0.pause_after_trial.store(true, Ordering::Release);
    }

    /// Keeps what was done in the journal.
    pub fn note(&self, deed: OperatorAction, desk: ActionOrigin) {
        let remark = AuditEntry { sample: self.0.place.sample(), desk, deed };
        if self.0.remarks.send(remark.clone()) {
            self.tell(OperatorNotice::Did(remark));
        } else if !matches!(remark.deed, OperatorAction::Joined | OperatorAction::Left) {
            self.tell(OperatorNotice::Alarm("the session is over: this was not kept".to_owned()));
        }
    }

    /// How the loop fares.
    pub fn vitals(&self) -> Vitals {
        let gauges = &self.0.gauges;
        let read = |gauge: &AtomicU64| gauge.load(Ordering::Relaxed);
        Vitals {
            periods: read(&gauges.periods),
            late_p99_us: read(&gauges.late_p99_us),
            latest_us: read(&gauges.latest_us),
            missed: read(&gauges.missed),
            bus_load: Some(f64::from_bits(read(&gauges.bus_load))).filter(|load| load.is_finite()),
            bus_errors: read(&gauges.bus_errors),
        }
    }

    fn tell(&self, told: OperatorNotice) {
        // Nobody reads it any more when the console closes.
        let _ = self.0.told.lock().unwrap_or_else(PoisonError::into_inner).send(told);
    }
}

/// The loop's end.
#[derive(Debug)]
pub struct CommandReceiver {
    shared: Arc<Shared>,
    words: Consumer<Event>,
    stop: Arc<AtomicBool>,
    starts_at_once: bool,
}

impl CommandReceiver {
    fn wants_to_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// The wish for a pause becomes the word when no measurement is broken off by it. A ramp notes it; in a rest the
    /// session pauses at once.
    fn due_pause(&mut self, phase: Phase) -> Option<Event> {
        if !self.shared.pause_after_trial.load(Ordering::Acquire) {
            return None;
        }
        match phase {
            Phase::Offset | Phase::MvcEffort | Phase::Hold | Phase::Delay | Phase::Homing => None,
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
    // Called once a sample: it may not wait, write or ask for memory.
    fn heard(&mut self, machine: &Machine) -> Option<Event> {
        if self.wants_to_stop() {
            return Some(Event::Abort);
        }
        self.words.pop().ok().or_else(|| self.due_pause(machine.phase()))
    }

    fn asked(&mut self, machine: &Machine) -> Event {
        if std::mem::take(&mut self.starts_at_once) && machine.phase() == Phase::Ready {
            return Event::Start;
        }
        loop {
            if self.wants_to_stop() {
                return Event::Abort;
            }
            if let Ok(word) = self.words.pop() {
                return word;
            }
            self.due_pause(machine.phase());
            thread::sleep(IDLE);
        }
    }

    // The journal has it, and the console shows it.
    fn refused(&mut self, _: Event, _: Phase) {}

    fn not_armed(&mut self, fault: Fault) {
        CommandSender(self.shared.clone())
            .tell(OperatorNotice::Alarm(format!("the rig could not be armed: {fault}")));
    }

    fn faulted(&mut self, fault: Fault) {
        CommandSender(self.shared.clone())
            .tell(OperatorNotice::Alarm(format!("fault, the motor is safe: {fault}")));
    }

    fn vitals(&mut self, vitals: Vitals) {
        let gauges = &self.shared.gauges;
        let write = |gauge: &AtomicU64, value: u64| gauge.store(value, Ordering::Relaxed);
        write(&gauges.periods, vitals.periods);
        write(&gauges.late_p99_us, vitals.late_p99_us);
        write(&gauges.latest_us, vitals.latest_us);
        write(&gauges.missed, vitals.missed);
        write(&gauges.bus_load, vitals.bus_load.unwrap_or(f64::NAN).to_bits());
        write(&gauges.bus_errors, vitals.bus_errors);
    }
}
