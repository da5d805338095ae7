//! How a mechanism's real law may differ from the catalogue's, and what that would leave over.

use super::candidates::Candidate;
use super::residual_projection::{Direction, Tangent, whiten};
use crate::diagnose::predicted_torque::torques;
use crate::fit::Observations;
use crate::random::Stream;

/// How far a mechanism's real law may be from the catalogue's, as a part of the torque that it adds. Assumed: between laws that
/// yield, slide or give in another way, it is about that.
pub const FORM_ERROR: f64 = 0.03;

/// Of a lag the same, as a part of its delay. Of one delay, lags of first and of second order and a pure one have second
/// moments of 2, 1.5 (critically damped) and 1 of its square; half of the difference is a shift in time of what they add.
const SPREAD_ERROR: f64 = 0.25;

/// What any other law that is a few per cent off leaves, as a part of what the mechanism is worth. Assumed.
const PART_LEFT: f64 = 0.06;

/// How a candidate's law may be another.
enum Doubt {
    /// It is a constant that is other than assumed: not at all.
    None,
    /// It is a lag: what it adds may come so many samples (sd) earlier or later.
    Spread(f64),
    /// By a smooth factor.
    Form,
}

impl Doubt {
    fn of(own: &Candidate, period_s: f64) -> Self {
        match own.kind.delay_s(own.values()) {
            _ if own.kind.has_known_form() => Self::None,
            Some(delay_s) => Self::Spread(SPREAD_ERROR * delay_s / period_s),
            None => Self::Form,
        }
    }
}

/// What a candidate predicts, and what its mechanism, the last of its fit, adds to that: a vector a trial each, N m.
pub struct Added {
    predicted_nm: Vec<Vec<f64>>,
    added_nm: Vec<Vec<f64>>,
    doubt: Doubt,
}

impl Added {
    pub fn new(prepared: &Observations, own: &Candidate) -> Self {
        let predicted_nm = torques(prepared, &own.fit.kinds, &own.fit.parameters);
        let kinds = &own.fit.kinds[..own.fit.kinds.len() - 1];
        let without = |parameters: &Vec<f64>| parameters[..parameters.len() - own.values().len()].to_vec();
        let parameters: Vec<Vec<f64>> = own.fit.parameters.iter().map(without).collect();
        let difference = |(with, without): (&Vec<f64>, &Vec<f64>)| {
            with.iter().zip(without).map(|(with, without)| with - without).collect()
        };
        let without = torques(prepared, kinds, &parameters);
        let added_nm = predicted_nm.iter().zip(&without).map(difference).collect();
        Self { predicted_nm, added_nm, doubt: Doubt::of(own, prepared.period_s) }
    }

    /// The torques under another law, the same in all trials, N m.
    pub fn under_another_law(&self, stream: &mut Stream) -> Vec<Vec<f64>> {
        let law = match self.doubt {
            Doubt::None => return self.predicted_nm.clone(),
            Doubt::Spread(samples) => OtherLaw::Later(samples * stream.normal()),
            // Each wave has half the variance of the constant.
            Doubt::Form => {
                OtherLaw::Factor(std::array::from_fn(|_| FORM_ERROR / libm::sqrt(3.0) * stream.normal()))
            }
        };
        let plus = |(torque, added): (&Vec<f64>, &Vec<f64>)| {
            torque.iter().zip(law.errors_nm(added)).map(|(torque, error)| torque + error).collect()
        };
        self.predicted_nm.iter().zip(&self.added_nm).map(plus).collect()
    }
}

/// What would be left of the sum of squares for other mechanisms to describe, were the law of `own` another, in units of the
/// noise. `tangent` is that of its fit.
pub fn may_leave(prepared: &Observations, tangent: &Tangent, own: &Candidate) -> f64 {
    match Doubt::of(own, prepared.period_s) {
        Doubt::None => 0.0,
        Doubt::Spread(samples) => {
            let error = |(trial, added): (usize, &Vec<f64>)| {
                whiten(prepared, &own.fit, trial, &OtherLaw::Later(samples).errors_nm(added))
            };
            let added_nm = Added::new(prepared, own).added_nm;
            let change: Direction = added_nm.iter().enumerate().map(error).collect();
            tangent.project(&change).iter().map(|own| own.norm_squared()).sum()
        }
        Doubt::Form => PART_LEFT * own.worth,
    }
}

/// A law that is not the catalogue's.
enum OtherLaw {
    /// A lag that spreads the same delay otherwise: to second order, what it adds comes so many samples later.
    Later(f64),
    /// What it adds has a smooth factor: one constant and four waves of time.
    Factor([f64; 5]),
}

impl OtherLaw {
    /// What it adds over the catalogue's `added`.
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
    fn a_lag_and_a_pure_delay_of_as_much_differ_by_a_shift_of_what_they_add() {
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
        let error = OtherLaw::Later(-0.5 * delay_s / period_s).errors_nm(&added);
        // Once what the onset has set off is over.
        let (mut apart, mut left) = (0.0_f64, 0.0_f64);
        for sample in 80..400 {
            let delayed = rise(times[sample] - delay_s);
            apart = apart.max((delayed - lagged[sample]).abs());
            left = left.max((delayed - lagged[sample] - error[sample]).abs());
        }
        assert!(left < 0.3 * apart, "{left} of {apart}");
    }
}
