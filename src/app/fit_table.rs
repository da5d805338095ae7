//! The table of a fit on standard output.

use std::io::Write;

use crate::fit::{
    ConditionEstimate, DESCRIBING_VAF, K_DEC, K_SRS, Results, TrialEstimate, onset_warnings, plain_warning,
    reflex_warning, torque_falls,
};
use crate::report::SHOWN;
use crate::wrist::BASE_PARAMETERS;

use super::console::Console;
use super::failure::Failure;

/// So many numbers of trials are listed.
const SHOWN_TRIALS: usize = 12;

/// Prints the table of parameters by condition: mean and standard deviation over repetitions, with remarks.
pub fn fit_table(console: &Console, results: &Results) -> Result<(), Failure> {
    let mut out = console.results();
    if results.best_vaf() < DESCRIBING_VAF {
        writeln!(
            out,
            "THE MODEL DOES NOT DESCRIBE THESE DATA: the best VAF of any trial is {:.2}, below {DESCRIBING_VAF}. The numbers below \
             mean nothing; look at the trials in the report first",
            results.best_vaf()
        )?;
    }
    let repetitions = results.conditions.iter().map(|c| c.repetitions).max().unwrap_or(0);
    writeln!(
        out,
        "{}: {} trials, {} conditions; mean over up to {repetitions} repetitions +- {}",
        results.subject,
        results.estimates.len(),
        results.conditions.len(),
        if results.is_together() { "its standard error" } else { "SD" }
    )?;
    let rows: Vec<Vec<String>> = head()
        .into_iter()
        .chain(results.conditions.iter().map(|condition| row(condition, results.is_together())))
        .collect();
    let widest = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(widest).collect();
    for row in &rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
        writeln!(out, "{}", cells.join("  ").trim_end())?;
    }
    match &results.no_session_model {
        None => writeln!(
            out,
            "all trials fitted together; each on its own, as in the paper: fit-independent.csv, conditions-independent.csv"
        )?,
        Some(reason) => writeln!(out, "each trial fitted on its own: {reason}")?,
    }
    if let Some(warning) = results.json["settings"]["window_s"]
        .as_f64()
        .and_then(|window_s| reflex_warning(window_s, &results.json["model"]))
    {
        writeln!(out, "{warning}")?;
    }
    if let Some(warning) = plain_warning(&results.json["settings"]["weighting"]) {
        writeln!(out, "{warning}")?;
    }
    let [late_s, early_s] = ["stated_onsets_late_s", "stated_onsets_early_s"]
        .map(|name| results.json["settings"][name].as_f64().unwrap_or(0.0));
    for warning in onset_warnings(late_s, early_s) {
        writeln!(out, "{warning}")?;
    }
    let several: Vec<&TrialEstimate> =
        results.estimates.iter().filter(|e| !e.other_optima.is_empty()).collect();
    if !several.is_empty() {
        writeln!(
            out,
            "another optimum fits within the noise in {} of {} trials: {} (fit.json has its values and probability)",
            several.len(),
            results.estimates.len(),
            first_of(&several)
        )?;
    }
    let failed: Vec<String> =
        results.estimates.iter().filter(|e| !e.converged).map(|e| e.trial.to_string()).collect();
    if !failed.is_empty() {
        writeln!(out, "not converged: trials {} (fit.json says why)", failed.join(", "))?;
    }
    let unknown = |estimate: &&TrialEstimate| estimate.se_of_rig.iter().any(Option::is_none);
    let untold: Vec<&TrialEstimate> = results.estimates.iter().filter(unknown).collect();
    if !untold.is_empty() {
        writeln!(
            out,
            "what the errors of the calibration add to a standard error cannot be computed in {} of {} trials, where there is none: {} \
             (fit.json says why)",
            untold.len(),
            results.estimates.len(),
            first_of(&untold)
        )?;
    }
    let undescribed: Vec<&TrialEstimate> =
        results.estimates.iter().filter(|e| e.vaf < DESCRIBING_VAF).collect();
    if !undescribed.is_empty() && results.best_vaf() >= DESCRIBING_VAF {
        writeln!(
            out,
            "the model does not describe {} of {} trials (VAF below {DESCRIBING_VAF}), which are in the means all the same: {}; look at \
             them in the report, and reject what went wrong (ramphold trials)",
            undescribed.len(),
            results.estimates.len(),
            first_of(&undescribed)
        )?;
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
    bounds(&mut out, results)?;
    let falling = results.conditions.iter().filter(|condition| falls(condition)).count();
    if falling > 0 {
        writeln!(
            out,
            "k_after is below zero by more than 3 standard errors in {falling} of {} conditions: there the torque falls beyond \
             the elastic limit, which no stiffness explains; `ramphold diagnose` looks for the cause",
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

/// The numbers of the first of `trials`.
fn first_of(trials: &[&TrialEstimate]) -> String {
    let numbers: Vec<String> = trials.iter().take(SHOWN_TRIALS).map(|own| own.trial.to_string()).collect();
    numbers.join(", ") + if trials.len() > SHOWN_TRIALS { ", ..." } else { "" }
}

/// Says which parameters ended at a bound, and in how many trials: their values are not averaged.
fn bounds(out: &mut impl Write, results: &Results) -> Result<(), Failure> {
    for (parameter, name) in BASE_PARAMETERS.iter().enumerate() {
        let at_bound: Vec<&TrialEstimate> =
            results.estimates.iter().filter(|estimate| !estimate.determined[parameter]).collect();
        if !at_bound.is_empty() {
            writeln!(
                out,
                "{name} ended at its bound in {} of {} trials, whose data do not determine it (not averaged): {}",
                at_bound.len(),
                results.estimates.len(),
                first_of(&at_bound)
            )?;
        }
    }
    Ok(())
}

/// Whether the mean stiffness beyond the elastic limit of a condition is below zero beyond its standard error.
fn falls(condition: &ConditionEstimate) -> bool {
    let [Some(k_srs), Some(k_dec)] = [condition.mean[K_SRS], condition.mean[K_DEC]] else { return false };
    torque_falls([k_srs, k_dec], [condition.se[K_SRS], condition.se[K_DEC]])
}

/// Symbols and units, those of the report.
fn head() -> [Vec<String>; 2] {
    let line = |first: [&str; 2], of: fn(&crate::report::Shown) -> String| {
        first.map(str::to_owned).into_iter().chain(SHOWN.iter().map(of)).chain([String::new()]).collect()
    };
    [
        line(["velocity", "torque"], |shown| shown.sign.to_owned()),
        line(["rad/s", "N m"], |shown| shown.unit.replace('²', "2")),
    ]
}

/// A condition with the uncertainty, digits and marks of the report, in the letters of every terminal.
fn row(condition: &ConditionEstimate, is_together: bool) -> Vec<String> {
    let mut cells = vec![format!("{:.2}", condition.velocity_rad_s), format!("{:.2}", condition.torque_nm)];
    cells.extend(SHOWN.iter().map(|shown| {
        let text = shown.text_of_condition(condition, is_together);
        text.replace('±', "+-").replace(['−', '–'], "-")
    }));
    cells.push(condition.condition.clone().unwrap_or_default());
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table had digits of its own, and a mean over fewer trials than the condition has did not say so.
    #[test]
    fn the_table_has_the_uncertainty_and_the_marks_of_the_report() {
        let mut condition = ConditionEstimate {
            se_of_rig: [Some(0.0); 6],
            condition: None,
            velocity_rad_s: 1.3,
            torque_nm: 0.9,
            repetitions: 3,
            mean: [
                Some(0.005),
                Some(1.2),
                Some(300.0),
                Some(15.512),
                Some(9.0),
                Some(0.0251),
                None,
                None,
                Some(0.99412),
            ],
            sd: [None; 9],
            averaged: [3, 3, 3, 3, 3, 2, 0, 0, 3],
            se: [Some(0.01); 6],
        };
        condition.sd[3] = Some(0.98);
        let together = row(&condition, true);
        assert_eq!(together[5], "15.51 +- 0.16");
        assert_eq!(together[7], "25.10 +- 0.25 (n = 2)");
        assert_eq!((together[8].as_str(), together[10].as_str()), ("-", "0.9941"));
        assert_eq!(row(&condition, false)[5], "15.51 +- 0.98");
        assert_eq!(head()[1][2], "g m2");
    }
}
