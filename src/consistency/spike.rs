//! Single wrong samples: a byte that was lost between converter and disk gives a value far from its neighbours on both sides.
//!
//! A spike of one sample, or of two, is as high against what comes before it as against what comes after it. Neither a step, nor a corner
//! such as the yield's, nor the acceleration of the ramp is: they are predicted by the samples of one side.

use super::contradiction::Contradiction;
use super::ramp::rounded;
use super::samples_of_ramp::{RampChannel, resolution, samples_of_ramp};
use super::signal_check::SignalCheck;
use crate::dataset::Trial;
use crate::statistics::{SD_BY_MEDIAN, upper_median};

/// Standard deviations of the noise from which on a sample is no chance: in white noise, of which a second difference has the variance 6, half
/// of it is beyond 8.6 standard deviations of a sample once in 5e11 samples (normal), in less than one session of a million.
pub(super) const LARGEST_BY_NOISE: f64 = 8.6;

/// Steps of the resolution from which on a sample is no rounding: two neighbours and the sample itself are each off by half a step.
pub(super) const RESOLUTION_STEPS: f64 = 4.0;

/// Part of all that the channel moves in a record, below which a wrong sample changes no fit, and noise is less white than assumed.
pub(super) const LEAST_PART: f64 = 0.02;

/// A sample counts if it is this many times as far off as any that is not among the farthest [`FEW`] of the same ramp: a lever that rings fast
/// gives many such samples.
const TIMES_OTHERS: f64 = 3.0;

/// Samples of a ramp that may be spikes, with the neighbours that one spike has.
const FEW: usize = 12;

/// A sample counts if it is this many times as far off as the farthest of the same ramp is in three quarters of the trials: the shock of a ramp
/// comes in all of them. In the measured ankles, whose torque is sampled at 1 kHz behind no lever, the largest is 2.4 times as far off.
const TIMES_OTHER_TRIALS: f64 = 4.0;

/// A sample far from its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Spike {
    /// Its place in the record.
    sample: usize,
    /// How far it is from what both sides predict, in the unit of the channel.
    height: f64,
}

/// What is known of a channel in a trial.
struct Measured<'a> {
    trial: &'a Trial,
    /// The farthest sample of the ramp.
    farthest: Spike,
    /// How far a sample may be by noise, resolution and what else this ramp shows.
    by_chance: f64,
}

/// Samples of angle and torque in the ramps that their neighbours contradict.
pub fn check_spikes(trials: &[&Trial], sample_rate_hz: f64) -> Vec<Contradiction> {
    RampChannel::ALL.into_iter().filter_map(|channel| of_channel(channel, trials, sample_rate_hz)).collect()
}

fn of_channel(channel: RampChannel, trials: &[&Trial], sample_rate_hz: f64) -> Option<Contradiction> {
    let measured: Vec<Measured<'_>> =
        trials.iter().filter_map(|trial| measure(channel, trial, sample_rate_hz)).collect();
    let mut farthest: Vec<f64> = measured.iter().map(|own| own.farthest.height).collect();
    farthest.sort_by(f64::total_cmp);
    // A single trial does not say what a ramp shows by itself.
    let usual = *farthest.get(3 * farthest.len().checked_sub(1).filter(|others| *others > 0)? / 4)?;
    let limit = |own: &Measured<'_>| own.by_chance.max(TIMES_OTHER_TRIALS * usual);
    let found: Vec<&Measured<'_>> = measured.iter().filter(|own| own.farthest.height > limit(own)).collect();
    let worst = found.iter().max_by(|a, b| a.farthest.height.total_cmp(&b.farthest.height))?;
    let Spike { sample, height } = worst.farthest;
    let unit = channel.unit();
    let at_s = worst.trial.record.start_s + sample as f64 / sample_rate_hz;
    Some(wrong_samples(
        channel,
        found.iter().map(|own| own.trial.number).collect(),
        format!(
            "the sample at {} s of trial {} ({}, line {}) is {} {unit}, and {} {unit} from what the samples on both sides of it give",
            rounded(at_s),
            worst.trial.number,
            worst.trial.file,
            sample + 2,
            rounded(channel.of(worst.trial)[sample]),
            rounded(height)
        ),
        limit(worst),
        "what the sample should have been, nobody knows",
    ))
}

