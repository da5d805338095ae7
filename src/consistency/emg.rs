//! Whether EMG is free of offsets, a fraction of maximal voluntary contraction, and goes on changing.
//!
//! Raw EMG and its envelope are both right: the analysis rectifies what has both signs.

use super::contradiction::Contradiction;
use super::frozen_emg::check_frozen;
use super::measured_trial::mean;
use super::ramp::rounded;
use super::signal_check::SignalCheck;
use crate::dataset::{Record, Trial};

/// Raw EMG has a mean of zero over a trial, and an envelope has no negative values. A signal with negative values whose mean is above
/// this part of its root mean square has an offset, which would be rectified with it.
const OFFSET_OVER_RMS: f64 = 0.3;

/// This part of the samples of an envelope may be below zero: the low-pass filter behind the rectifier can swing.
const NEGATIVE_SHARE: f64 = 0.02;

/// No muscle is active above this fraction of its maximal effort while a torque is held, with room for a poor maximal effort.
const HIGHEST_MVC: f64 = 1.5;

/// Of two muscles that hold a torque, one is active above this fraction of its maximal effort.
const LOWEST_MVC: f64 = 1e-3;

/// One channel over all trials.
struct EmgChannel<'a> {
    column: &'static str,
    /// Number of the trial, and its record.
    records: Vec<(u32, &'a [f64])>,
}

impl EmgChannel<'_> {
    /// Mean over the trials of the mean of `of` over the samples.
    fn mean_of(&self, of: impl Fn(f64) -> f64) -> f64 {
        let of_record =
            |(_, record): &(u32, &[f64])| mean(&record.iter().map(|x| of(*x)).collect::<Vec<_>>());
        mean(&self.records.iter().map(of_record).collect::<Vec<_>>())
    }
}

/// What is wrong with the EMG of `trials`.
pub fn check_emg(trials: &[&Trial], sample_rate_hz: f64) -> Vec<Contradiction> {
    let channel = |column: &'static str, of: fn(&Record) -> Option<&Vec<f64>>| EmgChannel {
        column,
        records: trials
            .iter()
            .filter_map(|trial| Some((trial.number, of(&trial.record)?.as_slice())))
            .collect(),
    };
    let channels = [
        channel("emg_fcr_mvc", |record| record.emg_fcr_mvc.as_ref()),
        channel("emg_ecr_mvc", |record| record.emg_ecr_mvc.as_ref()),
    ];
    let is_held = trials.iter().any(|trial| trial.torque_nm != 0.0);
    let is_low = |channel: &EmgChannel| channel.records.is_empty() || channel.mean_of(f64::abs) < LOWEST_MVC;
    let is_silent = is_held && channels.iter().all(is_low);
    let numbers: Vec<u32> = trials.iter().map(|trial| trial.number).collect();
    let there = channels.iter().filter(|channel| !channel.records.is_empty());
    there
        .filter_map(|channel| {
            // What does not change is neither silent nor in volts.
            let frozen = check_frozen(channel.column, &channel.records, sample_rate_hz);
            frozen.or_else(|| check_channel(channel, is_silent, &numbers))
        })
        .collect()
}

fn check_channel(channel: &EmgChannel, is_silent: bool, trials: &[u32]) -> Option<Contradiction> {
    let (offset, level) = (channel.mean_of(|x| x), channel.mean_of(f64::abs));
    let rms = libm::sqrt(channel.mean_of(|x| x * x));
    let negative = channel.mean_of(|x| f64::from(u8::from(x < 0.0)));
    let (measured, stated, mistake, remedy) =
        if negative > NEGATIVE_SHARE && offset.abs() > OFFSET_OVER_RMS * rms {
            (
                format!("its mean is {} and its root mean square {}", rounded(offset), rounded(rms)),
                "a mean near 0 of raw EMG, or no negative values of an envelope",
                "Has the amplifier an offset, or was only a part rectified?",
                "Take the offset off, or rectify after that.",
            )
        } else if level > HIGHEST_MVC {
            (
                format!("its mean size is {}", rounded(level)),
                "at most 1.5, since 1 is a maximal effort",
                "Is the EMG in percent, millivolts or microvolts?",
                "Divide it by that of a maximal effort, processed alike.",
            )
        } else if is_silent {
            (
                format!("its mean size is {}", rounded(level)),
                "at least 0.001 in a muscle while a torque is held, since 1 is a maximal effort",
                "Is the EMG in volts?",
                "Divide it by that of a maximal effort, processed alike.",
            )
        } else {
            return None;
        };
    Some(Contradiction {
        check: SignalCheck::Emg,
        place: format!("column {} of the records", channel.column),
        trials: trials.to_vec(),
        measured,
        stated: stated.into(),
        likely_mistake: Some(mistake.into()),
        remedy: remedy.into(),
    })
}
