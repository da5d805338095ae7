//! How often the fit's 95 % intervals hold the truth: fits sessions whose truth is known, and counts.
//!
//! `cargo run --release --example coverage DIR [--plain]` reads `DIR/session-*` and `DIR/truth/session-*.json`, as
//! `python -m hidden_effects --effect none` writes them, and prints one line of JSON. `scripts/coverage` makes the page of it.

use std::error::Error;
use std::path::{Path, PathBuf};

use ramphold::dataset;
use ramphold::fit::{
    Fit, Model, Observations, PROFILED_PARAMETERS, PreprocessingSettings, TrialEstimate, Weighting, estimates,
};
use ramphold::wrist::BASE_PARAMETERS;
use rayon::prelude::*;
use serde_json::{Value, json};

/// Half the width of a 95 % interval, in standard errors.
const WIDTH: f64 = 1.959_963_984_540_054;

/// One kind of interval of one parameter, over all trials of all sessions.
#[derive(Default)]
struct Count {
    covered: usize,
    missed: usize,
    absent: usize,
    /// Half widths relative to the estimate.
    widths: Vec<f64>,
}

impl Count {
    fn take(&mut self, interval: Option<[f64; 2]>, truth: f64, value: f64) {
        let Some([low, high]) = interval else {
            self.absent += 1;
            return;
        };
        if low <= truth && truth <= high {
            self.covered += 1
        } else {
            self.missed += 1
        }
        self.widths.push(0.5 * (high - low) / value);
    }

    fn json(mut self) -> Value {
        self.widths.sort_by(f64::total_cmp);
        let of = self.covered + self.missed;
        json!({
            "covered": self.covered as f64 / of.max(1) as f64,
            "intervals": of,
            "absent": self.absent,
            "median_half_width": self.widths.get(self.widths.len() / 2),
        })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let plain = arguments.iter().any(|word| word == "--plain");
    let folder = PathBuf::from(arguments.iter().find(|word| !word.starts_with('-')).ok_or("which folder?")?);
    let weighting = if plain { Weighting::Plain } else { Weighting::MeasuredNoise };
    let mut sessions: Vec<PathBuf> =
        std::fs::read_dir(&folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
    sessions.retain(|path| path.join("session.json").exists());
    sessions.sort();
    let fitted: Vec<(Vec<TrialEstimate>, Value)> = sessions
        .par_iter()
        .map(|session| {
            fit(&folder, session, weighting).map_err(|error| format!("{}: {error}", session.display()))
        })
        .collect::<Result<_, _>>()?;
    let mut table = Vec::new();
    for (parameter, name) in BASE_PARAMETERS.into_iter().enumerate() {
        let [mut honest, mut profile, mut eq9] = [Count::default(), Count::default(), Count::default()];
        let mut errors = Vec::new();
        let mut several = 0;
        for (estimates, truth) in &fitted {
            for estimate in estimates {
                let of_trial = truth["trials"].as_array().into_iter().flatten();
                let own = of_trial.clone().find(|own| own["trial"] == estimate.trial).ok_or("no truth")?;
                let truth = own[name].as_f64().ok_or("no value")?;
                let value = estimate.values[parameter];
                let relative = |se: f64| [value * (-WIDTH * se).exp(), value * (WIDTH * se).exp()];
                honest.take(estimate.se[parameter].map(relative), truth, value);
                eq9.take(estimate.sem[parameter].map(relative), truth, value);
                if let Some(place) = PROFILED_PARAMETERS.iter().position(|own| *own == parameter) {
                    let ends = estimate.profile[place];
                    let open = |own: ramphold::fit::ProfileInterval| {
                        [own.low.unwrap_or(0.0), own.high.unwrap_or(f64::INFINITY)]
                    };
                    profile.take(ends.map(open), truth, value);
                }
                errors.push((value / truth).ln());
                several +=
                    usize::from(estimate.remarks.iter().any(|remark| remark.contains("another optimum")));
            }
        }
        errors.sort_by(f64::total_cmp);
        let at = |part: f64| errors[((errors.len() - 1) as f64 * part) as usize];
        table.push(json!({
            "parameter": name,
            "median_error": at(0.5),
            "error_68": 0.5 * (at(0.84) - at(0.16)),
            "measured_noise": honest.json(),
            "profile": PROFILED_PARAMETERS.contains(&parameter).then(|| profile.json()),
            "eq9": eq9.json(),
            "several_optima": several,
        }));
    }
    let trials: usize = fitted.iter().map(|(estimates, _)| estimates.len()).sum();
    println!(
        "{}",
        json!({ "sessions": fitted.len(), "trials": trials, "plain": plain, "parameters": table })
    );
    Ok(())
}

fn fit(
    folder: &Path,
    path: &Path,
    weighting: Weighting,
) -> Result<(Vec<TrialEstimate>, Value), Box<dyn Error + Send + Sync>> {
    let session = dataset::load(path)?;
    let prepared = Observations::new(&session, PreprocessingSettings::default())?;
    let fit = Fit::new(&prepared, &Model::paper(), weighting);
    let name = path.file_name().unwrap_or_default();
    let truth = std::fs::read_to_string(folder.join("truth").join(name).with_extension("json"))?;
    Ok((estimates(&prepared, &fit), serde_json::from_str(&truth)?))
}
