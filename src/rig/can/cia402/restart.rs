//! Whether a drive was restarted since it was armed: a restart takes its origin away, and nothing in CiA 402 says that it has one.
//!
//! Three things show it, and each may fail:
//!
//! - the boot-up message, which is lost while nobody reads the bus;
//! - the limits, which a drive with a memory for its settings keeps;
//! - a mark in the target torque (6071h), which no drive keeps, but which some do not have.

use super::device::Cia402;
use crate::rig::can::canopen::{CanopenError, Link, Object, emergency};
use crate::rig::can::cia402_state::DriveState;
use crate::rig::can::fault::CanFault;
use crate::rig::can::limits::HandleLimits;

/// The target torque, thousandths of the rated torque. Modes of operation with positions have no use for it, it is no setting that a drive
/// would keep, and after a start it is 0.
const TARGET_TORQUE: Object = Object::plain(0x6071);
/// The mark of a drive that has an origin: the least that is not 0, which moves no motor in any mode.
pub(super) const ARMED: i16 = 1;
/// The mark of a drive whose home is being found: it has no origin until that is over.
pub(super) const BEING_ARMED: i16 = 2;
/// What a drive has after a start, and after it may have lost its origin.
pub(super) const UNMARKED: i16 = 0;

impl Cia402 {
    /// Marks the drive. One that does not take the mark goes without.
    ///
    /// # Errors
    /// The drive does not answer.
    pub(super) fn write_mark(&self, link: &mut Link, mark: i16) -> Result<(), CanopenError> {
        match link.write(self.motor.node, TARGET_TORQUE, mark) {
            Err(CanopenError::SdoAborted { .. }) => Ok(()),
            outcome => outcome,
        }
    }

    /// The mark of the drive; `None` if it cannot have one.
    ///
    /// # Errors
    /// The drive does not answer, or not as it should.
    pub(super) fn mark(&self, link: &mut Link) -> Result<Option<i16>, CanopenError> {
        match link.read(self.motor.node, TARGET_TORQUE) {
            Ok(read) => Ok(Some(read.number() as i16)),
            Err(CanopenError::SdoAborted { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Nothing that was written at this arming may be trusted after a restart: watchdogs and reactions are not read again.
    ///
    /// # Errors
    /// [`CanopenError::Rebooted`]
    pub(super) fn check_not_restarted(&self, link: &Link) -> Result<(), CanFault> {
        let node = self.motor.node;
        if link.has_booted(node) { Err(CanopenError::Rebooted { node }.into()) } else { Ok(()) }
    }

    /// Whether the drive stopped because of its position sensor, since it was set up or now: counts may have been lost while it was off.
    ///
    /// # Errors
    /// The drive does not answer, or not as it should.
    pub(super) fn shows_sensor_error(&self, link: &mut Link) -> Result<bool, CanFault> {
        if link.has_sensor_error(self.motor.node) {
            return Ok(true);
        }
        if self.ask_status(link)?.state() != DriveState::Fault {
            return Ok(false);
        }
        match link.read(self.motor.node, Object::plain(0x603F)) {
            Ok(code) => Ok(emergency::is_sensor_error(code.number() as u16)),
            Err(CanopenError::SdoAborted { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Takes the mark from a drive that may have lost its origin, so that nobody who asks later takes it for kept.
    ///
    /// # Errors
    /// The drive does not answer, or not as it should.
    pub(super) fn forget_origin_after_sensor_error(&mut self, link: &mut Link) -> Result<(), CanFault> {
        if self.shows_sensor_error(link)? {
            self.was_restarted |= self.homed;
            self.write_mark(link, UNMARKED)?;
        }
        Ok(())
    }

    /// Whether the drive shows that it was restarted since it was armed with `limits`. `is_marked` says that it had the mark then.
    ///
    /// # Errors
    /// The drive does not answer, or not as it should.
    pub(super) fn shows_restart(
        &self,
        link: &mut Link,
        limits: &HandleLimits,
        is_marked: bool,
    ) -> Result<bool, CanopenError> {
        Ok(link.has_booted(self.motor.node)
            || is_marked && self.mark(link)? != Some(ARMED)
            || self.first_limit_not_held(link, limits)?.is_some())
    }
}
