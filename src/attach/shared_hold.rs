//! Whether two channels measured the same signal: what they have in common in the holds before the ramps.
//!
//! Whatever moves with the ramp is at the right intervals, and correlates with everything else that does: an angle with a torque to 0.7 and
//! more. In the hold before the ramp nothing is tied to it, and what fluctuates there is that of one trial alone. If a column measured the
//! same signal, the hold of a trial in the recording is more like that of the same trial in the session than like those of other trials.
//! Under the hypothesis that it did not, every assignment of the holds of the recording to those of the session is as likely, so the
//! share of random assignments that correlate at least as well is a p-value (permutation test; Phipson & Smyth 2010 for the count of one).

use crate::random::Stream;

use super::correlation::{PiecewiseRecording, Sampled};

/// Random assignments that are compared.
const ASSIGNMENTS: usize = 99_999;

/// The hold ends this long before the onset, which is known to some milliseconds, s.
const BEFORE_ONSET_S: f64 = 0.01;

/// Steps at which holds are compared, Hz: a person's torque has little above 30 Hz.
const STEPS_HZ: f64 = 200.0;

/// A hold has at least so many steps.
const FEWEST_STEPS: usize = 20;

/// The share of random assignments of holds to trials that correlate at least as well as the one that was found, over the trials
/// `(signal with its time 0 at the onset, time of the onset in the recording)`; 1 where fewer than two trials have a hold in both.
pub fn chance(recording: &PiecewiseRecording, trials: &[(Sampled, f64)]) -> f64 {
    let before_s = |trial: &Sampled| -trial.start_s - BEFORE_ONSET_S;
    let shortest_s = trials.iter().map(|(trial, _)| before_s(trial)).fold(f64::INFINITY, f64::min);
    let steps = if shortest_s.is_finite() { (shortest_s.max(0.0) * STEPS_HZ) as usize } else { 0 };
    // The last step has half a step of samples before it.
    let steps = steps.saturating_sub(1);
    if steps < FEWEST_STEPS {
        return 1.0;
    }
    let times_s: Vec<f64> = (1..=steps).map(|step| -BEFORE_ONSET_S - step as f64 / STEPS_HZ).collect();
    let hold = |at: &dyn Fn(f64) -> Option<f64>| {
        let values: Option<Vec<f64>> = times_s.iter().map(|time_s| at(*time_s)).collect();
        values.map(standardised)
    };
    let both: Vec<(Vec<f64>, Vec<f64>)> = trials
        .iter()
        .filter_map(|(trial, onset_s)| {
            let own = hold(&|time_s| trial.mean_at(time_s, 1.0 / STEPS_HZ))?;
            Some((own, hold(&|time_s| recording.mean_at(onset_s + time_s, 1.0 / STEPS_HZ))?))
        })
        .collect();
    if both.len() < 2 {
        return 1.0;
    }
    let alike: Vec<Vec<f64>> = both
        .iter()
        .map(|(own, _)| {
            both.iter().map(|(_, other)| own.iter().zip(other).map(|(a, b)| a * b).sum()).collect()
        })
        .collect();
    let sum = |order: &[usize]| order.iter().enumerate().map(|(own, other)| alike[own][*other]).sum::<f64>();
    let mut order: Vec<usize> = (0..both.len()).collect();
    let found = sum(&order);
    // A column with its sign turned is refused by the search of the places.
    let mut stream = Stream::new(0, "assignment of holds");
    let as_good = (0..ASSIGNMENTS)
        .filter(|_| {
            stream.shuffle(&mut order);
            // The same assignment again differs by rounding.
            sum(&order) >= found - 1e-9
        })
        .count();
    (1 + as_good) as f64 / (1 + ASSIGNMENTS) as f64
}

/// Values without their mean, and of unit length; zeros if they do not change.
fn standardised(values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let length = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>().sqrt();
    let scale = if length > 1e-12 * mean.abs() { 1.0 / length } else { 0.0 };
    values.into_iter().map(|value| (value - mean) * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;
    const TRIALS: usize = 10;
    const EVERY_S: f64 = 3.0;

    /// Hold of 1 s with fluctuations of the trial, then a ramp that all trials have.
    fn trial(number: usize, own: f64, ramp: f64) -> Vec<f64> {
        let mut stream = Stream::new(number as u64, "hold");
        let mut slow = 0.0;
        (0..1300)
            .map(|sample| {
                slow += 0.05 * (stream.normal() - slow);
                own * slow + ramp * ((f64::from(sample) - 1000.0) / 100.0).clamp(0.0, 1.0)
            })
            .collect()
    }

    fn recording(own: f64, noise: f64) -> Vec<f64> {
        let mut stream = Stream::new(1, "noise");
        let mut values: Vec<f64> =
            (0..(TRIALS as f64 * EVERY_S * RATE_HZ) as usize).map(|_| noise * stream.normal()).collect();
        for number in 0..TRIALS {
            let from = (number as f64 * EVERY_S * RATE_HZ) as usize + 500;
            for (value, own) in values[from..].iter_mut().zip(trial(number, own, 1.0)) {
                *value += own;
            }
        }
        values
    }

    fn chance_of(values: &[f64]) -> f64 {
        let times_s: Vec<f64> = (0..values.len()).map(|sample| sample as f64 / RATE_HZ).collect();
        let recording = PiecewiseRecording::new(&times_s, values, RATE_HZ, &[]);
        let records: Vec<Vec<f64>> = (0..TRIALS).map(|number| trial(number, 1.0, 1.0)).collect();
        let sampled = |values| Sampled { start_s: -1.0, rate_hz: RATE_HZ, values };
        let trials: Vec<(Sampled, f64)> =
            (0..TRIALS).map(|number| (sampled(&records[number]), number as f64 * EVERY_S + 1.5)).collect();
        chance(&recording, &trials)
    }

    #[test]
    fn a_column_with_the_fluctuations_of_the_holds_is_told_from_one_that_shares_the_ramps_alone() {
        let shared = chance_of(&recording(1.0, 0.1));
        assert!(shared < 1e-4, "{shared}");
        for noise in [0.0, 0.01, 0.3] {
            let other = chance_of(&recording(0.0, noise));
            assert!(other > 0.01, "noise {noise}: {other}");
        }
    }
}
