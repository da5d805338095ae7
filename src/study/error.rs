//! Errors of a study and of its sessions, and issues that keep a subject out of a table.

use std::io;
use std::path::PathBuf;

use crate::consistency::Contradictions;
use crate::dataset::{DatasetError, RecordError};
use crate::fit::{DESCRIBING_VAF, PreprocessingError};
use crate::json_file::JsonFileError;
use crate::protocol::{ProtocolError, TooShort};
use crate::rig::Fault;
use crate::rig::virtual_wrist::{PersonError, RigFileError};
use crate::schedule::DrawError;
use crate::session::EveryTrialFails;

/// Why a study cannot be carried out.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The file cannot be read, is not JSON, or has a field that is unknown, missing or of the wrong type.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// A field of the study file has a value outside its range.
    #[error("{}, field {field}: {found}; expected {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// The value found.
        found: String,
        /// The values allowed.
        expected: &'static str,
    },
    /// The study's protocol is not valid.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The file of the average virtual subject is not valid.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// The file of the virtual rig is not valid.
    #[error(transparent)]
    Rig(#[from] RigFileError),
    /// The study's folder is used for something else.
    #[error("{}: {found}; {advice}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the folder contains.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// A file in the study's folder cannot be read or written.
    #[error("{}: {source}. Check the disk; finished parts are kept, and --resume continues from them", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A part that was finished is missing or damaged.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A folder of measured sessions that cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A `study.csv` that cannot be used.
    #[error("{}, line {line}: {message}", .file.display())]
    ResultTable {
        /// The file.
        file: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// What was found, and what was expected.
        message: String,
    },
}

impl StudyError {
    /// Makes a [`StudyError::File`] of an error of the operating system at `path`.
    pub fn at(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Whether the input files are at fault, rather than the disk or a damaged part.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File { .. } | Self::Part(_))
    }
}

/// Why the file of a part cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}. Run the study again with --resume, which does this part anew", .path.display())]
pub struct PartError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with the file.
    pub problem: &'static str,
}

/// Why a session of a study gives no estimates. The other sessions are not affected.
#[derive(Debug, thiserror::Error)]
pub enum UnitError {
    /// The order of the trials cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A ramp is too short to reach its velocity.
    #[error(transparent)]
    TooShort(#[from] TooShort),
    /// The session ended before all trials were done.
    #[error("the session ended with {left} trials still to do{}", fault.map_or(String::new(), |fault| format!(": {fault}")))]
    Ended {
        /// Number of trials not done.
        left: usize,
        /// The fault that ended the session, if any.
        fault: Option<Fault>,
    },
    /// The virtual person fails every trial.
    #[error(transparent)]
    EveryTrialFails(#[from] EveryTrialFails),
    /// The session cannot be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The session folder cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The session's protocol, which sets the filter and the analysed window, cannot be read.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The signals of the session contradict its table.
    #[error(transparent)]
    Contradicts(#[from] Contradictions),
    /// The fit means nothing.
    #[error(
        "the model does not describe the session: the best VAF of any trial is {best_vaf:.2}, below {DESCRIBING_VAF}; look at it with: \
         ramphold fit, and correct what the report shows"
    )]
    NotDescribed {
        /// Largest share of the variance that the model accounts for in a trial.
        best_vaf: f64,
    },
    /// The session cannot be preprocessed for the fit.
    #[error(transparent)]
    Prepare(#[from] PreprocessingError),
}

/// A reason why a table does not contain all subjects. The issue is reported; the tables are computed from the rest.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyIssue {
    /// A session could not be simulated, read or fitted.
    #[error("{subject}, session {session}: {reason}. The session is not in the study's tables")]
    SessionFailed {
        /// The subject's identifier.
        subject: String,
        /// The session's number, from 1.
        session: u32,
        /// The reason.
        reason: String,
    },
    /// A subject was measured with another protocol.
    #[error(
        "{subject}: measured with another protocol ({difference}). The rows are in study.csv and in no other table; analyse \
         subjects with different protocols in separate studies"
    )]
    OtherProtocol {
        /// The subject's identifier.
        subject: String,
        /// The protocol field that differs.
        difference: String,
    },
    /// A session has no model of its own, and the others have.
    #[error(
        "{subject}, session {session}: the session has no model of its own, so that its values are those of each trial alone, \
         which are biased differently at each velocity. The rows are in study.csv and in no other table; `ramphold fit` on the \
         session says why, and \"fit\": \"independent\" in the study file fits all sessions alike"
    )]
    NoSessionModel {
        /// The subject's identifier.
        subject: String,
        /// The session's number, from 1.
        session: u32,
    },
    /// A subject has no usable trial in some conditions.
    #[error(
        "{subject}: no usable trial of {} in {} of {of} conditions (first: {first}). The subject is left out of the analysis \
         of variance of that quantity; scripts/mixed-model uses all rows", .quantity, .missing
    )]
    MissingConditions {
        /// The subject's identifier.
        subject: String,
        /// The quantity without values.
        quantity: &'static str,
        /// Number of conditions without a value.
        missing: usize,
        /// Number of conditions of the study.
        of: usize,
        /// The first condition without a value.
        first: String,
    },
    /// A session's first record is that of another session.
    #[error(
        "{subject}: the first record in {place} is that of {other}, byte by byte: is it one session under two names? The rows are in \
         study.csv and in no other table"
    )]
    CopiedSession {
        /// The subject's identifier.
        subject: String,
        /// The session's folder.
        place: String,
        /// The subject whose session came first.
        other: String,
    },
    /// A subject appears twice.
    #[error(
        "{subject}: appears twice (the second time in {place}). Only the first is in the tables; if these are repeated sessions of one \
         subject, set \"repeated\": true in the study file"
    )]
    DuplicateSubject {
        /// The subject's identifier.
        subject: String,
        /// Where the second appearance is.
        place: String,
    },
    /// A session that the table itself leaves out.
    #[error(
        "{subject}, session {session}: is excluded in study.csv (column excluded) and is in no other table"
    )]
    ExcludedInTable {
        /// The subject's identifier.
        subject: String,
        /// Number of the session of the subject.
        session: u32,
    },
    /// An identifier that is probably a slip of another.
    #[error(
        "{subject}: differs from the subject {other} in nothing but case or separators; its sessions are in study.csv and in no other \
         table. Give all sessions of one subject the same subject.id, and two subjects names that differ in a letter or a digit"
    )]
    SimilarSubject {
        /// The later identifier.
        subject: String,
        /// The earlier identifier.
        other: String,
    },
    /// Fewer than two subjects have all conditions.
    #[error("{subjects} subjects have all conditions; statistics need at least 2. Only means are computed")]
    TooFewSubjects {
        /// Number of subjects with all conditions.
        subjects: usize,
    },
}
