//! What is left of each trial, beside what is known of it: order, velocity, torque, rest, EMG.

use serde_json::{Map, Value, json};

use super::predicted_torque::residuals;
use crate::fit::{Fit, Observations};
use crate::statistics::rank_correlation;

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
