//! MIT mode: the frame of the mini-cheetah's motors, which CubeMars' AK series speaks, too. One frame to the motor, one
//! back, each a row of numbers without byte borders: an unsigned number of so many bits over the range of the model.
//!
//! Command: position 16 bits, speed 12, kp 12, kd 12, torque 12. Reply: id 8, position 16, speed 12, torque 12; CubeMars
//! adds temperature and error code. FF seven times and FC enters motor mode, FD leaves it, FE makes this position zero.

use std::time::{Duration, Instant};

use super::bus::Frame;
use super::canopen::{ErrorPolicy, Link, MonitoredNode, cob};
use super::drive::{Drive, DriveRequest, MotionMonitor, PowerState};
use super::fault::CanFault;
use super::file::{CanRigFile, MitModel, MitMotor};
use super::limits::{HandleLimits, LimitsConfirmed};
use super::pdo_decoder::Readings;
use super::sensors::Sensors;
use super::units::JointAngle;

const KP_MAX: f64 = 500.0;
const KD_MAX: f64 = 5.0;
const ENTER: u8 = 0xFC;
const LEAVE: u8 = 0xFD;
const ZERO: u8 = 0xFE;
/// How long a motor may take to reply to a special frame.
const MIT_REPLY_TIMEOUT: Duration = Duration::from_millis(100);
const MIT_ATTEMPTS: usize = 5;

/// Half-widths of the symmetric ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ranges {
    position_rad: f64,
    speed_rad_s: f64,
    torque_nm: f64,
}

/// The ranges of a model, from the manufacturer's table.
fn ranges(model: MitModel) -> Ranges {
    let (speed_rad_s, torque_nm) = match model {
        MitModel::Ak10_9 => (50.0, 65.0),
        MitModel::Ak60_6 => (45.0, 15.0),
        MitModel::Ak70_10 => (50.0, 25.0),
        MitModel::Ak80_6 => (76.0, 12.0),
        MitModel::Ak80_9 => (50.0, 18.0),
        MitModel::Ak80_80 => (8.0, 144.0),
        MitModel::MiniCheetah => (65.0, 18.0),
    };
    Ranges { position_rad: 12.5, speed_rad_s, torque_nm }
}

/// A motor in MIT mode.
#[derive(Debug)]
pub struct Mit {
    motor: MitMotor,
    sensors: Sensors,
    /// Torque that the position loop may ask for, N m at the motor.
    torque_limit_nm: f64,
    zeroed: bool,
    in_motor_mode: bool,
    following: bool,
    /// The command that goes out with the next SYNC.
    command: Option<[u8; 8]>,
    has_replied: bool,
    position_rad: f64,
    error: u8,
}

impl Mit {
    /// The motor of a rig file; nothing is sent yet.
    pub fn new(motor: &MitMotor, file: &CanRigFile) -> Self {
        Self {
            motor: motor.clone(),
            sensors: Sensors::new(file),
            torque_limit_nm: 0.0,
            zeroed: false,
            in_motor_mode: false,
            following: false,
            command: None,
            has_replied: false,
            position_rad: f64::NAN,
            error: 0,
        }
    }

    /// A special frame and its reply.
    fn ask(&mut self, link: &mut Link, special: u8) -> Result<(), CanFault> {
        for _ in 0..MIT_ATTEMPTS {
            self.has_replied = false;
            link.send(&Frame::new(self.motor.id, &special_frame(special)))?;
            let deadline = link.now() + MIT_REPLY_TIMEOUT;
            while let Some(frame) = link.receive(deadline)? {
                if self.handle_frame(&frame, link.now())? && self.has_replied {
                    return Ok(());
                }
            }
        }
        Err(CanFault::MissedCycle { in_a_row: MIT_ATTEMPTS as u32, tolerated: 0, id: self.motor.reply_id })
    }

    /// A target no further from the shaft than the torque limit allows: the loop's torque is kp times the distance.
    fn position_command(&self, target_rad: f64) -> [u8; 8] {
        let reach_rad = self.torque_limit_nm / self.motor.kp_nm_per_rad;
        let position = target_rad.clamp(self.position_rad - reach_rad, self.position_rad + reach_rad);
        let ranges = ranges(self.motor.model);
        let mut word = to_bits(position, -ranges.position_rad, ranges.position_rad, 16);
        word = word << 12 | to_bits(0.0, -ranges.speed_rad_s, ranges.speed_rad_s, 12);
        word = word << 12 | to_bits(self.motor.kp_nm_per_rad, 0.0, KP_MAX, 12);
        word = word << 12 | to_bits(self.motor.kd_nm_s_per_rad, 0.0, KD_MAX, 12);
        word = word << 12 | to_bits(0.0, -ranges.torque_nm, ranges.torque_nm, 12);
        word.to_be_bytes()
    }
}

impl Drive for Mit {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault> {
        self.torque_limit_nm = (limits.motor_torque_nm / self.motor.gear_ratio).abs();
        self.ask(link, LEAVE)?;
        self.in_motor_mode = false;
        self.following = false;
        self.sensors.prepare(link, file)?;
        // The rig file says that it knows that there is nothing to read back from this motor.
        Ok(LimitsConfirmed::by_reading_back())
    }

    fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        self.sensors.monitored_nodes()
    }

    fn start(
        &mut self,
        link: &mut Link,
        _limits: &HandleLimits,
        _lookout: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        self.sensors.start(link)?;
        link.set_error_policy(ErrorPolicy::Fault);
        if self.motor.zero_here && !self.zeroed {
            self.ask(link, ZERO)?;
            self.zeroed = true;
        }
        // In motor mode it stays limp until its first command, which the cycle sends.
        self.ask(link, ENTER)?;
        self.in_motor_mode = true;
        Ok(())
    }

    fn send_target(
        &mut self,
        _link: &mut Link,
        target: JointAngle,
        _shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault> {
        self.command = match request {
            DriveRequest::None => None,
            DriveRequest::RemovePower => Some(special_frame(LEAVE)),
            DriveRequest::Enable | DriveRequest::Follow | DriveRequest::QuickStop => {
                Some(self.position_command(target.0 * self.motor.gear_ratio))
            }
        };
        if request == DriveRequest::RemovePower {
            self.in_motor_mode = false;
        }
        Ok(())
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.has_replied = false;
        if let Some(command) = self.command.take() {
            link.send(&Frame::new(self.motor.id, &command))?;
        }
        Ok(link.send(&Frame::new(cob::SYNC, &[]))?)
    }

    fn handle_frame(&mut self, frame: &Frame, _now: Instant) -> Result<bool, CanFault> {
        let data = frame.data();
        if frame.id != self.motor.reply_id || data.first() != Some(&(self.motor.id as u8)) {
            return Ok(false);
        }
        let [_, high, low, _, _, _, rest @ ..] = data else {
            return Err(CanFault::Malformed { id: frame.id, length: data.len() as u8, expected: 8 });
        };
        let reach = ranges(self.motor.model).position_rad;
        self.position_rad = from_bits(u32::from(u16::from_be_bytes([*high, *low])), -reach, reach, 16);
        self.has_replied = true;
        if let [_, error, ..] = rest {
            self.error = *error;
        }
        Ok(true)
    }

    fn has_replied(&self) -> bool {
        self.has_replied
    }

    fn angle(&self, _readings: &Readings, _sample: usize) -> JointAngle {
        JointAngle(self.position_rad / self.motor.gear_ratio)
    }

    fn check(&self, _readings: &Readings, _now: Instant) -> Result<(), CanFault> {
        if self.error != 0 || !self.in_motor_mode {
            return Err(CanFault::MotorError { code: u32::from(self.error) });
        }
        Ok(())
    }

    fn power(&self, _readings: &Readings) -> PowerState {
        match (self.in_motor_mode, self.following) {
            (true, true) => PowerState::Following,
            (true, false) => PowerState::Changing,
            (false, _) => PowerState::Off,
        }
    }

    /// It goes there as soon as it is told, and its reply comes after that.
    fn target_delay_periods(&self) -> usize {
        1
    }

    fn approach_speed_rad_s(&self) -> f64 {
        self.motor.go_to_start_rad_s
    }

    fn period_complete(&mut self, _readings: &Readings) {
        self.following = self.in_motor_mode;
    }

    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.in_motor_mode = false;
        self.following = false;
        self.ask(link, LEAVE).map_err(|_| CanFault::PowerNotConfirmed)?;
        Ok(self.sensors.release(link)?)
    }
}

fn special_frame(code: u8) -> [u8; 8] {
    [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, code]
}

fn to_bits(value: f64, low: f64, high: f64, bits: u32) -> u64 {
    let most = f64::from((1u32 << bits) - 1);
    ((value.clamp(low, high) - low) * most / (high - low)) as u64
}

fn from_bits(number: u32, low: f64, high: f64, bits: u32) -> f64 {
    f64::from(number) * (high - low) / f64::from((1u32 << bits) - 1) + low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_to_within_a_step_of_their_range() {
        for (value, reach, bits) in [(0.14, 12.5, 16), (-3.2, 12.5, 16), (17.9, 18.0, 12)] {
            let step = 2.0 * reach / f64::from((1u32 << bits) - 1);
            let back = from_bits(to_bits(value, -reach, reach, bits) as u32, -reach, reach, bits);
            assert!((back - value).abs() <= step, "{value} -> {back}");
        }
        assert_eq!(to_bits(1e9, -12.5, 12.5, 16), 0xFFFF, "never beyond the range");
    }

    /// The example of the manufacturer's manual: all fields in the middle are 7FFFh, 7FFh, and gains of zero.
    #[test]
    fn fields_lie_in_the_frame_one_after_the_other_highest_bit_first() {
        let file_motor = MitMotor {
            id: 1,
            reply_id: 0,
            model: MitModel::Ak80_9,
            gear_ratio: 1.0,
            kp_nm_per_rad: 500.0,
            kd_nm_s_per_rad: 5.0,
            zero_here: true,
            go_to_start_rad_s: 0.1,
            has_no_limits_of_its_own: true,
        };
        let motor = Mit {
            motor: file_motor,
            sensors: Sensors::none(),
            torque_limit_nm: 1e9,
            zeroed: false,
            in_motor_mode: true,
            following: true,
            command: None,
            has_replied: false,
            position_rad: 0.0,
            error: 0,
        };
        assert_eq!(motor.position_command(0.0), [0x7F, 0xFF, 0x7F, 0xFF, 0xFF, 0xFF, 0xF7, 0xFF]);
        assert_eq!(motor.position_command(12.5)[..2], [0xFF, 0xFF]);
        let limited = Mit { torque_limit_nm: 5.0, ..motor };
        assert_eq!(limited.position_command(1.0), limited.position_command(0.01), "5 N m at 500 N m/rad");
    }
}
