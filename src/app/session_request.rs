//! A new session as the operator asks for it, on the command line or in the page of a laboratory, until its folder is made and it runs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::dataset::{NewSession, RecordError, SessionAbout, Subject, Wrist};
use crate::files;
use crate::lsl::{LslFeed, LslLibrary, LslPublisher, MARKERS_STREAM, SIGNALS_STREAM};
use crate::protocol::ValidProtocol;
use crate::rig::can::file::ValidRigFile;
use crate::rig::can::{CanMotor, Connection, DryRun};
use crate::rig::virtual_wrist::{Person, RigFile, Seal, Setup, VirtualWrist, draw_hidden_effect};
use crate::rig::{RecordedSignals, StreamSettings};
use crate::schedule;
use crate::session::{Machine, Settings};
use crate::wrist::Lever;

use super::requested_rig::RequestedRig;
use super::session_rig::with_hidden_effect;
use super::{
    Console, ConsoleOptions, Failure, Pace, SessionDescription, SessionRig, SessionRun, SessionStreams,
    UsedCalibration, add_mechanisms_of_model, check_out, draw_seed, new_folder, now_utc, subject_number,
    utc_offset_s,
};

/// What is asked of a new session.
pub struct SessionRequest<'a> {
    /// The protocol.
    pub protocol: &'a ValidProtocol,
    /// The rig file; without one the virtual wrist.
    pub rig: Option<&'a Path>,
    /// The subject; without one the average virtual subject.
    pub subject: Option<RequestedSubject<'a>>,
    /// The seed; without one a new one is drawn.
    pub seed: Option<u64>,
    /// The session's folder, which must not be there.
    pub folder: NewSessionFolder<'a>,
    /// Speed on the virtual wrist.
    pub pace: Pace,
    /// Model file whose mechanisms the virtual wrist gets.
    pub model: Option<&'a Path>,
    /// Seed of an effect that is hidden in the virtual wrist.
    pub hide: Option<u64>,
    /// The file of the rig's measured constants.
    pub calibration: Option<&'a Path>,
    /// Whether arming a motor was confirmed on the command line.
    pub is_confirmed: bool,
    /// Who runs the session.
    pub operator: Option<&'a str>,
    /// The hand that is measured.
    pub hand: Option<Wrist>,
    /// Fields of the subject that `session.json` keeps.
    pub subject_fields: serde_json::Map<String, serde_json::Value>,
    /// Whether the session is published over Lab Streaming Layer.
    pub lsl: bool,
    /// The file of liblsl; without one, it is where the operating system finds it.
    pub lsl_library: Option<&'a Path>,
    /// Options of the console.
    pub console: &'a ConsoleOptions,
}

