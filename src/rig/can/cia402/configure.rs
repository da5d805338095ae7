//! Reads the drive's units, writes limits, watchdogs and frames, and reads every one back.

use super::device::Cia402;
use super::object_setup::{ObjectSetup, is_missing};
use crate::rig::can::canopen::pdo::{MAX_PDOS, Pdo, PdoDirection};
use crate::rig::can::canopen::{CanopenError, Link, Object, Value};
use crate::rig::can::device_setup::write_tpdos;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::units::{Gearing, JointAngle, JointTorque};

/// 60A8h: encoder increments.
const INCREMENTS: u32 = 0x00B5_0000;
/// 60A9h: increments a second.
const INCREMENTS_PER_S: u32 = 0x00B5_0300;
/// Of 60AAh: power of ten and numerator of the unit, without the unit of time.
const NUMERATOR: u32 = 0xFFFF_0000;
/// 607Eh: positions and speeds are reversed.
const REVERSED: u32 = 0xC0;

impl Cia402 {
    /// Every unit and scale that the drive tells must be that of the rig file: all limits rest on them.
    pub(super) fn check_units(&self, setup: &mut ObjectSetup<'_>) -> Result<(), CanopenError> {
        let counts = self.motor.counts_per_revolution;
        let is_needed = !self.motor.counts_checked_by_hand;
        let told = setup.read_needed(Object::entry(0x608F, 1), is_needed)?;
        if let (Some(read), Some(turns)) = (told, setup.read_needed(Object::entry(0x608F, 2), is_needed)?)
            && read != counts.saturating_mul(turns.max(1))
        {
            setup.wrong_device(Object::entry(0x608F, 1), read, counts);
        }
        let rated = (self.motor.rated_torque_nm * 1000.0).round() as u32;
        if let Some(read) = setup.read(Object::plain(0x6076))?.filter(|read| *read != rated) {
            setup.wrong_device(Object::plain(0x6076), read, rated);
        }
        if let Some(read) = setup.read(Object::plain(0x607E))?.filter(|read| read & REVERSED != 0) {
            setup.wrong_unit(Object::plain(0x607E), read, 0);
        }
        let position_unit = setup.read(Object::plain(0x60A8))?.unwrap_or(0);
        if ![0, INCREMENTS].contains(&position_unit) {
            setup.wrong_unit(Object::plain(0x60A8), position_unit, INCREMENTS);
        }
        if let Some(read) =
            setup.read(Object::plain(0x60A9))?.filter(|read| ![0, INCREMENTS_PER_S].contains(read))
        {
            setup.wrong_unit(Object::plain(0x60A9), read, INCREMENTS_PER_S);
        }
        if let Some(read) = setup.read(Object::plain(0x60AA))?
            && read != 0
            && read & NUMERATOR != INCREMENTS
        {
            setup.wrong_unit(Object::plain(0x60AA), read, INCREMENTS);
        }
        self.check_gear_and_feed(setup, position_unit)
    }

