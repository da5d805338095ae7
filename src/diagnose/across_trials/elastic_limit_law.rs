//! Regression of the elastic limit on velocity and torque: is the limit a time or an angle?

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::fit::{Fit, Observations, X_E};
use crate::statistics::{HALF_INTERVAL_95, MeanVariance, WeightedRegression};
use crate::wrist::mechanisms::EvidenceSource;

/// Form of the dependence of the elastic limit on velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitForm {
    /// x_e proportional to velocity: the muscle yields after a constant time.
    TimedYield,
    /// x_e = x_0: the muscle yields at a constant angle.
    FixedAngle,
    /// x_e = x_0 + slope v with both parts different from zero.
    Linear,
    /// The data do not decide between the forms.
    Undecided,
}

/// Regression x_e = x_0 + slope v + torque term; the slope is a time, and not the SRS period x_t. Coefficients come with their standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLimitLaw {
    /// The form that the coefficients support.
    pub law: LimitForm,
    /// x_0 at the mean torque, rad.
    pub x_0_rad: (f64, f64),
    /// Slope of x_e over velocity, s.
    pub slope_s: (f64, f64),
    /// Slope over torque, rad/(N m).
    pub per_torque_rad_per_nm: (f64, f64),
}

/// Smallest number of trials with a visible elastic limit for the regression.
const MIN_LIMIT_TRIALS: usize = 9;

/// A part of the limit is called zero only if its 95 % interval extends less than this fraction of the mean limit. Assumed.
const NEGLIGIBLE_FRACTION: f64 = 0.1;

/// A part of the limit is called different from zero beyond this many standard errors (two-sided level 0.01).
const NONZERO_STANDARD_ERRORS: f64 = 2.58;

/// Each trial's elastic limit, rad.
fn limits(fit: &Fit) -> Vec<f64> {
    fit.parameters.iter().map(|own| own[X_E]).collect()
}

/// Regression of a fit's elastic limits; `simulated` are the limits in sessions simulated with that fit as the truth, rad.
///
/// Weighted least squares on a constant, velocity and torque. The variance of a trial is the sum of its noise variance, from the scatter
/// of its limit between the simulated sessions, and a variance between trials (Paule and Mandel 1982). Errors that trials have in
/// common, such as those of the inertia or of the averaged input, appear in the scatter of the coefficients between the simulated
/// sessions, which is part of the standard errors. `None` if velocity or torque does not vary, if too few limits are visible, or if the
/// model prescribes a law for them.
pub fn elastic_limit_law(
    observations: &Observations,
    fit: &Fit,
    simulated: &[Vec<f64>],
) -> Option<ElasticLimitLaw> {
    let trials: Vec<usize> =
        (0..observations.trials.len()).filter(|trial| is_seen(observations, fit, *trial)).collect();
    if trials.len() < MIN_LIMIT_TRIALS
        || fit.kinds.iter().any(|kind| kind.evidence() == EvidenceSource::LimitLaw)
    {
        return None;
    }
    let own = limits(fit);
    let scatter = |t: &usize| simulated.iter().map(|limits| limits[*t]).collect::<MeanVariance>().variance();
    let noise: Vec<f64> = trials.iter().map(scatter).collect::<Option<_>>()?;
    let mean = |of: &dyn Fn(usize) -> f64| trials.iter().map(|t| of(*t)).sum::<f64>() / trials.len() as f64;
    let mean_torque = mean(&|trial| observations.trials[trial].torque_nm);
    let row = |trial: &usize| {
        let own = &observations.trials[*trial];
        Vector3::new(1.0, own.velocity_rad_s.abs(), own.torque_nm - mean_torque)
    };
    let rows: Vec<Vector3<f64>> = trials.iter().map(row).collect();
    let of_trials = |limits: &[f64]| trials.iter().map(|t| limits[*t]).collect::<Vec<f64>>();
    let plane = LimitRegression::between(&rows, &noise, &of_trials(&own))?;
    let coefficients = plane.coefficients(&of_trials(&own));
    let in_simulated: Vec<Vector3<f64>> =
        simulated.iter().map(|limits| plane.coefficients(&of_trials(limits))).collect();
    let value = |index: usize| {
        let in_common = in_simulated.iter().map(|own| own[index]).collect::<MeanVariance>().variance()?;
        let between_trials =
            plane.variance_between * plane.shares.iter().map(|s| s[index] * s[index]).sum::<f64>();
        Some((coefficients[index], libm::sqrt(in_common + between_trials)))
    };
    let (x_0, slope, per_torque) = (value(0)?, value(1)?, value(2)?);
    // Contributions to the mean limit.
    let limit = mean(&|trial| own[trial]);
    let velocity = mean(&|trial| observations.trials[trial].velocity_rad_s.abs());
    let part = |(value, se): (f64, f64), by: f64| LimitPart::of(by * value / limit, by * se / limit);
    let law = match (part(x_0, 1.0), part(slope, velocity)) {
        (LimitPart::Zero, LimitPart::Some) => LimitForm::TimedYield,
        (LimitPart::Some, LimitPart::Zero) => LimitForm::FixedAngle,
        (LimitPart::Some, LimitPart::Some) => LimitForm::Linear,
        _ => LimitForm::Undecided,
    };
    Some(ElasticLimitLaw { law, x_0_rad: x_0, slope_s: slope, per_torque_rad_per_nm: per_torque })
}

