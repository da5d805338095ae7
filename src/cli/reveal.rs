//! `ramphold reveal`: which mechanism `run --hide` added, and whether the diagnosis found it.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{
    Console, Failure, StoredVirtualRig, named_causes, open_seal, parse_seed, read_diagnosis,
    read_stored_virtual_rig,
};
use crate::protocol::significant;
use crate::rig::virtual_wrist::RigFile;

use super::verb::Verb;

/// Print the mechanism that `run --hide` added to a session, and whether the diagnosis of the session found it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold run protocols/de-vlugt-2011.json --hide 7 --out sessions/riddle\n  \
                        ramphold diagnose sessions/riddle\n  ramphold reveal sessions/riddle --seed 7\n\n\
                        Exit code 1 if the diagnosis missed it."
)]
pub struct RevealArgs {
    /// The session's folder.
    session: PathBuf,
    /// The seed that was given to `run --hide`.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: u64,
}

impl Verb for RevealArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let StoredVirtualRig { rig: RigFile::Virtual(setup), seal, .. } =
            read_stored_virtual_rig(&self.session)?;
        let effect = open_seal(seal.as_ref(), Some(self.seed), setup.lever, "--seed", &self.session)?;
        let kind = effect.kinds[0];
        let mut out = console.results();
        writeln!(out, "hidden: {} ({})", kind.id(), kind.title())?;
        for (parameter, value) in kind.parameters().iter().zip(&effect.parameters) {
            writeln!(out, "  {} = {}: {}", parameter.name, significant(*value), parameter.meaning)?;
        }
        let diagnosis = read_diagnosis(&self.session)?;
        writeln!(out, "verdict: {}", diagnosis["verdict"].as_str().unwrap_or("not stated"))?;
        let mut found = false;
        for (cause, set) in named_causes(&diagnosis) {
            let is_it = set.contains(&kind.id());
            found |= is_it;
            writeln!(out, "named: {}{}", set.join(" or "), if is_it { ", which is right" } else { "" })?;
            if set.first() != Some(&kind.id()) {
                continue;
            }
            for (parameter, value) in kind.parameters().iter().zip(&effect.parameters) {
                let own = &cause["parameters"][parameter.name];
                if let (Some(low), Some(high)) = (own["low"].as_f64(), own["high"].as_f64()) {
                    let covers = if (low..=high).contains(value) { "holds" } else { "misses" };
                    let [low, high, truth] = [low, high, *value].map(significant);
                    writeln!(out, "  {}: {low} to {high} {covers} the true {truth}", parameter.name)?;
                }
            }
        }
        if found { Ok(()) } else { Err(Failure::NotFound { mechanism: kind.id() }) }
    }
}
