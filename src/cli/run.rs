//! `ramphold run`: a session from its protocol to its folder.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ramphold::console::{ConsoleSetup, Live};
use ramphold::dataset::{BackgroundRecorder, Disk, Manifest, NewSession, RecordError, Recorder, Resumable};
use ramphold::fit::{Model, Weighting};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::virtual_wrist::{
    MechanismList, Person, RigFile, Seal, Setup, VirtualWrist, draw_hidden_effect,
};
use ramphold::schedule;
use ramphold::session::{AsFastAsItGoes, Machine, Phase, RealTime, Settings, Status, run_control_loop};

use super::fit::{fit_session, table};
use super::live::{ConsoleOptions, Facts, see_off};
use super::model::add_model;
use super::operator::CommandLineOperator;
use super::report::write_report;
use super::resume::operators_word;
use super::run_motor;
use super::{Console, Failure, Verb};

/// Run a session of a protocol and write its folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold run protocols/quick.json --seed 1\n  \
                        ramphold run protocols/de-vlugt-2011.json --subject S03 --out sessions/s03")]
pub struct Run {
    /// The protocol file.
    protocol: PathBuf,
    /// The seed of every random draw; drawn and printed if not given.
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// The virtual person: a JSON file, or an identifier that a person is drawn from (the average one if not given).
    #[arg(long, value_name = "FILE|ID")]
    pub(super) subject: Option<String>,
    /// The session's folder, which must not be there yet; a new one under sessions/ if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The rig: a JSON file (the virtual wrist as it comes if not given).
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// At true speed rather than as fast as it goes; a motor always runs at true speed.
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// So many times true speed; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// A model file: the virtual wrist has its mechanisms, at the values given (the fit at the end stays the paper's).
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Hide an effect of the catalogue in the virtual wrist, drawn by this seed; the session's folder does not say which.
    /// `ramphold reveal` tells, and checks what a diagnosis made of it.
    #[arg(long, value_name = "SEED")]
    hide: Option<u64>,
    /// The operator's word that a motor may be armed, instead of asking for it; a virtual rig needs none.
    #[arg(long)]
    pub(super) yes: bool,
    #[command(flatten)]
    pub(super) desk: ConsoleOptions,
}

impl Verb for Run {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        self.desk.check()?;
        let pace = Pace::of(self.real_time, self.speed)?;
        if let Some(file) = self.rig.as_deref().filter(|file| run_motor::is_on_can(file)) {
            if self.hide.is_some() {
                return Err(Failure::Usage(format!(
                    "--hide: {} is a motor, and what moves on it is real; expected a virtual wrist",
                    file.display()
                )));
            }
            return run_motor::run(&self, &protocol, file, console);
        }
        let person = person(self.subject.as_deref())?;
        let mut rig = self.rig.as_deref().map(RigFile::read).transpose()?.unwrap_or_default();
        if let Some(model) = &self.model {
            let RigFile::Virtual(setup) = &mut rig;
            add_model(model, &person, setup)?;
        }
        let seed = self.seed.unwrap_or_else(drawn_seed);
        let order = schedule::draw(&protocol, seed, subject_number(&person.id))?;
        // A protocol was checked against its own amplitude; what is left is an order that was changed by hand.
        let settings = Settings::new(&protocol, seed, &order)?;
        let folder = self.folder(&person.id, seed)?;
        let RigFile::Virtual(setup) = &rig;
        operators_word(self.yes || rig.is_virtual(), &format!("subject {}", person.id))?;
        let hidden = self.hide.map(|seed| draw_hidden_effect(seed, setup.lever)).unwrap_or_default();
        let recorder = NewSession {
            protocol: &protocol,
            order: &order,
            seed,
            subject: &person.id,
            lever: setup.lever,
            rig: &rig_json(&rig, &person, self.hide.map(|seed| Seal::new(seed, &hidden))),
            motion_delay_samples: 0,
        }
        .create(&folder, Disk::default())?;
        console.message(format_args!("session {}, subject {}, seed {seed}", folder.display(), person.id));

        let facts = Facts {
            protocol: &protocol,
            subject: &person.id,
            lever: setup.lever,
            rig: "virtual wrist",
            folder: &folder,
            earlier: Vec::new(),
        };
        let plan = self.desk.plan(facts, self.yes, pace.is_patient())?;
        let setup = with_hidden(setup.clone(), &hidden);
        let wrist = VirtualWrist::new(person, setup, seed, settings.sample_rate_hz);
        let machine = Machine::new(Arc::new(settings));
        let (machine, live) = go_on(wrist, machine, recorder, pace, (&self.desk, plan), console)?;
        see_off(live, &folder, finish(&machine, false, &folder, console))
    }
}

impl Run {
    pub(super) fn folder(&self, subject: &str, seed: u64) -> Result<PathBuf, Failure> {
        let folder = match &self.out {
            Some(folder) => folder.clone(),
            None => {
                let stem = self.protocol.file_stem().unwrap_or_default().to_string_lossy();
                let subject: String =
                    subject.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
                new_folder(&Path::new("sessions").join(format!("{stem}-{subject}-{seed}")))
            }
        };
        if let Some(parent) = folder.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent).map_err(RecordError::at(parent))?;
        }
        Ok(folder)
    }
}

/// Contents of the session's `rig.json`: rig, subject, and the sealed hidden effect, if there is one.
fn rig_json(rig: &RigFile, person: &Person, seal: Option<Seal>) -> serde_json::Value {
    let mut kept = serde_json::json!({ "rig": rig, "person": person });
    if let (Some(seal), Some(fields)) = (seal, kept.as_object_mut()) {
        fields.insert("hidden".into(), serde_json::json!(seal));
    }
    kept
}

