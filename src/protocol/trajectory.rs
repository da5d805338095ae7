//! The movement of the motor in a trial, in closed form: ramp, hold, return.

use std::f64::consts::PI;

use super::Ramp;

/// Angle, speed and acceleration of the motor at one time, from the start position.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// Angle, rad.
    pub angle_rad: f64,
    /// Angular velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Angular acceleration, rad/s2.
    pub acceleration_rad_s2: f64,
}

/// The amplitude does not suffice to reach the velocity.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "a movement of {distance_rad} rad is too short to reach {velocity_rad_s} rad/s in {rise_time_s} s and stop again: \
     it takes at least {needed_rad:.4} rad. Make it longer, slower or the rise shorter"
)]
pub struct TooShort {
    /// How far the movement goes, rad.
    pub distance_rad: f64,
    /// The speed to reach, rad/s.
    pub velocity_rad_s: f64,
    /// Time to reach it, s.
    pub rise_time_s: f64,
    /// How far it would have to go, rad.
    pub needed_rad: f64,
}

/// One movement at constant speed that starts and stops smoothly: the speed rises and falls as a raised cosine.
///
/// With rise time r, speed v and distance d, the speed is v (1 - cos(pi t / r)) / 2 until r, then v until d / v, and
/// falls as it rose until d / v + r. The acceleration is continuous, and at most pi v / (2 r).
///
/// ```
/// use ramphold::protocol::Sweep;
///
/// let sweep = Sweep::new(0.14, 3.25, 0.020)?;
/// assert_eq!(sweep.at(0.0).velocity_rad_s, 0.0);
/// assert_eq!(sweep.at(0.030).velocity_rad_s, 3.25);
/// assert!((sweep.at(0.020).angle_rad - 3.25 * 0.020 / 2.0).abs() < 1e-15);
/// assert_eq!(sweep.at(sweep.duration_s()).angle_rad, 0.14);
/// assert!((sweep.peak_acceleration_rad_s2() - 255.25).abs() < 0.01);
/// # Ok::<(), ramphold::protocol::TooShort>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    distance_rad: f64,
    speed_rad_s: f64,
    rise_time_s: f64,
    direction: f64,
}

impl Sweep {
    /// A sweep over `distance_rad` at `velocity_rad_s`, whose sign is the direction.
    pub fn new(distance_rad: f64, velocity_rad_s: f64, rise_time_s: f64) -> Result<Self, TooShort> {
        let speed_rad_s = velocity_rad_s.abs();
        let needed_rad = speed_rad_s * rise_time_s;
        if distance_rad >= needed_rad && speed_rad_s > 0.0 {
            Ok(Self { distance_rad, speed_rad_s, rise_time_s, direction: velocity_rad_s.signum() })
        } else {
            Err(TooShort { distance_rad, velocity_rad_s, rise_time_s, needed_rad })
        }
    }

    /// When the sweep is over, s.
    pub fn duration_s(&self) -> f64 {
        self.end_of_constant_speed_s() + self.rise_time_s
    }

    /// Until when it runs at its full speed, s.
    pub fn end_of_constant_speed_s(&self) -> f64 {
        self.distance_rad / self.speed_rad_s
    }

    /// The highest acceleration, at the middle of the rise, rad/s2.
    pub fn peak_acceleration_rad_s2(&self) -> f64 {
        PI * self.speed_rad_s / (2.0 * self.rise_time_s)
    }

    /// Where the motor is `t_s` after the start of the sweep; at rest before and after.
    pub fn at(&self, t_s: f64) -> Motion {
        let (from_end, since_end) = (self.duration_s() - t_s, t_s - self.end_of_constant_speed_s());
        let (angle, speed, acceleration) = if t_s <= 0.0 {
            (0.0, 0.0, 0.0)
        } else if from_end <= 0.0 {
            (self.distance_rad, 0.0, 0.0)
        } else if t_s < self.rise_time_s {
            self.rising(t_s)
        } else if since_end <= 0.0 {
            (self.speed_rad_s * (t_s - self.rise_time_s / 2.0), self.speed_rad_s, 0.0)
        } else {
            // The stop is the start run backwards.
            let (angle, speed, acceleration) = self.rising(from_end);
            (self.distance_rad - angle, speed, -acceleration)
        };
        Motion {
            angle_rad: self.direction * angle,
            velocity_rad_s: self.direction * speed,
            acceleration_rad_s2: self.direction * acceleration,
        }
    }

    fn rising(&self, t_s: f64) -> (f64, f64, f64) {
        let (v, r) = (self.speed_rad_s, self.rise_time_s);
        let phase = PI * t_s / r;
        (
            v / 2.0 * (t_s - r / PI * libm::sin(phase)),
            v / 2.0 * (1.0 - libm::cos(phase)),
            v * PI / (2.0 * r) * libm::sin(phase),
        )
    }
}

/// The whole movement of one trial: the ramp, the hold at its end, and the way back.
///
/// ```
/// use ramphold::protocol::Protocol;
///
/// let protocol = Protocol::parse(include_str!("../../protocols/de-vlugt-2011.json"), "de-vlugt-2011.json")?;
/// let movement = protocol.ramp_and_hold(1.3).unwrap();
/// let held = movement.at(movement.ramp().duration_s() + 0.1);
/// assert_eq!((held.angle_rad, held.velocity_rad_s), (protocol.ramp.amplitude_rad, 0.0));
/// assert_eq!(movement.at(movement.duration_s()).angle_rad, 0.0);
/// # Ok::<(), ramphold::protocol::ProtocolError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RampAndHold {
    ramp: Sweep,
    hold_s: f64,
    way_back: Sweep,
}

