//! Writes limits, watchdogs and frames to the drive and reads every one back.

use super::device::Cia402;
use crate::rig::can::canopen::pdo::{MAX_PDOS, Pdo, PdoDirection};
use crate::rig::can::canopen::{CanopenError, Link, Object, Value};
use crate::rig::can::device_setup::{expect, write_tpdos};
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::units::{Gearing, JointAngle, JointTorque};

impl Cia402 {
    /// Encoder and rated torque as the drive has them must be those of the rig file: all limits rest on them.
    pub(super) fn check_scale(&self, link: &mut Link) -> Result<(), CanopenError> {
        let motor = &self.motor;
        let node = motor.node;
        let counts = link.read(node, Object::entry(0x608F, 1))?.number();
        let turns = link.read(node, Object::entry(0x608F, 2))?.number().max(1);
        if counts != motor.counts_per_revolution.saturating_mul(turns) {
            let expected = motor.counts_per_revolution;
            return Err(CanopenError::WrongDevice { node, index: 0x608F, sub: 1, read: counts, expected });
        }
        expect(link, node, Object::plain(0x6076), (motor.rated_torque_nm * 1000.0).round() as u32)
    }

    /// What stops the motor without this program's help.
    pub(super) fn write_watchdogs(&self, link: &mut Link, file: &CanRigFile) -> Result<(), CanopenError> {
        let node = self.motor.node;
        let master = file.master;
        let minded = u32::from(master.node) << 16 | u32::from(master.motor_waits_ms);
        let writes: [(Object, Value); 7] = [
            (Object::plain(0x1017), self.motor.heartbeat_ms.into()),
            (Object::entry(0x1016, 1), minded.into()),
            // Heartbeat lost: to PRE-OPERATIONAL, and a fault, whose reaction is the quick-stop ramp.
            (Object::entry(0x1029, 1), 0u8.into()),
            (Object::plain(0x6007), 1i16.into()),
            (Object::plain(0x605E), 2i16.into()),
            (Object::plain(0x605A), 2i16.into()),
            (Object::plain(0x6085), self.gearing.length(self.motor.quick_stop_rad_s2).into()),
        ];
        // A drive that is armed anew still minds us; one node may not stand there twice.
        link.write(node, Object::entry(0x1016, 1), 0u32)?;
        writes.into_iter().try_for_each(|(object, value)| link.write_and_confirm(node, object, value))
    }

    /// What the drive itself holds against every motion.
    pub(super) fn write_limits(&self, link: &mut Link, limits: &HandleLimits) -> Result<(), CanopenError> {
        let node = self.motor.node;
        limit_objects(&self.gearing, limits)
            .into_iter()
            .try_for_each(|(object, value)| link.write_and_confirm(node, object, value))
    }

    /// The limits once more: homing has moved the origin, and some drives forget with it.
    pub(super) fn confirm_limits(&self, link: &mut Link, limits: &HandleLimits) -> Result<(), CanopenError> {
        match self.first_limit_not_held(link, limits)? {
            None => Ok(()),
            Some(fault) => Err(fault),
        }
    }

    /// Whether the drive still has the limits that were written when it was armed last: one that was restarted has not.
    pub(super) fn keeps_limits(&self, link: &mut Link, limits: &HandleLimits) -> Result<bool, CanopenError> {
        Ok(self.first_limit_not_held(link, limits)?.is_none())
    }

    fn first_limit_not_held(
        &self,
        link: &mut Link,
        limits: &HandleLimits,
    ) -> Result<Option<CanopenError>, CanopenError> {
        let node = self.motor.node;
        for (object, value) in limit_objects(&self.gearing, limits) {
            let read = link.read(node, object)?;
            if !read.bytes().starts_with(value.bytes()) {
                let (written, read) = (value.number(), read.number());
                return Ok(Some(CanopenError::ValueNotAccepted {
                    node,
                    index: object.index,
                    sub: object.sub,
                    written,
                    read,
                }));
            }
        }
        Ok(None)
    }

    /// Interpolation period and frames.
    pub(super) fn write_frames(&self, link: &mut Link, file: &CanRigFile) -> Result<(), CanopenError> {
        let node = self.motor.node;
        let (value, exponent) = self.interpolation;
        link.write_and_confirm(node, Object::entry(0x60C2, 1), value)?;
        link.write_and_confirm(node, Object::entry(0x60C2, 2), exponent)?;
        let target = self.target_pdo(file);
        for number in 2..=MAX_PDOS {
            link.switch_off_pdo(node, PdoDirection::Receive, number)?;
        }
        link.configure_pdo(node, &target)?;
        write_tpdos(link, node, file)
    }

    /// Speeds and accelerations of homing and of the way to the start position.
    pub(super) fn write_profiles(&self, link: &mut Link) -> Result<(), CanopenError> {
        let (node, gearing) = (self.motor.node, &self.gearing);
        let (homing, start) = (&self.motor.homing, &self.motor.go_to_start);
        let writes: [(Object, Value); 8] = [
            (Object::plain(0x6098), homing.method.into()),
            (Object::entry(0x6099, 1), gearing.length(homing.fast_rad_s).into()),
            (Object::entry(0x6099, 2), gearing.length(homing.slow_rad_s).into()),
            (Object::plain(0x609A), gearing.length(homing.acceleration_rad_s2).into()),
            (Object::plain(0x607C), gearing.to_drive(JointAngle(homing.offset_rad)).0.into()),
            (Object::plain(0x6081), gearing.length(start.speed_rad_s).into()),
            (Object::plain(0x6083), gearing.length(start.acceleration_rad_s2).into()),
            (Object::plain(0x6084), gearing.length(start.acceleration_rad_s2).into()),
        ];
        writes.into_iter().try_for_each(|(object, value)| link.write_and_confirm(node, object, value))
    }

    /// The frame that carries the target.
    fn target_pdo(&self, file: &CanRigFile) -> Pdo {
        let mut mapped = vec![(Object::plain(0x6040), 2), (Object::plain(0x607A), 4)];
        mapped.extend(file.display.map(|display| (display.object, display.kind.bytes())));
        Pdo {
            direction: PdoDirection::Receive,
            number: 1,
            id: self.target_id(),
            mapped,
            deadline_ms: self.motor.target_wait_ms,
        }
    }
}

/// 607Dh, 6072h, 6065h, 6066h and 6080h. A turned gear swaps the end stops.
fn limit_objects(gearing: &Gearing, limits: &HandleLimits) -> [(Object, Value); 6] {
    let ends = limits.angle_rad.map(|rad| gearing.to_drive(JointAngle(rad)));
    [
        (Object::entry(0x607D, 1), ends[0].min(ends[1]).0.into()),
        (Object::entry(0x607D, 2), ends[0].max(ends[1]).0.into()),
        (Object::plain(0x6072), gearing.drive_torque(JointTorque(limits.motor_torque_nm)).0.into()),
        (Object::plain(0x6065), gearing.length(limits.following_error_rad).into()),
        (Object::plain(0x6066), limits.following_error_ms.into()),
        (Object::plain(0x6080), gearing.motor_rpm(limits.speed_rad_s).into()),
    ]
}
