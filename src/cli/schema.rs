//! `ramphold schema`: the JSON schemas of the input files.

use std::io::Write;

use crate::app::{Console, Failure};
use crate::dataset;
use crate::import;
use crate::protocol;
use crate::rig::{self, virtual_wrist};
use crate::study;

use super::verb::Verb;

/// Print the JSON schema of protocols, virtual subjects, rigs, studies, sessions or mappings.
///
/// The files protocols/*.schema.json contain this output. An editor that reads them completes field names and marks
/// mistakes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold schema > protocol.schema.json\n  ramphold schema person")]
pub struct SchemaArgs {
    /// The kind of file.
    #[arg(value_enum, default_value_t = SchemaKind::Protocol)]
    kind: SchemaKind,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum SchemaKind {
    /// A protocol, for `run`.
    Protocol,
    /// A virtual subject, for `run --subject`.
    Person,
    /// A rig, virtual or on a CAN bus, for `run --rig`.
    Rig,
    /// A study, for `cohort`.
    Study,
    /// The description of a session that was measured elsewhere: its `session.json`.
    Session,
    /// A mapping, for `import`.
    Import,
}

impl Verb for SchemaArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let text = match self.kind {
            SchemaKind::Protocol => protocol::schema_text(),
            SchemaKind::Person => virtual_wrist::person_schema_text(),
            SchemaKind::Rig => rig::schema_text(),
            SchemaKind::Study => study::schema_text(),
            SchemaKind::Session => dataset::session_schema_text(),
            SchemaKind::Import => import::schema_text(),
        };
        Ok(console.results().write_all(text.as_bytes())?)
    }
}
