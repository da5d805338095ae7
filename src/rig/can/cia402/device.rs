//! The drive's settings, and the state that its latest frames told.

use crate::rig::Origin;
use crate::rig::can::cia402_state::{Controlword, DriveState, next_controlword};
use crate::rig::can::drive::DriveRequest;
use crate::rig::can::file::{CanRigFile, Cia402Motor, Display};
use crate::rig::can::finding::ObjectFinding;
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::sensors::Sensors;
use crate::rig::can::units::{BusPeriod, Gearing, JointAngle};

/// A CiA 402 drive.
#[derive(Debug)]
pub struct Cia402 {
    pub(super) motor: Cia402Motor,
    pub(super) gearing: Gearing,
    /// 60C2h.
    pub(super) interpolation: (u8, i8),
    pub(super) sensors: Sensors,
    pub(super) display: Option<Display>,
    /// The start position was found.
    pub(super) homed: bool,
    /// How it was known at the latest arming.
    pub(super) origin: Origin,
    /// The limits of the last arming, which a drive that was not restarted still has.
    pub(super) written: Option<HandleLimits>,
    /// Whether the drive was restarted since it was homed.
    pub(super) was_restarted: bool,
    /// Whether the drive kept the mark of its arming until it was homed, so that only a restart takes it away; `None` before it was tried.
    pub(super) keeps_mark: Option<bool>,
    /// The drive has said in a frame since it was prepared that it minds its controlword.
    pub(super) was_remote: bool,
    /// The state that the latest frames told.
    pub(super) seen: DriveState,
    /// What was missing or refused when the drive was set up last.
    pub(super) findings: Vec<ObjectFinding>,
}

impl Cia402 {
    /// The drive of a rig file; nothing is sent yet.
    pub fn new(motor: &Cia402Motor, file: &CanRigFile) -> Self {
        let period = BusPeriod::from_us(file.period_us).and_then(BusPeriod::interpolation);
        Self {
            // The drive's own offset (607Ch) is 0: drives do not agree on its sign.
            gearing: Gearing::new(motor.counts_per_revolution, motor.gear_ratio, motor.rated_torque_nm)
                .with_home(JointAngle(motor.homing.offset_rad)),
            motor: motor.clone(),
            // The rig file was checked for a period that can be written so.
            interpolation: period.unwrap_or((0, 0)),
            sensors: Sensors::new(file),
            display: file.display,
            homed: false,
            origin: Origin::Found,
            written: None,
            was_restarted: false,
            keeps_mark: None,
            was_remote: false,
            seen: DriveState::NotReady,
            findings: Vec::new(),
        }
    }

    pub(super) fn target_id(&self) -> u16 {
        0x200 + u16::from(self.motor.node)
    }

    /// The controlword that goes with a target, if one goes out.
    pub(super) fn controlword(&self, request: DriveRequest) -> Option<Controlword> {
        Some(match request {
            DriveRequest::None => return None,
            DriveRequest::Enable => next_controlword(self.seen).unwrap_or(Controlword::SHUTDOWN),
            DriveRequest::Follow => Controlword::ENABLE,
            DriveRequest::QuickStop => Controlword::QUICK_STOP,
            DriveRequest::RemovePower => Controlword::DISABLE_VOLTAGE,
        })
    }
}