/// What is said of samples of `channel` that are more than `by_chance` from those around them; `why` the trials are rejected.
pub(super) fn wrong_samples(
    channel: RampChannel,
    trials: Vec<u32>,
    measured: String,
    by_chance: f64,
    why: &str,
) -> Contradiction {
    let unit = channel.unit();
    Contradiction {
        check: SignalCheck::Spike,
        place: format!("column {} of the records", channel.column()),
        trials,
        measured,
        stated: format!(
            "at most {} {unit}, as noise and resolution of the channel make it",
            rounded(by_chance)
        ),
        likely_mistake: Some(
            "Was a byte lost on the way from the converter to the file, or was there a loose contact?".into(),
        ),
        remedy: format!("Set these trials to rejected with ramphold trials --reject: {why}."),
    }
}

fn measure<'a>(channel: RampChannel, trial: &'a Trial, sample_rate_hz: f64) -> Option<Measured<'a>> {
    let values = channel.of(trial);
    let ramp = samples_of_ramp(trial, sample_rate_hz)?;
    let mut heights: Vec<Spike> =
        ramp.map(|sample| Spike { sample, height: height(values, sample) }).collect();
    heights.sort_by(|a, b| b.height.total_cmp(&a.height));
    let farthest = *heights.first()?;
    let others = heights.get(FEW).map_or(0.0, |spike| spike.height);
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    let by_chance = (LARGEST_BY_NOISE * noise(values))
        .max(RESOLUTION_STEPS * resolution(values))
        .max(LEAST_PART * (high - low))
        .max(TIMES_OTHERS * others);
    Some(Measured { trial, farthest, by_chance })
}

/// How far a sample, or it and the next, is from what the two samples before and the two after it give, whichever is nearer; 0 where the two
/// sides contradict each other, as at a step or a corner.
fn height(values: &[f64], sample: usize) -> f64 {
    let second = |at: usize| values[at - 1] - 2.0 * values[at] + values[at + 1];
    if sample < 2 || sample + 3 >= values.len() {
        return 0.0;
    }
    let [before, own, after, later] =
        [second(sample - 1), second(sample), second(sample + 1), second(sample + 2)];
    let of_sign = |sign: f64| {
        let one = (sign * before).min(-0.5 * sign * own).min(sign * after);
        let two = (sign * before).min(-sign * own).min(-sign * after).min(sign * later);
        one.max(two)
    };
    of_sign(1.0).max(of_sign(-1.0)).max(0.0)
}

/// Standard deviation of the noise of a channel, from the second differences of its samples, most of which are at rest; the ramp and wrong
/// samples do not count.
fn noise(values: &[f64]) -> f64 {
    let differences = values.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs());
    SD_BY_MEDIAN * upper_median(differences).unwrap_or(0.0) / libm::sqrt(6.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heights(values: &[f64]) -> f64 {
        (0..values.len()).map(|sample| height(values, sample)).fold(0.0, f64::max)
    }

    #[test]
    fn a_spike_has_its_own_height_and_a_step_a_corner_and_an_acceleration_have_none() {
        let line = |at: usize| 0.1 * at as f64;
        let with = |add: &dyn Fn(usize) -> f64| (0..30).map(|at| line(at) + add(at)).collect::<Vec<f64>>();
        for width in [1, 2] {
            let spike = with(&|at| if (12..12 + width).contains(&at) { -8.0 } else { 0.0 });
            assert!((heights(&spike) - 8.0).abs() < 1e-9, "{width}: {}", heights(&spike));
        }
        let step = with(&|at| if at >= 12 { 8.0 } else { 0.0 });
        let corner = with(&|at| if at >= 12 { 8.0 * (at - 12) as f64 } else { 0.0 });
        let parabola = with(&|at| if at >= 12 { (at - 12).pow(2) as f64 } else { 0.0 });
        for smooth in [step, corner, parabola] {
            assert!(heights(&smooth) < 1e-9, "{}", heights(&smooth));
        }
    }

    #[test]
    fn the_noise_is_that_of_most_samples() {
        let mut stream = crate::random::Stream::new(3, "spike");
        let mut rest: Vec<f64> = (0..2000).map(|_| 0.005 * stream.normal()).collect();
        rest[500] = 8.0;
        assert!((noise(&rest) / 0.005 - 1.0).abs() < 0.05, "{}", noise(&rest));
    }
}
