//! Homing (mode 6 of CiA 402): the drive finds its origin by the method that the rig file gives (object 6098h).
//!
//! Every method runs the same way here: the mode is set, the start bit is given, and statusword bits 10, 12 and 13 tell the end.
//! A method that takes the present position for the origin is used once only.

use std::time::Duration;

use super::device::Cia402;
use super::power::LET_BITS_SETTLE;
use crate::rig::Origin;
use crate::rig::can::canopen::Link;
use crate::rig::can::cia402_state::{Controlword, DriveState, Mode, Statusword};
use crate::rig::can::drive::MotionMonitor;
use crate::rig::can::fault::CanFault;
use crate::rig::can::motion_proof::SpeedWatch;
use crate::rig::can::units::{Counts, JointAngle};

/// Homing methods that take the present position for the origin.
const METHODS_AT_PRESENT_POSITION: [i8; 2] = [35, 37];

/// Whether a method takes the present position for the origin, so that the motor does not move.
pub(super) fn takes_present_position(method: i8) -> bool {
    METHODS_AT_PRESENT_POSITION.contains(&method)
}

impl Cia402 {
    /// Lets the drive find its origin. A method that takes the present position is used once: after a fault the motor
    /// may stand anywhere.
    ///
    /// # Errors
    /// The drive left its state, reported a homing error (bit 13), took too long, or lost the origin that it had.
    pub(super) fn home(
        &mut self,
        link: &mut Link,
        drive_keeps_limits: bool,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        let homing = self.motor.homing;
        if self.homed && takes_present_position(homing.method) {
            self.origin = Origin::Kept;
            return if drive_keeps_limits { Ok(()) } else { Err(CanFault::OriginLost) };
        }
        self.homed = false;
        self.set_mode(link, Mode::Homing)?;
        self.go_to_state(link, DriveState::OperationEnabled)?;
        self.control(link, Controlword::ENABLE_AND_GO)?;
        monitor.begin();
        let deadline = link.now() + Duration::from_secs_f64(homing.timeout_s);
        // The drive is told its speeds in a unit that only it knows for sure.
        let resolution_rad = self.gearing.from_drive(Counts(1)).0.abs();
        let mut speed = SpeedWatch::new(homing.fast_rad_s, resolution_rad, link.time_stretch());
        // Until the first periods are over, the bits may be those of before.
        for period in 0u64.. {
            let (readings, JointAngle(angle_rad)) = monitor.period(link, self)?;
            speed.observe(angle_rad, link.now())?;
            let status = Statusword(readings.statusword);
            if status.state() != DriveState::OperationEnabled {
                return Err(self.not_reached(link, DriveState::OperationEnabled, status));
            }
            if status.mode_bit_13() || link.now() > deadline {
                self.control(link, Controlword::SHUTDOWN)?;
                return Err(CanFault::HomingFailed { timeout_s: homing.timeout_s, statusword: status.0 });
            }
            if period >= LET_BITS_SETTLE && status.mode_bit_12() && status.target_reached() {
                break;
            }
        }
        self.homed = true;
        self.origin = Origin::at_arming(takes_present_position(homing.method), false);
        self.go_to_state(link, DriveState::ReadyToSwitchOn)
    }
}
