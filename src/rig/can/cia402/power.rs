//! The power drive state machine of CiA 402, changed over SDO while no cycle runs: fault reset, states, modes, the movement to the
//! start position.

use std::time::Duration;

use super::device::Cia402;
use crate::rig::can::canopen::{CanopenError, Link, Object};
use crate::rig::can::cia402_state::{Controlword, DriveState, Mode, Statusword, next_controlword};
use crate::rig::can::drive::MotionMonitor;
use crate::rig::can::fault::CanFault;
use crate::rig::can::units::{Counts, JointAngle};

/// How long a drive may take to change its state.
const DRIVE_STATE_TIMEOUT: Duration = Duration::from_secs(2);
/// How often a drive is asked.
const ASK_EVERY: Duration = Duration::from_millis(5);
/// How near to the start position is there, rad at the handle: a count of a coarse encoder, or the slack of a gear.
const AT_START_RAD: f64 = 0.005;

/// Periods after a controlword until the statusword is sure to answer it.
pub(super) const LET_BITS_SETTLE: u64 = 3;

impl Cia402 {
    /// The statusword, asked for.
    pub(super) fn ask_status(&self, link: &mut Link) -> Result<Statusword, CanFault> {
        Ok(Statusword(link.read(self.motor.node, Object::plain(0x6041))?.number() as u16))
    }

    /// The handle's angle, asked for.
    pub(super) fn ask_angle(&self, link: &mut Link) -> Result<JointAngle, CanFault> {
        let counts = link.read(self.motor.node, Object::plain(0x6064))?.number() as i32;
        Ok(self.gearing.from_drive(Counts(counts)))
    }

    pub(super) fn control(&self, link: &mut Link, word: Controlword) -> Result<(), CanFault> {
        Ok(link.write(self.motor.node, Object::plain(0x6040), word.0)?)
    }

    /// Out of FAULT, once: a fault that comes back at once is there to stay.
    pub(super) fn reset_fault(&self, link: &mut Link) -> Result<(), CanFault> {
        if self.ask_status(link)?.state() != DriveState::Fault {
            return Ok(());
        }
        self.control(link, Controlword::DISABLE_VOLTAGE)?;
        self.control(link, Controlword::FAULT_RESET)?;
        self.wait_for(link, DriveState::SwitchOnDisabled)?;
        self.control(link, Controlword::DISABLE_VOLTAGE)
    }

    /// Step by step to `wanted`, which is READY TO SWITCH ON or OPERATION ENABLED.
    pub(super) fn go_to_state(&self, link: &mut Link, wanted: DriveState) -> Result<(), CanFault> {
        let deadline = link.now() + DRIVE_STATE_TIMEOUT;
        loop {
            let status = self.ask_status(link)?;
            let state = status.state();
            if state == wanted {
                return Ok(());
            }
            let word = match (state, wanted) {
                (DriveState::SwitchedOn | DriveState::OperationEnabled, DriveState::ReadyToSwitchOn) => {
                    Some(Controlword::SHUTDOWN)
                }
                _ => next_controlword(state),
            };
            match word {
                Some(word) if link.now() < deadline => self.control(link, word)?,
                None if state != DriveState::Fault && link.now() < deadline => {}
                _ => return Err(self.not_reached(link, wanted, status)),
            }
            self.pause(link)?;
        }
    }

    fn wait_for(&self, link: &mut Link, wanted: DriveState) -> Result<(), CanFault> {
        let deadline = link.now() + DRIVE_STATE_TIMEOUT;
        loop {
            let status = self.ask_status(link)?;
            if status.state() == wanted {
                return Ok(());
            }
            if link.now() > deadline {
                return Err(self.not_reached(link, wanted, status));
            }
            self.pause(link)?;
        }
    }

    pub(super) fn not_reached(&self, link: &mut Link, wanted: DriveState, status: Statusword) -> CanFault {
        let code = link.read(self.motor.node, Object::plain(0x603F)).map_or(0, |code| code.number() as u16);
        CanFault::StateNotReached { wanted, state: status.state(), statusword: status.0, code }
    }

    /// Lets some time pass with heartbeats going both ways.
    fn pause(&self, link: &mut Link) -> Result<(), CanFault> {
        let end = link.now() + ASK_EVERY;
        while link.receive(end)?.is_some() {}
        Ok(())
    }

    pub(super) fn set_mode(&self, link: &mut Link, mode: Mode) -> Result<(), CanFault> {
        let node = self.motor.node;
        link.write(node, Object::plain(0x6060), mode as i8)?;
        let deadline = link.now() + DRIVE_STATE_TIMEOUT;
        loop {
            let display = link.read(node, Object::plain(0x6061))?.number() as u8;
            if display == mode as u8 {
                return Ok(());
            }
            if link.now() > deadline {
                let (written, read) = (mode as u32, u32::from(display));
                return Err(
                    CanopenError::ValueNotAccepted { node, index: 0x6061, sub: 0, written, read }.into()
                );
            }
            self.pause(link)?;
        }
    }

    /// To the start position on the drive's own profile.
    pub(super) fn go_to_start(
        &mut self,
        link: &mut Link,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        let from = self.ask_angle(link)?;
        if from.0.abs() < AT_START_RAD {
            return Ok(());
        }
        self.set_mode(link, Mode::ProfilePosition)?;
        self.go_to_state(link, DriveState::OperationEnabled)?;
        link.write(self.motor.node, Object::plain(0x607A), 0i32)?;
        self.control(link, Controlword::ENABLE_AND_GO)?;
        let start = self.motor.go_to_start;
        let expected_s =
            from.0.abs() / start.speed_rad_s + 2.0 * start.speed_rad_s / start.acceleration_rad_s2;
        let timeout =
            Duration::from_secs_f64(2.0 * expected_s).mul_f64(link.time_stretch()) + DRIVE_STATE_TIMEOUT;
        let deadline = link.now() + timeout;
        monitor.moving_from(from, AT_START_RAD);
        for period in 0u64.. {
            let (readings, JointAngle(angle_rad)) = monitor.period(link, self)?;
            let status = Statusword(readings.statusword);
            if status.state() != DriveState::OperationEnabled {
                return Err(self.not_reached(link, DriveState::OperationEnabled, status));
            }
            let off_rad = angle_rad.abs();
            if period >= LET_BITS_SETTLE && status.target_reached() && off_rad < AT_START_RAD {
                break;
            }
            if link.now() > deadline {
                self.control(link, Controlword::SHUTDOWN)?;
                return Err(CanFault::NotAtStart { off_rad });
            }
        }
        self.go_to_state(link, DriveState::ReadyToSwitchOn)
    }

    /// No power, asked until the drive says so.
    pub(super) fn confirm_no_power(&self, link: &mut Link) -> Result<(), CanFault> {
        let deadline = link.now() + DRIVE_STATE_TIMEOUT;
        loop {
            self.control(link, Controlword::DISABLE_VOLTAGE)?;
            if !self.ask_status(link)?.state().has_power() {
                return Ok(());
            }
            if link.now() > deadline {
                return Err(CanFault::PowerNotConfirmed);
            }
            self.pause(link)?;
        }
    }
}