/// The rig with a hidden effect in it; an empty list changes nothing.
pub fn with_hidden(mut setup: Setup, effect: &MechanismList) -> Setup {
    setup.mechanisms = setup.mechanisms.and(effect);
    setup
}

/// `path`, or `path-2`, `path-3`... if it is there already.
pub(super) fn new_folder(path: &Path) -> PathBuf {
    let numbered = |number: u32| PathBuf::from(format!("{}-{number}", path.display()));
    if !path.exists() {
        return path.to_owned();
    }
    (2..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| path.to_owned())
}

/// How fast a session on the virtual wrist goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As fast as it goes.
    Free,
    /// So many times true speed.
    Times(f64),
}

impl Pace {
    /// What the options say.
    pub fn of(real_time: bool, speed: Option<f64>) -> Result<Self, Failure> {
        match speed {
            None if real_time => Ok(Self::Times(1.0)),
            None => Ok(Self::Free),
            Some(speed) if (0.01..=1000.0).contains(&speed) => Ok(Self::Times(speed)),
            Some(speed) => {
                Err(Failure::Usage(format!("--speed {speed}: expected a number from 0.01 to 1000")))
            }
        }
    }

    /// Whether nobody waits for the next sample.
    pub fn is_patient(self) -> bool {
        self == Self::Free
    }
}

/// Runs a session, new or resumed, until it is over; with the console that was asked for, which is still open then.
pub fn go_on(
    wrist: VirtualWrist,
    mut machine: Machine,
    mut recorder: Recorder,
    pace: Pace,
    (desk, plan): (&ConsoleOptions, Option<ConsoleSetup>),
    console: &Console,
) -> Result<(Machine, Option<Live>), Failure> {
    let rate_hz = machine.settings().sample_rate_hz;
    if let Some(plan) = plan {
        let live = match pace {
            Pace::Free => desk.conduct(plan, wrist, &mut machine, &mut AsFastAsItGoes, recorder, console)?.1,
            Pace::Times(speed) => {
                let mut clock = RealTime::new(speed * rate_hz);
                let live = desk.conduct(plan, wrist, &mut machine, &mut clock, recorder, console)?.1;
                console.message(clock.lateness());
                live
            }
        };
        return Ok((machine, Some(live)));
    }
    let mut operator = CommandLineOperator::new(&machine, console)?;
    let ended = if let Pace::Times(speed) = pace {
        let mut clock = RealTime::new(speed * rate_hz);
        let mut recorder = BackgroundRecorder::start(recorder);
        let ended = run_control_loop(wrist, &mut machine, &mut operator, &mut clock, &mut recorder);
        console.message(clock.lateness());
        // A disk that failed has already ended the session, and said why.
        ended.and_then(|_| recorder.finish())
    } else {
        run_control_loop(wrist, &mut machine, &mut operator, &mut AsFastAsItGoes, &mut recorder).map(|_| ())
    };
    operator.finish();
    ended?;
    Ok((machine, None))
}

/// Says what became of the trials, fits them if the session was (or is now) finished, writes the results, and takes
/// stock of it all.
pub fn finish(
    machine: &Machine,
    was_finished: bool,
    folder: &Path,
    console: &Console,
) -> Result<(), Failure> {
    let count = |wanted: Status| {
        let measured = machine.progress().attempts().iter().filter(|attempt| !attempt.planned.key.practice);
        measured.filter(|attempt| matches!(attempt.ended, Some((status, _)) if status == wanted)).count()
    };
    console.message(format_args!(
        "{} trials ok, {} rejected, {} aborted; {}",
        count(Status::Ok),
        count(Status::Rejected),
        count(Status::Aborted),
        folder.display()
    ));
    // From here to the end nobody else may go on with the session either.
    let _held = Resumable::open(folder, Disk::default())?;
    let disk = Disk::default();
    let is_virtual = !run_motor::was_on_can(folder);
    if !was_finished && machine.phase() != Phase::Finished {
        Manifest::take(folder, is_virtual)?.write(&disk, folder)?;
        return Err(Failure::Ended { folder: folder.to_owned(), left: machine.progress().queue().len() });
    }
    let results = fit_session(folder, &Model::paper(), None, Weighting::default())?;
    results.write(&disk, &folder.join("results"))?;
    write_report(folder, &folder.join("results"), console)?;
    // Last: until it is there, the session counts as not brought to its end.
    Manifest::take(folder, is_virtual)?.write(&disk, folder)?;
    table(console, &results)
}

/// A file if there is one, or a name that looks like one; else the person drawn from the identifier.
fn person(subject: Option<&str>) -> Result<Person, Failure> {
    let in_identifier = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    match subject {
        None => Ok(Person::default()),
        Some(file) if file.ends_with(".json") || Path::new(file).is_file() => {
            Ok(Person::read(Path::new(file))?)
        }
        Some(id) if !id.is_empty() && id.chars().all(in_identifier) => Ok(Person::drawn(id)),
        Some(other) => Err(Failure::Usage(format!(
            "--subject {other:?}: is no file, and no identifier; expected the JSON file of a person, or letters, digits, \
             -, _ and . such as S03"
        ))),
    }
}

/// The number in an identifier: 3 in `S03`.
pub(super) fn subject_number(id: &str) -> Option<u32> {
    let digits = id.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
    digits.parse().ok().filter(|number| *number > 0)
}

/// Short enough to be typed again.
pub(super) fn drawn_seed() -> u64 {
    RandomState::new().build_hasher().finish() >> 32
}