    /// 6091h and 6092h: the gear is that of the rig file, and must not stand in the drive too.
    fn check_gear_and_feed(
        &self,
        setup: &mut ObjectSetup<'_>,
        position_unit: u32,
    ) -> Result<(), CanopenError> {
        let pair = |setup: &mut ObjectSetup<'_>, index| -> Result<Option<(u32, u32)>, CanopenError> {
            let first = setup.read(Object::entry(index, 1))?;
            let second = setup.read(Object::entry(index, 2))?;
            Ok(first.zip(Some(second.unwrap_or(1))))
        };
        if let Some((motor_turns, shaft_turns)) = pair(setup, 0x6091)?
            && motor_turns != shaft_turns
        {
            setup.wrong_unit(Object::entry(0x6091, 1), motor_turns, shaft_turns);
        }
        let feed = pair(setup, 0x6092)?;
        // The feed constant is not used where positions are encoder increments, or where it is not set.
        if let Some((units, turns)) = feed.filter(|(units, _)| *units != 0 && position_unit != INCREMENTS) {
            let expected = self.motor.counts_per_revolution.saturating_mul(turns.max(1));
            if units != expected {
                setup.wrong_unit(Object::entry(0x6092, 1), units, expected);
            }
        }
        Ok(())
    }

    /// What stops the motor without this program's help.
    pub(super) fn write_watchdogs(
        &self,
        setup: &mut ObjectSetup<'_>,
        file: &CanRigFile,
    ) -> Result<(), CanopenError> {
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
        // A drive that is armed anew still minds us; one node may not stand there twice. A drive without it is found below.
        match setup.link.write(setup.node, Object::entry(0x1016, 1), 0u32) {
            Ok(()) | Err(CanopenError::SdoAborted { .. }) => {}
            Err(error) => return Err(error),
        }
        writes.into_iter().try_for_each(|(object, value)| setup.write(object, value, true))
    }

    /// What the drive itself holds against every motion.
    pub(super) fn write_limits(
        &self,
        setup: &mut ObjectSetup<'_>,
        limits: &HandleLimits,
    ) -> Result<(), CanopenError> {
        limit_objects(&self.gearing, limits)
            .into_iter()
            .try_for_each(|(object, value)| setup.write(object, value, true))
    }

    /// The limits once more: homing has moved the origin, and some drives forget with it.
    pub(super) fn confirm_limits(&self, link: &mut Link, limits: &HandleLimits) -> Result<(), CanopenError> {
        match self.first_limit_not_held(link, limits)? {
            None => Ok(()),
            Some(fault) => Err(fault),
        }
    }

    /// The first limit that the drive does not hold.
    pub(super) fn first_limit_not_held(
        &self,
        link: &mut Link,
        limits: &HandleLimits,
    ) -> Result<Option<CanopenError>, CanopenError> {
        let node = self.motor.node;
        for (object, value) in limit_objects(&self.gearing, limits) {
            let read = match link.read(node, object) {
                Ok(read) => read,
                // It was noted when the drive was set up, and is one that may be missing.
                Err(error) if is_missing(&error) => continue,
                Err(error) => return Err(error),
            };
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
    pub(super) fn write_frames(
        &self,
        setup: &mut ObjectSetup<'_>,
        file: &CanRigFile,
    ) -> Result<(), CanopenError> {
        let (value, exponent) = self.interpolation;
        setup.write(Object::entry(0x60C2, 1), value, true)?;
        // Without it the period is in milliseconds.
        setup.write(Object::entry(0x60C2, 2), exponent, exponent != -3)?;
        let (node, target) = (setup.node, self.target_pdo(file));
        for number in 2..=MAX_PDOS {
            let outcome = setup.link.switch_off_pdo(node, PdoDirection::Receive, number);
            setup.note_refusal(outcome)?;
        }
        let outcome = setup.link.configure_pdo(node, &target);
        setup.note_refusal(outcome)?;
        let outcome = write_tpdos(setup.link, node, file);
        setup.note_refusal(outcome)
    }

    /// Method, speeds and acceleration of homing.
    pub(super) fn write_homing(&self, setup: &mut ObjectSetup<'_>) -> Result<(), CanopenError> {
        let (gearing, homing) = (&self.gearing, &self.motor.homing);
        let moves = !homing.takes_present_position();
        let writes: [(Object, Value, bool); 5] = [
            (Object::plain(0x6098), homing.method.into(), true),
            (Object::entry(0x6099, 1), gearing.length(homing.fast_rad_s).into(), moves),
            (Object::entry(0x6099, 2), gearing.length(homing.slow_rad_s).into(), moves),
            (Object::plain(0x609A), gearing.length(homing.acceleration_rad_s2).into(), moves),
            // By the standard the origin is offset from home, by some drives home from the origin; and 607Dh may or may not count it.
            (Object::plain(0x607C), 0i32.into(), false),
        ];
        writes.into_iter().try_for_each(|(object, value, is_needed)| setup.write(object, value, is_needed))
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

/// 607Dh, 6072h, 6065h, 6066h and 6080h; and what the drive adds to its targets, which would move the motor beside the target that was
/// checked: 60B0h, 60B1h and 60B2h. A turned gear swaps the end stops.
fn limit_objects(gearing: &Gearing, limits: &HandleLimits) -> [(Object, Value); 9] {
    let ends = limits.angle_rad.map(|rad| gearing.to_drive(JointAngle(rad)));
    [
        (Object::entry(0x607D, 1), ends[0].min(ends[1]).0.into()),
        (Object::entry(0x607D, 2), ends[0].max(ends[1]).0.into()),
        (Object::plain(0x6072), gearing.drive_torque(JointTorque(limits.motor_torque_nm)).0.into()),
        (Object::plain(0x6065), gearing.length(limits.following_error_rad).into()),
        (Object::plain(0x6066), limits.following_error_ms.into()),
        (Object::plain(0x6080), gearing.motor_rpm(limits.speed_rad_s).into()),
        (Object::plain(0x60B0), 0i32.into()),
        (Object::plain(0x60B1), 0i32.into()),
        (Object::plain(0x60B2), 0i16.into()),
    ]
}
