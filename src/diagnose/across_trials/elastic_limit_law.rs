//! How the elastic limit goes with velocity and torque.

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::fit::{Fit, Observations, X_E};
use crate::statistics::{MeanVariance, WeightedRegression};
use crate::wrist::mechanisms::EvidenceSource;

/// Which law the elastic limits follow over the velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// x_e = v x_t: the muscle yields after a time.
    TimedYield,
    /// x_e = x_0: it yields at an angle.
    FixedAngle,
    /// x_e = x_0 + v x_t, and neither part is zero.
    Linear,
    /// The data cannot tell.
    Undecided,
}

/// How x_e goes with velocity and torque: values with their standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitLaw {
    /// The law.
    pub law: Law,
    /// x_0 of x_e = x_0 + v x_t, rad.
    pub x_0_rad: (f64, f64),
    /// x_t, s.
    pub x_t_s: (f64, f64),
    /// Change with torque, rad/(N m).
    pub per_torque_rad_per_nm: (f64, f64),
}

/// Fewest trials with a limit of their own.
const FEWEST: usize = 9;

/// A part of the limit that is known no better than to this share of the mean limit is not said to be zero. Assumed.
const KNOWN_TO: f64 = 0.1;

/// Half of a 95 % interval, in standard errors.
const HALF_INTERVAL: f64 = 1.96;

/// A part of the limit is not zero if it is this many standard errors: 99 %, as of a misfit.
const NOT_ZERO: f64 = 2.58;

/// Each trial's elastic limit, rad.
fn limits(fit: &Fit) -> Vec<f64> {
    fit.parameters.iter().map(|own| own[X_E]).collect()
}

/// The law of a fit's elastic limits; `simulated` are those of sessions simulated with that fit as the truth.
///
/// Weighed least squares on one, velocity and torque. A trial's weight is from its noise, which is how its limit scatters between the
/// simulated sessions, and from the variance between trials, which is what the limits scatter by beyond that (Paule and Mandel
/// 1982). Errors that trials have in common, of the inertia or of a velocity's recorded motion, do not show in that scatter: they
/// are in how the coefficients scatter between the simulated sessions. `None` if velocity or torque does not vary, if too few
/// limits are seen, or if the model has a law for them.
pub fn limit_law(prepared: &Observations, fit: &Fit, simulated: &[Vec<f64>]) -> Option<LimitLaw> {
    let trials: Vec<usize> =
        (0..prepared.trials.len()).filter(|trial| is_seen(prepared, fit, *trial)).collect();
    if trials.len() < FEWEST || fit.kinds.iter().any(|kind| kind.evidence() == EvidenceSource::LimitLaw) {
        return None;
    }
    let own = limits(fit);
    let scatter = |t: &usize| simulated.iter().map(|limits| limits[*t]).collect::<MeanVariance>().variance();
    let noise: Vec<f64> = trials.iter().map(scatter).collect::<Option<_>>()?;
    let mean = |of: &dyn Fn(usize) -> f64| trials.iter().map(|t| of(*t)).sum::<f64>() / trials.len() as f64;
    let mean_torque = mean(&|trial| prepared.trials[trial].torque_nm);
    let row = |trial: &usize| {
        let own = &prepared.trials[*trial];
        Vector3::new(1.0, own.velocity_rad_s.abs(), own.torque_nm - mean_torque)
    };
    let rows: Vec<Vector3<f64>> = trials.iter().map(row).collect();
    let of_trials = |limits: &[f64]| trials.iter().map(|t| limits[*t]).collect::<Vec<f64>>();
    let plane = Plane::between(&rows, &noise, &of_trials(&own))?;
    let coefficients = plane.coefficients(&of_trials(&own));
    let in_simulated: Vec<Vector3<f64>> =
        simulated.iter().map(|limits| plane.coefficients(&of_trials(limits))).collect();
    let value = |index: usize| {
        let in_common = in_simulated.iter().map(|own| own[index]).collect::<MeanVariance>().variance()?;
        let between_trials =
            plane.variance_between * plane.shares.iter().map(|s| s[index] * s[index]).sum::<f64>();
        Some((coefficients[index], libm::sqrt(in_common + between_trials)))
    };
    let (x_0, x_t, per_torque) = (value(0)?, value(1)?, value(2)?);
    // What the mean limit owes to each.
    let limit = mean(&|trial| own[trial]);
    let velocity = mean(&|trial| prepared.trials[trial].velocity_rad_s.abs());
    let part = |(value, se): (f64, f64), by: f64| Part::of(by * value / limit, by * se / limit);
    let law = match (part(x_0, 1.0), part(x_t, velocity)) {
        (Part::Zero, Part::Some) => Law::TimedYield,
        (Part::Some, Part::Zero) => Law::FixedAngle,
        (Part::Some, Part::Some) => Law::Linear,
        _ => Law::Undecided,
    };
    Some(LimitLaw { law, x_0_rad: x_0, x_t_s: x_t, per_torque_rad_per_nm: per_torque })
}

