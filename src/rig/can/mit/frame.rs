//! Frames of MIT mode: numbers without byte borders, each so many bits over a range of the motor's firmware.
//!
//! Command: position 16 bits, speed 12, kp 12, kd 12, torque 12. Reply: id 8, position 16, speed 12, torque 12; CubeMars
//! adds temperature and error code. Layout and ranges: AK Series Module Driver User Manual; mini-cheetah motor controller.

use crate::rig::can::fault::CanFault;
use crate::rig::can::file::{MitModel, MitMotor};

/// The motor goes to motor mode.
pub const ENTER: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
/// The motor leaves motor mode: no power.
pub const LEAVE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD];
/// The present position becomes zero.
pub const ZERO: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE];

const POSITION_BITS: u32 = 16;
const OTHER_BITS: u32 = 12;

/// Ranges of the fields: half-widths of position, speed and torque, and the highest gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldRanges {
    /// rad at the motor's output.
    pub position_rad: f64,
    /// rad/s.
    pub speed_rad_s: f64,
    /// N m/rad.
    pub kp: f64,
    /// N m s/rad.
    pub kd: f64,
    /// N m.
    pub torque_nm: f64,
}

/// What a motor in motor mode does: torque = kp (position - its own) + kd (speed - its own) + torque.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorCommand {
    /// rad at the motor's output.
    pub position_rad: f64,
    /// rad/s.
    pub speed_rad_s: f64,
    /// N m/rad.
    pub kp: f64,
    /// N m s/rad.
    pub kd: f64,
    /// N m.
    pub torque_nm: f64,
}

/// What a motor reports of itself, at its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MitReply {
    /// rad.
    pub position_rad: f64,
    /// rad/s.
    pub speed_rad_s: f64,
    /// N m.
    pub torque_nm: f64,
    /// Error code; 0 where the reply has none.
    pub error: u8,
}

impl FieldRanges {
    /// Those of the rig file; what it does not give is that of the model, from the manufacturer's table.
    pub fn of(motor: &MitMotor) -> Self {
        let (speed_rad_s, torque_nm) = match motor.model {
            MitModel::Ak10_9 => (50.0, 65.0),
            MitModel::Ak60_6 => (45.0, 15.0),
            MitModel::Ak70_10 => (50.0, 25.0),
            MitModel::Ak80_6 => (76.0, 12.0),
            MitModel::Ak80_9 => (50.0, 18.0),
            MitModel::Ak80_80 => (8.0, 144.0),
            MitModel::MiniCheetah => (65.0, 18.0),
        };
        let given = motor.ranges.unwrap_or_default();
        Self {
            position_rad: motor.position_max_rad(),
            speed_rad_s: given.speed_max_rad_s.unwrap_or(speed_rad_s),
            kp: given.kp_max_nm_per_rad.unwrap_or(500.0),
            kd: given.kd_max_nm_s_per_rad.unwrap_or(5.0),
            torque_nm: given.torque_max_nm.unwrap_or(torque_nm),
        }
    }

    /// The smallest difference of two positions, rad.
    pub fn position_step_rad(&self) -> f64 {
        step(self.position_rad, POSITION_BITS)
    }

    /// The smallest difference of two speeds, rad/s.
    pub fn speed_step_rad_s(&self) -> f64 {
        step(self.speed_rad_s, OTHER_BITS)
    }

    /// The smallest difference of two torques, N m.
    pub fn torque_step_nm(&self) -> f64 {
        step(self.torque_nm, OTHER_BITS)
    }

    /// The command as the motor will read it: every number is the nearest of its field. A speed of zero has no number;
    /// the torque makes up for what the damping makes of the difference.
    pub fn rounded(&self, asked: &MotorCommand) -> MotorCommand {
        let near = |value: f64, reach: f64, bits: u32| {
            from_bits(to_bits(value, -reach, reach, bits), -reach, reach, bits)
        };
        let gain =
            |value: f64, most: f64| from_bits(to_bits(value, 0.0, most, OTHER_BITS), 0.0, most, OTHER_BITS);
        let speed_rad_s = near(asked.speed_rad_s, self.speed_rad_s, OTHER_BITS);
        let kd = gain(asked.kd, self.kd);
        let torque_nm = asked.torque_nm + kd * (asked.speed_rad_s - speed_rad_s);
        MotorCommand {
            position_rad: near(asked.position_rad, self.position_rad, POSITION_BITS),
            speed_rad_s,
            kp: gain(asked.kp, self.kp),
            kd,
            torque_nm: near(torque_nm, self.torque_nm, OTHER_BITS),
        }
    }

