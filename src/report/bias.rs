//! Which numbers of the page a diagnosis found to be biased, and by how much.

use super::diagnosed::Diagnosed;
use super::fitted::{Fitted, SHOWN, Shown};
use super::scale::significant;

/// The sign beside a number that is biased.
pub const BIAS_SIGN: &str = "\u{a0}†";

/// How a quantity would change with the causes in the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bias {
    /// The mean over the trials would be another one.
    Change(MeanChange),
    /// The model misfits, and nothing says what follows for the quantity.
    Unknown,
}

/// Means of a quantity over the trials, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanChange {
    /// Of the model as fitted.
    pub as_fitted: f64,
    /// With the causes in the model: the smallest and the largest over the candidates.
    pub with_causes: [f64; 2],
}

/// Largest ratio of two means that is given in per cent.
const LARGEST_RATIO: f64 = 10.0;

/// Smallest change that is not printed as 0.0 %.
const SMALLEST_SHOWN: f64 = 0.0005;

impl MeanChange {
    /// The change in per cent; `None` where that would say little: with another sign, or many times as large.
    pub fn percent(&self) -> Option<String> {
        let ratios = self.with_causes.map(|own| own / self.as_fitted);
        let percent = |ratio: f64| {
            let text = significant(100.0 * (ratio - 1.0), 2);
            if ratio > 1.0 { format!("+{text}") } else { text }
        };
        let is_close = |ratio: &f64| *ratio > 1.0 / LARGEST_RATIO && *ratio < LARGEST_RATIO;
        ratios.iter().all(is_close).then(|| format!("{} %", range(ratios.map(percent))))
    }

    /// The change in per cent, or else both means.
    pub fn in_words(&self, shown: &Shown) -> String {
        let value = |own: f64| significant(own * shown.factor, 3);
        let means = || format!("{} instead of {}", range(self.with_causes.map(value)), value(self.as_fitted));
        self.percent().unwrap_or_else(means)
    }

    fn is_seen(&self) -> bool {
        self.with_causes.iter().any(|own| (own / self.as_fitted - 1.0).abs() >= SMALLEST_SHOWN)
    }
}

/// Two ends as a range; one of them where they are the same.
fn range([low, high]: [String; 2]) -> String {
    if low == high { low } else { format!("{low} to {high}") }
}

/// The biases that a diagnosis found.
#[derive(Debug, Clone, Default)]
pub struct Biases {
    found: Vec<(&'static Shown, Bias)>,
}

impl Biases {
    /// Those of the quantities of a fit; none without a diagnosis, or if the model is adequate.
    pub fn of(diagnosis: Option<&Diagnosed>, fitted: Option<&Fitted>) -> Self {
        let Some(diagnosis) = diagnosis.filter(|own| own.verdict.is_some() && !own.is_adequate()) else {
            return Self::default();
        };
        let estimates = SHOWN.iter().filter(|shown| shown.name != "vaf");
        if diagnosis.causes.is_empty() {
            return Self { found: estimates.map(|shown| (shown, Bias::Unknown)).collect() };
        }
        let change = |shown: &'static Shown| {
            let with_causes = diagnosis.range_with_causes(shown.name)?;
            let as_fitted = as_fitted(diagnosis, fitted, shown.name)?;
            let change = MeanChange { as_fitted, with_causes };
            change.is_seen().then_some((shown, Bias::Change(change)))
        };
        Self { found: estimates.filter_map(change).collect() }
    }

    /// The bias of a quantity.
    pub fn of_quantity(&self, name: &str) -> Option<Bias> {
        self.found.iter().find(|(own, _)| own.name == name).map(|(_, bias)| *bias)
    }

