//! `ramphold fit`: the wrist's parameters out of measured sessions.

use std::io::Write;
use std::path::{Path, PathBuf};

use ramphold::dataset::{self, Disk};
use ramphold::fit::{self, ConditionEstimate, Model, Prepared, Results, View, Weighting};
use ramphold::protocol::ValidProtocol;
use rayon::prelude::*;

use super::{Console, Failure, Verb};

/// Fit the wrist model to measured sessions; writes fit.csv, conditions.csv and fit.json.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold fit sessions/S01\n  ramphold fit ankle-0 --window 0.180 --out results\n  \
                        ramphold fit sessions"
)]
pub struct Fit {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
    /// The analysed time after the onset, s; the session's protocol says it, else 0.040.
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    /// A fit model: which mechanisms, and how each parameter is shared (default: the paper's).
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Count every sample alike as the paper does, instead of weighing by the noise measured in the holds.
    #[arg(long)]
    plain: bool,
    /// Where to write, instead of the session's own results folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the result file instead of a table.
    #[arg(long)]
    json: bool,
}

impl Verb for Fit {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let model = read_model(self.model.as_deref())?;
        let sessions = session_folders(&self.sessions)?;
        if let [session] = sessions.as_slice() {
            let results = self.fit(session, &model)?;
            let folder = self.out.clone().unwrap_or_else(|| session.join("results"));
            results.write(&Disk::default(), &folder)?;
            return self.show(console, &results);
        }
        self.fit_many(console, &sessions, &model)
    }
}

impl Fit {
    fn fit(&self, session: &Path, model: &Model) -> Result<Results, Failure> {
        fit_session(session, model, self.window, self.weighting())
    }

    fn weighting(&self) -> Weighting {
        if self.plain { Weighting::Plain } else { Weighting::MeasuredNoise }
    }

    /// Fits session by session, as many at once as there are cores; one that fails is told of and the rest is done.
    fn fit_many(&self, console: &Console, sessions: &[PathBuf], model: &Model) -> Result<(), Failure> {
        let progress = console.progress(sessions.len() as u64, "fitting");
        let failed: usize = sessions
            .par_iter()
            .map(|session| {
                let name = session.file_name().map_or_else(|| session.clone(), PathBuf::from);
                let folder = self.out.as_ref().map_or_else(|| session.join("results"), |out| out.join(name));
                let done = self
                    .fit(session, model)
                    .and_then(|results| results.write(&Disk::default(), &folder).map_err(Failure::from));
                progress.inc(1);
                match done {
                    Ok(()) => 0,
                    Err(failure) => {
                        progress.suspend(|| console.error(&failure));
                        1
                    }
                }
            })
            .sum();
        progress.finish_and_clear();
        writeln!(console.results(), "fitted {} of {} sessions", sessions.len() - failed, sessions.len())?;
        if failed == 0 { Ok(()) } else { Err(Failure::Some { failed, of: sessions.len() }) }
    }

    fn show(&self, console: &Console, results: &Results) -> Result<(), Failure> {
        if self.json {
            let text = serde_json::to_string_pretty(&results.json).unwrap_or_default();
            writeln!(console.results(), "{text}")?;
        } else {
            table(console, results)?;
        }
        for left in results.json["left_out"].as_array().into_iter().flatten() {
            console.message(format_args!(
                "trial {} left out: {}",
                left["trial"],
                left["reason"].as_str().unwrap_or("")
            ));
        }
        Ok(())
    }
}

/// Loads, prepares and fits one session.
pub fn fit_session(
    folder: &Path,
    model: &Model,
    window_s: Option<f64>,
    weighting: Weighting,
) -> Result<Results, Failure> {
    let session = dataset::load(folder)?;
    let view = view(folder, window_s)?;
    let prepared = Prepared::new(&session, view)
        .map_err(|source| Failure::Prepare { session: folder.display().to_string(), source })?;
    let fit = fit::Fit::new(&prepared, model, weighting);
    Ok(Results::new(&session.subject.id, &prepared, &fit, view, weighting))
}

/// How the session's protocol looks at its records, or the paper does; `window_s` overrides.
pub fn view(folder: &Path, window_s: Option<f64>) -> Result<View, Failure> {
    let file = folder.join("protocol.json");
    let mut view = View::default();
    if file.exists() {
        let protocol = ValidProtocol::read(&file)?;
        view = View { window_s: protocol.window_s, filter: protocol.signal.filter };
    }
    if let Some(window_s) = window_s {
        if !(window_s > 0.0 && window_s <= 10.0) {
            return Err(Failure::Usage(format!(
                "--window {window_s}: expected seconds, more than 0 and at most 10"
            )));
        }
        view.window_s = window_s;
    }
    Ok(view)
}

