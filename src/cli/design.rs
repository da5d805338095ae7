//! `ramphold design`: the protocol that best separates what a diagnosis could not tell apart.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use ramphold::dataset;
use ramphold::diagnose::{ProtocolProposal, propose_protocols};
use ramphold::protocol::ValidProtocol;
use ramphold::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismKind};

use super::diagnose::{named, read_diagnosis};
use super::{Console, Failure, Verb};

/// Propose the protocol that best tells apart the causes which a session's diagnosis left open.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold diagnose sessions/S01\n  \
                        ramphold design sessions/S01 --out next.json\n  ramphold check next.json")]
pub struct Design {
    /// The session's folder, with its results/diagnosis.json.
    session: PathBuf,
    /// Causes to tell apart, instead of those that the diagnosis left open.
    #[arg(long, value_name = "MECHANISM", num_args = 2..)]
    between: Vec<String>,
    /// The protocol that is varied; the session's own if it has one.
    #[arg(long, value_name = "FILE")]
    protocol: Option<PathBuf>,
    /// Where the best protocol is written; a file that is there is not overwritten.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Most causes that a protocol is made for.
const MOST: usize = 3;

impl Verb for Design {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let causes = if self.between.is_empty() { self.left_open()? } else { self.asked_for()? };
        if let Some(out) = self.out.as_ref().filter(|out| out.exists()) {
            return Err(Failure::Usage(format!("{}: is there already; expected a new file", out.display())));
        }
        let protocol = self.protocol()?;
        let session = dataset::load(&self.session)?;
        console.message(format_args!("fitting {} causes to each protocol in question ...", causes.len()));
        let proposals = propose_protocols(&session, &protocol, &causes)
            .map_err(|source| Failure::Prepare { session: self.session.display().to_string(), source })?;
        table(console, &proposals)?;
        if let (Some(out), Some(best)) = (&self.out, proposals.first()) {
            fs::write(out, best.protocol.text())?;
            console.message(format_args!("{}: {}", out.display(), best.change));
        }
        Ok(())
    }
}

impl Design {
    fn protocol(&self) -> Result<ValidProtocol, Failure> {
        let own = self.session.join("protocol.json");
        match &self.protocol {
            Some(file) => Ok(ValidProtocol::read(file)?),
            None if own.exists() => Ok(ValidProtocol::read(&own)?),
            None => Err(Failure::Usage(format!(
                "{}: has no protocol.json to start from; give one with --protocol FILE",
                self.session.display()
            ))),
        }
    }

    fn asked_for(&self) -> Result<Vec<MechanismKind>, Failure> {
        self.between.iter().map(|id| kind(id)).collect()
    }

    /// The first cause of the diagnosis that could be another, with what it could be.
    fn left_open(&self) -> Result<Vec<MechanismKind>, Failure> {
        let diagnosis = read_diagnosis(&self.session)?;
        if let Some((_, ids)) = named(&diagnosis).find(|(_, ids)| ids.len() > 1) {
            return ids.into_iter().take(MOST).map(kind).collect();
        }
        let session = self.session.display();
        Err(Failure::Usage(format!(
            "{session}: its diagnosis left no cause open, so nothing is to be told apart; name mechanisms with --between"
        )))
    }
}

/// The mechanism of this id, if a longer or wider ramp can show it.
fn kind(id: &str) -> Result<MechanismKind, Failure> {
    let Some(kind) = CATALOGUE.iter().copied().find(|kind| kind.id() == id) else {
        let known: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id()).collect();
        return Err(Failure::Usage(format!(
            "mechanism \"{id}\": unknown; expected one of {}",
            known.join(", ")
        )));
    };
    if !matches!(kind.evidence(), EvidenceSource::Trace | EvidenceSource::LimitLaw) {
        return Err(Failure::Usage(format!(
            "mechanism \"{id}\": shows between trials or in the hold, not in how a trial goes; designs are made for what \
             shows within the trials"
        )));
    }
    Ok(kind)
}

fn table(console: &Console, proposals: &[ProtocolProposal]) -> Result<(), Failure> {
    let mut out = console.results();
    writeln!(out, "power  trials  minutes  change")?;
    for proposal in proposals {
        writeln!(
            out,
            "{:5.2}  {:6}  {:7.0}  {}",
            proposal.least_power(),
            proposal.protocol.trial_count(),
            proposal.protocol.duration().expected_s / 60.0,
            proposal.change
        )?;
    }
    if let Some(best) = proposals.first() {
        writeln!(out, "the best, if the first is the cause, rules out the second with probability:")?;
        for (truth, other, power) in &best.power {
            writeln!(out, "  {} / {}: {power:.2}", truth.id(), other.id())?;
        }
    }
    Ok(())
}
