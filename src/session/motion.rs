//! Whether the measured motion of a ramp was the one that was asked for.
//!
//! The difference between measured and asked angle is fitted by a straight line over the part of the ramp at constant
//! speed. Its slope is the difference of the velocities, and the scatter about the line gives the standard error. A ramp is
//! as asked when the interval of two standard errors about the measured velocity lies within the tolerance. So a motion too
//! rough to tell its velocity is not as asked either.
//!
//! Where the part at constant speed has fewer than [`LEAST_SAMPLES`] samples, the middle half of the ramp takes its place.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::protocol::Sweep;

/// Fewest samples of the part at constant speed from which the velocity is taken: a slope and its standard error need 3.
const LEAST_SAMPLES: f64 = 5.0;

/// Half-width of the confidence interval of the velocity, standard errors: 95 %.
const STANDARD_ERRORS: f64 = 2.0;

/// Why the motion of a trial was not as asked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionDeviation {
    /// The rig lost periods between the onset and the end of the hold: the motor had no new target meanwhile.
    LostPeriods {
        /// Their number.
        lost_periods: u64,
    },
    /// The ramp had another velocity.
    Velocity {
        /// Mean measured velocity, rad/s.
        measured_rad_s: f64,
        /// Its standard error, rad/s.
        standard_error_rad_s: f64,
        /// Mean velocity asked for over the same time, rad/s.
        asked_rad_s: f64,
        /// Largest difference allowed, fraction of the velocity asked for.
        tolerance: f64,
    },
}

impl fmt::Display for MotionDeviation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LostPeriods { lost_periods } => write!(
                formatter,
                "the motor got no new target in {lost_periods} periods of its ramp and hold: use a real-time kernel, and \
                 close other programs"
            ),
            Self::Velocity { measured_rad_s, standard_error_rad_s, asked_rad_s, tolerance } => write!(
                formatter,
                "the ramp had {measured_rad_s:.3} rad/s (standard error {standard_error_rad_s:.3}) where {asked_rad_s:.3} \
                 rad/s were asked for, {:.1} % are allowed: is the motor able to follow? See ramp.velocity_tolerance in \
                 the protocol",
                100.0 * tolerance
            ),
        }
    }
}

/// Sums of a straight line's least-squares fit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct LineFit {
    n: f64,
    t: f64,
    tt: f64,
    y: f64,
    ty: f64,
    yy: f64,
}

impl LineFit {
    fn add(&mut self, t: f64, y: f64) {
        self.n += 1.0;
        self.t += t;
        self.tt += t * t;
        self.y += y;
        self.ty += t * y;
        self.yy += y * y;
    }

    /// Slope and its standard error; `None` for fewer than 3 points.
    fn slope(&self) -> Option<(f64, f64)> {
        let s_tt = self.tt - self.t * self.t / self.n;
        let s_ty = self.ty - self.t * self.y / self.n;
        let s_yy = self.yy - self.y * self.y / self.n;
        let slope = s_ty / s_tt;
        let residual = (s_yy - slope * s_ty).max(0.0) / (self.n - 2.0);
        (self.n >= 3.0).then(|| (slope, libm::sqrt(residual / s_tt)))
    }
}

/// The velocity of the ramp under way, from its samples.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct RampVelocity {
    /// Measured less asked angle.
    difference: LineFit,
    asked: LineFit,
}

impl RampVelocity {
    /// Takes the angle measured `t_s` after the onset of the motion.
    pub fn add(&mut self, ramp: &Sweep, sample_rate_hz: f64, t_s: f64, angle_rad: f64) {
        let (rise_s, end_s) =
            (ramp.duration_s() - ramp.end_of_constant_speed_s(), ramp.end_of_constant_speed_s());
        let constant_samples = (end_s - rise_s) * sample_rate_hz;
        let [from_s, to_s] = if constant_samples >= LEAST_SAMPLES {
            [rise_s, end_s]
        } else {
            [0.25 * ramp.duration_s(), 0.75 * ramp.duration_s()]
        };
        if (from_s..=to_s).contains(&t_s) {
            let asked_rad = ramp.at(t_s).angle_rad;
            // From the middle, where the sums keep most digits.
            let t_s = t_s - 0.5 * (from_s + to_s);
            self.difference.add(t_s, angle_rad - asked_rad);
            self.asked.add(t_s, asked_rad);
        }
    }

    /// The deviation, if the velocity was not the one asked for, or cannot be told to within the tolerance.
    pub fn deviation(&self, tolerance: f64) -> Option<MotionDeviation> {
        let ((difference_rad_s, standard_error_rad_s), (asked_rad_s, _)) =
            (self.difference.slope()?, self.asked.slope()?);
        let most_rad_s = difference_rad_s.abs() + STANDARD_ERRORS * standard_error_rad_s;
        (most_rad_s > tolerance * asked_rad_s.abs()).then_some(MotionDeviation::Velocity {
            measured_rad_s: asked_rad_s + difference_rad_s,
            standard_error_rad_s,
            asked_rad_s,
            tolerance,
        })
    }
}
