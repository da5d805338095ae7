//! A study: many persons through one protocol, every session fitted, and what the table of all of them says.
//!
//! A study is a list of independent units, each a session with its own seed. Units are done in parts of a few; a part is a
//! file that proves itself whole, so it does not matter who made it, in which order, or after how many interruptions: threads of
//! one program, or workers of a cluster. The tables are gathered from the parts person by person.

mod aggregation;
pub mod detection_power;
mod error;
mod part;
mod plan;
mod population;
pub mod power;
mod simulated_pool;
mod study_file;
mod study_folder;
mod table_reader;
mod tables;
mod unit_session;

pub use aggregation::{Gathered, Origin, assemble, gather};
pub use error::{Problem, StudyError, UnitError};
pub use part::{PARTS, Part, PartError};
pub use plan::{Study, Unit, What};
pub use population::{PersonSpread, Population, SurfaceSpread, subject_id};
pub use simulated_pool::{Pooled, pool};
pub use study_file::{FORMAT, Measured, Persons, StudyFile, VirtualPersons, schema_text};
pub use study_folder::{StudyFolder, tables_of};
pub use table_reader::{Cells, PersonRows, Row, Rows};
pub use tables::{Layout, RESULTS_FORMAT, Table, Tables, effect_name};
pub use unit_session::{Kept, fit, simulate};

#[cfg(test)]
mod tests;
