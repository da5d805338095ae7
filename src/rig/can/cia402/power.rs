//! The power drive state machine of CiA 402, changed over SDO while no cycle runs: fault reset, states, modes, and
//! no power.

use std::time::Duration;

use super::device::Cia402;
use crate::rig::can::canopen::{CanopenError, Link, Object};
use crate::rig::can::cia402_state::{Controlword, DriveState, Mode, Statusword, next_controlword};
use crate::rig::can::fault::CanFault;

/// How long a drive may take to change its state.
pub(super) const DRIVE_STATE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long a drive that answers may keep its power after it was told over SDO to switch it off; then the program's heartbeat ends.
pub(super) const OBEDIENCE_TIMEOUT: Duration = Duration::from_millis(100);
/// How often a drive is asked.
const ASK_EVERY: Duration = Duration::from_millis(5);
/// Periods after a controlword until the statusword is sure to answer it.
pub(super) const LET_BITS_SETTLE: u64 = 3;

impl Cia402 {
    /// The statusword, asked for.
    pub(super) fn ask_status(&self, link: &mut Link) -> Result<Statusword, CanFault> {
        Ok(Statusword(link.read(self.motor.node, Object::plain(0x6041))?.number() as u16))
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
        Ok(link.pass_time(end)?)
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

    /// No power, asked until the drive says so. One that must obey has `patience` for it, in its own time; one that reacts to a fault
    /// brakes first.
    ///
    /// # Errors
    /// [`CanFault::PowerNotConfirmed`], or the drive does not answer.
    pub(super) fn confirm_no_power(&self, link: &mut Link, patience: Duration) -> Result<(), CanFault> {
        let (begun, stretch) = (link.now(), link.time_stretch());
        loop {
            let commanded = self.control(link, Controlword::DISABLE_VOLTAGE);
            // A drive that refuses the command may have no power all the same; one that does not answer is not asked twice.
            if let Err(fault @ CanFault::Canopen(CanopenError::SdoSilent { .. } | CanopenError::BusGone)) =
                commanded
            {
                return Err(fault);
            }
            let state = self.ask_status(link)?.state();
            if !state.has_power() {
                return Ok(());
            }
            let patience = if state.must_obey() { patience.mul_f64(stretch) } else { DRIVE_STATE_TIMEOUT };
            if link.now() > begun + patience.min(DRIVE_STATE_TIMEOUT) {
                return Err(CanFault::PowerNotConfirmed);
            }
            self.pause(link)?;
        }
    }
}
