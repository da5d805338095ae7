//! `ramphold schema`: the JSON schema of protocol files.

use std::io::Write;

use ramphold::protocol;

use super::{Console, Failure, Verb};

/// Print the JSON schema of protocol files.
///
/// The file protocols/protocol.schema.json is this output. An editor that knows it completes field names and marks
/// mistakes while a protocol is written.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold schema > protocol.schema.json")]
pub struct Schema {}

impl Verb for Schema {
    fn run(self, console: &Console) -> Result<(), Failure> {
        Ok(console.results().write_all(protocol::schema_text().as_bytes())?)
    }
}