/// The subject of a new session.
#[derive(Debug, Clone, Copy)]
pub enum RequestedSubject<'a> {
    /// An identifier, whatever files there are.
    Identifier(&'a str),
    /// The file of a virtual subject.
    File(&'a str),
}

/// Where the folder of a new session is made.
pub enum NewSessionFolder<'a> {
    /// Here.
    Here(PathBuf),
    /// In this folder, under a name made of this stem, subject and seed.
    In(PathBuf, &'a str),
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

impl SessionRequest<'_> {
    /// Makes the session's folder, runs the session and makes its results.
    ///
    /// # Errors
    /// If something of the request cannot be used, before the folder is made; or if the session fails.
    pub fn run(self, console: &Console) -> Result<(), Failure> {
        match RequestedRig::read(self.rig, self.protocol)? {
            RequestedRig::Can(motor) => self.run_on_motor(*motor, console),
            RequestedRig::Virtual(setup) => self.run_on_virtual_wrist(*setup, console),
        }
    }

    fn run_on_virtual_wrist(self, mut setup: Setup, console: &Console) -> Result<(), Failure> {
        let subject =
            self.subject.map_or_else(|| Ok(Person::default()), RequestedSubject::virtual_subject)?;
        if let Some(model) = self.model {
            add_mechanisms_of_model(model, &subject, &mut setup)?;
        }
        for outside in subject.mechanisms.and(&setup.mechanisms).outside_catalogue() {
            console.message(outside);
        }
        let seed = self.seed.unwrap_or_else(draw_seed);
        let order = schedule::draw(self.protocol, seed, subject_number(&subject.id))?;
        let settings = Settings::new(self.protocol, seed, &order)?;
        let lever = setup.lever;
        let hidden = self.hide.map(|seed| draw_hidden_effect(seed, lever)).unwrap_or_default();
        let seal = self.hide.map(|seed| Seal::new(seed, &hidden));
        let rig_json = rig_json(&RigFile::Virtual(setup.clone()), &subject, seal);
        let streams = self.connect_streams(&setup.streams, self.pace.is_real_time(), console)?;
        let setup = with_hidden_effect(setup, &hidden);
        let wrist = VirtualWrist::new(subject.clone(), setup, seed, settings.sample_rate_hz);
        let rig = SessionRig::Virtual { wrist: Box::new(wrist), lever, pace: self.pace };
        self.start(
            Plan { seed, subject: &subject.id, order, settings, rig, rig_json, lever, streams },
            console,
        )
    }

    fn run_on_motor(self, (rig, dry_run): (ValidRigFile, DryRun), console: &Console) -> Result<(), Failure> {
        if self.hide.is_some() {
            return Err(Failure::Usage(format!(
                "--hide: {} describes a motor; an effect can only be hidden in a virtual wrist",
                rig.file_name()
            )));
        }
        let Some(RequestedSubject::Identifier(subject) | RequestedSubject::File(subject)) = self.subject
        else {
            return Err(Failure::Usage(
                "--subject is required with a motor; give the identifier of the subject".to_owned(),
            ));
        };
        if !files::is_single_name(subject) {
            return Err(Failure::Usage(format!(
                "--subject {subject:?}: expected a name such as S03, without /, \\, : and control characters: files of its sessions are named after it"
            )));
        }
        let seed = self.seed.unwrap_or_else(draw_seed);
        let order = schedule::draw(self.protocol, seed, subject_number(subject))?;
        // Before the bus is open: from then on, somebody must listen to it.
        let streams = self.connect_streams(&rig.streams, true, console)?;
        let motor = CanMotor::new(Connection::open(rig.clone())?, dry_run);
        let mut settings = Settings::new(self.protocol, seed, &order)?;
        settings.motion_delay_samples = motor.motion_delay_samples();
        let rig_json = serde_json::from_str(rig.text()).unwrap_or_default();
        let lever = rig.lever;
        let rig = SessionRig::Can(Box::new(motor));
        self.start(Plan { seed, subject, order, settings, rig, rig_json, lever, streams }, console)
    }

    /// Makes the session's folder and runs the session.
    fn start(&self, plan: Plan, console: &Console) -> Result<(), Failure> {
        let Plan { seed, subject, order, settings, rig, rig_json, lever, streams } = plan;
        rig.check_operator(self.console.check()?, !settings.rig_plan.is_empty())?;
        let folder = self.folder.of(subject, seed);
        if files::exists(&folder) {
            return Err(RecordError::Exists(folder).into());
        }
        check_out("--out", &folder)?;
        if let Some(parent) = folder.parent() {
            files::make_folders(parent).map_err(RecordError::at(parent))?;
        }
        let calibration = self.calibration.map(UsedCalibration::given).transpose()?.flatten();
        // A calibration that no analysis can use is found before a trial is run.
        UsedCalibration::constants(calibration.as_ref(), lever)?;
        if let Some(used) = &calibration {
            used.warn(console);
        }
        let signals = rig.recorded_signals(settings.sample_rate_hz);
        // Before the folder is made: without the library there is no session.
        let lsl = self.publish(&settings, &signals, &folder, console)?;
        let recorder = NewSession {
            protocol: self.protocol,
            order: &order,
            seed,
            subject,
            lever,
            rig: &rig_json,
            calibration: calibration.as_ref().map(|own| own.bytes.as_slice()),
            about: &self.about(&rig),
            subject_fields: &self.subject_fields,
            signals: &signals,
            motion_delay_samples: settings.motion_delay_samples,
        }
        .create(&folder, rig.disk())?;
        console.message(format_args!("session {}, subject {subject}, seed {seed}", folder.display()));
        let description = SessionDescription {
            protocol: self.protocol,
            subject,
            lever,
            recorded_filter: signals.recorded_filter,
            rig: rig.name(),
            questions: rig.questions(),
            folder: &folder,
            earlier_trials: Vec::new(),
        };
        let setup = self.console.setup(description, self.is_confirmed, rig.may_wait())?;
        let machine = Machine::new(Arc::new(settings));
        let (options, is_confirmed) = (self.console, self.is_confirmed);
        SessionRun { folder, rig, machine, recorder, setup, options, is_confirmed, lsl, streams }.run(console)
    }

    /// Finds the streams of the rig file, if it has any.
    fn connect_streams(
        &self,
        streams: &[StreamSettings],
        in_real_time: bool,
        console: &Console,
    ) -> Result<Option<SessionStreams>, Failure> {
        SessionStreams::connect(streams, self.lsl_library, in_real_time, console)
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
        let library = LslLibrary::load(self.lsl_library)?;
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
            operator: self.operator.map(str::to_owned),
            hand: self.hand,
        }
    }
}

impl NewSessionFolder<'_> {
    /// The folder of a session of `subject` with `seed`.
    pub fn of(&self, subject: &str, seed: u64) -> PathBuf {
        match self {
            Self::Here(folder) => folder.clone(),
            Self::In(folder, stem) => {
                let subject: String =
                    subject.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
                new_folder(&folder.join(format!("{stem}-{subject}-{seed}")))
            }
        }
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

impl RequestedSubject<'_> {
    /// The virtual subject: from a JSON file, or drawn from an identifier.
    fn virtual_subject(self) -> Result<Person, Failure> {
        match self {
            Self::File(file) => Ok(Person::read(Path::new(file))?),
            Self::Identifier(id) if Subject::is_identifier(id) => Ok(Person::drawn(id)),
            Self::Identifier(other) => Err(Failure::Usage(format!(
                "--subject {other:?}: is neither a file nor an identifier; expected the JSON file of a virtual subject, or \
                 an identifier of letters, digits, -, _ and . such as S03"
            ))),
        }
    }
}