impl RampAndHold {
    /// The movement at `velocity_rad_s`; a negative one goes the other way.
    pub fn new(ramp: &Ramp, velocity_rad_s: f64) -> Result<Self, TooShort> {
        let back_rad_s = -velocity_rad_s.signum() * ramp.return_velocity_rad_s;
        Ok(Self {
            ramp: Sweep::new(ramp.amplitude_rad, velocity_rad_s, ramp.rise_time_s)?,
            hold_s: ramp.hold_s,
            way_back: Sweep::new(ramp.amplitude_rad, back_rad_s, ramp.rise_time_s)?,
        })
    }

    /// The ramp, from the start position.
    pub fn ramp(&self) -> &Sweep {
        &self.ramp
    }

    /// When the way back begins, s after the onset.
    pub fn start_of_return_s(&self) -> f64 {
        self.ramp.duration_s() + self.hold_s
    }

    /// When the motor is back and at rest, s after the onset.
    pub fn duration_s(&self) -> f64 {
        self.start_of_return_s() + self.way_back.duration_s()
    }

    /// Where the motor is `t_s` after the onset; at the start position before and after.
    pub fn at(&self, t_s: f64) -> Motion {
        let out = self.ramp.at(t_s);
        let since_return_s = t_s - self.start_of_return_s();
        if t_s >= self.duration_s() {
            Motion::default()
        } else if since_return_s <= 0.0 {
            out
        } else {
            let back = self.way_back.at(since_return_s);
            Motion { angle_rad: out.angle_rad + back.angle_rad, ..back }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ramp_and_hold(velocity_rad_s: f64) -> RampAndHold {
        let ramp = Ramp {
            amplitude_rad: 0.14,
            rise_time_s: 0.02,
            hold_s: 0.2,
            return_velocity_rad_s: 0.5,
            velocity_tolerance: 0.1,
        };
        RampAndHold::new(&ramp, velocity_rad_s).unwrap()
    }

    /// Speed is the derivative of the angle, and acceleration that of the speed, by central differences.
    fn assert_derivatives_agree(at: impl Fn(f64) -> Motion, t_s: f64, acceleration_slope: f64) {
        let h = 1e-6;
        let (before, now, after) = (at(t_s - h), at(t_s), at(t_s + h));
        let speed = (after.angle_rad - before.angle_rad) / (2.0 * h);
        let acceleration = (after.velocity_rad_s - before.velocity_rad_s) / (2.0 * h);
        // The acceleration has kinks, where a central difference is off by up to h / 2 of its slope.
        let tolerance = acceleration_slope * h;
        assert!((speed - now.velocity_rad_s).abs() < tolerance * h + 1e-8, "speed at {t_s} s");
        assert!((acceleration - now.acceleration_rad_s2).abs() < tolerance + 1e-6, "acceleration at {t_s} s");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn speed_and_acceleration_are_derivatives_everywhere(
            velocity in prop_oneof![-3.25..-0.3, 0.3..3.25f64], part in -0.1..1.1f64,
        ) {
            let movement = ramp_and_hold(velocity);
            let slope = velocity.abs() * PI * PI / (2.0 * 0.02 * 0.02);
            assert_derivatives_agree(|t_s| movement.at(t_s), part * movement.duration_s(), slope.max(1e4));
        }

        #[test]
        fn no_motion_exceeds_speed_peak_acceleration_and_amplitude(
            speed in 0.1..3.25f64, rise_time in 0.002..0.04f64, part in 0.0..1.0f64,
        ) {
            let sweep = Sweep::new(0.14, speed, rise_time).unwrap();
            let motion = sweep.at(part * sweep.duration_s());
            prop_assert!((0.0..=0.14 + 1e-15).contains(&motion.angle_rad));
            prop_assert!((0.0..=speed).contains(&motion.velocity_rad_s));
            prop_assert!(motion.acceleration_rad_s2.abs() <= sweep.peak_acceleration_rad_s2());
        }
    }

    #[test]
    fn the_movement_ends_where_it_began_and_rests_between() {
        for velocity in [3.25, -1.3] {
            let movement = ramp_and_hold(velocity);
            let end = Motion { angle_rad: 0.14 * f64::signum(velocity), ..Motion::default() };
            assert_eq!(movement.at(0.0), Motion::default());
            assert_eq!(movement.at(movement.ramp().duration_s()), end);
            assert_eq!(movement.at(movement.start_of_return_s()), end);
            assert_eq!(movement.at(movement.duration_s()), Motion::default());
            assert_eq!(movement.at(1e9), Motion::default());
        }
    }

    #[test]
    fn a_movement_of_no_speed_or_too_short_for_its_speed_is_refused() {
        assert!(Sweep::new(0.14, 0.0, 0.02).is_err());
        assert!(Sweep::new(0.14, f64::NAN, 0.02).is_err());
        let error = Sweep::new(0.06, 3.25, 0.02).unwrap_err();
        assert!(error.to_string().contains("at least 0.0650 rad"), "{error}");
        assert!(Sweep::new(0.065, 3.25, 0.02).is_ok());
    }
}
