//! `ramphold resume`: goes on with a session after any end.

use std::fs;
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

use ramphold::console::ConsoleSetup;
use ramphold::dataset::{self, Disk, Resumable, Resumed};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::can::CanMotor;
use ramphold::rig::virtual_wrist::{MechanismList, Person, RigFile, Seal, SealError, VirtualWrist};
use ramphold::wrist::Lever;
use serde::Deserialize;
use serde_json::Value;

use super::live::{ConsoleOptions, Facts, see_off};
use super::run::{Pace, finish, go_on, with_hidden};
use super::run_motor;
use super::{Console, Failure, Verb};

/// Go on with a session that was stopped, killed or ended by a fault.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold resume sessions/quick-V00-7\n  ramphold resume sessions/quick-V00-7 --yes\n\n\
                        The trial that was under way is kept, marked as aborted, and run again later."
)]
pub struct Resume {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// The operator's word that the motor may move.
    #[arg(long)]
    yes: bool,
    /// The seed of the effect that `run --hide` hid, if the session has one.
    #[arg(long, value_name = "SEED")]
    hide: Option<u64>,
    /// At true speed rather than as fast as it goes.
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// So many times true speed; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    #[command(flatten)]
    desk: ConsoleOptions,
}

impl Verb for Resume {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let has_console = self.desk.check()?;
        let pace = Pace::of(self.real_time, self.speed)?;
        let session = Resumable::open(&self.session, Disk::default())?;
        if session.is_complete() {
            let folder = self.session.display();
            console.message(format_args!(
                "every trial is done and the results are there; nothing was changed. Make them anew with: ramphold fit {folder}"
            ));
            return Ok(());
        }
        let (subject, seed, left) = (session.subject().to_owned(), session.seed(), session.left());
        let is_finished = session.is_finished();
        // Whatever is wrong with the rig is said before anything in the folder is changed.
        let rig = if is_finished { None } else { Some(self.rig(&session)?) };
        if let (Some(Motor::Virtual(..)), false) = (&rig, has_console) {
            let what = format!("subject {subject}: {left} trials left to do");
            operators_word(self.yes, &what)?;
        }
        let Resumed { recorder, machine, interrupted, torn } = session.resume()?;
        if let Some(torn) = torn {
            console.message(format_args!(
                "the journal was torn at byte {}: {} bytes cut off ({})",
                torn.offset, torn.length, torn.reason
            ));
        }
        if let Some(trial) = interrupted {
            console.message(format_args!(
                "trial {} was under way: kept with {} samples, marked as aborted, put back",
                trial.number, trial.samples
            ));
        }
        let Some(rig) = rig else {
            console.message(format_args!("every trial is done; making the results"));
            drop(recorder);
            return finish(&machine, true, &self.session, console);
        };
        console.message(format_args!("session {}, subject {subject}, seed {seed}", self.session.display()));
        let plan = if has_console { self.plan(&rig, &subject, pace)? } else { None };
        let desk = (&self.desk, plan);
        let (machine, live) = match rig {
            Motor::Virtual(wrist, _) => go_on(*wrist, machine, recorder, pace, desk, console)?,
            Motor::Can(motor) => run_motor::go_on(*motor, machine, recorder, self.yes, desk, console)?,
        };
        see_off(live, &self.session, finish(&machine, false, &self.session, console))
    }
}

/// What the session goes on with.
enum Motor {
    Virtual(Box<VirtualWrist>, Option<Lever>),
    Can(Box<CanMotor>),
}

impl Resume {
    /// The console that was asked for.
    fn plan(&self, rig: &Motor, subject: &str, pace: Pace) -> Result<Option<ConsoleSetup>, Failure> {
        let protocol = ValidProtocol::read(&self.session.join("protocol.json"))?;
        let (lever, rig, is_patient) = match rig {
            Motor::Virtual(_, lever) => (*lever, "virtual wrist".to_owned(), pace.is_patient()),
            Motor::Can(motor) => (motor.lever(), motor.name().to_owned(), false),
        };
        let earlier = dataset::load(&self.session)?.trials;
        let folder = &self.session;
        let facts = Facts { protocol: &protocol, subject, lever, rig: &rig, folder, earlier };
        self.desk.plan(facts, self.yes, is_patient)
    }

    fn rig(&self, session: &Resumable) -> Result<Motor, Failure> {
        if !run_motor::was_on_can(&self.session) {
            let Kept { rig: RigFile::Virtual(setup), person, seal } = kept(&self.session)?;
            let lever = setup.lever;
            let hidden = open_seal(seal.as_ref(), self.hide, lever, "--hide", &self.session)?;
            let setup = with_hidden(setup, &hidden);
            let wrist = VirtualWrist::new(person, setup, session.seed(), session.sample_rate_hz());
            return Ok(Motor::Virtual(Box::new(wrist), lever));
        }
        let motor = run_motor::motor_of(&self.session)?;
        if motor.motion_delay_samples() != session.motion_delay_samples() {
            return Err(Failure::Usage(format!(
                "{}: is not the rig that the session began with: its motor follows {} samples late, that one {}; \
                 put the rig.json of the session back",
                self.session.join("rig.json").display(),
                motor.motion_delay_samples(),
                session.motion_delay_samples()
            )));
        }
        Ok(Motor::Can(Box::new(motor)))
    }
}

/// The rig and the person as the session's folder keeps them, and the seal of what is hidden in the rig.
pub struct Kept {
    /// The rig.
    pub rig: RigFile,
    /// The person.
    pub person: Person,
    /// The seal of the hidden effect, if there is one.
    pub seal: Option<Seal>,
}

/// Reads them.
pub fn kept(session: &Path) -> Result<Kept, Failure> {
    let path = session.join("rig.json");
    let file = path.display().to_string();
    let text = fs::read_to_string(&path).map_err(|source| Failure::Read { file: file.clone(), source })?;
    let not_a_rig = |error: &dyn std::fmt::Display| {
        Failure::Usage(format!("{file}: {error}; expected the rig of the session"))
    };
    let kept: Value = serde_json::from_str(&text).map_err(|error| not_a_rig(&error))?;
    let part = |name: &str| kept.get(name).map(Value::to_string).unwrap_or_default();
    let seal = kept.get("hidden").map(Seal::deserialize).transpose().map_err(|error| not_a_rig(&error))?;
    Ok(Kept {
        rig: RigFile::parse(&part("rig"), &path)?,
        person: Person::parse(&part("person"), &path)?,
        seal,
    })
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

/// The rig comes up disarmed: someone must say that it may move.
pub fn operators_word(given: bool, what: &str) -> Result<(), Failure> {
    if given {
        return Ok(());
    }
    let (stdin, mut stderr) = (std::io::stdin(), std::io::stderr());
    if !stdin.is_terminal() {
        return Err(Failure::NoWord);
    }
    write!(stderr, "{what}. May the motor move? Type yes: ")?;
    stderr.flush()?;
    let mut answer = String::new();
    stdin.lock().read_line(&mut answer)?;
    if answer.trim() == "yes" { Ok(()) } else { Err(Failure::NoWord) }
}
