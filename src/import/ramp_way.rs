//! Ramps of a recording by where the motor goes, however fast.

use crate::statistics::upper_median;

/// The motor is gone from where it held beyond this part of the ramp, and back below the other: far from both ends, so that neither
/// overshoot nor noise counts.
const GONE: f64 = 0.7;
const BACK: f64 = 0.3;

/// Where the motor holds and how far its ramps go, rad; the way has the sign of the ramps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RampWay {
    hold_rad: f64,
    way_rad: f64,
}

impl RampWay {
    /// The way of the ramp of one trial that begins at `hold_rad`: to the farthest angle of its record.
    pub fn of(theta_rad: &[f64], hold_rad: f64) -> Self {
        let farthest =
            |far: f64, angle: &f64| if (angle - hold_rad).abs() > far.abs() { angle - hold_rad } else { far };
        Self { hold_rad, way_rad: theta_rad.iter().fold(0.0, farthest) }
    }

    /// How far the ramps go, without sign, rad.
    pub fn length_rad(&self) -> f64 {
        self.way_rad.abs()
    }

    /// The median of several ways, each of its two numbers by itself; `None` for none.
    pub fn median(ways: &[Self]) -> Option<Self> {
        let median = |number: fn(&Self) -> f64| upper_median(ways.iter().map(number));
        Some(Self { hold_rad: median(|own| own.hold_rad)?, way_rad: median(|own| own.way_rad)? })
    }

    /// For each time that the motor goes this way, the samples from the last before it left to the first at which it is gone.
    pub fn taken_in(&self, theta_rad: &[f64]) -> Vec<(usize, usize)> {
        let (mut taken, mut gone, mut left_at) = (Vec::new(), false, 0);
        for (sample, angle) in theta_rad.iter().enumerate() {
            let part = (angle - self.hold_rad) / self.way_rad;
            if part < BACK {
                gone = false;
                left_at = sample;
            } else if part > GONE && !gone {
                gone = true;
                taken.push((left_at, sample));
            }
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::RampWay;

    #[test]
    fn only_a_motor_that_came_back_and_leaves_again_makes_another_ramp() {
        let taken = |places: &[f64]| {
            let angle: Vec<f64> = places.iter().flat_map(|place| [0.1 - 0.14 * place; 5]).collect();
            RampWay::of(&angle, 0.1).taken_in(&angle)
        };
        assert_eq!(taken(&[0.0, 1.0, 0.8, 1.1, 0.0]), [(4, 5)]);
        assert_eq!(taken(&[0.0, 1.0, 0.0, -0.9, 0.0, 0.5, 1.0]), [(4, 5), (24, 30)]);
        assert_eq!(taken(&[0.0; 20]), []);
    }
}
