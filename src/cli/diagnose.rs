//! `ramphold diagnose`: what the model gets wrong, which mechanism explains it, and what adding it gains.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{
    AnalysedSession, AnalysisRequest, Console, DiagnosedSession, Failure, ResultsFolder, announce_unfinished,
    check_has_none, check_none_left_out, check_out, folder_of_diagnosis, lock_results, parse_seed,
    read_model, write_report,
};
use crate::consistency::SignalCheck;
use crate::dataset::{Disk, Manifest, Session};
use crate::diagnose::{Cause, CauseEvidence, Diagnosis, FoundLaw, Verdict, picture};
use crate::fit::NoiseSource;
use crate::json_file;
use crate::protocol::significant;
use crate::report;
use serde_json::Value;

use super::verb::Verb;

/// Diagnose a session: test whether the model misfits, find the mechanisms that explain the misfit, and how much they gain.
///
/// The verb compares the model with those that have a mechanism of the catalogue, two of them, or an unknown law in
/// addition, and gives each cause its probability. It writes diagnosis.json and its figures into the results folder and
/// prints a summary. The verdict is one of: adequate (no misfit beyond the noise), named (each cause has a probability of
/// at least 0.95), ambiguous (a cause can be another one), unexplained (misfit remains that no mechanism explains).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold diagnose sessions/S01\n  \
                        ramphold diagnose ankle-0 --window 0.180 --out results")]
pub struct DiagnoseArgs {
    /// The session's folder.
    session: PathBuf,
    /// Analysed time after the onset of the ramp, s [default: that of the session's protocol, else 0.040].
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    /// Seed of the draws of noise that give the null distributions.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed, default_value_t = 1)]
    seed: u64,
    /// The model file that the diagnosis starts from [default: the model of the paper].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The file of the rig's measured constants, as `ramphold calibrate` writes it; `none` uses what the session states [default:
    /// rig-calibration.json in the session's folder, if there is one].
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Analyse although a check of the signals against the table fails; the results keep it. Names as in `ramphold fit`.
    #[arg(long, value_name = "CHECKS", value_delimiter = ',')]
    accept: Vec<SignalCheck>,
    /// Folder for the results [default: results/ in the session's folder, or a named folder in it if results/ holds a fit or a
    /// diagnosis of another window or model].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print diagnosis.json instead of the summary.
    #[arg(long)]
    json: bool,
}

impl Verb for DiagnoseArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let model = read_model(self.model.as_deref())?;
        let asked = AnalysisRequest {
            window_s: self.window,
            calibration: self.calibration.clone(),
            accept: self.accept.clone(),
        };
        announce_unfinished(&self.session, console);
        let session = AnalysedSession::read(&self.session, &asked, console)?;
        let given = self.given_folder(&session.checked.session)?;
        let input = session.prepare_diagnosis(&model)?;
        if input.observations.noise_source != Some(NoiseSource::Holds) {
            console.message("no hold before the ramps: the noise is estimated from the repetitions instead");
        }
        let stages = console.stages();
        let found = session.diagnose(input, &model, self.seed, &|stage| stages.set_message(stage));
        stages.finish_and_clear();
        let DiagnosedSession { input, diagnosis, json } = found;
        let prepared = &input.observations;
        let _alone = if given.is_none() { Some(lock_results(&self.session)?) } else { None };
        let folder = match given {
            Some(folder) => folder,
            None => folder_of_diagnosis(&self.session, &json)?,
        };
        if matches!(folder, ResultsFolder::Named { .. }) {
            console.announce(format_args!(
                "results/ holds results of another window, model or calibration, which are kept; this diagnosis is in {}",
                folder.path().display()
            ));
        }
        let folder = folder.open()?;
        diagnosis.write(prepared, &json, &Disk::default(), &folder)?;
        write_report(&self.session, session.checked.session, &folder, console)?;
        if self.out.is_none() {
            Manifest::renew_results(&Disk::default(), &self.session)?;
        }
        if self.json {
            write!(console.results(), "{}", json_file::pretty(&json))?;
        } else {
            summary(console, &diagnosis, &json)?;
        }
        check_none_left_out(&self.session, prepared)
    }
}

