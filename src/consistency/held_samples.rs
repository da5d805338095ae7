//! Channels that were measured more slowly than the session and brought to its rate by repeating each value.
//!
//! A signal that moves by more than its resolution from one value to the next has no reason to stand still in between. Where
//! a value is measured anew for each sample, a move with a repeat before it is the exception, and never more frequent than one without.

use super::contradiction::Contradiction;
use super::ramp::rounded;
use super::samples_of_ramp::{AFTER_S, RampChannel, resolution};
use super::signal_check::SignalCheck;
use crate::dataset::Trial;
use crate::signal;

/// A move counts if it is larger than this many steps of the resolution.
const MOVE_STEPS: f64 = 1.5;

/// Repeats count as more frequent than not beyond this many standard deviations: by chance once in three million.
const STANDARD_DEVIATIONS: f64 = 5.0;

/// Moves of a signal, by whether the value before was a repeat.
#[derive(Debug, Clone, Copy, Default)]
struct Moves {
    after_repeat: usize,
    at_once: usize,
    /// Samples from each move after a repeat to the change before it.
    samples_between: usize,
}

impl Moves {
    fn of(trial: &Trial, values: &[f64], sample_rate_hz: f64) -> Self {
        let least = MOVE_STEPS * resolution(values);
        let Some(motion) = signal::onset(&trial.record.theta_m_rad) else { return Self::default() };
        let end = motion + libm::round(AFTER_S * sample_rate_hz) as usize;
        let mut moves = Self::default();
        let mut changed = None;
        for at in motion + 1..end.min(values.len()) {
            let step = (values[at] - values[at - 1]).abs();
            if step == 0.0 {
                continue;
            }
            match changed.replace(at).map(|before| at - before) {
                Some(1) if step > least => moves.at_once += 1,
                Some(samples) if step > least => {
                    moves.after_repeat += 1;
                    moves.samples_between += samples;
                }
                _ => (),
            }
        }
        moves
    }

    fn with(self, other: Self) -> Self {
        Self {
            after_repeat: self.after_repeat + other.after_repeat,
            at_once: self.at_once + other.at_once,
            samples_between: self.samples_between + other.samples_between,
        }
    }

    /// Whether repeats before a move are more frequent than not.
    fn are_held(self) -> bool {
        let all = (self.after_repeat + self.at_once) as f64;
        self.after_repeat as f64 - 0.5 * all > STANDARD_DEVIATIONS * 0.5 * libm::sqrt(all)
    }

    /// Mean number of samples for which a value stands.
    fn samples_held(self) -> f64 {
        (self.samples_between + self.at_once) as f64 / (self.after_repeat + self.at_once) as f64
    }
}

/// Angle or torque that stands still between its moves, over all trials, or in single ones.
pub fn check_held(trials: &[&Trial], sample_rate_hz: f64) -> Vec<Contradiction> {
    RampChannel::ALL.into_iter().filter_map(|channel| held(channel, trials, sample_rate_hz)).collect()
}

fn held(channel: RampChannel, trials: &[&Trial], sample_rate_hz: f64) -> Option<Contradiction> {
    let of_trials: Vec<(u32, Moves)> = trials
        .iter()
        .map(|trial| (trial.number, Moves::of(trial, channel.of(trial), sample_rate_hz)))
        .collect();
    let together =
        |moves: &[(u32, Moves)]| moves.iter().fold(Moves::default(), |sum, (_, own)| sum.with(*own));
    let concerned: Vec<(u32, Moves)> = if together(&of_trials).are_held() {
        of_trials.into_iter().filter(|(_, moves)| moves.after_repeat > moves.at_once).collect()
    } else {
        of_trials.into_iter().filter(|(_, moves)| moves.are_held()).collect()
    };
    if concerned.is_empty() {
        return None;
    }
    let samples = together(&concerned).samples_held();
    Some(Contradiction {
        check: SignalCheck::HeldSamples,
        place: format!("column {} of the records", channel.column()),
        trials: concerned.into_iter().map(|(number, _)| number).collect(),
        measured: format!(
            "during the ramps each value stands for {} samples, as if it were measured at {} Hz",
            rounded(samples),
            rounded(sample_rate_hz / samples)
        ),
        stated: format!("a value measured anew for each sample, at {} Hz", rounded(sample_rate_hz)),
        likely_mistake: Some(
            "Was a slower channel brought to the rate of the session by repeating its values?".into(),
        ),
        remedy: "Such steps come late and look like stiffness. Interpolate the channel between its own measurements, or give the \
                 session at its rate."
            .into(),
    })
}
