//! A CiA 402 drive as the motor of a rig: cyclic synchronous position between SYNCs.

use std::time::{Duration, Instant};

use super::device::Cia402;
use super::object_setup::ObjectSetup;
use super::power::{DRIVE_STATE_TIMEOUT, OBEDIENCE_TIMEOUT};
use super::restart::{ARMED, BEING_ARMED};
use crate::rig::Origin;
use crate::rig::can::bus::{Arrival, Frame};
use crate::rig::can::canopen::{
    CanopenError, DataType, ErrorPolicy, Link, MonitoredNode, NmtCommand, Object, cob,
};
use crate::rig::can::cia402_state::{DriveState, Mode, Statusword};
use crate::rig::can::device_setup::identify;
use crate::rig::can::drive::{
    Drive, DriveRequest, HANDLE_AT_START_RAD, MotionMonitor, OriginReport, PowerState, leave_to_watchdog,
};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::finding::ObjectFinding;
use crate::rig::can::limits::{HandleLimits, LimitsConfirmed};
use crate::rig::can::pdo_decoder::Readings;
use crate::rig::can::sensors::start_nodes;
use crate::rig::can::target_motion::Profile;
use crate::rig::can::units::{Counts, JointAngle};

impl Drive for Cia402 {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault> {
        let node = self.motor.node;
        for node in self.monitored_nodes() {
            link.nmt(NmtCommand::EnterPreOperational, node.node)?;
        }
        identify(link, node, &self.motor.identity)?;
        if file.bench.is_some() {
            check_emulated(link, node)?;
        }
        let mut setup = ObjectSetup::new(link, node);
        let outcome = self.set_up(&mut setup, file, limits);
        self.findings = setup.into_findings();
        outcome?;
        self.sensors.prepare(link, file)?;
        self.written = Some(*limits);
        self.was_remote = false;
        Ok(LimitsConfirmed::by_reading_back())
    }

    fn findings(&self) -> &[ObjectFinding] {
        &self.findings
    }

    fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        let timeout = Duration::from_millis(u64::from(self.motor.heartbeat_wait_ms));
        std::iter::once(MonitoredNode { node: self.motor.node, timeout })
            .chain(self.sensors.monitored_nodes())
            .collect()
    }

    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        start_nodes(link, &self.monitored_nodes())?;
        link.set_error_policy(ErrorPolicy::Fault);
        self.check_not_restarted(link)?;
        let has_origin = self.homed && self.takes_present_position();
        if has_origin && !self.shows_lost_origin() {
            let angle_rad = self.ask_angle(link)?;
            if angle_rad.abs() > HANDLE_AT_START_RAD {
                return Err(CanFault::OriginNotConfirmed { angle_rad });
            }
        }
        if !has_origin {
            // Whatever ends this, nobody may take the place where the handle happens to be for an origin.
            self.write_mark(link, BEING_ARMED)?;
        }
        self.home(link, limits, monitor)?;
        if !has_origin {
            // It had power meanwhile, and lost it again.
            self.keeps_mark = Some(self.mark(link)? == Some(BEING_ARMED));
            self.write_mark(link, ARMED)?;
        }
        self.confirm_limits(link, limits)?;
        self.set_mode(link, Mode::CyclicSynchronousPosition)?;
        self.seen = self.ask_status(link)?.state();
        self.check_not_restarted(link)
    }

    fn send_target(
        &mut self,
        link: &mut Link,
        target: JointAngle,
        shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault> {
        let Some(word) = self.controlword(request) else { return Ok(()) };
        let Counts(counts) = self.gearing.to_drive(target);
        let mut data = [0u8; 8];
        data[..2].copy_from_slice(&word.0.to_le_bytes());
        DataType::I32.write(f64::from(counts), &mut data[2..]);
        let mut length = 6;
        if let Some(display) = self.display {
            display.kind.write(shown_nm / display.nm_per_count, &mut data[6..]);
            length += display.kind.bytes();
        }
        Ok(link.send(&Frame::new(self.target_id(), &data[..length.min(8)]))?)
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        Ok(link.send(&Frame::new(cob::SYNC, &[]))?)
    }

    fn handle_frame(&mut self, _frame: &Frame, _arrival: Arrival) -> Result<bool, CanFault> {
        Ok(false)
    }

    fn has_replied(&self) -> bool {
        true
    }

    fn angle(&self, readings: &Readings, sample: usize) -> JointAngle {
        let JointAngle(at_sync) = self.gearing.from_drive(Counts(readings.position));
        JointAngle(at_sync + readings.steps[sample] * self.gearing.count_rad())
    }

    fn check(&self, readings: &Readings, _now: Instant) -> Result<(), CanFault> {
        let status = Statusword(readings.statusword);
        let (state, statusword) = (status.state(), status.0);
        if state != DriveState::OperationEnabled {
            return Err(CanFault::NotEnabled { state, statusword });
        }
        self.check_remote(status)?;
        // A drive that is at a limit, or too far from its target, may say besides that it does not follow.
        if status.internal_limit() || status.mode_bit_13() {
            return Err(CanFault::DriveLimit { statusword });
        }
        if !status.mode_bit_12() {
            return Err(CanFault::TargetIgnored { statusword });
        }
        Ok(())
    }

    fn power(&self, readings: &Readings) -> PowerState {
        match Statusword(readings.statusword).state() {
            DriveState::OperationEnabled => PowerState::Following,
            state if state.has_power() => PowerState::Changing,
            _ => PowerState::Off,
        }
    }

    /// To the next SYNC, and through the drive's interpolation.
    fn target_delay_periods(&self) -> usize {
        2
    }

    fn approach(&self) -> Profile {
        let start = self.motor.go_to_start;
        Profile { speed_rad_s: start.speed_rad_s, acceleration_rad_s2: start.acceleration_rad_s2 }
    }

    fn stops_by_itself(&self) -> Option<f64> {
        Some(self.motor.quick_stop_rad_s2)
    }

    /// A drive that reacts to a fault brakes by itself, and minds no controlword meanwhile.
    fn obeys(&self, readings: &Readings, request: DriveRequest) -> bool {
        let state = Statusword(readings.statusword).state();
        match request {
            DriveRequest::QuickStop => state != DriveState::OperationEnabled,
            DriveRequest::RemovePower => !state.must_obey(),
            DriveRequest::Enable | DriveRequest::Follow | DriveRequest::None => true,
        }
    }

    fn angle_resolution_rad(&self) -> f64 {
        self.gearing.count_rad().abs()
    }

    fn period_complete(&mut self, readings: &Readings) {
        let status = Statusword(readings.statusword);
        self.seen = status.state();
        self.was_remote |= status.is_remote();
    }

    fn takes_present_position(&self) -> bool {
        self.motor.homing.takes_present_position()
    }

    fn homes_by_moving(&self) -> bool {
        !self.motor.homing.takes_present_position()
    }

    /// One that keeps its mark has lost it after a restart. The limits show nothing: a memory may keep them.
    fn shows_lost_origin(&self) -> bool {
        self.keeps_mark.unwrap_or(true)
    }

    /// A drive that was not restarted still has the limits and the mark that were written when it was armed. One that takes no mark may
    /// have been restarted while nobody listened, and keep its limits.
    fn ask_origin(
        &mut self,
        link: &mut Link,
        _file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<OriginReport, CanFault> {
        identify(link, self.motor.node, &self.motor.identity)?;
        let mut setup = ObjectSetup::new(link, self.motor.node);
        self.check_units(&mut setup)?;
        setup.first_fault()?;
        let takes_mark = self.mark(link)?.is_some();
        self.keeps_mark = Some(takes_mark);
        let is_lost = self.shows_restart(link, limits, takes_mark)? || self.shows_sensor_error(link)?;
        let is_kept = (is_lost || takes_mark).then_some(!is_lost);
        Ok(OriginReport { is_kept, angle: Some(JointAngle(self.ask_angle(link)?)) })
    }

    fn adopt_origin(&mut self, limits: &HandleLimits) {
        self.homed = true;
        self.written = Some(*limits);
    }

    fn origin(&self) -> Origin {
        self.origin
    }

    fn power_off(&mut self, link: &mut Link) -> Result<Option<CanFault>, CanFault> {
        let node = self.motor.node;
        let mut disobedience = None;
        match self.confirm_no_power(link, OBEDIENCE_TIMEOUT) {
            Err(CanFault::Canopen(CanopenError::SdoSilent { .. })) => {
                // A stopped node answers no SDO. While it is asked again, its own watchdog may act.
                link.set_own_heartbeat(None);
                link.nmt(NmtCommand::EnterPreOperational, node)?;
                self.confirm_no_power(link, DRIVE_STATE_TIMEOUT)?;
            }
            Err(CanFault::PowerNotConfirmed) => {
                leave_to_watchdog(link, &[node]);
                // Only a node that is not stopped answers whether it has power.
                link.nmt(NmtCommand::EnterPreOperational, node)?;
                self.confirm_no_power(link, DRIVE_STATE_TIMEOUT)?;
                disobedience =
                    Some(CanFault::PowerOffIgnored { waited_ms: OBEDIENCE_TIMEOUT.as_millis() as u64 });
            }
            outcome => outcome?,
        }
        let _ = self.forget_origin_after_sensor_error(link);
        // There is no power. From here on it need not mind us, and sends nothing but heartbeats; if that fails, it goes to
        // its fault state when our heartbeat ends.
        for node in self.monitored_nodes() {
            let _ = link.nmt(NmtCommand::EnterPreOperational, node.node);
        }
        let _ = link.write(node, Object::entry(0x1016, 1), 0u32);
        Ok(disobedience)
    }
}

impl Cia402 {
    /// A drive that minded its controlword, and does not any more, is commanded by somebody else. One that never says so is taken as
    /// it is.
    ///
    /// # Errors
    /// [`CanFault::LocalControl`]
    pub(super) fn check_remote(&self, status: Statusword) -> Result<(), CanFault> {
        if self.was_remote && !status.is_remote() {
            return Err(CanFault::LocalControl { statusword: status.0 });
        }
        Ok(())
    }

    /// Units first, which all else rests on; then everything that is written, so that all refusals are known at once.
    fn set_up(
        &mut self,
        setup: &mut ObjectSetup<'_>,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<(), CanFault> {
        self.check_units(setup)?;
        let units = setup.first_fault();
        self.was_restarted |= match self.written.filter(|_| units.is_ok()) {
            Some(written) => self.shows_restart(setup.link, &written, self.keeps_mark == Some(true))?,
            None => self.homed,
        };
        self.forget_origin_after_sensor_error(setup.link)?;
        // From here on a boot-up message says that the drive has lost what is written now, and an error of its sensor the origin.
        setup.link.forget_boot_up(self.motor.node);
        setup.link.forget_sensor_error(self.motor.node);
        self.reset_fault(setup.link)?;
        self.confirm_no_power(setup.link, DRIVE_STATE_TIMEOUT)?;
        // Before anything is written that would hide it from the next who asks.
        self.check_origin()?;
        self.written = None;
        self.write_watchdogs(setup, file)?;
        self.write_limits(setup, limits)?;
        self.write_homing(setup)?;
        self.write_frames(setup, file)?;
        setup.first_fault()
    }
}

/// A stretched cycle would make a real motor jerk from target to target.
fn check_emulated(link: &mut Link, node: u8) -> Result<(), CanFault> {
    let name = link.read_bytes(node, Object::plain(0x1008))?;
    if name.starts_with(b"canbench") { Ok(()) } else { Err(CanFault::NotTheBench { node }) }
}
