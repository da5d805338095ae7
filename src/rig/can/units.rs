//! Quantities that look alike and are not: encoder counts, motor angle, joint angle; bus period and sample period.

use std::f64::consts::TAU;
use std::time::Duration;

/// A position as the drive counts it (6064h, 607Ah).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Counts(pub i32);

/// Angle of the motor's shaft, rad.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct MotorAngle(pub f64);

/// Angle of the handle, behind the gear, from the start position, rad.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct JointAngle(pub f64);

/// Torque of the motor in thousandths of its rated torque (6072h, 6077h).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct DriveTorque(pub u16);

/// Torque at the handle, N m.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct JointTorque(pub f64);

/// Time from one SYNC to the next, whole microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BusPeriod(u32);

/// Time from one sample to the next. Several samples may come in one bus period.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct SamplePeriod(f64);

/// The one place where the units of a drive become those of a joint and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gearing {
    counts_per_rad: f64,
    ratio: f64,
    rated_torque_nm: f64,
    /// Angle of the joint where the drive counts 0.
    home: JointAngle,
}

impl Gearing {
    /// A drive with `counts_per_revolution` and `rated_torque_nm` of its motor, behind a gear that turns the motor
    /// `ratio` times for one turn of the handle; a negative one turns it the other way.
    pub fn new(counts_per_revolution: u32, ratio: f64, rated_torque_nm: f64) -> Self {
        Self {
            counts_per_rad: f64::from(counts_per_revolution) / TAU,
            ratio,
            rated_torque_nm,
            home: JointAngle(0.0),
        }
    }

    /// With home, where the drive counts 0, at `home` from the start position.
    pub fn with_home(self, home: JointAngle) -> Self {
        Self { home, ..self }
    }

    /// The motor's angle when the handle is at `angle`.
    pub fn motor(&self, angle: JointAngle) -> MotorAngle {
        MotorAngle(angle.0 * self.ratio)
    }

    /// The handle's angle when the motor is at `angle`.
    pub fn joint(&self, angle: MotorAngle) -> JointAngle {
        JointAngle(angle.0 / self.ratio)
    }

    /// The nearest count to a motor angle; beyond what 32 bits hold, the last one.
    pub fn counts(&self, angle: MotorAngle) -> Counts {
        Counts((angle.0 * self.counts_per_rad).round() as i32)
    }

    /// The motor angle at a count.
    pub fn angle(&self, counts: Counts) -> MotorAngle {
        MotorAngle(f64::from(counts.0) / self.counts_per_rad)
    }

    /// Counts of a joint angle, for what is given to the drive.
    pub fn to_drive(&self, angle: JointAngle) -> Counts {
        self.counts(self.motor(JointAngle(angle.0 - self.home.0)))
    }

    /// Joint angle of counts, for what comes from the drive.
    pub fn from_drive(&self, counts: Counts) -> JointAngle {
        JointAngle(self.joint(self.angle(counts)).0 + self.home.0)
    }

    /// By how much one count more turns the joint, rad; negative where the gear turns the other way.
    pub fn count_rad(&self) -> f64 {
        self.joint(self.angle(Counts(1))).0
    }

    /// A length on the joint's scale, such as a speed or a window, in whole counts, rounded down: a limit never grows.
    pub fn length(&self, joint_rad: f64) -> u32 {
        self.unbounded_length(joint_rad) as u32
    }

    /// Speed of the joint as revolutions a minute of the motor (6080h), rounded down.
    pub fn motor_rpm(&self, joint_rad_s: f64) -> u32 {
        self.unbounded_rpm(joint_rad_s) as u32
    }

    /// The motor's torque that gives `torque` at the handle (6072h), rounded down.
    pub fn drive_torque(&self, torque: JointTorque) -> DriveTorque {
        DriveTorque(self.unbounded_torque(torque) as u16)
    }

    /// [`Self::to_drive`], in counts, for a number that may be larger than an object of the drive can hold.
    pub fn unbounded_counts(&self, angle: JointAngle) -> f64 {
        (self.motor(JointAngle(angle.0 - self.home.0)).0 * self.counts_per_rad).round()
    }

    /// [`Self::length`], in counts, for a number that may be larger than an object of the drive can hold.
    pub fn unbounded_length(&self, joint_rad: f64) -> f64 {
        (joint_rad * self.ratio * self.counts_per_rad).abs().floor()
    }