/// The model in `file`, or the paper's.
pub fn read_model(file: Option<&Path>) -> Result<Model, Failure> {
    let Some(path) = file else { return Ok(Model::paper()) };
    let file = path.display().to_string();
    let text =
        std::fs::read_to_string(path).map_err(|source| Failure::Read { file: file.clone(), source })?;
    Model::parse(&text).map_err(|source| Failure::Model { file, source })
}

/// The folders themselves where they hold a session, else the sessions in them.
fn session_folders(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let is_session = |folder: &Path| folder.join("session.json").exists();
    let mut found = Vec::new();
    for folder in given {
        if is_session(folder) || !folder.is_dir() {
            found.push(folder.clone());
            continue;
        }
        let entries = std::fs::read_dir(folder)
            .map_err(|source| Failure::Read { file: folder.display().to_string(), source })?;
        let mut inside: Vec<PathBuf> = entries
            .filter_map(|entry| entry.ok().map(|e| e.path()))
            .filter(|path| is_session(path))
            .collect();
        inside.sort();
        if inside.is_empty() {
            found.push(folder.clone()); // loading it says what is missing
        }
        found.append(&mut inside);
    }
    Ok(found)
}

/// The table by condition that a person reads.
pub fn table(console: &Console, results: &Results) -> Result<(), Failure> {
    let mut out = console.results();
    let repetitions = results.conditions.iter().map(|c| c.repetitions).max().unwrap_or(0);
    writeln!(
        out,
        "{}: {} trials, {} conditions; mean +- SD over up to {repetitions} repetitions",
        results.subject,
        results.estimates.len(),
        results.conditions.len()
    )?;
    writeln!(
        out,
        "{:>8} {:>6}  {:>15} {:>13} {:>13} {:>13} {:>13} {:>15} {:>13} {:>13} {:>7}",
        "velocity", "torque", "I_j", "b_h", "k_h", "k_srs", "k_dec", "x_e", "k_after", "x_t", "VAF"
    )?;
    writeln!(
        out,
        "{:>8} {:>6}  {:>15} {:>13} {:>13} {:>13} {:>13} {:>15} {:>13} {:>13} {:>7}",
        "rad/s", "N m", "g m2", "N m s/rad", "N m/rad", "N m/rad", "N m/rad", "mrad", "N m/rad", "ms", ""
    )?;
    for condition in &results.conditions {
        writeln!(
            out,
            "{:>8.2} {:>6.2}  {:>15} {:>13} {:>13} {:>13} {:>13} {:>15} {:>13} {:>13} {:>7}{}",
            condition.velocity_rad_s,
            condition.torque_nm,
            spread(condition, 0, 1e3, 2),
            spread(condition, 1, 1.0, 2),
            spread(condition, 2, 1.0, 0),
            spread(condition, 3, 1.0, 1),
            spread(condition, 4, 1.0, 1),
            spread(condition, 5, 1e3, 1),
            spread(condition, 6, 1.0, 1),
            spread(condition, 7, 1e3, 1),
            condition.mean[8].map_or("-".into(), |vaf| format!("{vaf:.4}")),
            condition.condition.as_ref().map_or(String::new(), |label| format!("  {label}")),
        )?;
    }
    let failed: Vec<String> =
        results.estimates.iter().filter(|e| !e.converged).map(|e| e.trial.to_string()).collect();
    if !failed.is_empty() {
        writeln!(out, "not converged: trials {} (fit.json says why)", failed.join(", "))?;
    }
    match results.json["noise_source"].as_str() {
        Some("repetitions") => writeln!(
            out,
            "no hold long enough to measure the noise in: all samples count alike; standard errors from how repetitions differ"
        )?,
        None => writeln!(
            out,
            "neither holds nor repetitions to measure the noise in: no standard errors but those of Eq. 9"
        )?,
        Some(_) => {}
    }
    let falling =
        results.conditions.iter().filter(|c| c.mean[6].is_some_and(|k_after| k_after < 0.0)).count();
    if falling > 0 {
        writeln!(
            out,
            "k_after is below zero in {falling} of {} conditions: there the torque falls beyond the elastic limit, which no \
             stiffness explains (relaxation or a reflex in the window; `ramphold diagnose` looks for it)",
            results.conditions.len()
        )?;
    }
    let undetermined = results.estimates.iter().filter(|e| e.se[5].is_none_or(|se| se > 0.5)).count();
    if undetermined > 0 {
        writeln!(
            out,
            "x_e is not determined (standard error over 50 %, or none) in {undetermined} of {} trials",
            results.estimates.len()
        )?;
    }
    Ok(())
}

fn spread(condition: &ConditionEstimate, quantity: usize, factor: f64, digits: usize) -> String {
    match (condition.mean[quantity], condition.sd[quantity]) {
        (Some(mean), Some(sd)) => format!("{:.digits$} +- {:.digits$}", mean * factor, sd * factor),
        (Some(mean), None) => format!("{:.digits$}", mean * factor),
        (None, _) => "-".into(),
    }
}
