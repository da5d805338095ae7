//! The errors that the steps of the recorded angle make along a motion.

use crate::random::Stream;

/// Positions of the encoder's steps that the angle may have had, as parts of a step: the records do not tell which.
pub fn step_positions(count: usize, stream: &mut Stream) -> Vec<f64> {
    // One in each equal part, so that few positions stand for all.
    (0..count).map(|place| (place as f64 + stream.uniform()) / count as f64).collect()
}

/// Error of the recorded angle along a motion if the steps lie at `position`, rad.
pub fn step_error_rad(motion_rad: &[f64], step_rad: f64, position: f64) -> Vec<f64> {
    motion_rad
        .iter()
        .map(|angle| {
            let steps = angle / step_rad + position;
            (libm::floor(steps + 0.5) - steps) * step_rad
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::smallest_step;

    #[test]
    fn the_step_is_found_and_its_error_is_uniform() {
        let step = std::f64::consts::TAU / 8192.0;
        let motion: Vec<f64> = (0..5000).map(|sample| 0.1 * libm::sin(f64::from(sample) * 0.01)).collect();
        let recorded: Vec<f64> = motion.iter().map(|angle| libm::round(angle / step) * step).collect();
        let found = smallest_step([recorded.as_slice()].into_iter());
        assert!((found / step - 1.0).abs() < 1e-9);
        let error = step_error_rad(&motion, step, 0.3);
        let square = error.iter().map(|value| value * value).sum::<f64>() / error.len() as f64;
        assert!((square / (step * step / 12.0) - 1.0).abs() < 0.05);
        assert_eq!(smallest_step([[0.5; 9].as_slice()].into_iter()), 0.0);
    }
}
