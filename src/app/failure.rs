//! Errors of all layers as the program reports them: message and exit code.

use std::io;
use std::path::PathBuf;

use crate::attach::AttachError;
use crate::calibrate::CalibrateError;
use crate::consistency::Contradictions;
use crate::console::ConsoleError;
use crate::dataset::{DatasetError, RecordError, ResumeError, RigCalibrationError};
use crate::export::ExportError;
use crate::files::is_refusal;
use crate::fit::{CalibrationMisuse, ExcludedTrial, ModelError, PreprocessingError, WriteError};
use crate::import::ImportError;
use crate::json_file::JsonFileError;
use crate::lsl::LslError;
use crate::protocol::{ProtocolError, TooShort};
use crate::report::ReportError;
use crate::rig::can;
use crate::rig::virtual_wrist::{PersonError, RigFileError};
use crate::schedule::DrawError;
use crate::study::{StudyError, UnitError};

/// Why a verb failed. One variant for each layer that can fail.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The protocol cannot be run.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The trials cannot be ordered as asked.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A session folder cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A session cannot be analysed.
    #[error("{session}: {source}")]
    Prepare {
        /// The session's folder.
        session: String,
        /// The reason.
        source: PreprocessingError,
    },
    /// The signals of a session contradict its table.
    #[error("{session}: {found}")]
    Contradicts {
        /// The session's folder.
        session: String,
        /// What they contradict.
        found: Contradictions,
    },
    /// A model file cannot be used.
    #[error("{file}: {source}")]
    Model {
        /// The file.
        file: String,
        /// The reason.
        source: ModelError,
    },
    /// A file is no calibration of a rig.
    #[error(transparent)]
    CalibrationFile(#[from] RigCalibrationError),
    /// A calibration cannot be used for a session.
    #[error("{file}: {source}")]
    Calibration {
        /// The file.
        file: String,
        /// The reason.
        source: CalibrationMisuse,
    },
    /// A JSON file cannot be used.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// A file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// The reason.
        source: io::Error,
    },
    /// The folder of results cannot be opened or made.
    #[error("{}: cannot be written: {source}", .path.display())]
    ResultsFolder {
        /// The folder.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// Results could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The report could not be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The export could not be made.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// Some of the sessions could not be fitted, or only some of their trials; the error of each has been printed.
    #[error("{failed} of {of} sessions could not be fitted, and {partly} only in part")]
    Some {
        /// Sessions that failed.
        failed: usize,
        /// Sessions of which trials are left out.
        partly: usize,
        /// All sessions.
        of: usize,
    },
    /// Some of the trials could not be analysed; the results of the others are written.
    #[error("{session}: the results are those of {analysed} of its trials; {}", reasons(.left_out))]
    TrialsLeftOut {
        /// The session's folder.
        session: String,
        /// Number of trials that were analysed.
        analysed: usize,
        /// The others, with the reasons.
        left_out: Vec<ExcludedTrial>,
    },
    /// A recording cannot be imported.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The session cannot be published.
    #[error(transparent)]
    Lsl(#[from] LslError),
    /// A recording cannot be attached.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The study cannot be done.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A session of a simulation could not be run.
    #[error("a session of the simulation: {0}")]
    Unit(UnitError),
    /// Parts of a study could not be computed; each problem has been printed.
    #[error("the study is incomplete: {problems} problems exclude subjects from its tables; the rest is in {}", .folder.display())]
    PartOfStudy {
        /// Their number.
        problems: u64,
        /// The study's folder.
        folder: PathBuf,
    },
    /// An option has a value that cannot be used.
    #[error("{0}")]
    Usage(String),
    /// A velocity that the ramp cannot reach.
    #[error(transparent)]
    TooShort(#[from] TooShort),
    /// The file of a virtual subject is wrong.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// The file of a virtual rig is wrong.
    #[error(transparent)]
    Rig(#[from] RigFileError),
    /// The file of a CAN motor is wrong, or does not fit the protocol.
    #[error(transparent)]
    CanRig(#[from] can::file::CanRigFileError),
    /// The CAN bus cannot be opened.
    #[error(transparent)]
    Connect(#[from] can::ConnectError),
    /// The motor failed a check.
    #[error("{0}")]
    Motor(can::CanFault),
    /// A session with a motor cannot be resumed with the start position that it has.
    #[error(transparent)]
    Origin(#[from] can::OriginError),
    /// The bus could not be read.
    #[error("{bus}: {source}")]
    Bus {
        /// The bus.
        bus: String,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The session cannot be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The session ended before all trials were done.
    #[error(
        "the session ended with {left} trials left to do; everything up to here is in {}. Go on with: ramphold resume {}",
        .folder.display(),
        .folder.display()
    )]
    Ended {
        /// The session's folder.
        folder: PathBuf,
        /// Number of trials left.
        left: usize,
    },
    /// The console cannot be opened.
    #[error(transparent)]
    Live(#[from] ConsoleError),
    /// A session cannot be resumed.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// No variant of a protocol gains anything.
    #[error("{}: not written, since no change of the protocol is expected to gain anything", .out.display())]
    NothingToGain {
        /// The file that was asked for.
        out: PathBuf,
    },
    /// A replay differs from the record.
    #[error("{}: the replay differs from the record", .session.display())]
    Differs {
        /// The session's folder.
        session: PathBuf,
    },
    /// Files of a session differ from its manifest.
    #[error("{}: {files} files differ from what they were when the session ended", .session.display())]
    NotAsItWas {
        /// The session's folder.
        session: PathBuf,
        /// Their number.
        files: usize,
    },
    /// The rig trials of a session cannot be analysed.
    #[error("{session}: {source}")]
    Calibrate {
        /// The session's folder.
        session: String,
        /// The reason.
        source: CalibrateError,
    },
    /// The rig differs from its calibration.
    #[error("{}: the rig differs from its calibration in {quantities}. Find out why, or calibrate it anew", .session.display())]
    RigChanged {
        /// The session's folder.
        session: PathBuf,
        /// Names of the quantities, one of which changed.
        quantities: String,
    },
    /// The rig differs from its calibration, and no quantity is named.
    #[error(
        "{}: the rig differs from its calibration (p = {p_value:.4}), and a change of no single quantity explains it. Find out why, or \
         calibrate it anew", .session.display()
    )]
    RigDiffers {
        /// The session's folder.
        session: PathBuf,
        /// Probability of trials so different if nothing changed.
        p_value: f64,
    },
    /// The rig was not compared with its calibration.
    #[error("{}: the rig was not compared with its calibration: {reason}", .session.display())]
    RigNotCompared {
        /// The session's folder.
        session: PathBuf,
        /// Why.
        reason: &'static str,
    },
    /// A diagnosis did not find the hidden mechanism.
    #[error("the diagnosis does not name the hidden mechanism {mechanism}")]
    NotFound {
        /// The hidden mechanism.
        mechanism: &'static str,
    },
    /// Signal handlers cannot be installed.
    #[error("cannot listen for signals: {0}")]
    Signals(io::Error),
    /// Results could not be printed.
    #[error("standard output cannot be written: {0}. Is the disk it is redirected to full?")]
    Output(#[from] io::Error),
}

impl Failure {
    /// The exit code: 1 if the work failed, 2 if its input was wrong.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Protocol(_)
            | Self::Draw(_)
            | Self::Dataset(_)
            | Self::Prepare { .. }
            | Self::Contradicts { .. }
            | Self::Calibrate { .. }
            | Self::Model { .. }
            | Self::CalibrationFile(_)
            | Self::Calibration { .. }
            | Self::Json(_)
            | Self::Read { .. }
            | Self::Usage(_)
            | Self::Import(_)
            | Self::Lsl(_)
            | Self::Resume(ResumeError::Dataset(_) | ResumeError::NotAsItWas { .. })
            | Self::TooShort(_)
            | Self::Person(_)
            | Self::Rig(_)
            | Self::CanRig(_)
            | Self::Record(RecordError::Exists(_)) => 2,
            Self::Export(error) => code_of(error.is_bad_input()),
            Self::Attach(error) => code_of(error.is_bad_input()),
            Self::Live(error) => code_of(error.is_bad_input()),
            Self::Study(error) => code_of(error.is_bad_input()),
            Self::Report(ReportError::Study(error)) => code_of(error.is_bad_input()),
            Self::Report(ReportError::Unwritable { source, .. })
            | Self::ResultsFolder { source, .. }
            | Self::Record(RecordError::Unwritable { source, .. })
            | Self::Resume(ResumeError::Record(RecordError::Unwritable { source, .. })) => {
                code_of(is_refusal(source))
            }
            Self::Report(_) => 2,
            Self::Write(_)
            | Self::Some { .. }
            | Self::TrialsLeftOut { .. }
            | Self::PartOfStudy { .. }
            | Self::Unit(_)
            | Self::Record(_)
            | Self::Resume(_)
            | Self::NothingToGain { .. }
            | Self::Differs { .. }
            | Self::NotAsItWas { .. }
            | Self::Ended { .. }
            | Self::NotFound { .. }
            | Self::RigChanged { .. }
            | Self::RigDiffers { .. }
            | Self::RigNotCompared { .. }
            | Self::Signals(_) => 1,
            Self::Origin(can::OriginError::WordNeeded { .. } | can::OriginError::HandleElsewhere { .. }) => 2,
            Self::Connect(_) | Self::Motor(_) | Self::Origin(_) | Self::Bus { .. } => 1,
            Self::Output(_) if self.is_broken_pipe() => 0,
            Self::Output(_) => 1,
        }
    }

    /// Whether the reader of standard output closed it early (`ramphold schedule ... | head -1`), which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}

/// Why each trial is left out.
fn reasons(left_out: &[ExcludedTrial]) -> String {
    let reason = |own: &ExcludedTrial| format!("trial {} left out: {}", own.trial, own.reason);
    left_out.iter().map(reason).collect::<Vec<_>>().join("; ")
}

/// The exit code of a failure whose cause may be its input or the work.
fn code_of(is_bad_input: bool) -> u8 {
    if is_bad_input { 2 } else { 1 }
}
