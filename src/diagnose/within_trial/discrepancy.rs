//! Discrepancy between a mechanism's true law and the catalogue's, and the misfit that it would leave.

use super::candidates::Candidate;
use super::residual_projection::{ResidualProjection, WhitenedTrials};
use crate::diagnose::predicted_torque::torques;
use crate::fit::Observations;
use crate::random::Stream;

/// Standard deviation of the difference between a mechanism's true law and the catalogue's, as a fraction of the torque that the
/// mechanism adds. Assumed: plausible laws of yielding or friction differ by about that.
pub const LAW_FORM_ERROR: f64 = 0.03;

/// Difference between a lag's true law and the catalogue's, as a fraction of the delay. Lags with the same delay have second moments
/// of 2 (first order), 1.5 (second order, critically damped) and 1 (pure delay) times its square; half of the difference acts as a time
/// shift of the added torque.
const LAG_SHAPE_ERROR: f64 = 0.25;

/// Misfit that a law wrong by a few per cent leaves, as a fraction of the mechanism's decrease of chi-square. Assumed.
const DISCREPANCY_FRACTION: f64 = 0.06;

/// How the true law of a candidate may differ from the catalogue's.
enum LawUncertainty {
    /// Not at all: the mechanism is a constant whose value differs from the assumed one.
    None,
    /// A lag: the added torque may come earlier or later, by this standard deviation in samples.
    Spread(f64),
    /// By a smooth factor on the added torque.
    Form,
}

impl LawUncertainty {
    fn of(own: &Candidate, period_s: f64) -> Self {
        match own.kind.delay_s(own.values()) {
            _ if own.kind.has_known_form() => Self::None,
            Some(delay_s) => Self::Spread(LAG_SHAPE_ERROR * delay_s / period_s),
            None => Self::Form,
        }
    }
}

/// Torque that a candidate predicts, and the torque that its mechanism (the last of its fit) adds: one vector per trial, N m.
pub struct AddedTorque {
    predicted_nm: Vec<Vec<f64>>,
    added_nm: Vec<Vec<f64>>,
    doubt: LawUncertainty,
}

impl AddedTorque {
    pub fn new(observations: &Observations, own: &Candidate) -> Self {
        let predicted_nm = torques(observations, &own.fit.kinds, &own.fit.parameters);
        let kinds = &own.fit.kinds[..own.fit.kinds.len() - 1];
        let without = |parameters: &Vec<f64>| parameters[..parameters.len() - own.values().len()].to_vec();
        let parameters: Vec<Vec<f64>> = own.fit.parameters.iter().map(without).collect();
        let difference = |(with, without): (&Vec<f64>, &Vec<f64>)| {
            with.iter().zip(without).map(|(with, without)| with - without).collect()
        };
        let without = torques(observations, kinds, &parameters);
        let added_nm = predicted_nm.iter().zip(&without).map(difference).collect();
        Self { predicted_nm, added_nm, doubt: LawUncertainty::of(own, observations.period_s) }
    }

    /// Torques under a randomly drawn alternative law, the same for all trials, N m.
    pub fn draw_alternative_law(&self, stream: &mut Stream) -> Vec<Vec<f64>> {
        let law = match self.doubt {
            LawUncertainty::None => return self.predicted_nm.clone(),
            LawUncertainty::Spread(samples) => AlternativeLaw::Later(samples * stream.normal()),
            // Each cosine has half the variance of the constant.
            LawUncertainty::Form => AlternativeLaw::Factor(std::array::from_fn(|_| {
                LAW_FORM_ERROR / libm::sqrt(3.0) * stream.normal()
            })),
        };
        let plus = |(torque, added): (&Vec<f64>, &Vec<f64>)| {
            torque.iter().zip(law.errors_nm(added)).map(|(torque, error)| torque + error).collect()
        };
        self.predicted_nm.iter().zip(&self.added_nm).map(plus).collect()
    }
}

/// Sum of squares that other mechanisms could describe if the true law of `own` differs from the catalogue's, in chi-square units.
/// `tangent` belongs to the fit of `own`.
pub fn misfit_from_discrepancy(
    observations: &Observations,
    tangent: &ResidualProjection,
    own: &Candidate,
) -> f64 {
    match LawUncertainty::of(own, observations.period_s) {
        LawUncertainty::None => 0.0,
        LawUncertainty::Spread(samples) => {
            let error = |(trial, added): (usize, &Vec<f64>)| {
                own.fit
                    .objective
                    .whiten(observations.noise_index[trial], &AlternativeLaw::Later(samples).errors_nm(added))
            };
            let added_nm = AddedTorque::new(observations, own).added_nm;
            let change: WhitenedTrials = added_nm.iter().enumerate().map(error).collect();
            tangent.project(&change).iter().map(|own| own.norm_squared()).sum()
        }
        LawUncertainty::Form => DISCREPANCY_FRACTION * own.chi_square_gain,
    }
}

/// A law that differs from the catalogue's.
enum AlternativeLaw {
    /// A lag of another shape with the same delay: to second order, the added torque comes this many samples later.
    Later(f64),
    /// A smooth factor on the added torque: coefficients of one constant and four cosines over the window.
    Factor([f64; 5]),
}

impl AlternativeLaw {
    /// Difference from the catalogue's added torque `added`, N m.
    fn errors_nm(&self, added: &[f64]) -> Vec<f64> {
        (0..added.len()).map(|sample| self.error_nm(added, sample)).collect()
    }

    fn error_nm(&self, added: &[f64], sample: usize) -> f64 {
        match self {
            Self::Later(samples) => {
                let (before, after) = (sample.saturating_sub(1), (sample + 1).min(added.len() - 1));
                -samples * (added[after] - added[before]) / (after - before) as f64
            }
            Self::Factor(heights) => {
                let place = sample as f64 / added.len() as f64;
                let wave = |(order, height)| height * libm::cos(std::f64::consts::PI * order as f64 * place);
                heights.iter().enumerate().map(wave).sum::<f64>() * added[sample]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_and_a_pure_delay_differ_by_a_shift_of_the_added_torque() {
        let (period_s, delay_s) = (1e-4, 1e-3);
        let rise = |t: f64| if t < 0.0 { 0.0 } else { 1.0 - libm::cos(t / 0.008) };
        let times: Vec<f64> = (0..400).map(|sample| f64::from(sample) * period_s).collect();
        let mut lagged = Vec::new();
        let mut state = 0.0;
        for t in &times {
            lagged.push(state);
            state += (rise(*t) - state) * period_s / delay_s;
        }
        let added: Vec<f64> = times.iter().zip(&lagged).map(|(t, lagged)| lagged - rise(*t)).collect();
        let error = AlternativeLaw::Later(-0.5 * delay_s / period_s).errors_nm(&added);
        // After the transient of the onset.
        let (mut apart, mut left) = (0.0_f64, 0.0_f64);
        for sample in 80..400 {
            let delayed = rise(times[sample] - delay_s);
            apart = apart.max((delayed - lagged[sample]).abs());
            left = left.max((delayed - lagged[sample] - error[sample]).abs());
        }
        assert!(left < 0.3 * apart, "{left} of {apart}");
    }
}
