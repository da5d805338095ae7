//! Whether EMG goes on changing: an amplifier that has stopped repeats its last value, and looks like a silent muscle.
//!
//! Two samples of a live channel in a row are equal with some probability, which its noise and its resolution make: near 0
//! for fine steps, near 1 where the noise is below a step. It is estimated from the channel itself, and says how long a run of
//! equal values is still chance.

use super::contradiction::Contradiction;
use super::ramp::rounded;
use super::signal_check::SignalCheck;

/// No run below this time counts, s: a whole period of 20 Hz, the lowest frequency of surface EMG (its usual band is 20 to
/// 450 Hz). Clipped peaks and values that are repeated to a higher rate are shorter.
pub const SHORTEST_RUN_S: f64 = 0.05;

/// Expected number of runs in a session that are called frozen though they are chance.
const FALSE_ALARMS: f64 = 1e-6;

/// The longest run of equal values in a record.
#[derive(Debug, Clone, Copy, PartialEq)]
struct EqualRun {
    value: f64,
    /// Pairs of neighbours in the run, one less than its samples.
    pairs: usize,
}

/// What is wrong with a channel of EMG, whose records are those of `trials` in order.
pub fn check_frozen(column: &str, trials: &[(u32, &[f64])], sample_rate_hz: f64) -> Option<Contradiction> {
    let runs: Vec<(u32, EqualRun, f64, usize)> = trials
        .iter()
        .filter_map(|(number, record)| {
            let longest = longest_run(record)?;
            Some((*number, longest, chance_of_equal(record, longest)?, record.len()))
        })
        .collect();
    let mut live: Vec<f64> = runs.iter().filter(|run| run.1.pairs + 1 < run.3).map(|run| run.2).collect();
    live.sort_by(f64::total_cmp);
    // Half of the trials may be frozen.
    let usual = live.get(live.len() / 2).copied();
    let samples: usize = runs.iter().map(|run| run.3).sum();
    let longest_by_chance = |own: f64| {
        let equal = usual.map_or(0.0, |usual| usual.max(own));
        (SHORTEST_RUN_S * sample_rate_hz).max(longest_run_by_chance(equal, samples))
    };
    let frozen: Vec<_> = runs.iter().filter(|run| run.1.pairs as f64 > longest_by_chance(run.2)).collect();
    let longest = frozen.iter().max_by_key(|run| run.1.pairs)?;
    let seconds = |pairs: f64| rounded(pairs / sample_rate_hz);
    let (measured, mistake) = if live.is_empty() {
        (
            format!(
                "it has the same value throughout each record, {} in trial {}",
                longest.1.value, longest.0
            ),
            "Was it measured at all?",
        )
    } else {
        (
            format!(
                "it stays at {} for {} s in trial {}",
                longest.1.value,
                seconds(longest.1.pairs as f64),
                longest.0
            ),
            "Had the amplifier stopped, or was an electrode off?",
        )
    };
    Some(Contradiction {
        check: SignalCheck::EmgFrozen,
        place: format!("column {column} of the records"),
        trials: frozen.iter().map(|run| run.0).collect(),
        measured,
        stated: format!(
            "no more than {} s with the same value, as the noise of the channel and its resolution make it",
            seconds(longest_by_chance(longest.2))
        ),
        likely_mistake: Some(mistake.into()),
        remedy: "Leave a channel that was not measured out of the records. If it had stopped, reject the trials: nobody knows \
                 whether the muscle was active."
            .into(),
    })
}

/// Pairs of neighbours in the longest run of equal values that is still chance in so many samples, if two in a row are equal with the
/// probability `equal`.
pub fn longest_run_by_chance(equal: f64, samples: usize) -> f64 {
    libm::log(FALSE_ALARMS / samples as f64) / libm::log(equal)
}

/// The longest run of equal values; `None` for a record of fewer than two samples.
fn longest_run(record: &[f64]) -> Option<EqualRun> {
    let mut longest = EqualRun { value: *record.first()?, pairs: 0 };
    let mut pairs = 0;
    for pair in record.windows(2) {
        pairs = if pair[0] == pair[1] { pairs + 1 } else { 0 };
        if pairs > longest.pairs {
            longest = EqualRun { value: pair[1], pairs };
        }
    }
    (record.len() > 1).then_some(longest)
}

/// Probability that a sample equals the one before it, from the record without its longest run; with one equal and one
/// different pair added, so that it is neither 0 nor 1. `None` for a record of fewer than two samples.
fn chance_of_equal(record: &[f64], longest: EqualRun) -> Option<f64> {
    let pairs = record.len().checked_sub(1)?;
    let equal = record.windows(2).filter(|pair| pair[0] == pair[1]).count();
    Some((equal - longest.pairs + 1) as f64 / (pairs - longest.pairs + 2) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const RATE_HZ: f64 = 2500.0;

    /// Records of 2 s of noise with a standard deviation of `steps` steps of the converter.
    fn noise(steps: f64, trials: u32) -> Vec<Vec<f64>> {
        let record = |trial| {
            let mut stream = Stream::new(7, &format!("frozen/{trial}"));
            (0..5000).map(|_| 1e-4 * libm::round(steps * stream.normal())).collect()
        };
        (0..trials).map(record).collect()
    }

    fn found(records: &[Vec<f64>]) -> Option<Contradiction> {
        let trials: Vec<(u32, &[f64])> =
            records.iter().enumerate().map(|(at, record)| (at as u32 + 1, record.as_slice())).collect();
        check_frozen("emg_ecr_mvc", &trials, RATE_HZ)
    }

    #[test]
    fn noise_of_any_resolution_is_not_frozen() {
        for steps in [0.2, 0.3, 0.5, 1.0, 10.0, 1000.0] {
            assert_eq!(found(&noise(steps, 40)), None, "{steps} steps");
        }
    }

    #[test]
    fn values_that_are_repeated_four_times_are_not_frozen() {
        let mut records = noise(10.0, 40);
        for record in &mut records {
            for at in 0..record.len() {
                record[at] = record[at - at % 4];
            }
        }
        assert_eq!(found(&records), None);
    }

    #[test]
    fn an_amplifier_that_stops_in_one_trial_is_found_there() {
        for steps in [0.5, 1.0, 10.0] {
            let mut records = noise(steps, 40);
            let stopped = records[16][2000];
            records[16][2000..].fill(stopped);
            let one = found(&records).unwrap_or_else(|| panic!("{steps} steps"));
            assert_eq!((one.check, one.trials.as_slice()), (SignalCheck::EmgFrozen, &[17][..]));
            assert!(one.to_string().contains("1.2 s in trial 17"), "{one}");
        }
    }

    #[test]
    fn a_stop_shorter_than_a_period_of_the_lowest_frequency_is_not_called_frozen() {
        let mut records = noise(10.0, 4);
        records[0][1000..1120].fill(0.5);
        assert_eq!(found(&records), None);
        records[0][1000..1140].fill(0.5);
        assert!(found(&records).is_some());
    }

    #[test]
    fn a_channel_that_never_changes_was_not_measured() {
        let one = found(&vec![vec![0.0; 5000]; 3]).unwrap();
        assert_eq!(one.trials, [1, 2, 3]);
        assert!(one.to_string().contains("Was it measured at all?"), "{one}");
    }
}