    /// The sign that stands beside a quantity: empty if it is not biased.
    pub fn sign(&self, name: &str) -> &'static str {
        if self.of_quantity(name).is_some() { BIAS_SIGN } else { "" }
    }

    /// What the sign means, for those of the quantities `names` that have it; `None` if none has.
    pub fn note(&self, names: &[&str]) -> Option<String> {
        let biased: Vec<_> = self.found.iter().filter(|(own, _)| names.contains(&own.name)).collect();
        if biased.is_empty() {
            return None;
        }
        let in_words = |(shown, bias): &&(&Shown, Bias)| match bias {
            Bias::Change(change) => Some(format!("{} {}", shown.sign, change.in_words(shown))),
            Bias::Unknown => None,
        };
        let changes: Vec<String> = biased.iter().filter_map(in_words).collect();
        Some(if changes.is_empty() {
            "† The diagnosis found a misfit without a known cause: these values are biased by an unknown amount.".into()
        } else {
            format!(
                "† Biased, as the diagnosis found. With the causes in the model, the means over the trials change: {}.",
                changes.join(", ")
            )
        })
    }

    /// As [`Biases::note`], without the amounts.
    pub fn short_note(&self, names: &[&str]) -> &'static str {
        let is_biased = names.iter().any(|name| self.of_quantity(name).is_some());
        if is_biased { "† Biased, as the diagnosis found; the verdict says by how much." } else { "" }
    }
}

/// Mean of a quantity as fitted. It is the mean over the trials that both the fit and the diagnosis have, so that it is a number of the
/// page; without a fit it is that of the diagnosis.
pub fn as_fitted(diagnosis: &Diagnosed, fitted: Option<&Fitted>, name: &str) -> Option<f64> {
    let is_analysed =
        |number: u32| diagnosis.trials.is_empty() || diagnosis.trials.contains(&u64::from(number));
    let own = fitted.into_iter().flat_map(|fitted| &fitted.trials).filter(|trial| is_analysed(trial.trial));
    let values: Vec<f64> = own.filter_map(|trial| trial.determined(name)).collect();
    if !values.is_empty() {
        return Some(values.iter().sum::<f64>() / values.len() as f64);
    }
    let all = diagnosis.causes.iter().flat_map(|cause| &cause.candidates);
    all.filter_map(|own| own.shift(name)).next().map(|own| own.before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn diagnosis(verdict: &str, with_cause: bool) -> Diagnosed {
        let cause = json!({
            "mechanism": "torque_lag", "class": "sensor", "probability": 0.97, "parameters": {}, "indistinguishable": [],
            "gain": { "held_out_rmse_ratio": { "value": 0.4, "low": 0.3, "high": 0.5 }, "vaf_before": 0.9, "vaf_after": 1.0 },
            "parameter_shift": { "k_srs_nm_per_rad": { "before": 20.0, "after": 10.0 }, "x_e_rad": { "before": 0.04, "after": 0.04 } },
        });
        let causes = if with_cause { vec![cause] } else { Vec::new() };
        Diagnosed::of(&json!({ "verdict": verdict, "causes": causes }))
    }

    #[test]
    fn a_number_that_a_cause_changes_is_marked_and_one_that_it_leaves_is_not() {
        let biases = Biases::of(Some(&diagnosis("named", true)), None);
        assert_eq!(biases.sign("k_srs_nm_per_rad"), BIAS_SIGN);
        assert_eq!(biases.sign("x_e_rad"), "");
        let note = biases.note(&["k_srs_nm_per_rad", "x_e_rad"]).unwrap();
        assert!(note.contains("k_srs \u{2212}50 %") && !note.contains("x_e"), "{note}");
        assert_eq!(biases.note(&["x_e_rad"]), None);
    }

    #[test]
    fn without_a_known_cause_every_estimate_is_marked_and_in_an_adequate_model_none() {
        let unknown = Biases::of(Some(&diagnosis("unexplained", false)), None);
        assert_eq!(unknown.of_quantity("x_e_rad"), Some(Bias::Unknown));
        assert!(unknown.note(&["x_e_rad"]).unwrap().contains("unknown amount"));
        let adequate = Biases::of(Some(&diagnosis("adequate", false)), None);
        assert_eq!(adequate.sign("x_e_rad"), "");
        assert_eq!(Biases::of(None, None).sign("x_e_rad"), "");
    }

    #[test]
    fn a_change_of_sign_or_by_many_times_is_told_by_the_means() {
        let words =
            |as_fitted: f64, with_causes: [f64; 2]| MeanChange { as_fitted, with_causes }.in_words(&SHOWN[6]);
        assert_eq!(words(20.0, [10.0, 10.0]), "\u{2212}50 %");
        assert_eq!(words(20.0, [10.0, 11.0]), "\u{2212}50 to \u{2212}45 %");
        assert_eq!(words(-8.0, [3.0, 3.0]), "3.00 instead of \u{2212}8.00");
        assert_eq!(words(0.0004, [1.2, 1.3]), "1.20 to 1.30 instead of 0.000400");
    }
}
