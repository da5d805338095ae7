//! The largest sizes and counts of what is read. docs/explanation/security.md lists them; a test compares the two.

/// Bytes of a JSON file that people write: protocol, rig, subject, study, model, `session.json`.
pub const SETTINGS_BYTES: u64 = 4 << 20;
/// Bytes of a table of a session: `trials.csv`, `familiarisation.csv`, `schedule.csv`.
pub const TABLE_BYTES: u64 = 16 << 20;
/// Bytes of the record of one trial.
pub const RECORD_BYTES: u64 = 256 << 20;
/// Bytes of all records of a session together.
pub const ALL_RECORDS_BYTES: u64 = 1 << 30;
/// Bytes of a file of a foreign recording, as `import` reads it.
pub const RECORDING_BYTES: u64 = 1 << 30;
/// Bytes of a compressed recording, such as a .mat file, after it is unpacked.
pub const UNPACKED_BYTES: u64 = 4 << 30;
/// Bytes of a journal.
pub const JOURNAL_BYTES: u64 = 64 << 20;
/// Bytes of a manifest.
pub const MANIFEST_BYTES: u64 = 64 << 20;
/// Bytes of a result of a fit: `fit.json`, `fit.csv`.
pub const FIT_BYTES: u64 = 32 << 20;
/// Bytes of a diagnosis, `diagnosis.json`.
pub const DIAGNOSIS_BYTES: u64 = 8 << 20;
/// Bytes of the summary of a bus, `bus.json`.
pub const BUS_BYTES: u64 = 1 << 20;
/// Bytes of a part or a table of a study.
pub const STUDY_BYTES: u64 = 8 << 30;
/// Trials of a session, and rows of its tables.
pub const MAX_SESSION_TRIALS: usize = 20_000;
/// Columns of a table.
pub const MAX_COLUMNS: usize = 1_000;
/// Files and folders of a session.
pub const MAX_ENTRIES: usize = 100_000;
/// Folders inside each other in a session.
pub const MAX_DEPTH: usize = 8;
/// Samples a second of a session.
pub const MAX_SAMPLE_RATE_HZ: f64 = 1e6;
/// Analysed time after the onset, s.
pub const MAX_WINDOW_S: f64 = 10.0;
/// Conditions, and samples, of the residual map of a diagnosis.
pub const RESIDUAL_MAP: [usize; 2] = [1_000, 100_000];
/// Characters of a text that a message quotes from a file.
pub const QUOTED_CHARACTERS: usize = 200;
