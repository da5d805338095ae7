//! `ramphold run --rig FILE` with a motor on a CAN bus: the operator's word, the loop, and a thread that writes.

use std::io::{self, BufRead, IsTerminal};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ramphold::dataset::{Disk, NewSession, RecordError, RingRecorder};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::Fault;
use ramphold::rig::can::file::ValidRigFile;
use ramphold::rig::can::{CanMotor, Connection, DryRun, Summary};
use ramphold::schedule;
use ramphold::session::{AsFastAsItGoes, Event, Machine, Operator, Phase, Settings, conduct};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::run::{Run, drawn_seed, finish, subject_number};
use super::{Console, Failure};

/// Name of the file with what happened on the bus, in the session's folder.
const BUS: &str = "bus.json";

/// Whether a rig file says that its motor is on a CAN bus. What else is in it is not looked at yet.
pub fn is_on_can(file: &Path) -> bool {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let kind = serde_json::from_str::<serde_json::Value>(&text).ok().and_then(|rig| rig.get("kind").cloned());
    // A file that names no kind, or is not JSON, is a motor's: its reader says what is wrong, and nothing is armed.
    kind.is_none_or(|kind| kind != "virtual")
}

/// Runs a session on the motor.
pub fn run(verb: &Run, protocol: &ValidProtocol, file: &Path, console: &Console) -> Result<(), Failure> {
    let rig = ValidRigFile::read(file)?;
    let dry_run = DryRun::of(protocol, &rig)?;
    let subject = verb.subject.as_deref().ok_or_else(|| {
        Failure::Usage("whose wrist is in the motor? Give an identifier with --subject".to_owned())
    })?;
    let seed = verb.seed.unwrap_or_else(drawn_seed);
    let order = schedule::draw(protocol, seed, subject_number(subject))?;
    let motor = CanMotor::new(Connection::open(rig.clone())?, dry_run);
    let mut settings = Settings::new(protocol, seed, &order)?;
    settings.motion_delay_samples = motor.motion_delay_samples();
    let folder = verb.folder(subject, seed)?;
    let description: serde_json::Value = serde_json::from_str(rig.text()).unwrap_or_default();
    let recorder = NewSession { protocol, order: &order, seed, subject, lever: rig.lever, rig: &description }
        .create(&folder, Disk::default())?;
    console.message(format_args!("session {}, subject {subject}, seed {seed}", folder.display()));

    let mut machine = Machine::new(Arc::new(settings));
    let mut operator = AtTheMotor::new(verb.yes, console)?;
    let mut ring = RingRecorder::start(recorder, machine.clone());
    let ended = conduct(motor, &mut machine, &mut operator, &mut AsFastAsItGoes, &mut ring);
    let kept = ring.finish();
    let motor = ended?;
    kept?;
    keep_summary(&motor.summary(), &folder, console)?;
    finish(&machine, false, &folder, console)
}

fn keep_summary(summary: &Summary, folder: &Path, console: &Console) -> Result<(), Failure> {
    console.message(summary);
    let path = folder.join(BUS);
    let mut bytes = serde_json::to_vec_pretty(summary).unwrap_or_default();
    bytes.push(b'\n');
    Ok(Disk::default().write(&path, &bytes).map_err(RecordError::at(&path))?)
}

/// The operator beside the motor.
struct AtTheMotor {
    stop: Arc<AtomicBool>,
    /// The word was given on the command line.
    yes: bool,
    console: Console,
}

impl AtTheMotor {
    fn new(yes: bool, console: &Console) -> Result<Self, Failure> {
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, stop.clone()).map_err(Failure::Signals)?;
        }
        Ok(Self { stop, yes, console: *console })
    }

    fn says_yes_to(&self, question: &str) -> bool {
        if !io::stdin().is_terminal() {
            return false;
        }
        self.console.message(format_args!("{question} Type yes:"));
        let mut answer = String::new();
        io::stdin().lock().read_line(&mut answer).is_ok() && answer.trim() == "yes"
    }
}

impl Operator for AtTheMotor {
    // Called once a sample: it may not wait, write or ask for memory.
    fn heard(&mut self, machine: &Machine) -> Option<Event> {
        if self.stop.load(Ordering::Relaxed) {
            return Some(Event::Abort);
        }
        // The motor came back to the start position after a fault, on the operator's word.
        (machine.phase() == Phase::Paused).then_some(Event::Resume)
    }

    fn asked(&mut self, machine: &Machine) -> Event {
        if self.stop.load(Ordering::Relaxed) {
            return Event::Abort;
        }
        match machine.phase() {
            Phase::Ready
                if self.yes
                    || self.says_yes_to("The motor will be given power. Is everyone clear of it?") =>
            {
                Event::Start
            }
            // The word on the command line was for one arming; a fault needs eyes at the motor.
            Phase::Faulted
                if !self.yes
                    && self.says_yes_to("Is the cause mended? The motor will move to the start.") =>
            {
                Event::Rearm
            }
            _ => Event::Abort,
        }
    }

    fn refused(&mut self, word: Event, phase: Phase) {
        self.console.message(format_args!("{} is not possible in phase {}", word.name(), phase.name()));
    }

    fn not_armed(&mut self, fault: Fault) {
        self.console.error(format_args!("the motor was not armed: {fault}"));
        self.stop.store(true, Ordering::Relaxed);
    }

    fn faulted(&mut self, fault: Fault) {
        self.console.error(format_args!("fault, the motor was made safe: {fault}"));
    }
}