/// Whether a trial yields within the window. Otherwise its limit follows from those of other trials.
fn is_seen(observations: &Observations, fit: &Fit, trial: usize) -> bool {
    let window_s = observations.samples as f64 * observations.period_s;
    let within = |time_s: f64| time_s < LATEST_VISIBLE_YIELD * window_s;
    !fit.at_bound(trial, X_E) && fit.x_t_s(observations, trial).is_some_and(within)
}

/// Latest time of a visible yield, as a fraction of the window. Assumed.
const LATEST_VISIBLE_YIELD: f64 = 0.95;

/// Weighted least squares with a variance between trials.
struct LimitRegression {
    /// Weight of each trial's limit in each coefficient.
    shares: Vec<Vector3<f64>>,
    /// Variance between the trials beyond their noise, rad2.
    variance_between: f64,
}

impl LimitRegression {
    /// Estimates the variance between trials for which the weighted sum of squares equals its degrees of freedom.
    fn between(rows: &[Vector3<f64>], noise: &[f64], limits: &[f64]) -> Option<Self> {
        let mut low = Self::with(rows, noise, 0.0)?;
        if low.excess(rows, noise, limits) <= 0.0 {
            return Some(low);
        }
        let mut high = limits.iter().copied().collect::<MeanVariance>().variance()?;
        for _ in 0..VARIANCE_BISECTIONS {
            let middle = Self::with(rows, noise, 0.5 * (low.variance_between + high))?;
            if middle.excess(rows, noise, limits) > 0.0 {
                low = middle;
            } else {
                high = middle.variance_between;
            }
        }
        Some(low)
    }

    fn with(rows: &[Vector3<f64>], noise: &[f64], variance_between: f64) -> Option<Self> {
        let weights = || noise.iter().map(|own| 1.0 / (own + variance_between));
        let mut regression = WeightedRegression::new(0.0);
        // The shares of the trials do not depend on their limits.
        rows.iter().zip(weights()).for_each(|(row, weight)| regression.add(row, weight, 0.0));
        let inverse = regression.inverse()?;
        let shares = rows.iter().zip(weights()).map(|(row, weight)| weight * inverse * row).collect();
        Some(Self { shares, variance_between })
    }

    fn coefficients(&self, limits: &[f64]) -> Vector3<f64> {
        self.shares.iter().zip(limits).map(|(share, limit)| share * *limit).sum()
    }

    /// Weighted sum of squares less its degrees of freedom.
    fn excess(&self, rows: &[Vector3<f64>], noise: &[f64], limits: &[f64]) -> f64 {
        let coefficients = self.coefficients(limits);
        let square = |((row, noise), limit): ((&Vector3<f64>, &f64), &f64)| {
            let left = limit - row.dot(&coefficients);
            left * left / (noise + self.variance_between)
        };
        rows.iter().zip(noise).zip(limits).map(square).sum::<f64>() - (limits.len() as f64 - 3.0)
    }
}

