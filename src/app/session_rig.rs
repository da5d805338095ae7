//! The rig of a session: from its rig file, or as the session's folder keeps it.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::console::CommandQuestions;
use crate::dataset::{self, Disk, RIG_FILE, RecordError, RecordedRig, Resumable, recorded_rig};
use crate::files::{self, Folder, limits};
use crate::json_file;
use crate::rig::can::file::ValidRigFile;
use crate::rig::can::{CanMotor, Connection, DryRun, OriginError, ResumedOrigin, Summary};
use crate::rig::virtual_wrist::{MechanismList, Person, RigFile, Seal, SealError, Setup, VirtualWrist};
use crate::rig::{RecordedSignals, StreamSettings};
use crate::signal::FilterSpec;
use crate::wrist::Lever;
use serde::Deserialize;
use serde_json::Value;

use super::question::ask;
use super::{Console, Failure, Pace};

/// The rig that a session runs on.
pub enum SessionRig {
    /// The virtual wrist.
    Virtual {
        /// The wrist and its servo.
        wrist: Box<VirtualWrist>,
        /// Lever between motor and handle.
        lever: Option<Lever>,
        /// Speed of the session.
        pace: Pace,
    },
    /// A motor on a CAN bus.
    Can(Box<CanMotor>),
}

impl SessionRig {
    /// The rig of a session that is to be resumed, from the session's folder. `hide` is the seed of its hidden effect;
    /// `home_here` is the operator's word that the handle of a motor stands at the start position.
    ///
    /// # Errors
    /// If the rig file cannot be used, or is not the one that the session began with.
    pub fn of_session(
        folder: &Path,
        session: &Resumable,
        pace: Pace,
        hide: Option<u64>,
        home_here: bool,
        console: &Console,
    ) -> Result<Self, Failure> {
        if ran_on_can_motor(folder)? {
            return Self::can_motor_of_session(folder, session, home_here, console);
        }
        if home_here {
            let why = "the session ran on the virtual wrist, which needs no homing";
            return Err(Failure::Usage(format!("--home-here: {why}")));
        }
        let StoredVirtualRig { rig: RigFile::Virtual(setup), subject, seal } =
            read_stored_virtual_rig(folder)?;
        let lever = setup.lever;
        let hidden = open_seal(seal.as_ref(), hide, lever, "--hide", folder)?;
        let setup = with_hidden_effect(setup, &hidden);
        let wrist = VirtualWrist::new(subject, setup, session.seed(), session.sample_rate_hz());
        Ok(Self::Virtual { wrist: Box::new(wrist), lever, pace })
    }

    fn can_motor_of_session(
        folder: &Path,
        session: &Resumable,
        home_here: bool,
        console: &Console,
    ) -> Result<Self, Failure> {
        let path = folder.join(RIG_FILE);
        let rig = ValidRigFile::parse(&read_rig_text(folder)?, &path.display().to_string())?;
        let Some(protocol) = dataset::stored_protocol(folder)? else {
            return Err(Failure::Usage(format!("{}: has no protocol.json; put it back", folder.display())));
        };
        let dry_run = DryRun::of(&protocol, &rig)?;
        let mut motor = CanMotor::new(Connection::open(rig)?, dry_run);
        if motor.motion_delay_samples() != session.motion_delay_samples() {
            return Err(Failure::Usage(format!(
                "{}: is not the rig that the session began with: its motor follows {} samples late, that one {}; \
                 put the rig.json of the session back",
                folder.join(RIG_FILE).display(),
                motor.motion_delay_samples(),
                session.motion_delay_samples()
            )));
        }
        match resume_origin(&mut motor, session.was_armed(), home_here)? {
            ResumedOrigin::FoundByMotor => {}
            ResumedOrigin::Kept { angle_rad } => console.message(format_args!(
                "the motor still has the start position of the session; the handle is {angle_rad:.4} rad from it"
            )),
            ResumedOrigin::SetAnew { .. } => console.message(
                "the start position is set anew, where the handle stands when the motor is armed; the journal keeps that",
            ),
        }
        Ok(Self::Can(Box::new(motor)))
    }

    /// Lever between motor and handle; `None` for a rigid one.
    pub fn lever(&self) -> Option<Lever> {
        match self {
            Self::Virtual { lever, .. } => *lever,
            Self::Can(motor) => motor.lever(),
        }
    }

