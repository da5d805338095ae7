//! What a low-pass took from a recorded signal, as far as the record still tells it.
//!
//! A recorded low-pass cannot stay in the motor angle: the model yields where the true angle passes the elastic limit, and the filtered
//! one passes it later and more slowly. Angle and torque are therefore restored alike, and the torque is filtered again, with the
//! prediction.

use super::filter::{FilterError, FilterSpec, Section, filter_both_ways};

/// By how much restoring may raise what came into the record behind the filter, above all the rounding of its numbers: to less than the noise
/// before the filter where the record keeps two digits more than that noise.
const LARGEST_GAIN: f64 = 100.0;

/// The restored signal ends at this part of the sample rate, at the latest.
const HIGHEST_CUTOFF: f64 = 0.45;

/// Takes a low-pass out of signals that it was applied to, up to the frequency at which it left too little.
#[derive(Debug, Clone)]
pub struct Restoration {
    forwards: Vec<Section>,
    backwards: Vec<Section>,
    /// What restored signals are left with: in both directions.
    wide: Vec<Section>,
}

impl Restoration {
    /// Takes `recorded` out of signals of a sampling rate; `None` if the filter leaves nothing to restore below half the rate, or is steeper
    /// than the filters of this program.
    ///
    /// # Errors
    /// If the filter is not possible at this rate.
    pub fn of(recorded: FilterSpec, sample_rate_hz: f64) -> Result<Option<Self>, FilterError> {
        let FilterSpec::Butterworth { order, cutoff_hz, zero_phase } = recorded;
        if order > *FilterSpec::ORDERS.end() {
            return Ok(None);
        }
        let own = recorded.sections(sample_rate_hz)?;
        let passes = if zero_phase { 2.0 } else { 1.0 };
        let raised_hz = cutoff_hz * libm::pow(LARGEST_GAIN, 1.0 / (passes * f64::from(order)));
        let wide_hz = raised_hz.min(HIGHEST_CUTOFF * sample_rate_hz);
        if wide_hz <= cutoff_hz {
            return Ok(None);
        }
        // Two passes of the wider filter have no phase: the signal is not delayed.
        let wide =
            FilterSpec::Butterworth { order, cutoff_hz: wide_hz, zero_phase }.sections(sample_rate_hz)?;
        let widened: Vec<Section> = own.iter().zip(&wide).map(|(own, wide)| widened(own, wide)).collect();
        let backwards = if zero_phase { widened.clone() } else { wide.clone() };
        Ok(Some(Self { forwards: widened, backwards, wide }))
    }

    /// The signal before the filter.
    pub fn restored(&self, recorded: &[f64]) -> Vec<f64> {
        filter_both_ways(&self.forwards, &self.backwards, recorded)
    }

    /// What a restored signal has of one sample before the filter: `length` samples about it.
    pub fn of_one_sample(&self, length: usize) -> Vec<f64> {
        let mut signal = vec![0.0; length];
        signal[length / 2] = 1.0;
        filter_both_ways(&self.wide, &self.wide, &signal)
    }
}

/// The section that has the output of `wide` where its input is the output of `own`. Both are low-passes of the same order, whose zeros, all at
/// half the rate, cancel.
fn widened(own: &Section, wide: &Section) -> Section {
    let gain = wide.b[0] / own.b[0];
    Section { b: [gain, gain * own.a[0], gain * own.a[1]], a: wide.a }
}

#[cfg(test)]
mod tests {
    use super::super::filter;
    use super::*;

    const RATE_HZ: f64 = 2500.0;

    /// A ramp that rises in 10 ms and a ripple.
    fn signal() -> Vec<f64> {
        (0..1500)
            .map(|i| {
                let t = (f64::from(i) / RATE_HZ - 0.3).max(0.0);
                let risen = if t < 0.01 { t * t / 0.02 } else { t - 0.005 };
                (2.0 * risen).min(0.14) + 1e-3 * libm::sin(0.05 * f64::from(i))
            })
            .collect()
    }

    #[test]
    fn a_signal_is_what_it_was_before_the_filter_and_not_later() {
        let signal = signal();
        for order in 1..=4 {
            for zero_phase in [false, true] {
                let recorded = FilterSpec::Butterworth { order, cutoff_hz: 50.0, zero_phase };
                let sections = recorded.sections(RATE_HZ).unwrap();
                let filtered = match zero_phase {
                    true => filter_both_ways(&sections, &sections, &signal),
                    false => filter(&sections, &signal),
                };
                let restored = Restoration::of(recorded, RATE_HZ).unwrap().unwrap().restored(&filtered);
                let worst = |own: &[f64]| {
                    signal
                        .iter()
                        .zip(own)
                        .skip(250)
                        .take(1000)
                        .map(|(a, b)| (a - b).abs())
                        .fold(0.0, f64::max)
                };
                let (before, after) = (worst(&filtered), worst(&restored));
                // Without delay there is less to restore: the corners of the ramp.
                let left = if zero_phase { 0.55 } else { 0.03 };
                assert!(after < left * before, "order {order}, {zero_phase}: {after} of {before}");
            }
        }
    }

    #[test]
    fn rounding_is_raised_by_no_more_than_is_said() {
        let recorded = FilterSpec::PAPER;
        let restoration = Restoration::of(recorded, RATE_HZ).unwrap().unwrap();
        for hz in [20.0, 100.0, 200.0, 300.0, 600.0, 1200.0] {
            let wave: Vec<f64> =
                (0..5000).map(|i| libm::sin(std::f64::consts::TAU * hz * f64::from(i) / RATE_HZ)).collect();
            let restored = restoration.restored(&wave);
            let largest = restored[2000..3000].iter().fold(0.0, |most: f64, own| most.max(own.abs()));
            assert!(largest <= LARGEST_GAIN, "{hz} Hz: {largest}");
        }
    }

    #[test]
    fn a_filter_near_half_the_rate_or_one_that_is_too_steep_is_not_taken_out() {
        let high = FilterSpec::Butterworth { order: 3, cutoff_hz: 470.0, zero_phase: false };
        assert!(Restoration::of(high, 1000.0).unwrap().is_none());
        let steep = FilterSpec::Butterworth { order: 10, cutoff_hz: 50.0, zero_phase: false };
        assert!(Restoration::of(steep, 1000.0).unwrap().is_none());
        assert!(Restoration::of(high, 900.0).is_err());
    }
}
