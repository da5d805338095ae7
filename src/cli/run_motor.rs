//! `ramphold run --rig FILE` with a motor on a CAN bus: the operator's word, the loop, and a thread that writes.

use std::io::{self, BufRead, IsTerminal};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ramphold::console::{ConsoleSetup, Live};
use ramphold::dataset::{BackgroundRecorder, Disk, NewSession, RecordError, Recorder};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::Fault;
use ramphold::rig::can::file::ValidRigFile;
use ramphold::rig::can::{CanMotor, Connection, DryRun, Summary};
use ramphold::schedule;
use ramphold::session::{AsFastAsItGoes, Event, Machine, Operator, Phase, Settings, run_control_loop};

use super::live::{ConsoleOptions, Facts, see_off, stop_on_signals};
use super::run::{Run, drawn_seed, finish, subject_number};
use super::{Console, Failure};

/// Name of the file with the rig, in the session's folder.
const RIG: &str = "rig.json";

/// Whether a rig file says that its motor is on a CAN bus. What else is in it is not looked at yet.
pub fn is_on_can(file: &Path) -> bool {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let kind = serde_json::from_str::<serde_json::Value>(&text).ok().and_then(|rig| rig.get("kind").cloned());
    // A file that names no kind, or is not JSON, is a motor's: its reader says what is wrong, and nothing is armed.
    kind.is_none_or(|kind| kind != "virtual")
}

/// Whether the session in a folder ran with a motor on a CAN bus.
pub fn was_on_can(session: &Path) -> bool {
    // The rig of a virtual session is kept with its person, one level down.
    let text = std::fs::read_to_string(session.join(RIG)).unwrap_or_default();
    serde_json::from_str::<serde_json::Value>(&text).is_ok_and(|rig| rig.get("kind").is_some())
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
    let recorder = NewSession {
        protocol,
        order: &order,
        seed,
        subject,
        lever: rig.lever,
        rig: &description,
        motion_delay_samples: settings.motion_delay_samples,
    }
    .create(&folder, Disk::default())?;
    console.message(format_args!("session {}, subject {subject}, seed {seed}", folder.display()));
    let machine = Machine::new(Arc::new(settings));
    let facts =
        Facts { protocol, subject, lever: rig.lever, rig: &rig.name, folder: &folder, earlier: Vec::new() };
    let plan = verb.desk.plan(facts, verb.yes, false)?;
    let (machine, live) = go_on(motor, machine, recorder, verb.yes, (&verb.desk, plan), console)?;
    see_off(live, &folder, finish(&machine, false, &folder, console))
}

/// The motor of a session that is gone on with: the rig and the protocol are those that its folder keeps.
pub fn motor_of(session: &Path) -> Result<CanMotor, Failure> {
    let rig = ValidRigFile::read(&session.join(RIG))?;
    let protocol = ValidProtocol::read(&session.join("protocol.json"))?;
    let dry_run = DryRun::of(&protocol, &rig)?;
    Ok(CanMotor::new(Connection::open(rig)?, dry_run))
}

/// Runs a session, new or resumed, until it is over; then sums up what happened on the bus.
pub fn go_on(
    motor: CanMotor,
    mut machine: Machine,
    recorder: Recorder,
    yes: bool,
    (desk, plan): (&ConsoleOptions, Option<ConsoleSetup>),
    console: &Console,
) -> Result<(Machine, Option<Live>), Failure> {
    let folder = recorder.folder().to_owned();
    if let Some(plan) = plan {
        let (motor, live) =
            desk.conduct(plan, motor, &mut machine, &mut AsFastAsItGoes, recorder, console)?;
        keep_summary(&motor.summary(), &folder, console)?;
        return Ok((machine, Some(live)));
    }
    let mut operator = AtTheMotor::new(yes, console)?;
    let mut recorder = BackgroundRecorder::start(recorder);
    let ended = run_control_loop(motor, &mut machine, &mut operator, &mut AsFastAsItGoes, &mut recorder);
    let kept = recorder.finish();
    let motor = ended?;
    kept?;
    keep_summary(&motor.summary(), &folder, console)?;
    Ok((machine, None))
}

/// Each run of a session has a file of its own: `bus.json`, and `bus-2.json`, `bus-3.json` when it was resumed.
fn keep_summary(summary: &Summary, folder: &Path, console: &Console) -> Result<(), Failure> {
    console.message(summary);
    let name = |run: u32| if run == 1 { "bus.json".to_owned() } else { format!("bus-{run}.json") };
    let path = (1..).map(|run| folder.join(name(run))).find(|path| !path.exists());
    let path = path.unwrap_or_else(|| folder.join(name(1)));
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
        Ok(Self { stop: stop_on_signals()?, yes, console: *console })
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
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if self.stop.load(Ordering::Relaxed) {
            return Some(Event::Abort);
        }
        // The motor came back to the start position after a fault, on the operator's word.
        (machine.phase() == Phase::Paused).then_some(Event::Resume)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
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

    fn command_refused(&mut self, word: Event, phase: Phase) {
        self.console.message(format_args!("{} is not possible in phase {}", word.name(), phase.name()));
    }

    fn arming_failed(&mut self, fault: Fault) {
        self.console.error(format_args!("the motor was not armed: {fault}"));
        self.stop.store(true, Ordering::Relaxed);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.console.error(format_args!("fault, the motor was made safe: {fault}"));
    }
}