impl DiagnoseArgs {
    /// The folder in `--out`, where nothing is replaced. A fit may stand there already if it is of the same trials: the report
    /// shows both. `None` without `--out`: the diagnosis then decides.
    fn given_folder(&self, session: &Session) -> Result<Option<ResultsFolder>, Failure> {
        let Some(out) = &self.out else { return Ok(None) };
        check_out("--out", out)?;
        check_has_none("--out", out, &["diagnosis.json", "model.json"])?;
        if !report::is_of_session(out, session)? {
            return Err(Failure::Usage(format!(
                "{}: contains a fit of other trials, beside which this diagnosis would be read wrongly; give another --out",
                out.display()
            )));
        }
        Ok(Some(ResultsFolder::Given(out.clone())))
    }
}

fn summary(console: &Console, diagnosis: &Diagnosis, json: &Value) -> Result<(), Failure> {
    let mut out = console.results();
    let says = match diagnosis.verdict {
        Verdict::Adequate => "adequate: no misfit beyond the measured noise",
        Verdict::Named => "named: every cause has a probability of at least 0.95",
        Verdict::Ambiguous => "ambiguous: some cause could be another",
        Verdict::Unexplained if diagnosis.probabilities.is_none() => {
            "unexplained: the model does not describe the session, and no cause is named; a note below says why"
        }
        Verdict::Unexplained => "unexplained: misfit remains that no mechanism of the catalogue explains",
    };
    writeln!(out, "verdict: {says}")?;
    if diagnosis.p_value.is_nan() {
        return notes(&mut out, diagnosis);
    }
    writeln!(
        out,
        "misfit: largest score {:.1} standard errors, pattern {:.1} standard deviations, p = {:.4}",
        diagnosis.misfit.largest, diagnosis.misfit.excess, diagnosis.p_value
    )?;
    for (cause, entry) in diagnosis.causes.iter().zip(json["causes"].as_array().into_iter().flatten()) {
        print_cause(&mut out, cause, entry)?;
    }
    if !diagnosis.causes.is_empty() || diagnosis.verdict == Verdict::Unexplained {
        writeln!(
            out,
            "misfit that remains with the causes in the model, within the trials and across them: p = {:.3}",
            diagnosis.remaining_p_value
        )?;
    }
    if let Some(probabilities) = &diagnosis.probabilities {
        writeln!(
            out,
            "probability of no cause {:.3}, of a law in no catalogue {:.3}",
            probabilities.none, probabilities.none_of_these
        )?;
    }
    if let Some(law) = &diagnosis.free_law {
        print_free_law(&mut out, law)?;
    }
    if let Some(law) = &diagnosis.elastic_limit_law {
        writeln!(out, "elastic limit: {law}")?;
    }
    if let Some(term) = &diagnosis.residual_term {
        let terms: Vec<String> =
            term.terms.iter().map(|t| format!("{:.3e} * ({})", t.coefficient, t.term)).collect();
        let about = match terms.as_slice() {
            [] => "no sum of simple terms describes the residual".to_string(),
            _ => format!(
                "the residual is about {} (N m): a description of {:.0} % of it, not a mechanism",
                terms.join(" + "),
                100.0 * term.described
            ),
        };
        writeln!(
            out,
            "{about}; largest {:.1} ms after the onset, at {:.2} rad/s and {:.1} N m",
            1e3 * term.largest_at_s,
            term.largest_in.0,
            term.largest_in.1
        )?;
    }
    if !diagnosis.undetectable.is_empty() {
        let ids: Vec<&str> = diagnosis.undetectable.iter().map(|unseen| unseen.kind.id()).collect();
        writeln!(out, "this session cannot tell about: {} (diagnosis.json says why)", ids.join(", "))?;
    }
    notes(&mut out, diagnosis)?;
    write!(out, "{}", picture(&json["residual_map"]))?;
    Ok(())
}

/// Place, argument and curve of an unknown law; the curve at five points.
fn print_free_law(out: &mut impl Write, law: &FoundLaw) -> Result<(), Failure> {
    write!(out, "unknown law: {}", law.kind.title())?;
    for (kind, _) in &law.alternatives {
        write!(out, ", or {}", kind.title())?;
    }
    writeln!(out)?;
    for place in (0..law.argument.len()).step_by(law.argument.len().div_ceil(5).max(1)) {
        let [at, value, low, high] =
            [law.argument[place], law.value[place], law.band[0][place], law.band[1][place]].map(significant);
        writeln!(out, "  at {at}: {value} (95 %: {low} to {high})")?;
    }
    Ok(())
}

