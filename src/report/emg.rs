//! EMG of the trials for their figures, and the onset of the reflex response of the stretched muscle.

use crate::attach::shows_onsets;
use crate::dataset::Record;

/// Part of the record that is drawn before and after the onset of the ramp, s.
const DRAWN_S: (f64, f64) = (0.05, 0.15);

/// Time after the onset of the ramp in which a response is sought, s: a voluntary reaction may follow later.
const SOUGHT_S: f64 = 0.1;

/// Hold before the ramp from which the chance level is taken, s: what the torque gate requires to be steady.
const HOLD_S: f64 = 0.5;

/// Width of the mean over rectified EMG, s: the resolution of an onset.
const MEAN_S: f64 = 0.005;

/// Share of stretches of hold, without any ramp, in which an onset would be found.
pub const CHANCE: f64 = 0.05;

/// Fewest stretches of hold of a session that have a quantile at [`CHANCE`].
const FEWEST_STRETCHES: usize = 20;

/// The EMG of a trial.
#[derive(Debug, Clone)]
pub struct TrialEmg {
    /// Times from the onset of the ramp, s.
    pub time_s: Vec<f64>,
    /// Mean rectified EMG of flexor (FCR) and extensor (ECR), fraction of MVC; empty where not measured.
    pub rectified_mvc: [Vec<f64>; 2],
    /// Mean rectified EMG of flexor and extensor in the hold, fraction of MVC.
    pub hold_mvc: [Option<f64>; 2],
    /// Onset of the response of the stretched muscle after that of the ramp, s; `None` if none stands out.
    pub onset_s: Option<f64>,
    /// Whether it has samples enough a second to show an onset.
    pub shows_onsets: bool,
    /// Relative to its mean in the hold: EMG of the stretched muscle in the time in which a response is sought.
    after: Vec<f64>,
    /// The largest such value in each stretch of the hold.
    peaks: Vec<f64>,
    period_s: f64,
}

/// The muscle that a ramp stretches: the flexor in an extending ramp (0), the extensor in a flexing one (1).
fn stretched(velocity_rad_s: f64) -> usize {
    usize::from(velocity_rad_s < 0.0)
}

/// Means over the rectified values from each sample on.
fn rectified(emg: &[f64], period_s: f64) -> Vec<f64> {
    let width = (libm::round(MEAN_S / period_s) as usize).max(1);
    emg.windows(width.min(emg.len().max(1)))
        .map(|own| own.iter().map(|emg| emg.abs()).sum::<f64>() / own.len() as f64)
        .collect()
}

/// The EMG of a trial whose ramp begins at sample `onset`; `None` if the record has none.
pub fn trial_emg(record: &Record, onset: usize, velocity_rad_s: f64, period_s: f64) -> Option<TrialEmg> {
    let channels = [&record.emg_fcr_mvc, &record.emg_ecr_mvc];
    channels.iter().find(|channel| channel.is_some())?;
    let samples = |time_s: f64| libm::round(time_s / period_s) as usize;
    let means = channels.map(|channel| channel.as_ref().map(|emg| rectified(emg, period_s)));
    let length = means.iter().flatten().map(Vec::len).min()?;
    if length <= onset {
        return None;
    }
    let drawn = onset.saturating_sub(samples(DRAWN_S.0))..(onset + samples(DRAWN_S.1)).min(length);
    // A mean that reaches into the ramp is none of the hold.
    let hold = onset.saturating_sub(samples(HOLD_S))..onset.saturating_sub(samples(MEAN_S));
    let level = |own: &Option<Vec<f64>>| {
        let hold = own.as_ref()?.get(hold.clone())?;
        (!hold.is_empty()).then(|| hold.iter().sum::<f64>() / hold.len() as f64)
    };
    let hold_mvc = [level(&means[0]), level(&means[1])];
    let muscle = stretched(velocity_rad_s);
    let (mut after, mut peaks) = (Vec::new(), Vec::new());
    if let (Some(own), Some(level)) = (&means[muscle], hold_mvc[muscle].filter(|level| *level > 0.0)) {
        let relative = |own: &[f64]| -> Vec<f64> { own.iter().map(|emg| emg / level).collect() };
        after = relative(&own[onset.min(own.len())..(onset + samples(SOUGHT_S)).min(own.len())]);
        let stretches = own[hold].rchunks_exact(samples(SOUGHT_S).max(1));
        peaks = stretches.map(|own| relative(own).into_iter().fold(0.0, f64::max)).collect();
    }
    let cut = |own: Option<Vec<f64>>| own.map_or(Vec::new(), |own| own[drawn.clone()].to_vec());
    // The mean over what follows a sample is drawn at the middle of it.
    let time_s = |sample: usize| (sample as f64 - onset as f64) * period_s + MEAN_S / 2.0;
    Some(TrialEmg {
        time_s: drawn.clone().map(time_s).collect(),
        rectified_mvc: means.map(cut),
        hold_mvc,
        onset_s: None,
        shows_onsets: shows_onsets(1.0 / period_s),
        after,
        peaks,
        period_s,
    })
}