/// Number of bisections of the variance between trials.
const VARIANCE_BISECTIONS: usize = 30;

/// Whether a part of the limit differs from zero.
enum LimitPart {
    /// Consistent with zero, and known to be small.
    Zero,
    /// Different from zero.
    Some,
    /// Consistent with zero and with a large value.
    Unknown,
}

impl LimitPart {
    /// Classifies a fraction of the mean limit by its standard error `se`.
    fn of(share: f64, se: f64) -> Self {
        let half = HALF_INTERVAL_95 * se;
        if share.abs() > NONZERO_STANDARD_ERRORS * se {
            Self::Some
        } else if half < NEGLIGIBLE_FRACTION {
            Self::Zero
        } else {
            Self::Unknown
        }
    }
}

impl ElasticLimitLaw {
    /// The law with its values and 95 % intervals.
    pub fn to_json(&self) -> Value {
        let value = |(value, se): (f64, f64)| {
            let half = HALF_INTERVAL_95 * se;
            json!({ "value": value, "low": value - half, "high": value + half })
        };
        json!({
            "law": self.law,
            "says": self.to_string(),
            "x_0_rad": value(self.x_0_rad),
            "slope_s": value(self.slope_s),
            "per_torque_rad_per_nm": value(self.per_torque_rad_per_nm),
        })
    }
}

impl std::fmt::Display for ElasticLimitLaw {
    /// One line for the terminal.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let says = match self.law {
            LimitForm::TimedYield => "a time: x_e is proportional to velocity",
            LimitForm::FixedAngle => "an angle: x_e does not depend on velocity",
            LimitForm::Linear => {
                "neither a time nor an angle: x_e rises in a line that does not pass through zero"
            }
            LimitForm::Undecided => "too uncertain to tell a time from an angle",
        };
        let (x_0, slope) = (self.x_0_rad, self.slope_s);
        write!(
            formatter,
            "{says}; slope over velocity {:.1} ms (+- {:.1}), intercept {:.1} mrad (+- {:.1})",
            1e3 * slope.0,
            1e3 * HALF_INTERVAL_95 * slope.1,
            1e3 * x_0.0,
            1e3 * HALF_INTERVAL_95 * x_0.1
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn the_variance_between_trials_is_separated_from_their_noise() {
        let row = |trial: u32| Vector3::new(1.0, f64::from(trial % 4), f64::from(trial / 4 % 3) - 1.0);
        let rows: Vec<Vector3<f64>> = (0..36).map(row).collect();
        let noise: Vec<f64> = (0..36).map(|trial| 0.5 + f64::from(trial % 3)).collect();
        let mut stream = Stream::new(1, "limits");
        for between in [0.0, 4.0] {
            let mut draw = || {
                let limit = |(row, noise): (&Vector3<f64>, &f64)| {
                    row.dot(&Vector3::new(3.0, 20.0, -1.0)) + libm::sqrt(noise + between) * stream.normal()
                };
                let limits: Vec<f64> = rows.iter().zip(&noise).map(limit).collect();
                let plane = LimitRegression::between(&rows, &noise, &limits).unwrap();
                (plane.variance_between, plane.coefficients(&limits)[1])
            };
            let draws: Vec<(f64, f64)> = (0..400).map(|_| draw()).collect();
            let mean = |of: &dyn Fn(&(f64, f64)) -> f64| draws.iter().map(of).sum::<f64>() / 400.0;
            let (variance, slope) = (mean(&|draw| draw.0), mean(&|draw| draw.1));
            assert!((variance - between).abs() < 0.3, "{variance} between trials, {between} expected");
            assert!((slope - 20.0).abs() < 0.1, "{slope}");
        }
    }

    #[test]
    fn a_part_is_zero_only_if_it_is_known_to_be_small() {
        assert!(matches!(LimitPart::of(0.2, 0.05), LimitPart::Some));
        assert!(matches!(LimitPart::of(0.05, 0.04), LimitPart::Zero));
        assert!(matches!(LimitPart::of(0.05, 0.08), LimitPart::Unknown));
    }
}
