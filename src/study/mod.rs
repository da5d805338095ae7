//! Studies: many subjects with one protocol, every session fitted, and the statistical tables over subjects.
//!
//! A study is a list of independent units, each a session with its own seed. Units are processed in parts of a few sessions. A part is
//! a file with a checksum, so it does not matter which process made it, in which order, or after how many interruptions: threads of one
//! program, or workers of a cluster. The tables are computed from the parts one subject at a time.

mod aggregation;
mod condition_grid;
pub mod detection_power;
mod error;
mod part;
mod plan;
mod population;
pub mod power;
mod result_tables;
mod simulated_pool;
mod study_file;
mod study_folder;
mod study_results;
mod table_reader;
mod unit_session;

pub use aggregation::{StudySummary, SubjectMeans, TableOrigin, assemble_table, summarise};
pub use condition_grid::ConditionGrid;
pub use error::{PartError, StudyError, StudyIssue, UnitError};
pub use part::{PARTS_FOLDER, PartContents, StudyPart};
pub use plan::{Study, Unit, UnitSource};
pub use population::{Population, SubjectSpread, SurfaceSpread, subject_id};
pub use result_tables::{RESULTS_FILE, RESULTS_FORMAT, ResultTable, ResultTables, effect_name};
pub use simulated_pool::{PoolFit, PooledSubject, repetitions_in_words, simulate_pool};
pub use study_file::{
    MeasuredSessions, STUDY_FORMAT, StudyFile, StudyFit, Subjects, VirtualSubjects, schema_text,
};
pub use study_folder::{StudyFolder, tables_from_csv};
pub use study_results::{StudyResults, is_study};
pub use table_reader::{CellMeans, StudyRow, StudyTableReader, SubjectRows};
pub use unit_session::{SessionStorage, UnitEstimates, fit_unit, simulate_unit};

#[cfg(test)]
mod tests;
