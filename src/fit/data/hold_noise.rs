//! The noise of a session: measured in the holds, or where there are none in how repetitions differ.

use super::preprocessing::{HOLD_S, Observations, PreprocessingSettings, TrialObservation, mean};
use crate::dataset::Session;
use crate::signal::{FilterSpec, NoiseCovariance};

/// Where the noise was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseSource {
    /// In the holds before the ramps: the noise alone.
    Holds,
    /// In how the repetitions of a condition differ: the noise and what really changed from trial to trial. A standard error
    /// from it tells how far another repetition may lie off.
    Repetitions,
    /// In how the residuals of a plain fit differ between repetitions: the noise without what the parameters absorbed.
    Residuals,
}

/// How many stretches begin within one window's length: that many overlapping ones are worth about one.
pub(in crate::fit) const STRETCHES_A_WINDOW: usize = 10;

/// Independent stretches of hold that a torque level needs for a noise of its own, for each sample that it is measured on;
/// with fewer, all levels share one.
const STRETCHES_FOR_OWN_NOISE: usize = 4;

/// Stretches of hold that a noise is measured on at least: their covariance must leave the fit more directions to look in
/// than it has parameters.
const FEWEST_STRETCHES: usize = 60;

/// Part of the mean variance that stands for what the trials' parameters absorbed.
const ABSORBED: f64 = 0.05;

/// Differences between repetitions that a covariance is measured on at least.
const FEWEST_DIFFERENCES: usize = 12;

/// Time that the filter is given to settle at the start of a record, s.
const SETTLING_S: f64 = 0.025;

impl Observations {
    /// The samples of the window that noise is measured on; the last is among them.
    pub fn noise_samples(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.samples).rev().step_by(self.stride).collect::<Vec<_>>().into_iter().rev()
    }

    /// Stretches of the hold (which ends at the onset), each a window long, less the level before it; they overlap.
    pub(in crate::fit) fn hold_stretches(&self, hold: &[f64]) -> Vec<Vec<f64>> {
        let level = self.level_samples();
        let settling =
            if self.sections.is_empty() { 0 } else { libm::ceil(SETTLING_S / self.period_s) as usize };
        let longest = libm::round(HOLD_S / self.period_s) as usize;
        let begin = settling.max(hold.len().saturating_sub(longest));
        let mut stretches = Vec::new();
        let mut end = hold.len();
        while end >= begin + level + self.samples {
            let window = &hold[end - self.samples..end];
            let base = mean(&hold[end - self.samples - level..end - self.samples]);
            stretches.push(self.noise_samples().map(|i| window[i] - base).collect());
            end -= (self.samples / STRETCHES_A_WINDOW).max(1);
        }
        stretches
    }

    /// The covariance of the noise, by torque level where the holds are long enough, else over all trials.
    pub(in crate::fit) fn measure_noise(&mut self) {
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
        let enough = STRETCHES_FOR_OWN_NOISE * STRETCHES_A_WINDOW * self.noise_samples().count();
        if by_level.iter().all(|own| own.len() >= enough) {
            self.noise_covariances =
                by_level.iter().filter_map(|own| NoiseCovariance::measure(own)).collect();
            let level_of =
                |trial: &TrialObservation| levels.iter().position(|level| *level == trial.torque_nm);
            self.noise_index = self.trials.iter().map(level_of).collect();
            self.noise_source = Some(NoiseSource::Holds);
            return;
        }
        let all = stretches(None);
        let (source, of) = if all.len() >= FEWEST_STRETCHES {
            (NoiseSource::Holds, all)
        } else {
            (NoiseSource::Repetitions, self.differences())
        };
        if of.len() >= FEWEST_DIFFERENCES {
            self.noise_covariances = NoiseCovariance::measure(&of).into_iter().collect();
            self.noise_source = Some(source);
        }
        self.noise_index = vec![(!self.noise_covariances.is_empty()).then_some(0); self.trials.len()];
    }

    /// Takes the noise from how residuals of a plain fit scatter among the repetitions of a condition; for sessions without a
    /// hold. It lacks what the trials' own parameters absorbed, so a part of its mean variance is added to every direction.
    pub fn take_noise_from_repetitions(&mut self, model: &crate::fit::Model) {
        let fit = crate::fit::Fit::new(self, model, crate::fit::Weighting::Plain);
        let predictions = crate::fit::predictions(self, &fit);
        let places: Vec<usize> = self.noise_samples().collect();
        let of_trial =
            |trial: usize| places.iter().map(|p| predictions[trial].residual_nm[*p]).collect::<Vec<f64>>();
        let residuals: Vec<Vec<f64>> = (0..self.trials.len()).map(of_trial).collect();
        let mut deviations = Vec::new();
        for (trial, own) in residuals.iter().enumerate() {
            let same: Vec<&Vec<f64>> = (0..residuals.len())
                .filter(|other| self.trials[*other].condition == self.trials[trial].condition)
                .map(|other| &residuals[other])
                .collect();
            let count = same.len() as f64;
            if count < 2.0 {
                continue;
            }
            let bias = libm::sqrt(count / (count - 1.0));
            let mean_at = |place: usize| same.iter().map(|r| r[place]).sum::<f64>() / count;
            deviations.push((0..own.len()).map(|place| bias * (own[place] - mean_at(place))).collect());
        }
        if let Some(mut noise) = NoiseCovariance::measure(&deviations) {
            let floor = ABSORBED * noise.covariance.trace() / noise.covariance.nrows() as f64;
            for place in 0..noise.covariance.nrows() {
                noise.covariance[(place, place)] += floor;
            }
            self.noise_source = Some(NoiseSource::Residuals);
            self.noise_covariances = vec![noise];
            self.noise_index = vec![Some(0); self.trials.len()];
        }
    }

    /// How each trial's torque differs from the mean over its condition's repetitions, made as large as between independent
    /// records; one repetition of each condition, which says nothing new, is left out.
    fn differences(&self) -> Vec<Vec<f64>> {
        let places: Vec<usize> = self.noise_samples().collect();
        let same = |a: &TrialObservation, b: &TrialObservation| a.condition == b.condition;
        let of_condition = |trials: &[TrialObservation]| -> Vec<Vec<f64>> {
            let count = trials.len() as f64;
            let at = |place: usize| trials.iter().map(move |trial| trial.measured_nm[place]);
            let means: Vec<f64> = places.iter().map(|place| at(*place).sum::<f64>() / count).collect();
            let enlarge = libm::sqrt(count / (count - 1.0));
            let own = |trial: &TrialObservation| {
                places
                    .iter()
                    .zip(&means)
                    .map(|(place, mean)| enlarge * (trial.measured_nm[*place] - mean))
                    .collect()
            };
            trials.iter().skip(1).map(own).collect()
        };
        self.trials.chunk_by(same).filter(|trials| trials.len() > 1).flat_map(of_condition).collect()
    }
}

