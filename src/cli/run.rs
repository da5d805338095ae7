//! `ramphold run`: runs a session of a protocol.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::app::{
    Console, ConsoleOptions, Failure, Pace, SessionDescription, SessionRig, SessionRun, SessionStreams,
    UsedCalibration, add_mechanisms_of_model, check_out, draw_seed, is_can_rig_file, new_folder, now_utc,
    parse_seed, subject_number, utc_offset_s, with_hidden_effect,
};
use crate::dataset::{NewSession, RecordError, SessionAbout, Subject, Wrist};
use crate::files;
use crate::lsl::{LslFeed, LslLibrary, LslPublisher, MARKERS_STREAM, SIGNALS_STREAM};
use crate::protocol::ValidProtocol;
use crate::rig::can::file::ValidRigFile;
use crate::rig::can::{CanMotor, Connection, DryRun};
use crate::rig::virtual_wrist::{Person, RigFile, Seal, VirtualWrist, draw_hidden_effect};
use crate::rig::{RecordedSignals, StreamSettings, unmeasured_channels};
use crate::schedule;
use crate::session::{Machine, Settings};
use crate::wrist::Lever;

use super::verb::Verb;

/// Run a session of a protocol and write its folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold run protocols/quick.json --seed 1\n  \
                        ramphold run protocols/de-vlugt-2011.json --subject S03 --out sessions/s03")]
pub struct RunArgs {
    /// The protocol file.
    protocol: PathBuf,
    /// Seed of all random numbers [default: a new seed, which is printed].
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// Subject: an identifier, or the JSON file of a virtual subject. A virtual subject is drawn from its identifier [default:
    /// the average virtual subject]. Required with a motor.
    #[arg(long, value_name = "FILE|ID")]
    subject: Option<String>,
    /// Folder of the session, which must not exist [default: a new folder in sessions/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Rig file [default: the virtual wrist].
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Run in real time [default: as fast as possible]. A motor always runs in real time.
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// Run at this multiple of real time; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// Model file whose mechanisms the virtual wrist gets, with the given values. The fit at the end uses the paper's model.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Hide an effect of the catalogue in the virtual wrist, drawn with this seed. The session's folder does not say which;
    /// `ramphold reveal` does, and checks the diagnosis.
    #[arg(long, value_name = "SEED", allow_negative_numbers = true, value_parser = parse_seed)]
    hide: Option<u64>,
    /// The file of the rig's measured constants, as `ramphold calibrate` writes it; it is copied into the session's folder, and the
    /// analyses of the session use it.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Confirm that a motor may be armed, instead of being asked. A virtual rig needs no confirmation.
    #[arg(long)]
    yes: bool,
    /// Who runs the session; kept in session.json.
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    /// The hand that is measured, left or right; kept in session.json.
    #[arg(long, value_name = "HAND", value_enum)]
    hand: Option<Hand>,
    /// A field of the subject that session.json keeps, such as age=31 or condition=fatigued. May be given several times.
    #[arg(long, value_name = "FIELD=VALUE", value_parser = subject_field)]
    about: Vec<(String, String)>,
    /// Publish the session over Lab Streaming Layer: its samples, and a marker for each transition. Needs a motor, or --real-time.
    #[arg(long)]
    lsl: bool,
    /// The file of liblsl, for --lsl and for the streams of the rig file [default: where the operating system finds it].
    #[arg(long, value_name = "FILE")]
    lsl_library: Option<PathBuf>,
    #[command(flatten)]
    console: ConsoleOptions,
}

/// The hand that is measured.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Hand {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
}

/// Reads `FIELD=VALUE`.
fn subject_field(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some(("id", _)) => Err("the identifier is given with --subject".to_owned()),
        Some((field, value)) if !field.trim().is_empty() => {
            Ok((field.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected FIELD=VALUE, such as age=31".to_owned()),
    }
}

impl Verb for RunArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        self.console.check()?;
        let pace = Pace::new(self.real_time, self.speed)?;
        match self.rig.as_deref().filter(|file| is_can_rig_file(file)) {
            Some(file) => self.run_on_motor(&protocol, file, console),
            None if self.lsl && !self.real_time => Err(Failure::Usage(
                "--lsl: others see the session while it runs, so it must run in real time; add --real-time"
                    .to_owned(),
            )),
            None => self.run_on_virtual_wrist(&protocol, pace, console),
        }
    }
}

/// A new session before its folder is made.
struct Plan<'a> {
    seed: u64,
    subject: &'a str,
    order: Vec<schedule::ScheduledTrial>,
    settings: Settings,
    rig: SessionRig,
    /// Description of the rig for the session's folder.
    rig_json: serde_json::Value,
    lever: Option<Lever>,
    /// Streams that are recorded with the session.
    streams: Option<SessionStreams>,
}

