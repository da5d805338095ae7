//! `ramphold states`: the transition table of the session.

use std::io::Write;

use crate::app::{Console, Failure};
use crate::session::transitions;

use super::verb::Verb;

/// Print the transition table of the session's state machine: phases, events, guards and effects.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold states\n  ramphold states --dot | dot -Tsvg > states.svg")]
pub struct StatesArgs {
    /// Print a graph in the language of Graphviz.
    #[arg(long, conflicts_with = "mermaid")]
    dot: bool,
    /// Print a Mermaid state diagram, without faults and aborts.
    #[arg(long)]
    mermaid: bool,
}

impl Verb for StatesArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let text = match (self.dot, self.mermaid) {
            (true, _) => transitions::dot(),
            (_, true) => transitions::mermaid(),
            _ => transitions::text(),
        };
        console.results().write_all(text.as_bytes())?;
        Ok(())
    }
}