/// Every how many samples the noise is measured: six times the cut-off stays below half the rate of what is left, and a
/// long window keeps at most a hundred values.
pub(in crate::fit) fn stride(session: &Session, view: PreprocessingSettings, samples: usize) -> usize {
    let FilterSpec::Butterworth { cutoff_hz, .. } = session.recorded_filter.unwrap_or(view.filter);
    let by_filter = libm::floor(session.sample_rate_hz / (12.0 * cutoff_hz)) as usize;
    by_filter.max(samples.div_ceil(100)).max(1)
}

/// The error of the recorded angle, rad: from its second differences in the holds, at least that of the encoder's steps,
/// which a still motor does not show; and that step, where the holds are still.
pub(in crate::fit) fn angle_noise(trials: &[&crate::dataset::Trial]) -> (f64, f64) {
    let (mut squares, mut count, mut step) = (Vec::new(), 0.0, f64::INFINITY);
    for trial in trials {
        // The first sample may have been measured before the trial began.
        let theta = trial.record.theta_m_rad.get(1..).unwrap_or_default();
        for pair in theta.windows(2) {
            let change = (pair[1] - pair[0]).abs();
            if change > 1e-9 && change < step {
                step = change;
            }
        }
        let seconds = theta[..theta.len() / 5].windows(3).map(|three| three[0] - 2.0 * three[1] + three[2]);
        count += theta[..theta.len() / 5].windows(3).len() as f64;
        squares.push(seconds.map(|second| second * second).sum::<f64>());
    }
    // Added up in an order that is not that of the trials: a trial run again after a crash changes no bit.
    squares.sort_by(f64::total_cmp);
    let squares: f64 = squares.iter().sum();
    let step = if step.is_finite() { step } else { 0.0 };
    // White noise has second differences of six times its variance, rounding to steps a variance of step^2 / 12.
    let (in_hold, of_steps) = (squares / 6.0 / f64::max(count, 1.0), step * step / 12.0);
    (libm::sqrt(in_hold.max(of_steps)), if in_hold < of_steps { step } else { 0.0 })
}
