//! Residual of each trial and its rank correlation with covariates: position in the session, velocity, torque, rest, EMG.

use serde_json::{Map, Value, json};

use super::predicted_torque::residuals;
use crate::fit::{Fit, Observations};
use crate::statistics::rank_correlation;

/// Name and value of a covariate of a trial.
type Covariate = (&'static str, fn(&Observations, usize) -> f64);

const COVARIATES: [Covariate; 6] = [
    ("progress", |observations, trial| observations.trials[trial].input.covariates.progress),
    ("velocity_rad_s", |observations, trial| observations.trials[trial].velocity_rad_s),
    ("torque_nm", |observations, trial| observations.trials[trial].torque_nm),
    ("rest_s", |observations, trial| observations.trials[trial].input.covariates.rest_s),
    ("flexor_emg_excess_mvc", |observations, trial| {
        observations.trials[trial].input.covariates.flexor_emg_excess_mvc
    }),
    ("extensor_emg_mvc", |observations, trial| observations.trials[trial].input.covariates.extensor_emg_mvc),
];

/// A row for each trial with its covariates and its root mean square residual without and with the added mechanisms, and
/// Spearman's rank correlation of the residuals with each covariate (`null` where it does not vary).
pub fn residual_by_trial(observations: &Observations, before: &Fit, after: &Fit) -> Value {
    let rms = |fit: &Fit| -> Vec<f64> {
        let of = |own: &Vec<f64>| {
            let torque = observations.torque_of(own);
            libm::sqrt(torque.iter().map(|e| e * e).sum::<f64>() / torque.len() as f64)
        };
        residuals(observations, fit).iter().map(of).collect()
    };
    let (first, second) = (rms(before), rms(after));
    let rows: Vec<Value> = (0..observations.trials.len())
        .map(|trial| {
            let mut row = Map::new();
            row.insert("trial".into(), json!(observations.trials[trial].number));
            for (name, read) in COVARIATES {
                row.insert(name.into(), json!(read(observations, trial)));
            }
            row.insert("rms_before_nm".into(), json!(first[trial]));
            row.insert("rms_after_nm".into(), json!(second[trial]));
            Value::Object(row)
        })
        .collect();
    let correlations: Map<String, Value> = COVARIATES
        .iter()
        .map(|(name, read)| {
            let own: Vec<f64> =
                (0..observations.trials.len()).map(|trial| read(observations, trial)).collect();
            let with = |rms: &[f64]| rank_correlation(&own, rms);
            ((*name).to_owned(), json!({ "before": with(&first), "after": with(&second) }))
        })
        .collect();
    json!({ "trials": rows, "rank_correlation": correlations })
}
