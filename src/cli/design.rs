//! `ramphold design`: the protocol that best separates mechanisms which a diagnosis could not tell apart.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::app::{Console, Failure, check_out, named_causes, read_diagnosis};
use crate::dataset;
use crate::diagnose::{ProtocolProposal, inseparable, propose_protocols, worthwhile};
use crate::files::{self, Folder};
use crate::protocol::ValidProtocol;
use crate::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismKind};

use super::verb::Verb;

/// Propose the protocol that best separates the mechanisms which a session's diagnosis could not tell apart.
///
/// The verb varies the ramp and the conditions of a protocol, simulates each variant with each mechanism, and prints the
/// power: the probability that the wrong mechanism is ruled out. Variants that gain something are listed from the best to the worst;
/// a pair of mechanisms that no variant separates is named.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold diagnose sessions/S01\n  \
                        ramphold design sessions/S01 --out next.json\n  ramphold check next.json")]
pub struct DesignArgs {
    /// The session's folder. It needs results/diagnosis.json, unless --between is given.
    session: PathBuf,
    /// Ids of the mechanisms to separate [default: the first cause of the diagnosis and what it can be confused with].
    #[arg(long, value_name = "MECHANISM", num_args = 2..)]
    between: Vec<String>,
    /// The protocol that is varied [default: that of the session].
    #[arg(long, value_name = "FILE")]
    protocol: Option<PathBuf>,
    /// Write the best protocol to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Largest number of mechanisms that a protocol is designed to separate.
const MAX_MECHANISMS: usize = 3;

impl Verb for DesignArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let causes = if self.between.is_empty() { self.left_open()? } else { self.asked_for()? };
        if let Some(out) = &self.out {
            check_out("--out", out)?;
        }
        if let Some(out) = self.out.as_ref().filter(|out| files::exists(out)) {
            return Err(Failure::Usage(format!(
                "{}: exists already and is not overwritten; give another --out",
                out.display()
            )));
        }
        let protocol = self.protocol()?;
        let session = dataset::load(&self.session)?;
        console.message(format_args!("fitting {} mechanisms to each candidate protocol ...", causes.len()));
        let proposals = propose_protocols(&session, &protocol, &causes)
            .map_err(|source| Failure::Prepare { session: self.session.display().to_string(), source })?;
        for (one, other, power) in inseparable(&proposals) {
            writeln!(
                console.results(),
                "no protocol of this rig is expected to separate {} from {}: the wrong one is ruled out with a probability of at \
                 most {power:.2}",
                one.id(),
                other.id()
            )?;
        }
        let proposals = worthwhile(proposals);
        table(console, &proposals)?;
        if proposals.len() < 2 {
            writeln!(console.results(), "no change of the protocol is expected to gain anything")?;
        }
        match (&self.out, proposals.first()) {
            (Some(out), Some(_)) if proposals.len() < 2 => Err(Failure::NothingToGain { out: out.clone() }),
            (Some(out), Some(best)) => {
                let written = Folder::open(out.parent().unwrap_or(Path::new(""))).and_then(|folder| {
                    folder.write(out.file_name().unwrap_or_default(), best.protocol.text().as_bytes())
                });
                written.map_err(|source| Failure::ResultsFolder { path: out.clone(), source })?;
                console.message(format_args!("{}: {}", out.display(), best.change));
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

impl DesignArgs {
    fn protocol(&self) -> Result<ValidProtocol, Failure> {
        if let Some(file) = &self.protocol {
            return Ok(ValidProtocol::read(file)?);
        }
        match dataset::stored_protocol(&self.session)? {
            Some(protocol) => Ok(protocol),
            None => Err(Failure::Usage(format!(
                "{}: has no protocol.json to start from; give one with --protocol FILE",
                self.session.display()
            ))),
        }
    }

    fn asked_for(&self) -> Result<Vec<MechanismKind>, Failure> {
        self.between.iter().map(|id| kind(id)).collect()
    }

    /// The first cause of the diagnosis that can be confused with others, and those others.
    fn left_open(&self) -> Result<Vec<MechanismKind>, Failure> {
        let diagnosis = read_diagnosis(&self.session)?;
        if let Some((_, ids)) = named_causes(&diagnosis).find(|(_, ids)| ids.len() > 1) {
            return ids.into_iter().take(MAX_MECHANISMS).map(kind).collect();
        }
        let session = self.session.display();
        Err(Failure::Usage(format!(
            "{session}: its diagnosis leaves no cause open; name the mechanisms to separate with --between"
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
            "mechanism \"{id}\": has no effect within a trial, only across trials or in the hold; expected a mechanism \
             that acts within a trial"
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