    /// The filter that both angle and torque passed before they are recorded.
    pub fn recorded_filter(&self) -> Option<FilterSpec> {
        match self {
            Self::Virtual { .. } => None,
            Self::Can(motor) => motor.recorded_filter(),
        }
    }

    /// What is known of the recorded channels, of a rig that is sampled at `sample_rate_hz`.
    pub fn recorded_signals(&self, sample_rate_hz: f64) -> RecordedSignals {
        match self {
            Self::Virtual { wrist, .. } => wrist.recorded_signals(sample_rate_hz),
            Self::Can(motor) => motor.recorded_signals(),
        }
    }

    /// Whether somebody can say when the loads of rig trials are mounted: a virtual rig mounts them by itself.
    ///
    /// # Errors
    /// If rig trials are due on a motor, and the session has no console.
    pub fn check_operator(&self, has_console: bool, rig_trials_due: bool) -> Result<(), Failure> {
        if rig_trials_due && !has_console && matches!(self, Self::Can(_)) {
            return Err(Failure::Usage(
                "the protocol has rig trials, whose loads the operator mounts and confirms one after the other; run it with \
                 --console or --tui"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// Name of the rig for the operator.
    pub fn name(&self) -> &str {
        match self {
            Self::Virtual { .. } => "virtual wrist",
            Self::Can(motor) => motor.name(),
        }
    }

    /// What the operator is asked before the rig is armed.
    pub fn questions(&self) -> CommandQuestions {
        match self {
            Self::Virtual { .. } => CommandQuestions::for_virtual_wrist(),
            Self::Can(motor) => CommandQuestions::for_motor(
                motor.sets_origin_here(),
                motor.rearms_at_start(),
                motor.homes_by_moving(),
            ),
        }
    }

    /// The disk that a new session on this rig is written to. What was measured on a person in real time is lost for good if the machine
    /// dies before it is on the disk; a session in simulated time is run again.
    pub fn disk(&self) -> Disk {
        if self.may_wait() { Disk::synchronised_at_the_end() } else { Disk::default() }
    }

    /// Whether the control loop has no deadlines, so that it may wait for the disk and the console.
    pub fn may_wait(&self) -> bool {
        matches!(self, Self::Virtual { pace: Pace::Unlimited, .. })
    }
}

/// Decides how a resumed session gets its start position; asks at the terminal where the operator's word is needed.
fn resume_origin(
    motor: &mut CanMotor,
    was_armed: bool,
    home_here: bool,
) -> Result<ResumedOrigin, OriginError> {
    let needed = match motor.resume_origin(was_armed, home_here) {
        Err(needed @ OriginError::WordNeeded { .. }) if io::stdin().is_terminal() => needed,
        decided => return decided,
    };
    let question =
        format!("{needed}.\nIf the handle stands at the start position now, type \"{AT_START}\": ");
    match ask(&question, &AtomicBool::new(false)) {
        Some(answer) if answer == AT_START => motor.resume_origin(was_armed, true),
        _ => Err(needed),
    }
}

/// Answer by which the operator says that the handle stands at the start position.
const AT_START: &str = "at the start position";

/// Whether a rig file describes a motor on a CAN bus. The rest of the file is not checked here.
pub fn is_can_rig_file(file: &Path) -> bool {
    let text = files::read_text(file, limits::SETTINGS_BYTES).unwrap_or_default();
    let kind = serde_json::from_str::<Value>(&text).ok().and_then(|rig| rig.get("kind").cloned());
    // A file without a kind, or that is not JSON, goes to the motor's reader, which says what is wrong with it.
    kind.is_none_or(|kind| kind != "virtual")
}

/// The text of the rig file in a session's folder.
fn read_rig_text(session: &Path) -> Result<String, Failure> {
    let text = Folder::open(session).and_then(|folder| folder.read_text(RIG_FILE, limits::SETTINGS_BYTES));
    text.map_err(|source| Failure::Read { file: session.join(RIG_FILE).display().to_string(), source })
}

/// Whether the session in a folder ran on a motor.
///
/// # Errors
/// If `rig.json` is not there or cannot be read.
pub fn ran_on_can_motor(session: &Path) -> Result<bool, Failure> {
    match recorded_rig(session)? {
        Some(rig) => Ok(rig == RecordedRig::Motor),
        None => Err(Failure::Usage(format!(
            "{}: is not there; a session that this program ran has it",
            session.join(RIG_FILE).display()
        ))),
    }
}

/// The virtual rig with a hidden effect; an empty list changes nothing.
pub fn with_hidden_effect(mut setup: Setup, effect: &MechanismList) -> Setup {
    setup.mechanisms = setup.mechanisms.and(effect);
    setup
}

/// A virtual rig as the session's folder keeps it.
pub struct StoredVirtualRig {
    /// The rig.
    pub rig: RigFile,
    /// The virtual subject.
    pub subject: Person,
    /// The seal of the hidden effect, if there is one.
    pub seal: Option<Seal>,
}

/// What the file should be, for messages.
const RIG_RECORD: &str = "the rig.json of a session with a virtual wrist";

/// The content of the `rig.json` of a virtual session, before rig and subject are checked.
#[derive(Deserialize)]
struct RigRecord {
    #[serde(default)]
    rig: Value,
    #[serde(default)]
    person: Value,
    hidden: Option<Seal>,
}

/// Reads the virtual rig from the session's folder.
///
/// # Errors
/// If `rig.json` cannot be read or describes no virtual rig.
pub fn read_stored_virtual_rig(session: &Path) -> Result<StoredVirtualRig, Failure> {
    let path = session.join(RIG_FILE);
    let stored: RigRecord = json_file::parse(&read_rig_text(session)?, &path, RIG_RECORD)?;
    Ok(StoredVirtualRig {
        rig: RigFile::parse(&stored.rig.to_string(), &path)?,
        subject: Person::parse(&stored.person.to_string(), &path)?,
        seal: stored.hidden,
    })
}

/// The streams in the rig file of a session, which are recorded with it.
///
/// # Errors
/// If `rig.json` cannot be read or describes no rig.
pub fn stored_streams(session: &Path) -> Result<Vec<StreamSettings>, Failure> {
    if ran_on_can_motor(session)? {
        let path = session.join(RIG_FILE);
        let rig = ValidRigFile::parse(&read_rig_text(session)?, &path.display().to_string())?;
        return Ok(rig.streams.clone());
    }
    let RigFile::Virtual(setup) = read_stored_virtual_rig(session)?.rig;
    Ok(setup.streams)
}

/// The hidden effect of a session, which the seed given with `option` opens; an empty list for a session without one.
pub fn open_seal(
    seal: Option<&Seal>,
    seed: Option<u64>,
    lever: Option<Lever>,
    option: &str,
    session: &Path,
) -> Result<MechanismList, Failure> {
    let session = session.display();
    match (seal, seed) {
        (None, None) => Ok(MechanismList::default()),
        (Some(seal), Some(seed)) => seal.open(seed, lever).map_err(|error| match error {
            SealError::WrongSeed => {
                Failure::Usage(format!("{option} {seed}: is not the seed that {session} was run with --hide"))
            }
            SealError::Unknown(_) => {
                Failure::Usage(format!("{session}: {error}; open it with a newer version"))
            }
        }),
        (Some(_), None) => Err(Failure::Usage(format!(
            "{session}: was run with --hide, and its folder does not say what is hidden; expected the same seed as {option} SEED"
        ))),
        (None, Some(_)) => Err(Failure::Usage(format!(
            "{option}: {session} was run without --hide; nothing is hidden in it"
        ))),
    }
}

/// Writes the summary of a run on the bus: `bus.json`, and `bus-2.json`, `bus-3.json` when the session was resumed.
pub(super) fn write_bus_summary(summary: &Summary, folder: &Path, console: &Console) -> Result<(), Failure> {
    console.message(summary);
    let name = |run: u32| if run == 1 { "bus.json".to_owned() } else { format!("bus-{run}.json") };
    let opened = Folder::open(folder).map_err(RecordError::at(folder))?;
    let name = (1..).map(name).find(|name| !opened.contains(name)).unwrap_or_else(|| name(1));
    let text = json_file::pretty(summary);
    Ok(Disk::default()
        .write(&opened, &name, text.as_bytes())
        .map_err(RecordError::at(&folder.join(&name)))?)
}
