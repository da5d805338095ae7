//! `ramphold fit`: the wrist's parameters out of measured sessions.

use std::io::Write;
use std::path::{Path, PathBuf};

use ramphold::dataset::{self, Disk, Manifest};
use ramphold::diagnose::remove_hum;
use ramphold::fit::{
    self, ConditionEstimate, Model, Observations, PreprocessingSettings, Results, Weighting,
};
use ramphold::protocol::ValidProtocol;
use rayon::prelude::*;

use super::report::write_report;
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
    /// Refit so many sessions simulated from the fit, and say in fit.json how the estimates scatter.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    bootstrap: Option<u32>,
    /// Seed of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "bootstrap")]
    seed: u64,
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
        let folders = self.result_folders(&sessions)?;
        if let ([session], [folder]) = (sessions.as_slice(), folders.as_slice()) {
            let results = self.fit(session, &model)?;
            self.keep(session, folder, &results, console)?;
            return self.show(console, &results);
        }
        self.fit_many(console, &sessions, &folders, &model)
    }
}

impl Fit {
    fn fit(&self, session: &Path, model: &Model) -> Result<Results, Failure> {
        let (prepared, mut results, fit) = prepare_and_fit(session, model, self.window, self.weighting())?;
        if let Some(refits) = self.bootstrap {
            let scatter = fit::bootstrap(&prepared, &fit, refits as usize, self.seed);
            results.add_bootstrap(refits as usize, self.seed, &scatter);
        }
        Ok(results)
    }

    fn weighting(&self) -> Weighting {
        if self.plain { Weighting::Plain } else { Weighting::MeasuredNoise }
    }

    /// Where the results of each session go: its own folder, where a new fit replaces the last; or into `--out`, where
    /// nothing is replaced.
    fn result_folders(&self, sessions: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
        let Some(out) = &self.out else {
            return Ok(sessions.iter().map(|session| session.join("results")).collect());
        };
        let folder = |session: &PathBuf| match session.file_name() {
            Some(name) if sessions.len() > 1 => out.join(name),
            _ => out.clone(),
        };
        let folders: Vec<PathBuf> = sessions.iter().map(folder).collect();
        for (index, folder) in folders.iter().enumerate() {
            if folders[..index].contains(folder) {
                return Err(Failure::Usage(format!(
                    "two sessions are named {}; with --out their results would be one folder, so fit them apart",
                    folder.file_name().unwrap_or_default().display()
                )));
            }
            if folder.join("fit.json").exists() {
                return Err(Failure::Usage(format!(
                    "{}: holds the results of an earlier fit, which are not overwritten; give another --out",
                    folder.display()
                )));
            }
        }
        Ok(folders)
    }

    /// Fits session by session, as many at once as there are cores; one that fails is told of and the rest is done.
    fn fit_many(
        &self,
        console: &Console,
        sessions: &[PathBuf],
        folders: &[PathBuf],
        model: &Model,
    ) -> Result<(), Failure> {
        let progress = console.progress(sessions.len() as u64, "fitting");
        let fitted: Vec<Option<serde_json::Value>> = (sessions, folders)
            .into_par_iter()
            .map(|(session, folder)| {
                let done = self.fit(session, model).and_then(|results| {
                    self.keep(session, folder, &results, &console.silent())?;
                    Ok(results.json)
                });
                progress.inc(1);
                done.map_err(|failure| progress.suspend(|| console.error(&failure))).ok()
            })
            .collect();
        progress.finish_and_clear();
        let failed = fitted.iter().filter(|result| result.is_none()).count();
        if self.json {
            let text = serde_json::to_string_pretty(&fitted.into_iter().flatten().collect::<Vec<_>>());
            writeln!(console.results(), "{}", text.unwrap_or_default())?;
        } else {
            writeln!(console.results(), "fitted {} of {} sessions", sessions.len() - failed, sessions.len())?;
        }
        if failed == 0 { Ok(()) } else { Err(Failure::Some { failed, of: sessions.len() }) }
    }

