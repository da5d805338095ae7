//! Errors of a session folder: file, line, what was expected.

use std::fmt;
use std::io;

/// Where in a session folder something is: file, and line and column where they are known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePlace {
    /// Path of the file, as the user would type it.
    pub file: Box<str>,
    /// Line in the file, the first being 1.
    pub line: Option<u64>,
    /// Column of a table, or path of a field in a JSON file.
    pub column: Option<Box<str>>,
}

impl FilePlace {
    /// A field of a JSON file, by its path.
    pub fn field(file: impl Into<Box<str>>, path: &str) -> Self {
        Self { file: file.into(), line: None, column: Some(format!("field {path}").into()) }
    }

    /// The file as a whole.
    pub fn file(file: impl Into<Box<str>>) -> Self {
        Self { file: file.into(), line: None, column: None }
    }

    /// A line of the file.
    pub fn line(file: impl Into<Box<str>>, line: u64) -> Self {
        Self { file: file.into(), line: Some(line), column: None }
    }

    /// A column in a line of the file.
    pub fn cell(file: impl Into<Box<str>>, line: u64, column: impl Into<Box<str>>) -> Self {
        Self { file: file.into(), line: Some(line), column: Some(column.into()) }
    }
}

impl fmt::Display for FilePlace {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(formatter, ", line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(formatter, ", {column}")?;
        }
        Ok(())
    }
}

/// Asks whether a column is in milliseconds, if a `ratio` that would be 1 then is near it.
fn milliseconds(ratio: f64, column: &str) -> String {
    if (ratio - 1.0).abs() < 0.1 {
        format!(". Is {column} in milliseconds? Give it in s")
    } else {
        String::new()
    }
}

/// Files with `is` or `are`: the first three by name, of the others their number.
fn listed(files: &[String]) -> String {
    const NAMED: usize = 3;
    match files {
        [one] => format!("{one} is"),
        [named @ .., last] if files.len() <= NAMED => format!("{} and {last} are", named.join(", ")),
        _ => {
            let further = files.len().saturating_sub(NAMED);
            format!("{} and {further} more are", files[..files.len().min(NAMED)].join(", "))
        }
    }
}

/// What to do about times that are uneven.
pub(crate) const EVENLY: &str = "If the converter took them evenly and only their stamps are uneven, give even times; otherwise bring every channel to even times by \
     interpolation";