    /// [`Self::motor_rpm`], 1/min, for a number that may be larger than an object of the drive can hold.
    pub fn unbounded_rpm(&self, joint_rad_s: f64) -> f64 {
        ((joint_rad_s * self.ratio).abs() * 60.0 / TAU).floor()
    }

    /// [`Self::drive_torque`], in thousandths of the rated torque, for a number that may be larger than an object of the
    /// drive can hold.
    pub fn unbounded_torque(&self, torque: JointTorque) -> f64 {
        (torque.0 / self.ratio).abs().mul_add(1000.0 / self.rated_torque_nm, 1e-6).floor()
    }
}

impl BusPeriod {
    /// A period of whole microseconds, not 0.
    pub fn from_us(microseconds: u32) -> Option<Self> {
        (microseconds > 0).then_some(Self(microseconds))
    }

    /// In microseconds.
    pub fn us(self) -> u32 {
        self.0
    }

    /// In seconds.
    pub fn seconds(self) -> f64 {
        f64::from(self.0) * 1e-6
    }

    /// As a duration.
    pub fn duration(self) -> Duration {
        Duration::from_micros(u64::from(self.0))
    }

    /// As 60C2h wants it: an 8-bit number of tens to the power of; `None` when it cannot be said so.
    pub fn interpolation(self) -> Option<(u8, i8)> {
        let (mut value, mut exponent) = (self.0, -6i8);
        while value % 10 == 0 && exponent < 0 {
            value /= 10;
            exponent += 1;
        }
        Some((u8::try_from(value).ok()?, exponent))
    }

    /// The sample period when each bus period brings so many samples.
    pub fn with_samples(self, samples: usize) -> SamplePeriod {
        SamplePeriod(self.seconds() / samples as f64)
    }
}

impl SamplePeriod {
    /// Samples a second.
    pub fn rate_hz(self) -> f64 {
        1.0 / self.0
    }

    /// Whether this is the period of a rate, but for rounding.
    pub fn is_of(self, rate_hz: f64) -> bool {
        (self.0 * rate_hz - 1.0).abs() < 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEARING: fn(f64) -> Gearing = |ratio| Gearing::new(4096, ratio, 0.5);

    #[test]
    fn a_gear_stands_between_motor_and_joint_in_angle_and_in_torque() {
        let gearing = GEARING(-50.0);
        assert_eq!(gearing.to_drive(JointAngle(TAU / 50.0)), Counts(-4096));
        assert!((gearing.from_drive(Counts(-4096)).0 - TAU / 50.0).abs() < 1e-12);
        assert_eq!(gearing.drive_torque(JointTorque(5.0)), DriveTorque(200), "0.1 N m of 0.5 rated");
        assert_eq!(gearing.motor_rpm(TAU), 3000);
    }

    #[test]
    fn home_is_where_the_drive_counts_0_whichever_way_the_gear_turns() {
        for ratio in [1.0, -50.0] {
            let gearing = GEARING(ratio).with_home(JointAngle(0.25));
            assert_eq!(gearing.from_drive(Counts(0)), JointAngle(0.25));
            assert_eq!(gearing.to_drive(JointAngle(0.25)), Counts(0));
            assert!((gearing.from_drive(gearing.to_drive(JointAngle(-0.1))).0 + 0.1).abs() < 1e-3);
            assert_eq!(gearing.length(0.5), GEARING(ratio).length(0.5), "a length has no home");
            assert_eq!(gearing.count_rad(), GEARING(ratio).count_rad());
        }
    }

    #[test]
    fn a_limit_is_rounded_towards_the_safe_side() {
        let gearing = GEARING(1.0);
        assert_eq!(gearing.length(1.9 * TAU / 4096.0), 1);
        assert_eq!(gearing.motor_rpm(4.0), 38, "38.2");
    }

    #[test]
    fn the_interpolation_period_is_written_in_powers_of_ten() {
        let written = |us| BusPeriod::from_us(us).unwrap().interpolation();
        assert_eq!(written(1000), Some((1, -3)));
        assert_eq!(written(1600), Some((16, -4)));
        assert_eq!(written(400), Some((4, -4)));
        assert_eq!(written(333), None);
    }

    #[test]
    fn a_bus_period_with_four_samples_is_a_quarter_of_it_a_sample() {
        let period = BusPeriod::from_us(1600).unwrap();
        assert!(period.with_samples(4).is_of(2500.0));
        assert!(!period.with_samples(1).is_of(2500.0));
    }
}
