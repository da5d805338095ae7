//! The channels besides the torque: their scale, which makes one vector of values of a trial, and the steps of their encoders.

use super::hold_noise::encoder_error;
use super::observations::{Observations, mean};
use crate::dataset::{Record, Trial};
use crate::wrist::{FurtherChannel, ScaledChannel};

impl Observations {
    /// Number of values of a trial: the samples of the torque, then those of each further channel.
    pub fn rows(&self) -> usize {
        self.samples * (1 + self.further.len())
    }

    /// The torque's part of a trial's values.
    pub fn torque_of<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        &values[..self.samples]
    }

    /// The part of the further channel number `place` of a trial's values.
    pub fn further_of<'a>(&self, place: usize, values: &'a [f64]) -> &'a [f64] {
        &values[(1 + place) * self.samples..(2 + place) * self.samples]
    }

    /// Chooses the scale of each further channel and applies it to the observations, which are in the units of the channels.
    ///
    /// In N m, the noise of a channel in the holds is then as large as that of the torque, so that an unweighted fit weighs each channel
    /// by its noise. Where the holds show no noise, the channel itself is then as large as the torque.
    pub(super) fn scale_further_channels(&mut self, trials: &[&Trial]) {
        let samples = self.samples;
        let per_channel = 1 + self.further.len();
        for place in 0..self.further.len() {
            let channel = self.further[place].channel;
            let error = match channel.is_angle() {
                true => encoder_error(trials, |record| record.further(channel)),
                false => (0.0, 0.0),
            };
            self.further_step[place] = error.1;
            let in_holds = |of: usize| {
                let stretch = |own: &Vec<f64>| {
                    let count = own.len() / per_channel;
                    own[of * count..(of + 1) * count].iter().map(|x| x * x).sum::<f64>() / count as f64
                };
                let of_trial = self.trials.iter().flat_map(|trial| trial.hold_stretches.iter().map(stretch));
                ordered_mean(of_trial.collect())
            };
            let in_window = |of: usize| {
                let squares = self.trials.iter().map(|trial| {
                    let own = &trial.measured_nm[of * samples..(of + 1) * samples];
                    own.iter().map(|x| x * x).sum::<f64>() / samples as f64
                });
                ordered_mean(squares.collect())
            };
            let (of_torque, of_channel) = (in_holds(0), in_holds(1 + place) + error.1 * error.1 / 12.0);
            let square = match of_torque > 0.0 && of_channel > 0.0 {
                true => of_torque / of_channel,
                false => in_window(0) / in_window(1 + place),
            };
            let factor = libm::sqrt(square);
            self.further[place].nm_per_unit = factor;
            for trial in &mut self.trials {
                let own = &mut trial.measured_nm[(1 + place) * samples..(2 + place) * samples];
                own.iter_mut().for_each(|value| *value *= factor);
                for stretch in &mut trial.hold_stretches {
                    let count = stretch.len() / per_channel;
                    let own = &mut stretch[(1 + place) * count..(2 + place) * count];
                    own.iter_mut().for_each(|value| *value *= factor);
                }
            }
        }
    }
}

/// The further channels of a session, not scaled yet.
pub fn unscaled(channels: Vec<FurtherChannel>) -> Vec<ScaledChannel> {
    channels.into_iter().map(|channel| ScaledChannel { channel, nm_per_unit: 1.0 }).collect()
}

/// The samples of a further channel, which every record of the session has.
pub fn samples_of(record: &Record, channel: FurtherChannel) -> &[f64] {
    record.further(channel).map_or(&[], Vec::as_slice)
}

/// Mean that does not depend on the order of the values, so that a trial repeated after a crash changes no bit.
fn ordered_mean(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    mean(&values)
}
