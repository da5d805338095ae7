//! `ramphold states`: the transition table of the session.

use std::io::Write;

use ramphold::session::transitions;

use super::{Console, Failure, Verb};

/// Print the transition table of a session: which phase follows which, and why.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold states\n  ramphold states --dot | dot -Tsvg > states.svg")]
pub struct States {
    /// As a graph in the language of Graphviz.
    #[arg(long, conflicts_with = "mermaid")]
    dot: bool,
    /// As a Mermaid state diagram, without faults and aborts.
    #[arg(long)]
    mermaid: bool,
}

impl Verb for States {
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