fn notes(out: &mut impl Write, diagnosis: &Diagnosis) -> Result<(), Failure> {
    for remark in &diagnosis.remarks {
        writeln!(out, "note: {remark}")?;
    }
    Ok(())
}

/// The parameters of a candidate, and how much k_srs and x_e change with it.
fn print_candidate(out: &mut impl Write, entry: &Value) -> Result<(), Failure> {
    for (name, value) in entry["parameters"].as_object().into_iter().flatten() {
        if !value["value"].is_number() {
            continue;
        }
        let number = |key: &str| value[key].as_f64().map_or("?".into(), significant);
        if value["low"] == value["high"] {
            writeln!(out, "  {name} = {}", number("value"))?;
        } else {
            writeln!(out, "  {name} = {} (95 %: {} to {})", number("value"), number("low"), number("high"))?;
        }
    }
    for (name, field, unit, factor) in
        [("k_srs", "k_srs_nm_per_rad", "N m/rad", 1.0), ("x_e", "x_e_rad", "mrad", 1e3)]
    {
        let shift = &entry["parameter_shift"][field];
        if let (Some(before), Some(after)) = (shift["before"].as_f64(), shift["after"].as_f64()) {
            writeln!(
                out,
                "  with it in the model, {name} is {} {unit} instead of {} ({:+.1} %)",
                significant(factor * after),
                significant(factor * before),
                100.0 * (after - before) / before
            )?;
        }
    }
    Ok(())
}

fn print_cause(out: &mut impl Write, cause: &Cause, entry: &Value) -> Result<(), Failure> {
    write!(out, "cause: {} ({}, {:?})", cause.kind.id(), cause.kind.title(), cause.kind.class())?;
    for own in &cause.alternatives {
        write!(out, " or {}", own.kind.id())?;
    }
    writeln!(out, ", probability {:.3}", cause.probability)?;
    print_candidate(out, entry)?;
    for own in entry["alternatives"].as_array().into_iter().flatten() {
        let text = |key: &str| own[key].as_str().unwrap_or("?");
        let probability = own["probability"].as_f64().unwrap_or(f64::NAN);
        writeln!(
            out,
            "  or {} ({}, {}), probability in its place {probability:.3}",
            text("mechanism"),
            text("title"),
            text("class")
        )?;
        print_candidate(out, own)?;
    }
    if let Some(law) = &cause.law {
        let title = law.free.kind.title();
        match law.p_value {
            Some(p_value) => writeln!(
                out,
                "  its law and what the session shows without one ({title}) differ by as much as was declared with probability {p_value:.3}"
            )?,
            None => writeln!(out, "  what the session shows without its law: {title}")?,
        }
    }
    match &cause.evidence {
        CauseEvidence::WithinTrial { gain, .. } => writeln!(
            out,
            "  residual on repetitions left out: {:.3} of what it was ({:.3} to {:.3}); VAF {:.4} -> {:.4}",
            gain.held_out_rmse_ratio.value,
            gain.held_out_rmse_ratio.low,
            gain.held_out_rmse_ratio.high,
            gain.vaf_before,
            gain.vaf_after
        )?,
        CauseEvidence::Hold { gain, .. } => writeln!(
            out,
            "  found in the holds and taken out; residual of the ramps: {:.3} of what it was ({:.3} to {:.3})",
            gain.held_out_rmse_ratio.value, gain.held_out_rmse_ratio.low, gain.held_out_rmse_ratio.high
        )?,
        CauseEvidence::RigTrials { deviation_sds, .. } => writeln!(
            out,
            "  measured in rig trials: {deviation_sds:.1} standard deviations from what the session states; the fit uses the measured value"
        )?,
        CauseEvidence::AcrossTrials(trend) => writeln!(
            out,
            "  spread of k_srs about the other repetitions: {:.3} of what it was (t = {:.1})",
            trend.left_out_ratio, trend.t
        )?,
        CauseEvidence::Outliers(outliers) => {
            for (own, told) in outliers.iter().zip(entry["trials"].as_array().into_iter().flatten()) {
                let number = &told["trial"];
                match own.ratio {
                    Some(ratio) => {
                        writeln!(out, "  trial {number}: k_srs {ratio:.2} times that of its repetitions")?
                    }
                    None => writeln!(out, "  trial {number}: no repetition is left to compare it with")?,
                }
            }
        }
    }
    Ok(())
}
