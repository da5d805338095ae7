//! The rig trials of a session, ready to be fitted.

use super::covariance::INTERVAL;
use super::encoder::step_positions;
use super::error::CalibrateError;
use super::following::angle_against_target;
use super::noise::PowerSpectrum;
use super::prepared_trial::{ChannelNoise, PreparedTrial};
use crate::dataset::{
    AngleAgainstTarget, NoiseSpectrum, RIG_TRIAL_REST_S, RigTrial, RigTrialMotion, RigTrials, Status,
};
use crate::protocol::RigLoad;
use crate::random::Stream;
use crate::statistics::t_quantile;

/// Positions of the encoder's steps that are tried.
const POSITIONS: usize = 32;

/// Seed of the draws of a calibration, so that it is the same each time.
pub const SEED: u64 = 1;

/// The trials of a session, ready to be fitted.
pub struct PreparedRig {
    /// The trials that are analysed.
    pub trials: Vec<PreparedTrial>,
    /// Noise of the channels.
    pub noise: ChannelNoise,
    /// Standard deviation of a trial's mean torque, N m.
    pub mean_sd_nm: f64,
    /// Largest torque beside its median, N m.
    pub largest_nm: f64,
    /// Where the speed of the friction starts: a hundredth of the largest speed of the targets, rad/s.
    pub friction_speed_rad_s: f64,
    /// The loads with a stated value, without direction.
    pub loads: Vec<RigLoad>,
    /// How far the recorded angle is from the target.
    pub angle_against_target: Option<AngleAgainstTarget>,
}

impl PreparedRig {
    /// Prepares the trials of status ok that `used` takes. The noise of the torque is at least `known`: few rests tell it badly.
    ///
    /// # Errors
    /// If there are none, or one cannot be analysed.
    pub fn new(
        trials: &RigTrials,
        used: fn(&RigTrial) -> bool,
        known: Option<&NoiseSpectrum>,
    ) -> Result<Self, CalibrateError> {
        let analysed: Vec<&RigTrial> =
            trials.trials.iter().filter(|trial| trial.status == Status::Ok && used(trial)).collect();
        if !analysed.iter().any(|trial| trial.motion != RigTrialMotion::Still) {
            return Err(CalibrateError::NoMotion);
        }
        for trial in &analysed {
            check_return(trial, trials.sample_rate_hz)?;
        }
        let positions = step_positions(POSITIONS, &mut Stream::new(SEED, "calibrate/encoder"));
        let mut noise = ChannelNoise::measure(&analysed, trials.sample_rate_hz, positions);
        if noise.torque_nm == 0.0 {
            return Err(CalibrateError::NoNoise);
        }
        if let Some(known) = known {
            let known = PowerSpectrum {
                frequency_hz: known.frequency_hz.clone(),
                power_per_hz: known.power_nm2_per_hz.clone(),
            };
            noise.torque = noise.torque.larger(&known);
        }
        let prepared: Vec<PreparedTrial> =
            analysed.iter().map(|trial| PreparedTrial::new(trial, trials.sample_rate_hz)).collect();
        let mut loads: Vec<RigLoad> = Vec::new();
        for trial in &analysed {
            let load = trial.load.without_sign();
            if load.relative_error().is_some() && !loads.contains(&load) {
                loads.push(load);
            }
        }
        let mean_sd_nm = mean_sd_nm(&prepared, &noise);
        let speed_rad_s = largest_speed_rad_s(&analysed, trials.sample_rate_hz);
        Ok(Self {
            mean_sd_nm,
            largest_nm: largest_nm(&analysed),
            friction_speed_rad_s: 0.01 * speed_rad_s,
            angle_against_target: angle_against_target(&analysed, trials.sample_rate_hz, &noise, speed_rad_s),
            trials: prepared,
            noise,
            loads,
        })
    }
}

/// The signals are taken as periodic: a record must end where it began.
fn check_return(trial: &RigTrial, sample_rate_hz: f64) -> Result<(), CalibrateError> {
    let angle = &trial.record.theta_m_rad;
    let rest = ((RIG_TRIAL_REST_S * sample_rate_hz) as usize).min(angle.len());
    let start = angle[..rest].iter().sum::<f64>() / rest as f64;
    let farthest = angle.iter().fold(0.0, |far: f64, value| far.max((value - start).abs()));
    let end = angle.last().map_or(0.0, |last| last - start);
    // A ramp that is not taken back ends at its farthest angle, or near it.
    if trial.motion != RigTrialMotion::Still && end.abs() > 0.5 * farthest {
        return Err(CalibrateError::NoReturn { file: trial.file.clone(), end_rad: end });
    }
    Ok(())
}

/// Largest mean speed of the targets over 10 ms, which do not show the steps in which a target may be written.
fn largest_speed_rad_s(trials: &[&RigTrial], sample_rate_hz: f64) -> f64 {
    let samples = ((0.01 * sample_rate_hz) as usize).max(1);
    let ways = trials.iter().flat_map(|trial| {
        let target = &trial.record.target_rad;
        target.iter().zip(target.iter().skip(samples)).map(|(before, after)| (after - before).abs())
    });
    ways.fold(0.0, f64::max) * sample_rate_hz / samples as f64
}

fn largest_nm(trials: &[&RigTrial]) -> f64 {
    let mut largest: f64 = 0.0;
    for trial in trials {
        let torque = &trial.record.torque_l_nm;
        let mean = torque.iter().sum::<f64>() / torque.len() as f64;
        largest = torque.iter().fold(largest, |far, value| far.max((value - mean).abs()));
        if let RigLoad::KnownWeight { .. } = trial.load {
            largest = largest.max(mean.abs());
        }
    }
    largest
}

/// Standard deviation of the mean torque of a trial: from the scatter of the trials with one load, at least that of the noise. It
/// contains the error of its own few degrees of freedom, so that 1.96 of it make a 95 % interval.
fn mean_sd_nm(trials: &[PreparedTrial], noise: &ChannelNoise) -> f64 {
    let mut groups: Vec<(RigLoad, Vec<f64>)> = Vec::new();
    let mut of_noise: f64 = 0.0;
    for trial in trials {
        of_noise = of_noise.max(trial.variance(noise.torque.at(0.0)));
        if matches!(trial.load, RigLoad::ClampedHandle | RigLoad::KnownSpring { .. }) {
            continue;
        }
        let mean = trial.torque[0].re;
        match groups.iter_mut().find(|(load, _)| *load == trial.load) {
            Some((_, means)) => means.push(mean),
            None => groups.push((trial.load, vec![mean])),
        }
    }
    let (mut sum, mut freedom) = (0.0, 0.0);
    for (_, means) in &groups {
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        sum += means.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        freedom += means.len() as f64 - 1.0;
    }
    if freedom == 0.0 {
        return libm::sqrt(of_noise);
    }
    let factor = t_quantile(0.975, freedom) / INTERVAL;
    libm::sqrt((sum / freedom).max(of_noise)) * factor
}
