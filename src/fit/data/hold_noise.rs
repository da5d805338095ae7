//! Noise of a session, estimated from the holds before the ramps, or from the differences between repetitions.
//!
//! This file decides which data the noise is estimated from. [`NoiseCovariance`] holds an estimate and whitens with it.

use super::observations::{NoiseSource, Observations, TrialObservation, mean};
use crate::dataset::{Record, Trial};
use crate::signal::{FilterSpec, NoiseCovariance};

/// Longest part of the hold that is used, s; the torque gate of a session guarantees this much.
pub(super) const HOLD_S: f64 = 0.5;

/// Number of overlapping stretches that begin within the length of one window; together they count as one independent stretch.
pub(in crate::fit) const STRETCHES_PER_WINDOW: usize = 10;

/// Independent stretches per noise sample that a torque level needs for a covariance of its own; with fewer, all torque levels
/// share one covariance.
const STRETCHES_PER_SAMPLE: usize = 4;

/// Smallest number of stretches for a covariance from holds: the covariance must have more directions than the fit has
/// parameters.
const MIN_STRETCHES: usize = 60;

/// Smallest number of differences between repetitions for a covariance.
const MIN_DIFFERENCES: usize = 12;

/// Time that the filter needs to settle at the start of a record, s.
const SETTLING_S: f64 = 0.025;

impl Observations {
    /// Overlapping stretches of `hold`, the filtered channels up to the onset: each as long as the window, less the mean before it,
    /// read at the noise samples, channel by channel.
    pub(super) fn hold_stretches(&self, hold: &[&[f64]]) -> Vec<Vec<f64>> {
        let level = self.level_samples();
        let settling =
            if self.sections.is_empty() { 0 } else { libm::ceil(SETTLING_S / self.period_s) as usize };
        let longest = libm::round(HOLD_S / self.period_s) as usize;
        let length = hold[0].len();
        let begin = settling.max(length.saturating_sub(longest));
        let mut stretches = Vec::new();
        let mut end = length;
        while end >= begin + level + self.samples {
            let mut stretch = Vec::new();
            for channel in hold {
                let window = &channel[end - self.samples..end];
                let base = mean(&channel[end - self.samples - level..end - self.samples]);
                stretch.extend(self.window_noise_samples().map(|i| window[i] - base));
            }
            stretches.push(stretch);
            end -= (self.samples / STRETCHES_PER_WINDOW).max(1);
        }
        stretches
    }

    /// Estimates the noise covariance of each torque level if the holds are long enough, otherwise one for all trials; from the
    /// differences between repetitions if there are hardly any holds.
    pub(super) fn estimate_noise(&mut self) {
        let mut levels: Vec<f64> = self.trials.iter().map(|trial| trial.torque_nm).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let stretches = |wanted: Option<f64>| -> Vec<Vec<f64>> {
            let of_level = |trial: &&TrialObservation| wanted.is_none_or(|level| trial.torque_nm == level);
            self.trials
                .iter()
                .filter(of_level)
                .flat_map(|trial| trial.hold_stretches.iter().cloned())
                .collect()
        };
        let by_level: Vec<_> = levels.iter().map(|level| stretches(Some(*level))).collect();
        // Whether there is a covariance for each level does not depend on the sensors: their further directions are few, and the
        // precision is corrected for them.
        let enough = STRETCHES_PER_SAMPLE * STRETCHES_PER_WINDOW * self.window_noise_samples().count();
        if by_level.iter().all(|own| own.len() >= enough) {
            self.noise_covariances =
                by_level.iter().filter_map(|own| NoiseCovariance::estimate(own)).collect();
            let level_of =
                |trial: &TrialObservation| levels.iter().position(|level| *level == trial.torque_nm);
            self.noise_index = self.trials.iter().map(level_of).collect();
            self.noise_source = Some(NoiseSource::Holds);
            return;
        }
        let all = stretches(None);
        let (source, data) = if all.len() >= MIN_STRETCHES {
            (NoiseSource::Holds, all)
        } else {
            (NoiseSource::Repetitions, self.differences_between_repetitions())
        };
        if data.len() >= MIN_DIFFERENCES {
            self.noise_covariances = NoiseCovariance::estimate(&data).into_iter().collect();
            self.noise_source = Some(source);
        }
        self.noise_index = vec![(!self.noise_covariances.is_empty()).then_some(0); self.trials.len()];
    }