    /// Writes results and report, and what the session's manifest says of them.
    fn keep(
        &self,
        session: &Path,
        folder: &Path,
        results: &Results,
        console: &Console,
    ) -> Result<(), Failure> {
        results.write(&Disk::default(), folder)?;
        write_report(session, folder, console)?;
        if self.out.is_none() {
            Manifest::renew_results(&Disk::default(), session)?;
        }
        Ok(())
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
    prepare_and_fit(folder, model, window_s, weighting).map(|(_, results, _)| results)
}

fn prepare_and_fit(
    folder: &Path,
    model: &Model,
    window_s: Option<f64>,
    weighting: Weighting,
) -> Result<(Observations, Results, fit::Fit), Failure> {
    let mut session = dataset::load(folder)?;
    if let Some(frequency_hz) = model.hum_hz() {
        session = remove_hum(&session, frequency_hz);
    }
    let view = view(folder, window_s)?;
    let prepared = Observations::new(&session, view)
        .map_err(|source| Failure::Prepare { session: folder.display().to_string(), source })?;
    let fit = fit::Fit::new(&prepared, model, weighting);
    let results = Results::new(&session.subject.id, &prepared, &fit, view, weighting);
    Ok((prepared, results, fit))
}

/// How the session's protocol looks at its records, or the paper does; `window_s` overrides.
pub fn view(folder: &Path, window_s: Option<f64>) -> Result<PreprocessingSettings, Failure> {
    let file = folder.join("protocol.json");
    let mut view = PreprocessingSettings::default();
    if file.exists() {
        let protocol = ValidProtocol::read(&file)?;
        view = PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter };
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
pub fn session_folders(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
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

/// The columns of the table after velocity and torque: symbol, unit, factor to it, digits.
const COLUMNS: [(&str, &str, f64, usize); 8] = [
    ("I_j", "g m2", 1e3, 2),
    ("b_h", "N m s/rad", 1.0, 2),
    ("k_h", "N m/rad", 1.0, 0),
    ("k_srs", "N m/rad", 1.0, 1),
    ("k_dec", "N m/rad", 1.0, 1),
    ("x_e", "mrad", 1e3, 1),
    ("k_after", "N m/rad", 1.0, 1),
    ("x_t", "ms", 1e3, 1),
];

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
    let rows: Vec<Vec<String>> = head().into_iter().chain(results.conditions.iter().map(row)).collect();
    let widest = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(widest).collect();
    for row in &rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
        writeln!(out, "{}", cells.join("  ").trim_end())?;
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

/// Symbols and units.
fn head() -> [Vec<String>; 2] {
    let line = |first: [&str; 2],
                of: fn(&(&'static str, &'static str, f64, usize)) -> &'static str,
                last: [&str; 2]| {
        first.into_iter().chain(COLUMNS.iter().map(of)).chain(last).map(str::to_owned).collect()
    };
    [
        line(["velocity", "torque"], |column| column.0, ["VAF", ""]),
        line(["rad/s", "N m"], |column| column.1, ["", ""]),
    ]
}

fn row(condition: &ConditionEstimate) -> Vec<String> {
    let mut cells = vec![format!("{:.2}", condition.velocity_rad_s), format!("{:.2}", condition.torque_nm)];
    for (quantity, (_, _, factor, digits)) in COLUMNS.into_iter().enumerate() {
        cells.push(spread(condition, quantity, factor, digits));
    }
    cells.push(condition.mean[8].map_or("-".into(), |vaf| format!("{vaf:.4}")));
    cells.push(condition.condition.clone().unwrap_or_default());
    cells
}

fn spread(condition: &ConditionEstimate, quantity: usize, factor: f64, digits: usize) -> String {
    match (condition.mean[quantity], condition.sd[quantity]) {
        (Some(mean), Some(sd)) => format!("{:.digits$} +- {:.digits$}", mean * factor, sd * factor),
        (Some(mean), None) => format!("{:.digits$}", mean * factor),
        (None, _) => "-".into(),
    }
}