/// Finds the onsets: the first time at which the stretched muscle exceeds the level that its EMG in the holds exceeds in `CHANCE`
/// of the stretches as long as the time sought in. Holds are relative to their own mean, so that all trials share the level. No onset
/// is found if the holds are too few to have such a level, or the EMG has too few samples a second.
pub fn find_onsets(trials: &mut [&mut TrialEmg]) {
    if trials.iter().any(|emg| !emg.shows_onsets) {
        return;
    }
    let mut peaks: Vec<f64> = trials.iter().flat_map(|emg| emg.peaks.iter().copied()).collect();
    if peaks.len() < FEWEST_STRETCHES {
        return;
    }
    peaks.sort_by(f64::total_cmp);
    let level = peaks[peaks.len() - 1 - (CHANCE * peaks.len() as f64) as usize];
    for emg in trials {
        let found = emg.after.iter().position(|own| *own > level);
        emg.onset_s = found.map(|sample| sample as f64 * emg.period_s + MEAN_S / 2.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// The onsets in `count` trials of 1.5 s at 1 kHz, whose ramp begins at 1 s; with a burst of `times` the level of the hold from 30 ms
    /// after it on.
    fn onsets(count: usize, times: f64) -> Vec<Option<f64>> {
        let mut stream = Stream::new(1, "emg");
        let mut emg = |_| {
            let level = |sample: usize| if (1030..1060).contains(&sample) { times } else { 1.0 };
            let emg = (0..1500).map(|sample| 0.02 * level(sample) * stream.normal()).collect();
            let record = Record { emg_fcr_mvc: Some(emg), ..Record::default() };
            trial_emg(&record, 1000, 2.0, 1e-3).unwrap()
        };
        let mut trials: Vec<TrialEmg> = (0..count).map(&mut emg).collect();
        find_onsets(&mut trials.iter_mut().collect::<Vec<_>>());
        trials.iter().map(|emg| emg.onset_s).collect()
    }

    #[test]
    fn the_onset_of_a_burst_is_found_where_it_begins() {
        let onsets = onsets(40, 8.0);
        let near = onsets.iter().flatten().filter(|onset_s| (0.024..0.036).contains(*onset_s)).count();
        assert!(near >= 36, "{onsets:?}");
    }

    #[test]
    fn without_a_response_few_trials_have_an_onset() {
        let found = onsets(40, 1.0).into_iter().flatten().count();
        // 40 trials at 5 %: 7 or more have a probability below 1 %.
        assert!(found < 7, "{found}");
    }

    #[test]
    fn emg_that_ends_before_the_ramp_is_not_drawn() {
        let record = Record { emg_fcr_mvc: Some(vec![0.1; 900]), ..Record::default() };
        assert!(trial_emg(&record, 1000, 2.0, 1e-3).is_none());
    }

    #[test]
    fn emg_of_few_samples_a_second_has_no_latency() {
        let mut stream = Stream::new(1, "emg");
        let mut slow: Vec<TrialEmg> = (0..40)
            .map(|_| {
                let level = |sample: usize| if (515..530).contains(&sample) { 8.0 } else { 1.0 };
                let emg = (0..750).map(|sample| 0.02 * level(sample) * stream.normal()).collect();
                let own = Record { emg_fcr_mvc: Some(emg), ..Record::default() };
                trial_emg(&own, 500, 2.0, 2e-3).unwrap()
            })
            .collect();
        find_onsets(&mut slow.iter_mut().collect::<Vec<_>>());
        assert!(slow.iter().all(|emg| emg.onset_s.is_none() && !emg.shows_onsets));
    }

    #[test]
    fn holds_that_are_too_few_give_no_onset_and_a_record_without_emg_no_figure() {
        assert!(onsets(3, 8.0).iter().all(Option::is_none));
        assert!(trial_emg(&Record::default(), 10, 1.0, 1e-3).is_none());
    }
}