    /// Difference of each trial's torque from the mean over the repetitions of its condition, at the noise samples, scaled to the
    /// variance of independent records. The first repetition of each condition is left out: it depends on the others.
    fn differences_between_repetitions(&self) -> Vec<Vec<f64>> {
        let samples: Vec<usize> = self.noise_samples().collect();
        let same_condition = |a: &TrialObservation, b: &TrialObservation| a.condition == b.condition;
        let of_condition = |trials: &[TrialObservation]| -> Vec<Vec<f64>> {
            let count = trials.len() as f64;
            let at = |sample: usize| trials.iter().map(move |trial| trial.measured_nm[sample]);
            let means: Vec<f64> = samples.iter().map(|sample| at(*sample).sum::<f64>() / count).collect();
            let scale = libm::sqrt(count / (count - 1.0));
            let difference = |trial: &TrialObservation| {
                samples
                    .iter()
                    .zip(&means)
                    .map(|(sample, mean)| scale * (trial.measured_nm[*sample] - mean))
                    .collect()
            };
            trials.iter().skip(1).map(difference).collect()
        };
        self.trials
            .chunk_by(same_condition)
            .filter(|trials| trials.len() > 1)
            .flat_map(of_condition)
            .collect()
    }
}

/// Distance between noise samples, in samples: six times the cut-off stays below half of the reduced rate, and a long window
/// keeps at most 100 noise samples.
pub(super) fn noise_stride(sample_rate_hz: f64, filter: FilterSpec, samples: usize) -> usize {
    let FilterSpec::Butterworth { cutoff_hz, .. } = filter;
    let by_filter = libm::floor(sample_rate_hz / (12.0 * cutoff_hz)) as usize;
    by_filter.max(samples.div_ceil(100)).max(1)
}

/// The differences of the differences of neighbours.
pub(super) fn second_differences(values: &[f64]) -> impl Iterator<Item = f64> {
    values.windows(3).map(|three| three[0] - 2.0 * three[1] + three[2])
}

/// Standard deviation of the error of the recorded angle, rad, and the step of the encoder, rad, if quantisation dominates the
/// error; otherwise the step is zero.
///
/// The standard deviation comes from second differences during the holds. It is at least that of the quantisation, which a motor
/// at rest does not show.
pub(super) fn angle_error(trials: &[&Trial]) -> (f64, f64) {
    encoder_error(trials, |record| Some(&record.theta_m_rad))
}

/// As [`angle_error`], of an angle that the records have.
pub(super) fn encoder_error(trials: &[&Trial], angle: impl Fn(&Record) -> Option<&Vec<f64>>) -> (f64, f64) {
    let (mut squares, mut count, mut step) = (Vec::new(), 0.0, f64::INFINITY);
    for trial in trials {
        // The first sample may have been measured before the trial began.
        let theta = angle(&trial.record).and_then(|theta| theta.get(1..)).unwrap_or_default();
        for pair in theta.windows(2) {
            let change = (pair[1] - pair[0]).abs();
            if change > 1e-9 && change < step {
                step = change;
            }
        }
        let hold = &theta[..theta.len() / 5];
        count += hold.windows(3).len() as f64;
        squares.push(second_differences(hold).map(|second| second * second).sum::<f64>());
    }
    // Summed in an order that does not depend on the order of the trials, so that a trial repeated after a crash changes no bit.
    squares.sort_by(f64::total_cmp);
    let squares: f64 = squares.iter().sum();
    let step = if step.is_finite() { step } else { 0.0 };
    // The second differences of white noise have six times its variance; quantisation has the variance step^2 / 12.
    let (in_hold, quantisation) = (squares / 6.0 / f64::max(count, 1.0), step * step / 12.0);
    (libm::sqrt(in_hold.max(quantisation)), if in_hold < quantisation { step } else { 0.0 })
}
