//! What is left of each trial, beside what is known of it: order, velocity, torque, rest, EMG.

use serde_json::{Map, Value, json};

use super::within_trial::cross_validation::residuals;
use crate::fit::{Fit, Observations};

/// What a trial's residual may go with.
type Covariate = (&'static str, fn(&Observations, usize) -> f64);

const COVARIATES: [Covariate; 6] = [
    ("progress", |prepared, trial| prepared.trials[trial].input.covariates.progress),
    ("velocity_rad_s", |prepared, trial| prepared.trials[trial].velocity_rad_s),
    ("torque_nm", |prepared, trial| prepared.trials[trial].torque_nm),
    ("rest_s", |prepared, trial| prepared.trials[trial].input.covariates.rest_s),
    ("flexor_emg_excess_mvc", |prepared, trial| {
        prepared.trials[trial].input.covariates.flexor_emg_excess_mvc
    }),
    ("extensor_emg_mvc", |prepared, trial| prepared.trials[trial].input.covariates.extensor_emg_mvc),
];

/// A row for each trial with its covariates and its root mean square residual before and after the extension, and Spearman's
/// rank correlation of the residuals with each covariate (`null` where it does not vary).
pub fn residual_by_trial(prepared: &Observations, before: &Fit, after: &Fit) -> Value {
    let rms = |fit: &Fit| -> Vec<f64> {
        let of = |own: &Vec<f64>| libm::sqrt(own.iter().map(|e| e * e).sum::<f64>() / own.len() as f64);
        residuals(prepared, fit).iter().map(of).collect()
    };
    let (first, second) = (rms(before), rms(after));
    let rows: Vec<Value> = (0..prepared.trials.len())
        .map(|trial| {
            let mut row = Map::new();
            row.insert("trial".into(), json!(prepared.trials[trial].number));
            for (name, read) in COVARIATES {
                row.insert(name.into(), json!(read(prepared, trial)));
            }
            row.insert("rms_before_nm".into(), json!(first[trial]));
            row.insert("rms_after_nm".into(), json!(second[trial]));
            Value::Object(row)
        })
        .collect();
    let correlations: Map<String, Value> = COVARIATES
        .iter()
        .map(|(name, read)| {
            let own: Vec<f64> = (0..prepared.trials.len()).map(|trial| read(prepared, trial)).collect();
            let with = |rms: &[f64]| rank_correlation(&own, rms);
            ((*name).to_owned(), json!({ "before": with(&first), "after": with(&second) }))
        })
        .collect();
    json!({ "trials": rows, "rank_correlation": correlations })
}

/// Spearman's rank correlation; `None` where one of the two does not vary.
fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (a, b) = (ranks(a), ranks(b));
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - middle) * (y - middle)).sum::<f64>();
    let scale = libm::sqrt(sum(&a, &a) * sum(&b, &b));
    (scale > 0.0).then(|| sum(&a, &b) / scale)
}

/// Ranks from zero; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let below = |value: f64| values.iter().filter(|other| **other < value).count() as f64;
    let equal = |value: f64| values.iter().filter(|other| **other == value).count() as f64;
    values.iter().map(|value| below(*value) + (equal(*value) - 1.0) / 2.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_go_together_against_each_other_or_not_at_all() {
        assert_eq!(rank_correlation(&[1.0, 2.0, 5.0], &[0.1, 10.0, 11.0]), Some(1.0));
        assert_eq!(rank_correlation(&[1.0, 2.0, 5.0], &[3.0, 2.0, 1.0]), Some(-1.0));
        assert_eq!(rank_correlation(&[2.0, 2.0, 2.0], &[3.0, 2.0, 1.0]), None);
        let tied = rank_correlation(&[1.0, 1.0, 2.0], &[1.0, 2.0, 3.0]).unwrap();
        assert!((tied - 0.866).abs() < 1e-3, "{tied}");
    }
}