impl RunArgs {
    fn run_on_virtual_wrist(
        &self,
        protocol: &ValidProtocol,
        pace: Pace,
        console: &Console,
    ) -> Result<(), Failure> {
        let subject = virtual_subject(self.subject.as_deref())?;
        let mut rig = self.rig.as_deref().map(RigFile::read).transpose()?.unwrap_or_default();
        if let Some(model) = &self.model {
            let RigFile::Virtual(setup) = &mut rig;
            add_mechanisms_of_model(model, &subject, setup)?;
        }
        let seed = self.seed.unwrap_or_else(draw_seed);
        let order = schedule::draw(protocol, seed, subject_number(&subject.id))?;
        let settings = Settings::new(protocol, seed, &order)?;
        let RigFile::Virtual(setup) = &rig;
        let lever = setup.lever;
        let hidden = self.hide.map(|seed| draw_hidden_effect(seed, lever)).unwrap_or_default();
        let rig_json = rig_json(&rig, &subject, self.hide.map(|seed| Seal::new(seed, &hidden)));
        let streams = self.connect_streams(&setup.streams, pace.is_real_time(), console)?;
        let setup = with_hidden_effect(setup.clone(), &hidden);
        let missing = unmeasured_channels(protocol, [setup.emg; 2]);
        if !missing.is_empty() {
            return Err(Failure::Usage(format!(
                "the virtual rig measures no EMG (field emg): {}; measure it, or change the protocol",
                missing.join("; ")
            )));
        }
        let wrist = VirtualWrist::new(subject.clone(), setup, seed, settings.sample_rate_hz);
        let rig = SessionRig::Virtual { wrist: Box::new(wrist), lever, pace };
        self.start(
            protocol,
            Plan { seed, subject: &subject.id, order, settings, rig, rig_json, lever, streams },
            console,
        )
    }

    fn run_on_motor(&self, protocol: &ValidProtocol, file: &Path, console: &Console) -> Result<(), Failure> {
        if self.hide.is_some() {
            return Err(Failure::Usage(format!(
                "--hide: {} describes a motor; an effect can only be hidden in a virtual wrist",
                file.display()
            )));
        }
        let rig = ValidRigFile::read(file)?;
        let dry_run = DryRun::of(protocol, &rig)?;
        let subject = self.subject.as_deref().ok_or_else(|| {
            Failure::Usage(
                "--subject is required with a motor; give the identifier of the subject".to_owned(),
            )
        })?;
        let seed = self.seed.unwrap_or_else(draw_seed);
        let order = schedule::draw(protocol, seed, subject_number(subject))?;
        // Before the bus is open: from then on, somebody must listen to it.
        let streams = self.connect_streams(&rig.streams, true, console)?;
        let motor = CanMotor::new(Connection::open(rig.clone())?, dry_run);
        let mut settings = Settings::new(protocol, seed, &order)?;
        settings.motion_delay_samples = motor.motion_delay_samples();
        let rig_json = serde_json::from_str(rig.text()).unwrap_or_default();
        let lever = rig.lever;
        let rig = SessionRig::Can(Box::new(motor));
        self.start(protocol, Plan { seed, subject, order, settings, rig, rig_json, lever, streams }, console)
    }

    /// Makes the session's folder and runs the session.
    fn start(&self, protocol: &ValidProtocol, plan: Plan, console: &Console) -> Result<(), Failure> {
        let Plan { seed, subject, order, settings, rig, rig_json, lever, streams } = plan;
        rig.check_operator(self.console.check()?, !settings.rig_plan.is_empty())?;
        let folder = self.folder(subject, seed)?;
        if files::exists(&folder) {
            return Err(RecordError::Exists(folder).into());
        }
        check_out("--out", &folder)?;
        if let Some(parent) = folder.parent() {
            files::make_folders(parent).map_err(RecordError::at(parent))?;
        }
        let calibration = self.calibration.as_deref().map(UsedCalibration::given).transpose()?.flatten();
        // A calibration that no analysis can use is found before a trial is run.
        UsedCalibration::constants(calibration.as_ref(), lever)?;
        let signals = rig.recorded_signals(settings.sample_rate_hz);
        // Before the folder is made: without the library there is no session.
        let lsl = self.publish(&settings, &signals, &folder, console)?;
        let recorder = NewSession {
            protocol,
            order: &order,
            seed,
            subject,
            lever,
            rig: &rig_json,
            calibration: calibration.as_ref().map(|own| own.bytes.as_slice()),
            about: &self.about(&rig),
            subject_fields: &self.subject_fields(),
            signals: &signals,
            motion_delay_samples: settings.motion_delay_samples,
        }
        .create(&folder, rig.disk())?;
        console.message(format_args!("session {}, subject {subject}, seed {seed}", folder.display()));
        let description = SessionDescription {
            protocol,
            subject,
            lever,
            recorded_filter: signals.recorded_filter,
            rig: rig.name(),
            questions: rig.questions(),
            folder: &folder,
            earlier_trials: Vec::new(),
        };
        let setup = self.console.setup(description, self.yes, rig.may_wait())?;
        let machine = Machine::new(Arc::new(settings));
        let (options, is_confirmed) = (&self.console, self.yes);
        SessionRun { folder, rig, machine, recorder, setup, options, is_confirmed, lsl, streams }.run(console)
    }