    /// The frame of a command.
    ///
    /// # Errors
    /// [`CanFault::FieldSaturated`]: a number is beyond its field.
    pub fn encode(&self, asked: &MotorCommand) -> Result<[u8; 8], CanFault> {
        for (field, value, low, high) in [
            ("position", asked.position_rad, -self.position_rad, self.position_rad),
            ("speed", asked.speed_rad_s, -self.speed_rad_s, self.speed_rad_s),
            ("kp", asked.kp, 0.0, self.kp),
            ("kd", asked.kd, 0.0, self.kd),
            ("torque", asked.torque_nm, -self.torque_nm, self.torque_nm),
        ] {
            if !(low..=high).contains(&value) {
                return Err(CanFault::FieldSaturated { field, limit: high });
            }
        }
        let command = self.rounded(asked);
        let mut word = to_bits(command.position_rad, -self.position_rad, self.position_rad, POSITION_BITS);
        word = word << OTHER_BITS
            | to_bits(command.speed_rad_s, -self.speed_rad_s, self.speed_rad_s, OTHER_BITS);
        word = word << OTHER_BITS | to_bits(command.kp, 0.0, self.kp, OTHER_BITS);
        word = word << OTHER_BITS | to_bits(command.kd, 0.0, self.kd, OTHER_BITS);
        word = word << OTHER_BITS | to_bits(command.torque_nm, -self.torque_nm, self.torque_nm, OTHER_BITS);
        Ok(word.to_be_bytes())
    }

    /// What the bytes after the id say.
    ///
    /// # Errors
    /// [`CanFault::FieldSaturated`]: position or speed is at the end of its field, where it says nothing.
    pub fn decode(&self, data: [u8; 5], error: u8) -> Result<MitReply, CanFault> {
        let [a, b, c, d, e] = data.map(u64::from);
        let position = a << 8 | b;
        let speed = c << 4 | d >> 4;
        let torque = (d & 0xF) << 8 | e;
        for (field, number, bits, limit) in [
            ("position", position, POSITION_BITS, self.position_rad),
            ("speed", speed, OTHER_BITS, self.speed_rad_s),
        ] {
            if number == 0 || number == (1 << bits) - 1 {
                return Err(CanFault::FieldSaturated { field, limit });
            }
        }
        Ok(MitReply {
            position_rad: from_bits(position, -self.position_rad, self.position_rad, POSITION_BITS),
            speed_rad_s: from_bits(speed, -self.speed_rad_s, self.speed_rad_s, OTHER_BITS),
            torque_nm: from_bits(torque, -self.torque_nm, self.torque_nm, OTHER_BITS),
            error,
        })
    }
}

impl MotorCommand {
    /// Torque that it makes of a shaft's position and speed, N m.
    pub fn torque_at(&self, position_rad: f64, speed_rad_s: f64) -> f64 {
        self.kp * (self.position_rad - position_rad)
            + self.kd * (self.speed_rad_s - speed_rad_s)
            + self.torque_nm
    }
}

fn step(reach: f64, bits: u32) -> f64 {
    2.0 * reach / f64::from((1u32 << bits) - 1)
}

fn to_bits(value: f64, low: f64, high: f64, bits: u32) -> u64 {
    let most = f64::from((1u32 << bits) - 1);
    ((value.clamp(low, high) - low) * most / (high - low)).round() as u64
}

fn from_bits(number: u64, low: f64, high: f64, bits: u32) -> f64 {
    number as f64 * (high - low) / f64::from((1u32 << bits) - 1) + low
}

#[cfg(test)]
mod tests {
    use super::*;

    const AK80_9: FieldRanges =
        FieldRanges { position_rad: 12.5, speed_rad_s: 50.0, kp: 500.0, kd: 5.0, torque_nm: 18.0 };

    #[test]
    fn numbers_come_back_to_within_half_a_step_of_their_range() {
        for (value, reach, bits) in [(0.14, 12.5, 16), (-3.2, 12.5, 16), (17.9, 18.0, 12)] {
            let back = from_bits(to_bits(value, -reach, reach, bits), -reach, reach, bits);
            assert!((back - value).abs() <= 0.5001 * step(reach, bits), "{value} -> {back}");
        }
    }

    #[test]
    fn fields_lie_in_the_frame_one_after_the_other_highest_bit_first() {
        let ends =
            MotorCommand { position_rad: 12.5, speed_rad_s: -50.0, kp: 500.0, kd: 0.0, torque_nm: 18.0 };
        assert_eq!(AK80_9.encode(&ends), Ok([0xFF, 0xFF, 0x00, 0x0F, 0xFF, 0x00, 0x0F, 0xFF]));
    }

    #[test]
    fn number_beyond_its_field_is_a_fault_and_not_the_end_of_the_field() {
        let beyond = MotorCommand { position_rad: 12.6, ..MotorCommand::default() };
        assert!(matches!(AK80_9.encode(&beyond), Err(CanFault::FieldSaturated { field: "position", .. })));
        let not_a_number = MotorCommand { speed_rad_s: f64::NAN, ..MotorCommand::default() };
        assert!(matches!(AK80_9.encode(&not_a_number), Err(CanFault::FieldSaturated { field: "speed", .. })));
        let ended = AK80_9.decode([0xFF, 0xFF, 0x80, 0x08, 0x00], 0);
        assert!(matches!(ended, Err(CanFault::FieldSaturated { field: "position", .. })));
    }

    #[test]
    fn damping_makes_no_torque_of_a_speed_of_zero_that_has_no_number() {
        let still = MotorCommand { kd: 5.0, ..MotorCommand::default() };
        let command = AK80_9.rounded(&still);
        assert!(command.speed_rad_s.abs() > 0.01, "half a step");
        let torque_nm = command.torque_at(command.position_rad, 0.0);
        assert!(torque_nm.abs() < AK80_9.torque_step_nm(), "{torque_nm} N m");
    }
}
