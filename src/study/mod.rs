//! A study: many persons through one protocol, every session fitted, and what the table of all of them says.
//!
//! A study is a list of independent units, each a session with its own seed. Units are done in parts of a few; a part is a
//! file that proves itself whole, so it does not matter who made it, in which order, or after how many interruptions: threads of
//! one program, or workers of a cluster. The tables are gathered from the parts person by person.

pub mod detection;
mod error;
mod file;
mod folder;
mod gather;
mod part;
mod persons;
mod plan;
mod pool;
mod population;
pub mod power;
mod run;
mod tables;

pub use error::{Problem, StudyError, UnitError};
pub use file::{FORMAT, Measured, Persons, StudyFile, VirtualPersons, schema_text};
pub use folder::{StudyFolder, tables_of};
pub use gather::{Gathered, Origin, assemble, gather};
pub use part::{PARTS, Part, PartError};
pub use persons::{Cells, PersonRows, Row, Rows};
pub use plan::{Study, Unit, What};
pub use pool::{Pooled, pool};
pub use population::{PersonSpread, Population, SurfaceSpread, subject_id};
pub use run::{Kept, fit, simulate};
pub use tables::{Layout, RESULTS_FORMAT, Table, Tables, effect_name};

#[cfg(test)]
mod tests;