    /// Finds the streams of the rig file, if it has any.
    fn connect_streams(
        &self,
        streams: &[StreamSettings],
        in_real_time: bool,
        console: &Console,
    ) -> Result<Option<SessionStreams>, Failure> {
        let library = self.lsl_library.as_deref();
        if library.is_some() && !self.lsl && streams.is_empty() {
            return Err(Failure::Usage(
                "--lsl-library: nothing needs the library; expected --lsl, or a rig file with streams"
                    .to_owned(),
            ));
        }
        SessionStreams::connect(streams, library, in_real_time, console)
    }

    /// Publishes the session over Lab Streaming Layer, if that was asked for.
    fn publish(
        &self,
        settings: &Settings,
        signals: &RecordedSignals,
        folder: &Path,
        console: &Console,
    ) -> Result<Option<(LslPublisher, LslFeed)>, Failure> {
        if !self.lsl {
            return Ok(None);
        }
        let library = LslLibrary::load(self.lsl_library.as_deref())?;
        let emg = ["emg_fcr_mvc", "emg_ecr_mvc"].map(|column| signals.channels.contains_key(column));
        let source = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let delay = settings.motion_delay_samples;
        let (publisher, feed) = LslPublisher::start(library, settings.sample_rate_hz, delay, emg, &source)?;
        console.message(format_args!(
            "Lab Streaming Layer: streams {SIGNALS_STREAM:?} and {MARKERS_STREAM:?}, liblsl {}.{}",
            publisher.version() / 100,
            publisher.version() % 100
        ));
        Ok(Some((publisher, feed)))
    }

    /// When, who and what. A virtual session does not say when it was run: equal sessions have equal files.
    fn about(&self, rig: &SessionRig) -> SessionAbout {
        let is_virtual = matches!(rig, SessionRig::Virtual { .. });
        SessionAbout {
            started_utc: (!is_virtual).then(now_utc),
            utc_offset_s: if is_virtual { None } else { utc_offset_s() },
            clock: (!is_virtual).then(|| "system clock".to_owned()),
            operator: self.operator.clone(),
            hand: self.hand.map(|hand| match hand {
                Hand::Left => Wrist::Left,
                Hand::Right => Wrist::Right,
            }),
        }
    }

    /// The fields of the subject; a number is kept as a number.
    fn subject_fields(&self) -> serde_json::Map<String, serde_json::Value> {
        let value = |text: &str| match text.parse::<f64>() {
            Ok(number) if number.is_finite() => serde_json::from_str(text).unwrap_or_else(|_| text.into()),
            _ => text.into(),
        };
        self.about.iter().map(|(field, text)| (field.clone(), value(text))).collect()
    }

    /// The session's folder, which is not there yet.
    fn folder(&self, subject: &str, seed: u64) -> Result<PathBuf, Failure> {
        let folder = match &self.out {
            Some(folder) => folder.clone(),
            None => {
                let stem = self.protocol.file_stem().unwrap_or_default().to_string_lossy();
                let subject: String =
                    subject.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
                new_folder(&Path::new("sessions").join(format!("{stem}-{subject}-{seed}")))
            }
        };
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

/// The virtual subject: from a JSON file, or drawn from an identifier.
fn virtual_subject(subject: Option<&str>) -> Result<Person, Failure> {
    match subject {
        None => Ok(Person::default()),
        Some(file) if file.ends_with(".json") || Path::new(file).is_file() => {
            Ok(Person::read(Path::new(file))?)
        }
        Some(id) if Subject::is_identifier(id) => Ok(Person::drawn(id)),
        Some(other) => Err(Failure::Usage(format!(
            "--subject {other:?}: is neither a file nor an identifier; expected the JSON file of a virtual subject, or an \
             identifier of letters, digits, -, _ and . such as S03"
        ))),
    }
}
