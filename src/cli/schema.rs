//! `ramphold schema`: the JSON schemas of the files that people write.

use std::io::Write;

use ramphold::protocol;
use ramphold::rig::virtual_wrist;
use ramphold::study;

use super::{Console, Failure, Verb};

/// Print the JSON schema of protocol files, of virtual persons, of rigs or of studies.
///
/// The files protocols/*.schema.json are this output. An editor that knows them completes field names and marks mistakes
/// while a file is written.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold schema > protocol.schema.json\n  ramphold schema person")]
pub struct Schema {
    /// Which kind of file.
    #[arg(value_enum, default_value_t = Kind::Protocol)]
    kind: Kind,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Kind {
    /// What is run.
    Protocol,
    /// A virtual person, for `run --subject`.
    Person,
    /// A rig, for `run --rig`.
    Rig,
    /// A study, for `cohort`.
    Study,
}

impl Verb for Schema {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let text = match self.kind {
            Kind::Protocol => protocol::schema_text(),
            Kind::Person => virtual_wrist::person_schema_text(),
            Kind::Rig => virtual_wrist::rig_schema_text(),
            Kind::Study => study::schema_text(),
        };
        Ok(console.results().write_all(text.as_bytes())?)
    }
}
