//! A rig trial made ready for the fit: its Fourier coefficients and the noise in them.

use rustfft::num_complex::Complex64;

use super::fourier::Fourier;
use super::noise::PowerSpectrum;
use crate::dataset::{RIG_TRIAL_REST_S, RigTrial, RigTrialMotion};
use crate::protocol::RigLoad;
use crate::signal::smallest_step;

/// Highest frequency of the fit, Hz: three times the cut-off of the paper's filter, above which no analysis of a person looks. At low
/// sample rates it is a quarter of the rate.
const TOP_HZ: f64 = 150.0;

/// A trial, ready for the fit.
pub struct PreparedTrial {
    /// Its number in the table.
    pub number: u32,
    /// What is at the handle.
    pub load: RigLoad,
    /// What the motor does.
    pub motion: RigTrialMotion,
    /// Its transforms.
    pub fourier: Fourier,
    /// Target relative to the start position.
    pub target: Vec<Complex64>,
    /// Recorded angle relative to the start position.
    pub angle: Vec<Complex64>,
    /// Recorded torque.
    pub torque: Vec<Complex64>,
    /// Number of samples.
    pub samples: usize,
}

/// What the trials show of the two channels.
#[derive(Debug, Clone)]
pub struct ChannelNoise {
    /// Torque at rest.
    pub torque: PowerSpectrum,
    /// Its standard deviation, N m.
    pub torque_nm: f64,
    /// Angle at rest.
    pub angle: PowerSpectrum,
    /// Variance of the angle's steps over all frequencies, as a spectrum, rad2/Hz.
    pub step_power: f64,
    /// Size of the encoder's step, rad.
    pub step_rad: f64,
    /// Positions that the steps may have had at the start of a motion, as parts of a step.
    pub step_positions: Vec<f64>,
}

impl ChannelNoise {
    /// Measures the noise in the rests before the motions, and in trials without motion.
    pub fn measure(trials: &[&RigTrial], sample_rate_hz: f64, step_positions: Vec<f64>) -> Self {
        let rest = (RIG_TRIAL_REST_S * sample_rate_hz) as usize;
        let at_rest = |channel: fn(&RigTrial) -> &Vec<f64>| -> Vec<&[f64]> {
            trials
                .iter()
                .map(|trial| {
                    let record = channel(trial).as_slice();
                    if trial.motion == RigTrialMotion::Still { record } else { &record[..rest] }
                })
                .collect()
        };
        let torque_rests = at_rest(|trial| &trial.record.torque_l_nm);
        let angle_rests = at_rest(|trial| &trial.record.theta_m_rad);
        let torque = PowerSpectrum::of_stretches(&torque_rests, sample_rate_hz, RIG_TRIAL_REST_S);
        let angle = PowerSpectrum::of_stretches(&angle_rests, sample_rate_hz, RIG_TRIAL_REST_S);
        let step_rad = smallest_step(trials.iter().map(|trial| trial.record.theta_m_rad.as_slice()));
        let step_power = step_rad * step_rad / 12.0 / (0.5 * sample_rate_hz);
        // The mean of equal values is wrong by rounding.
        let is_constant = torque_rests.iter().all(|rest| rest.iter().all(|value| *value == rest[0]));
        Self {
            torque_nm: if is_constant { 0.0 } else { libm::sqrt(variance(&torque_rests)) },
            torque,
            step_power,
            step_rad,
            step_positions,
            angle,
        }
    }
}

/// Variance within stretches.
fn variance(stretches: &[&[f64]]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for stretch in stretches {
        let mean = stretch.iter().sum::<f64>() / stretch.len() as f64;
        sum += stretch.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        count += stretch.len().saturating_sub(1);
    }
    sum / count.max(1) as f64
}

fn top_hz(sample_rate_hz: f64) -> f64 {
    TOP_HZ.min(sample_rate_hz / 4.0)
}

impl PreparedTrial {
    /// Transforms the record.
    pub fn new(trial: &RigTrial, sample_rate_hz: f64) -> Self {
        let record = &trial.record;
        let samples = record.torque_l_nm.len();
        let rest = (RIG_TRIAL_REST_S * sample_rate_hz) as usize;
        let fourier = Fourier::new(samples, sample_rate_hz, top_hz(sample_rate_hz));
        let from_start = |channel: &[f64]| {
            let level = channel[..rest].iter().sum::<f64>() / rest as f64;
            let relative: Vec<f64> = channel.iter().map(|value| value - level).collect();
            fourier.of_record(&relative)
        };
        Self {
            number: trial.number,
            load: trial.load,
            motion: trial.motion,
            target: from_start(&record.target_rad),
            angle: from_start(&record.theta_m_rad),
            torque: fourier.of_record(&record.torque_l_nm),
            samples,
            fourier,
        }
    }

    /// Whether the motor moves.
    pub fn moves(&self) -> bool {
        self.motion != RigTrialMotion::Still
    }

    /// Variance of a Fourier coefficient under a one-sided spectrum.
    pub fn variance(&self, power_per_hz: f64) -> f64 {
        0.5 * power_per_hz * self.fourier.step_hz
    }
}
