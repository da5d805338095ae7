//! How errors of the layers end the program: message and exit code.

use std::io;
use std::path::PathBuf;

use ramphold::console::ConsoleError;
use ramphold::dataset::{DatasetError, RecordError, ResumeError};
use ramphold::export::ExportError;
use ramphold::fit::{ModelError, PreprocessingError, WriteError};
use ramphold::protocol::{ProtocolError, TooShort};
use ramphold::report::ReportError;
use ramphold::rig::can;
use ramphold::rig::virtual_wrist::{PersonError, RigFileError};
use ramphold::schedule::DrawError;
use ramphold::study::{StudyError, UnitError};

/// Why a verb did not do its work. One variant for each layer that can fail.
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
        /// Why.
        source: PreprocessingError,
    },
    /// A model file cannot be used.
    #[error("{file}: {source}")]
    Model {
        /// The file.
        file: String,
        /// Why.
        source: ModelError,
    },
    /// A file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
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
    /// Some of the sessions could not be fitted; each has been told of.
    #[error("{failed} of {of} sessions could not be fitted")]
    Some {
        /// How many failed.
        failed: usize,
        /// How many there were.
        of: usize,
    },
    /// The study cannot be done.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A session of a simulation could not be run.
    #[error("a session of the simulation: {0}")]
    Unit(UnitError),
    /// Not everything of a study could be computed; each problem has been told of.
    #[error("{problems} problems kept persons out of tables; what could be computed is in {}", .folder.display())]
    PartOfStudy {
        /// How many.
        problems: u64,
        /// The study's folder.
        folder: PathBuf,
    },
    /// What was asked for makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A velocity that the ramp cannot reach.
    #[error(transparent)]
    TooShort(#[from] TooShort),
    /// The virtual person cannot be made.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// The rig cannot be made.
    #[error(transparent)]
    Rig(#[from] RigFileError),
    /// The CAN motor's file is wrong, or does not go with the protocol.
    #[error(transparent)]
    CanRig(#[from] can::file::CanRigFileError),
    /// The CAN bus cannot be opened.
    #[error(transparent)]
    Connect(#[from] can::ConnectError),
    /// The motor is not as it must be.
    #[error("{0}")]
    Motor(can::CanFault),
    /// The bus could not be listened to.
    #[error("{bus}: {source}")]
    Bus {
        /// The bus.
        bus: String,
        /// What the system said.
        source: io::Error,
    },
    /// The session cannot be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The session was ended before its time.
    #[error(
        "the session ended with {left} trials left to do; everything up to here is in {}. Go on with: ramphold resume {}",
        .folder.display(),
        .folder.display()
    )]
    Ended {
        /// Its folder.
        folder: PathBuf,
        /// Trials left.
        left: usize,
    },
    /// The console cannot be opened.
    #[error(transparent)]
    Live(#[from] ConsoleError),
    /// A session cannot be gone on with.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// Nobody said that the motor may move.
    #[error("nothing was moved: the rig needs the operator's word. Say yes when asked, or give --yes")]
    NoWord,
    /// A replay went another way than the record.
    #[error("{}: does not replay as it was recorded", .session.display())]
    Differs {
        /// The session's folder.
        session: PathBuf,
    },
    /// Files of a session are not what they were.
    #[error("{}: {files} files are not as they were when the session ended", .session.display())]
    NotAsItWas {
        /// The session's folder.
        session: PathBuf,
        /// How many.
        files: usize,
    },
    /// A diagnosis missed what was hidden.
    #[error("the diagnosis does not name {mechanism}, which was hidden")]
    NotFound {
        /// What was hidden.
        mechanism: &'static str,
    },
    /// The system does not let the program listen for Ctrl-C.
    #[error("cannot listen for signals: {0}")]
    Signals(io::Error),
    /// Results could not be printed.
    #[error("standard output cannot be written: {0}. Is the disk it is redirected to full?")]
    Output(#[from] io::Error),
}

impl Failure {
    /// 1: the work failed; 2: what was given to it was bad.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Protocol(_)
            | Self::Draw(_)
            | Self::Dataset(_)
            | Self::Prepare { .. }
            | Self::Model { .. }
            | Self::Read { .. }
            | Self::Usage(_)
            | Self::NoWord
            | Self::Resume(ResumeError::Dataset(_) | ResumeError::NotAsItWas { .. })
            | Self::TooShort(_)
            | Self::Person(_)
            | Self::Rig(_)
            | Self::CanRig(_)
            | Self::Record(RecordError::Exists(_)) => 2,
            Self::Export(error) => {
                if error.is_bad_input() {
                    2
                } else {
                    1
                }
            }
            Self::Live(error) => {
                if error.is_bad_input() {
                    2
                } else {
                    1
                }
            }
            Self::Study(error) => {
                if error.is_bad_input() {
                    2
                } else {
                    1
                }
            }
            Self::Report(ReportError::Unwritable { .. }) => 1,
            Self::Report(_) => 2,
            Self::Write(_)
            | Self::Some { .. }
            | Self::PartOfStudy { .. }
            | Self::Unit(_)
            | Self::Record(_)
            | Self::Resume(_)
            | Self::Differs { .. }
            | Self::NotAsItWas { .. }
            | Self::Ended { .. }
            | Self::NotFound { .. }
            | Self::Signals(_) => 1,
            Self::Connect(_) | Self::Motor(_) | Self::Bus { .. } => 1,
            Self::Output(_) if self.is_broken_pipe() => 0,
            Self::Output(_) => 1,
        }
    }

    /// The reader of the results has read enough (`ramphold schedule ... | head -1`), which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
