//! `ramphold trials`: the trials of a session with the marks of the fit, and judgements on them.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, now_utc, operator_name, read_stored_fit};
use crate::dataset::{self, Amendment, Amendments, Disk, Manifest, Status, Trial};
use crate::files;

use super::verb::Verb;

/// List the trials of a session with the marks of its fit; reject trials after looking at them, or accept them again.
///
/// A judgement is written to amendments.json beside the raw data, with who judged, when and why. The raw data stay as they are. Fit,
/// diagnosis, report and export follow the last judgement on each trial; `ramphold verify` lists them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold trials sessions/S01\n  \
                        ramphold trials sessions/S01 --reject 7 --because \"hand slipped\"")]
pub struct TrialsArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Reject a trial: it is analysed no more. May be given several times.
    #[arg(long, value_name = "N", requires = "because")]
    reject: Vec<u32>,
    /// Accept a trial that was rejected. May be given several times.
    #[arg(long, value_name = "N")]
    accept: Vec<u32>,
    /// Why.
    #[arg(long, value_name = "TEXT")]
    because: Option<String>,
    /// Who judges [default: the name of the user at this computer].
    #[arg(long, value_name = "NAME")]
    by: Option<String>,
}

impl Verb for TrialsArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        if !self.reject.is_empty() || !self.accept.is_empty() {
            self.amend(console)?;
        }
        self.list(console)
    }
}

impl TrialsArgs {
    /// Adds the judgements to the file beside the raw data.
    fn amend(&self, console: &Console) -> Result<(), Failure> {
        if let Some(trial) = self.reject.iter().find(|trial| self.accept.contains(trial)) {
            return Err(Failure::Usage(format!(
                "trial {trial} is given with --reject and with --accept; give it with one of them"
            )));
        }
        if self.because.as_deref().is_some_and(|because| because.trim().is_empty()) {
            return Err(Failure::Usage(
                "--because is empty; say why, such as --because \"hand slipped\"".into(),
            ));
        }
        let before = dataset::load(&self.session)?;
        let mut amendments = Amendments::read(&self.session)?;
        let judged = self
            .reject
            .iter()
            .map(|trial| (*trial, Status::Rejected))
            .chain(self.accept.iter().map(|trial| (*trial, Status::Ok)));
        for (trial, status) in judged {
            let Some(own) = before.trials.iter().find(|own| own.number == trial) else {
                return Err(Failure::Usage(format!(
                    "{}: has no trial {trial}; its trials are {}",
                    self.session.join("trials.csv").display(),
                    numbers(&before.trials)
                )));
            };
            amendments.amendments.push(Amendment {
                trial,
                record_sha256: dataset::record_sha256(&self.session, own)?,
                status,
                because: self.because.clone().unwrap_or_default(),
                by: self.by.clone().unwrap_or_else(operator_name),
                at_utc: now_utc(),
            });
        }
        dataset::load_amended(&self.session, &amendments)?;
        amendments.write(&Disk::default(), &self.session)?;
        Manifest::renew_amendments(&Disk::default(), &self.session)?;
        if files::exists(&self.session.join("results")) {
            let session = self.session.display();
            console.message(format_args!(
                "results/ was made before this; make it again with: ramphold fit {session}; ramphold diagnose {session}"
            ));
        }
        Ok(())
    }

    fn list(&self, console: &Console) -> Result<(), Failure> {
        let session = dataset::load(&self.session)?;
        let amendments = Amendments::read(&self.session)?;
        let fit = read_stored_fit(&self.session)?.unwrap_or_default();
        let digest = session.digest();
        let made_from = fit.pointer("/made_from/session_sha256").and_then(serde_json::Value::as_str);
        let fit = if made_from.is_some_and(|own| own != digest) {
            let session = self.session.display();
            console.message(format_args!(
                "the fit was made before the session was changed, and is not shown; make it again with: ramphold fit {session}"
            ));
            serde_json::Value::Null
        } else {
            fit
        };
        let mut out = console.results();
        writeln!(out, "trial  rad/s   N m   rep  status    VAF     marks")?;
        for trial in &session.trials {
            let estimates = fit["trials"].as_array().into_iter().flatten();
            let own = estimates.into_iter().find(|own| own["trial"] == trial.number);
            let vaf = own.and_then(|own| own["values"]["vaf"].as_f64());
            let mut marks: Vec<String> = own
                .and_then(|own| own["remarks"].as_array())
                .into_iter()
                .flatten()
                .filter_map(|mark| mark.as_str().map(str::to_owned))
                .collect();
            if let Some(judged) = amendments.of_trial(trial.number) {
                marks.insert(0, judgement(judged));
            } else if let Some(reason) = trial.extra.get("reason").filter(|reason| !reason.is_empty()) {
                marks.insert(0, reason.replace('_', " "));
            }
            writeln!(
                out,
                "{:5}  {:5.2}  {:4.2}  {:3}  {:8}  {:6}  {}",
                trial.number,
                trial.velocity_rad_s,
                trial.torque_nm,
                trial.repetition,
                trial.status.name(),
                vaf.map_or("-".into(), |vaf| format!("{vaf:.4}")),
                marks.join("; ")
            )?;
        }
        Ok(())
    }
}

/// A judgement in words.
fn judgement(judged: &Amendment) -> String {
    let why = if judged.because.is_empty() { String::new() } else { format!(": {}", judged.because) };
    format!("{} by {}, {}{why}", judged.status.name(), judged.by, judged.at_utc)
}

fn numbers(trials: &[Trial]) -> String {
    match (trials.first(), trials.last()) {
        (Some(first), Some(last)) => format!("{} to {}", first.number, last.number),
        _ => "none".to_owned(),
    }
}
