//! Counts of errors and of intervals that hold the truth.

use ramphold::fit::{ConditionEstimate, K_SRS, TrialEstimate, X_E};
use ramphold::wrist::BASE_PARAMETERS;
use serde_json::{Value, json};

use super::sessions::Fitted;

/// Half the width of a 95 % interval, in standard errors.
const WIDTH: f64 = 1.959_963_984_540_054;

/// A gross error: off by more than this part, and by more than the stated error allows.
const GROSS: [(usize, f64); 2] = [(K_SRS, 0.2), (X_E, 0.4)];

/// Part by which a condition mean of k_srs may be off.
const MEAN_OFF: f64 = 0.1;

/// The counts of one kind of fit over all sessions.
pub fn count(kind: &str, sessions: &[Fitted]) -> Value {
    let (mut gross, mut marked, mut trials) = (0, 0, 0);
    for session in sessions {
        for estimate in &session.estimates {
            trials += 1;
            marked += usize::from(!estimate.other_optima.is_empty());
            let truth = session.truth[&estimate.trial];
            gross += usize::from(is_gross_error(estimate, &truth));
        }
    }
    let (mut off, mut means) = (0, 0);
    for (condition, truth, _) in sessions.iter().flat_map(condition_truths) {
        means += 1;
        off += usize::from(
            condition.mean[K_SRS].is_none_or(|mean| (mean / truth[K_SRS] - 1.0).abs() > MEAN_OFF),
        );
    }
    let parameters = (0..6).map(|parameter| of_parameter(sessions, parameter)).collect::<Vec<_>>();
    json!({
        "fit": kind, "sessions": sessions.len(), "trials": trials, "gross": gross, "marked": marked,
        "conditions": means, "means_off": off, "parameters": parameters,
    })
}

/// Whether k_srs or x_e is off by much, and by more than the stated error allows.
fn is_gross_error(estimate: &TrialEstimate, truth: &[f64; 6]) -> bool {
    GROSS.iter().any(|(parameter, part)| {
        let error = log_error(estimate, truth, *parameter).abs();
        error > part.ln_1p() && estimate.se[*parameter].is_some_and(|se| WIDTH * se < error)
    })
}

fn log_error(estimate: &TrialEstimate, truth: &[f64; 6], parameter: usize) -> f64 {
    (estimate.values[parameter] / truth[parameter]).ln()
}

/// The trial whose k_srs is most wrong among the gross errors of the first fit, as both fits see it.
pub fn worst(independent: &[Fitted], session: &[Fitted]) -> Option<Value> {
    let gross = independent.iter().zip(session).flat_map(|(own, other)| {
        let of_trial = move |(place, estimate): (usize, &TrialEstimate)| {
            let truth = own.truth[&estimate.trial];
            let error = log_error(estimate, &truth, K_SRS).abs();
            is_gross_error(estimate, &truth).then_some((error, own, other, place, truth))
        };
        own.estimates.iter().enumerate().filter_map(of_trial)
    });
    let (_, own, other, place, truth) = gross.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let fit = |fitted: &Fitted| {
        let estimate = &fitted.estimates[place];
        json!({
            "k_srs_nm_per_rad": estimate.values[K_SRS], "se_k_srs": estimate.se[K_SRS], "x_e_rad": estimate.values[X_E],
            "se_x_e": estimate.se[X_E], "vaf": estimate.vaf, "predicted_nm": fitted.torques_nm[place][1],
        })
    };
    let estimate = &own.estimates[place];
    Some(json!({
        "session": own.name, "trial": estimate.trial, "velocity_rad_s": estimate.velocity_rad_s, "torque_nm": estimate.torque_nm,
        "period_s": own.period_s, "measured_nm": own.torques_nm[place][0],
        "true_k_srs_nm_per_rad": truth[K_SRS], "true_x_e_rad": truth[X_E], "independent": fit(own), "together": fit(other),
    }))
}

/// Conditions with the mean of their trials' true parameters, and their number.
fn condition_truths(session: &Fitted) -> impl Iterator<Item = (&ConditionEstimate, [f64; 6], f64)> {
    session.conditions.iter().map(|condition| {
        let own = session.estimates.iter().filter(|estimate| {
            estimate.velocity_rad_s == condition.velocity_rad_s && estimate.torque_nm == condition.torque_nm
        });
        let truths: Vec<[f64; 6]> = own.map(|estimate| session.truth[&estimate.trial]).collect();
        let mean =
            |parameter: usize| truths.iter().map(|own| own[parameter]).sum::<f64>() / truths.len() as f64;
        (condition, std::array::from_fn(mean), truths.len() as f64)
    })
}

fn of_parameter(sessions: &[Fitted], parameter: usize) -> Value {
    let [mut of_trials, mut eq9, mut of_means] = [Count::default(), Count::default(), Count::default()];
    for session in sessions {
        for estimate in &session.estimates {
            of_trials.take(
                estimate.values[parameter],
                estimate.se[parameter],
                session.truth[&estimate.trial][parameter],
            );
            let truth = session.truth[&estimate.trial][parameter];
            eq9.take(estimate.values[parameter], estimate.sem[parameter], truth);
        }
        for (condition, truth, _) in condition_truths(session) {
            match condition.mean[parameter] {
                Some(mean) => of_means.take(mean, condition.se[parameter], truth[parameter]),
                None => of_means.absent += 1,
            }
        }
    }
    json!({ "parameter": BASE_PARAMETERS[parameter], "trials": of_trials.json(), "eq9": eq9.json(), "means": of_means.json() })
}

/// Errors and intervals of one parameter.
#[derive(Default)]
struct Count {
    covered: usize,
    missed: usize,
    absent: usize,
    /// Logarithms of estimate over truth.
    errors: Vec<f64>,
    /// Relative standard errors.
    widths: Vec<f64>,
}

impl Count {
    fn take(&mut self, value: f64, se: Option<f64>, truth: f64) {
        let error = (value / truth).ln();
        self.errors.push(error);
        match se {
            None => self.absent += 1,
            Some(se) => {
                self.widths.push(WIDTH * se);
                if error.abs() <= WIDTH * se { self.covered += 1 } else { self.missed += 1 }
            }
        }
    }

    fn json(mut self) -> Value {
        self.errors.sort_by(f64::total_cmp);
        self.widths.sort_by(f64::total_cmp);
        let intervals = self.covered + self.missed;
        let at =
            |part: f64| self.errors.get(((self.errors.len().max(1) - 1) as f64 * part) as usize).copied();
        json!({
            "covered": self.covered as f64 / intervals.max(1) as f64,
            "intervals": intervals,
            "absent": self.absent,
            "bias": self.errors.iter().sum::<f64>() / self.errors.len().max(1) as f64,
            "error_68": at(0.84).zip(at(0.16)).map(|(high, low)| 0.5 * (high - low)),
            "median_half_width": self.widths.get(self.widths.len() / 2),
        })
    }
}
