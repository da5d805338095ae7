//! Whether a drive was restarted since it was armed: a restart takes its origin away, and nothing in CiA 402 says that it has one.
//!
//! Three things show it, and each may fail:
//!
//! - the boot-up message, which is lost while nobody reads the bus;
//! - the limits, which a drive with a memory for its settings keeps;
//! - a mark in the target torque (6071h), which no drive keeps, but which some do not have.

use super::device::Cia402;
use crate::rig::can::canopen::{CanopenError, Link, Object};
use crate::rig::can::fault::CanFault;
use crate::rig::can::limits::HandleLimits;

/// The target torque, thousandths of the rated torque. Modes of operation with positions have no use for it, it is no setting that a drive
/// would keep, and after a start it is 0.
const TARGET_TORQUE: Object = Object::plain(0x6071);
/// The mark: the least that is not 0, which moves no motor in any mode.
const MARK: i16 = 1;

impl Cia402 {
    /// Marks the drive as armed. One that does not take the mark goes without.
    ///
    /// # Errors
    /// The drive does not answer.
    pub(super) fn write_mark(&self, link: &mut Link) -> Result<(), CanopenError> {
        match link.write(self.motor.node, TARGET_TORQUE, MARK) {
            Err(CanopenError::SdoAborted { .. }) => Ok(()),
            outcome => outcome,
        }
    }

    /// Whether the drive has the mark; `None` if it cannot have one.
    ///
    /// # Errors
    /// The drive does not answer, or not as it should.
    pub(super) fn has_mark(&self, link: &mut Link) -> Result<Option<bool>, CanopenError> {
        match link.read(self.motor.node, TARGET_TORQUE) {
            Ok(read) => Ok(Some(read.number() as i16 == MARK)),
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
            || is_marked && self.has_mark(link)? != Some(true)
            || self.first_limit_not_held(link, limits)?.is_some())
    }
}