/// Whether a trial yields within the window. One that does so at its end or later has a limit that its neighbours told.
fn is_seen(prepared: &Observations, fit: &Fit, trial: usize) -> bool {
    let window_s = prepared.samples as f64 * prepared.period_s;
    let within = |time_s: f64| time_s < SEEN * window_s;
    !fit.at_bound(trial, X_E) && fit.x_t_s(prepared, trial).is_some_and(within)
}

/// Part of the window after which a yield does not show. Assumed.
const SEEN: f64 = 0.95;

/// Weighed least squares.
struct Plane {
    /// What each trial's limit counts in each coefficient.
    shares: Vec<Vector3<f64>>,
    /// Variance between the trials beyond their noise, rad2.
    variance_between: f64,
}

impl Plane {
    /// With the variance between trials that makes the weighed residuals as large as expected.
    fn between(rows: &[Vector3<f64>], noise: &[f64], limits: &[f64]) -> Option<Self> {
        let mut low = Self::with(rows, noise, 0.0)?;
        if low.excess(rows, noise, limits) <= 0.0 {
            return Some(low);
        }
        let mut high = limits.iter().copied().collect::<MeanVariance>().variance()?;
        for _ in 0..BISECTIONS {
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

    /// The weighed sum of squares less its degrees of freedom.
    fn excess(&self, rows: &[Vector3<f64>], noise: &[f64], limits: &[f64]) -> f64 {
        let coefficients = self.coefficients(limits);
        let square = |((row, noise), limit): ((&Vector3<f64>, &f64), &f64)| {
            let left = limit - row.dot(&coefficients);
            left * left / (noise + self.variance_between)
        };
        rows.iter().zip(noise).zip(limits).map(square).sum::<f64>() - (limits.len() as f64 - 3.0)
    }
}

const BISECTIONS: usize = 30;

/// What is known of a part of the limit.
enum Part {
    /// It may well be zero, and not much else.
    Zero,
    /// It is not zero.
    Some,
    /// It may be zero and may be much.
    Unknown,
}

impl Part {
    /// Of a share of the mean limit and its standard error.
    fn of(share: f64, se: f64) -> Self {
        let half = HALF_INTERVAL * se;
        if share.abs() > NOT_ZERO * se {
            Self::Some
        } else if half < KNOWN_TO {
            Self::Zero
        } else {
            Self::Unknown
        }
    }
}

impl LimitLaw {
    /// The law with its values and 95 % intervals.
    pub fn to_json(&self) -> Value {
        let value = |(value, se): (f64, f64)| {
            let half = HALF_INTERVAL * se;
            json!({ "value": value, "low": value - half, "high": value + half })
        };
        json!({
            "law": self.law,
            "says": self.to_string(),
            "x_0_rad": value(self.x_0_rad),
            "x_t_s": value(self.x_t_s),
            "per_torque_rad_per_nm": value(self.per_torque_rad_per_nm),
        })
    }
}

impl std::fmt::Display for LimitLaw {
    /// One line for a person.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let says = match self.law {
            Law::TimedYield => "a time: x_e = v x_t",
            Law::FixedAngle => "an angle: x_e = x_0",
            Law::Linear => "x_e = x_0 + v x_t",
            Law::Undecided => "x_e = x_0 + v x_t, too uncertain to tell a time from an angle",
        };
        let (x_0, x_t) = (self.x_0_rad, self.x_t_s);
        write!(
            formatter,
            "{says}; x_t = {:.1} ms (+- {:.1}), x_0 = {:.1} mrad (+- {:.1})",
            1e3 * x_t.0,
            1e3 * HALF_INTERVAL * x_t.1,
            1e3 * x_0.0,
            1e3 * HALF_INTERVAL * x_0.1
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn what_trials_differ_by_is_told_from_their_noise() {
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
                let plane = Plane::between(&rows, &noise, &limits).unwrap();
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
        assert!(matches!(Part::of(0.2, 0.05), Part::Some));
        assert!(matches!(Part::of(0.05, 0.04), Part::Zero));
        assert!(matches!(Part::of(0.05, 0.08), Part::Unknown));
    }
}
