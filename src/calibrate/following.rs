//! How far the recorded angle is from the target: a drive that reports its target in place of the motor's angle has no error of following.

use super::prepared_trial::ChannelNoise;
use crate::dataset::{AngleAgainstTarget, RIG_TRIAL_REST_S, RigTrial, RigTrialMotion};
use crate::protocol::RigLoad;

/// Standard deviations of the noise at rest that no sample of a record exceeds.
const FARTHEST_NOISE_SD: f64 = 6.0;

/// The recorded angle against the target in the ramps of the empty handle, whose targets are at most as fast as `largest_speed_rad_s`;
/// `None` if there are none.
pub fn angle_against_target(
    trials: &[&RigTrial],
    sample_rate_hz: f64,
    noise: &ChannelNoise,
    largest_speed_rad_s: f64,
) -> Option<AngleAgainstTarget> {
    let is_ramp =
        |trial: &&&RigTrial| trial.load == RigLoad::EmptyHandle && trial.motion != RigTrialMotion::Still;
    let rest = (RIG_TRIAL_REST_S * sample_rate_hz) as usize;
    let (mut largest_rad, mut noise_rad): (f64, f64) = (0.0, 0.0);
    let mut ramps = 0;
    for trial in trials.iter().filter(is_ramp) {
        let errors: Vec<f64> = trial
            .record
            .theta_m_rad
            .iter()
            .zip(&trial.record.target_rad)
            .map(|(own, target)| own - target)
            .collect();
        let at_rest = &errors[..rest.min(errors.len())];
        let level = at_rest.iter().sum::<f64>() / at_rest.len() as f64;
        let squares: f64 = at_rest.iter().map(|own| (own - level) * (own - level)).sum();
        noise_rad = noise_rad.max(libm::sqrt(squares / at_rest.len() as f64));
        largest_rad = errors.iter().fold(largest_rad, |far, own| far.max((own - level).abs()));
        ramps += 1;
    }
    let resolution_rad = noise.step_rad.max(FARTHEST_NOISE_SD * noise_rad);
    (ramps > 0 && resolution_rad > 0.0 && largest_speed_rad_s > 0.0).then(|| AngleAgainstTarget {
        largest_steps: largest_rad / resolution_rad,
        largest_s: largest_rad / largest_speed_rad_s,
        sample_s: 1.0 / sample_rate_hz,
    })
}