/// Why a session folder cannot be read. The message names file, line, column and what was expected.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A file that must be there is not.
    #[error("{at}: not found; expected {expected}")]
    Missing {
        /// The file.
        at: FilePlace,
        /// What it should have been, and who names it.
        expected: String,
    },
    /// A record has other further channels than the records before it.
    #[error(
        "{at}: has {found}, where {first} has {expected}; expected the same further channels in every record of a session. \
         Remove the column from all records, or put the record that lacks it into a session of its own"
    )]
    FurtherChannels {
        /// Header of the record.
        at: FilePlace,
        /// Its further channels.
        found: String,
        /// Those of the first record.
        expected: String,
        /// File of the first record.
        first: String,
    },
    /// The operating system does not let it be read.
    #[error("{at}: cannot be read ({source}); expected a readable file")]
    Unreadable {
        /// The file.
        at: FilePlace,
        /// The operating system's reason.
        source: io::Error,
    },
    /// Nothing in it.
    #[error("{at}: the file is empty; expected {expected}")]
    Empty {
        /// The file.
        at: FilePlace,
        /// What should be there.
        expected: String,
    },
    /// Bytes that are not UTF-8 text.
    #[error("{at}: not UTF-8 text; expected a table or JSON saved as UTF-8")]
    NotText {
        /// The first line that is not.
        at: FilePlace,
    },
    /// `session.json` is not JSON, or not of the shape the format asks for.
    #[error("{at}: {message}; expected a session description of format {format}", format = super::SESSION_FORMAT)]
    Json {
        /// File, line and the path of the field.
        at: FilePlace,
        /// The parser's words.
        message: String,
    },
    /// Fields of `session.json` that must be there are not.
    #[error("{at}: the fields {fields} are missing; ramphold schema session describes the file")]
    MissingFields {
        /// The file.
        at: FilePlace,
        /// Their paths.
        fields: String,
    },
    /// Written in a version of the format that this program does not know.
    #[error("{at}: format version {found:?} is not known; expected {expected:?}, or a newer program")]
    UnknownFormat {
        /// The field.
        at: FilePlace,
        /// What is there.
        found: String,
        /// What this program reads.
        expected: &'static str,
    },
    /// A column that must be there is not, or is there twice.
    #[error("{at}: column {column} is {problem}; expected exactly one, the header is: {header}")]
    Column {
        /// The header line.
        at: FilePlace,
        /// Its name.
        column: String,
        /// `missing` or `there twice`.
        problem: &'static str,
        /// The header as it is.
        header: String,
    },
    /// A row that has more or fewer fields than the header.
    #[error("{at}: {found} fields; expected {expected} as in the header")]
    FieldCount {
        /// The row.
        at: FilePlace,
        /// Its number of fields.
        found: usize,
        /// The header's.
        expected: usize,
    },
    /// A value that is not what the column or field holds.
    #[error("{at}: {found:?} is not valid; expected {expected}")]
    Value {
        /// File, line and column.
        at: FilePlace,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// A judgement on another record than the one that is there.
    #[error(
        "{at}: the judgement on trial {trial} is of another record than {record}: the file is of another session, or the record was \
         changed since; put back what belongs together, or delete amendments.json and judge again with: ramphold trials"
    )]
    OtherRecord {
        /// The judgement.
        at: FilePlace,
        /// The trial.
        trial: u32,
        /// Its record.
        record: String,
    },
    /// Time stands still or runs backwards.
    #[error("{at}: time goes from {before_s} s to {after_s} s; expected a step forward of {step_s} s")]
    StepBack {
        /// The later row.
        at: FilePlace,
        /// Time of the row before.
        before_s: f64,
        /// Time of this row.
        after_s: f64,
        /// One sample period.
        step_s: f64,
    },
    /// Samples are missing.
    #[error("{at}: gap in time from {before_s} s to {after_s} s; expected a step of {step_s} s")]
    Gap {
        /// The row after the gap.
        at: FilePlace,
        /// Time of the row before.
        before_s: f64,
        /// Time of this row.
        after_s: f64,
        /// One sample period.
        step_s: f64,
    },
    /// The samples were not taken evenly, or their times do not say when they were taken.
    #[error(
        "{at}: the time is {:.1} us off even steps, more than its digits explain, and the motor turns by {moved_rad:.2e} rad in that; \
         expected samples taken evenly. {EVENLY}",
        *off_s * 1e6
    )]
    Uneven {
        /// The sample that is farthest off in the first stretch that is uneven.
        at: FilePlace,
        /// By how much, s.
        off_s: f64,
        /// How far the motor turns in that time, rad.
        moved_rad: f64,
    },
    /// The times in a record do not go at the session's rate.
    #[error(
        "{at}: the times run at {found_hz:.6} samples a second; expected the sample_rate_hz of session.json, {expected_hz}{}",
        milliseconds(*found_hz * 1e3 / *expected_hz, "t_s")
    )]
    Rate {
        /// The row where it became certain.
        at: FilePlace,
        /// Rate of the record.
        found_hz: f64,
        /// Rate of the session.
        expected_hz: f64,
    },
    /// The onset is not inside the record, or too near its end to be analysed.
    #[error(
        "{at}: onset at {onset_s} s; expected it {expected}, the record {record} runs from {first_s} s to {last_s} s{}",
        if *onset_s > *last_s && (*first_s..=*last_s).contains(&(*onset_s / 1e3)) { milliseconds(1.0, "onset_s") } else { "".into() }
    )]
    Onset {
        /// Cell of the table.
        at: FilePlace,
        /// The onset given.
        onset_s: f64,
        /// What is asked of it.
        expected: &'static str,
        /// File of the record.
        record: String,
        /// First time in the record.
        first_s: f64,
        /// Last time in the record.
        last_s: f64,
    },
    /// A record that would be read from outside the session folder.
    #[error(
        "{at}: {found:?} leads out of the session folder; expected a path inside it, such as trials/trial-001.csv"
    )]
    Outside {
        /// Cell of the table, or the file.
        at: FilePlace,
        /// The path given.
        found: String,
    },
    /// More of something than a session may have.
    #[error(
        "{at}: more than {limit} {what}; expected at most that. Divide the recording into several sessions"
    )]
    TooMany {
        /// Where it became certain.
        at: FilePlace,
        /// What there are too many of.
        what: &'static str,
        /// Limit.
        limit: usize,
    },
    /// The records of a session together are too large.
    #[error(
        "{at}: with this record, the records of the session have more than {limit} bytes; expected at most that. Divide \
         the recording into several sessions"
    )]
    TooMuch {
        /// The record.
        at: FilePlace,
        /// Limit, bytes.
        limit: u64,
    },
    /// Two trials with one record.
    #[error(
        "{at}: {file:?} is the record of line {first_line} already; expected a record of its own for each trial"
    )]
    SharedRecord {
        /// Cell of the second.
        at: FilePlace,
        /// The record.
        file: String,
        /// Line of the first.
        first_line: u64,
    },
    /// Records of the journal that cannot have followed each other.
    #[error(
        "{at}: the record at byte {offset} {problem}; expected the records in the order in which the session went. Put the \
         journal back from a copy. The trials in trials.csv can still be fitted"
    )]
    JournalOrder {
        /// The journal.
        at: FilePlace,
        /// First byte of the record.
        offset: u64,
        /// What is wrong.
        problem: String,
    },
    /// Records that the journal knows nothing of, under names that the session would give to the records to come.
    #[error(
        "{folder}: {} there, but the journal does not mention {}: the journal is older than the records, and the trials to \
         come would be written over them. Put the journal.log back that was written with them, or, if they are not needed, \
         move them to another folder. Nothing was changed. The trials in trials.csv can still be fitted",
        listed(.files),
        if .files.len() == 1 { "it" } else { "them" }
    )]
    NotInTheJournal {
        /// The session's folder.
        folder: String,
        /// Each record.
        files: Vec<String>,
    },
    /// The same session twice.
    #[error("{at}: is given twice; name each session once")]
    GivenTwice {
        /// Its folder.
        at: FilePlace,
    },
    /// The same trial number twice.
    #[error("{at}: trial {number} is already in line {first_line}; expected each number once")]
    DuplicateTrial {
        /// Cell of the second.
        at: FilePlace,
        /// The number.
        number: u32,
        /// Line of the first.
        first_line: u64,
    },
    /// Another program is at work in the session.
    #[error("{at}: another program has this session open; expected to be the only one. Wait until it ends")]
    InUse {
        /// The folder.
        at: FilePlace,
    },
    /// The journal lacks its beginning, or is no journal.
    #[error(
        "{at}: {problem}; expected the journal of a session that ramphold ran, beginning with its own record"
    )]
    NoJournal {
        /// The journal.
        at: FilePlace,
        /// What is there instead.
        problem: String,
    },
    /// Records are missing from the middle of the journal.
    #[error(
        "{at}: damaged at byte {offset} ({length} bytes): {reason}; expected an unbroken journal, what happened in the \
         session cannot be told for certain. The trials in trials.csv can still be fitted"
    )]
    Damaged {
        /// The journal.
        at: FilePlace,
        /// First byte of the damage.
        offset: u64,
        /// Number of bytes.
        length: u64,
        /// What is wrong.
        reason: String,
    },
    /// The protocol in the folder is not the one that the session was begun with.
    #[error(
        "{at}: SHA-256 {found}; expected {expected} as in the journal: it is not the protocol that the session was run with. Put that one back"
    )]
    ProtocolChanged {
        /// The protocol.
        at: FilePlace,
        /// Of the file.
        found: String,
        /// Of the journal.
        expected: String,
    },
    /// The protocol in the folder is none.
    #[error(transparent)]
    Protocol(#[from] crate::protocol::ProtocolError),
    /// A complete trial without enough samples.
    #[error("{at}: {found} samples; expected at least {expected} in a trial of status ok")]
    TooShort {
        /// The record.
        at: FilePlace,
        /// Samples there.
        found: usize,
        /// Samples needed.
        expected: usize,
    },
}
