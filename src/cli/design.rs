//! `ramphold design`: what separates mechanisms which a diagnosis could not tell apart: rig trials, a sensor or another protocol.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::app::{Console, Failure, check_out, named_causes, read_diagnosis};
use crate::dataset;
use crate::diagnose::{Needs, Proposal, inseparable, propose, worthwhile};
use crate::files::{self, Folder};
use crate::protocol::ValidProtocol;
use crate::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismKind};

use super::verb::Verb;

/// Propose what separates the mechanisms which a session's diagnosis could not tell apart: another protocol, rig trials or a sensor.
///
/// For each set of causes that the diagnosis left open, the verb varies the ramp and the conditions of the protocol, adds rig trials to
/// the session, and adds each sensor that it lacks. Each is simulated with each mechanism; the table has the probability that the right
/// one is named. What gains something is listed, the cheapest first; a pair of mechanisms that nothing on this rig separates is named.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold diagnose sessions/S01\n  \
                        ramphold design sessions/S01 --out next.json\n  ramphold check next.json")]
pub struct DesignArgs {
    /// The session's folder. It needs results/diagnosis.json, unless --between is given.
    session: PathBuf,
    /// Ids of the mechanisms to separate [default: each cause of the diagnosis with what it can be confused with].
    #[arg(long, value_name = "MECHANISM", num_args = 2..)]
    between: Vec<String>,
    /// The protocol that is varied [default: that of the session].
    #[arg(long, value_name = "FILE")]
    protocol: Option<PathBuf>,
    /// Write the best protocol for the first set of causes to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Largest number of mechanisms of a set that are separated: the first ones.
const MAX_MECHANISMS: usize = 3;

impl Verb for DesignArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let sets = if self.between.is_empty() { self.left_open(console)? } else { vec![self.asked_for()?] };
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
        let mut best = None;
        for causes in &sets {
            console.message(format_args!("fitting {} mechanisms to each candidate ...", causes.len()));
            let proposals = propose(&session, &protocol, causes)
                .map_err(|source| Failure::Prepare { session: self.session.display().to_string(), source })?;
            let proposals = advise(console, causes, proposals)?;
            best.get_or_insert(proposals);
        }
        match (&self.out, best.as_deref().and_then(best_protocol)) {
            (Some(out), Some(best)) => {
                let written = Folder::open(out.parent().unwrap_or(Path::new(""))).and_then(|folder| {
                    folder.write(out.file_name().unwrap_or_default(), best.protocol.text().as_bytes())
                });
                written.map_err(|source| Failure::ResultsFolder { path: out.clone(), source })?;
                console.message(format_args!("{}: {}", out.display(), best.change));
                Ok(())
            }
            (Some(out), None) => Err(Failure::NothingToGain { out: out.clone() }),
            _ => Ok(()),
        }
    }
}

/// The protocol with the largest power, if one gains something over that of the session; the first of equal ones, which is the shortest.
fn best_protocol(proposals: &[Proposal]) -> Option<&Proposal> {
    let protocols = proposals.iter().filter(|own| own.needs == Needs::Session && !own.is_unchanged());
    protocols.reduce(|best, own| if own.least_power() > best.least_power() { own } else { best })
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
        let mut kinds = Vec::new();
        for id in &self.between {
            let kind = kind(id)?;
            if kinds.contains(&kind) {
                return Err(Failure::Usage(format!(
                    "--between: {id} is given twice; name different mechanisms"
                )));
            }
            kinds.push(kind);
        }
        Ok(kinds)
    }

    /// Each cause of the diagnosis that can be confused with others, with those others.
    fn left_open(&self, console: &Console) -> Result<Vec<Vec<MechanismKind>>, Failure> {
        let diagnosis = read_diagnosis(&self.session)?;
        if diagnosis["verdict"] == "unexplained" {
            console.message(format_args!(
                "the diagnosis is unexplained: the cause may be none of these, and then no protocol names it; each probability holds \
                 if it is one of them"
            ));
        }
        let open = named_causes(&diagnosis).filter(|(_, ids)| ids.len() > 1);
        let sets: Vec<Vec<MechanismKind>> = open
            .map(|(_, ids)| ids.into_iter().take(MAX_MECHANISMS).map(kind).collect())
            .collect::<Result<_, _>>()?;
        if sets.is_empty() {
            let session = self.session.display();
            return Err(Failure::Usage(format!(
                "{session}: its diagnosis leaves no cause open; name the mechanisms to separate with --between"
            )));
        }
        Ok(sets)
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

/// Prints what separates `causes`, and returns the proposals that are worth offering.
fn advise(
    console: &Console,
    causes: &[MechanismKind],
    proposals: Vec<Proposal>,
) -> Result<Vec<Proposal>, Failure> {
    let mut out = console.results();
    let ids: Vec<&str> = causes.iter().map(|cause| cause.id()).collect();
    writeln!(out, "to tell apart: {}", ids.join(", "))?;
    for (one, other, power) in inseparable(&proposals) {
        writeln!(
            out,
            "nothing on this rig is expected to separate {} from {}: the right one is named with a probability of at most {power:.2}",
            one.id(),
            other.id()
        )?;
    }
    let proposals = worthwhile(proposals);
    writeln!(out, "right name  needs       trials  minutes  what to do")?;
    for proposal in &proposals {
        let needs = match proposal.needs {
            Needs::Session => "session",
            Needs::RigTrials => "rig trials",
            Needs::Sensor => "sensor",
        };
        writeln!(
            out,
            "{:10.2}  {needs:10}  {:6}  {:7.0}  {}",
            proposal.least_power(),
            proposal.protocol.trial_count(),
            proposal.protocol.duration().expected_s / 60.0,
            proposal.change
        )?;
    }
    if proposals.len() < 2 {
        writeln!(out, "no change is expected to gain anything")?;
    }
    let best =
        proposals.iter().reduce(|best, own| if own.least_power() > best.least_power() { own } else { best });
    if let Some(best) = best.filter(|best| best.power.len() > 2) {
        writeln!(
            out,
            "with the best of them ({}), the first is named, if only the second is left beside it:",
            best.change
        )?;
        for (truth, other, power) in &best.power {
            writeln!(out, "  {} / {}: {power:.2}", truth.id(), other.id())?;
        }
    }
    Ok(proposals)
}
