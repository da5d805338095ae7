//! A CiA 402 drive as the motor of a rig: cyclic synchronous position between SYNCs.

use std::time::{Duration, Instant};

use super::device::Cia402;
use crate::rig::can::bus::Frame;
use crate::rig::can::canopen::{DataType, ErrorPolicy, Link, MonitoredNode, NmtCommand, Object, cob};
use crate::rig::can::cia402_state::{DriveState, Mode, Statusword};
use crate::rig::can::device_setup::identify;
use crate::rig::can::drive::{Drive, DriveRequest, MotionMonitor, PowerState};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::{HandleLimits, LimitsConfirmed};
use crate::rig::can::pdo_decoder::Readings;
use crate::rig::can::sensors::start_nodes;
use crate::rig::can::units::{Counts, JointAngle};

/// Speed at which the cycle goes what the drive's own positioning has left over, rad/s.
const APPROACH_SPEED_RAD_S: f64 = 0.02;

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
        self.check_scale(link)?;
        self.keeps_limits = match self.written {
            Some(written) => self.keeps_limits(link, &written)?,
            None => false,
        };
        self.reset_fault(link)?;
        self.confirm_no_power(link)?;
        self.written = None;
        self.write_watchdogs(link, file)?;
        self.write_limits(link, limits)?;
        self.write_profiles(link)?;
        self.write_frames(link, file)?;
        self.sensors.prepare(link, file)?;
        self.written = Some(*limits);
        Ok(LimitsConfirmed::by_reading_back())
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
        self.home(link, self.keeps_limits, monitor)?;
        self.confirm_limits(link, limits)?;
        self.go_to_start(link, monitor)?;
        self.set_mode(link, Mode::CyclicSynchronousPosition)?;
        self.seen = self.ask_status(link)?.state();
        Ok(())
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

    fn handle_frame(&mut self, _frame: &Frame, _now: Instant) -> Result<bool, CanFault> {
        Ok(false)
    }

    fn has_replied(&self) -> bool {
        true
    }

    fn angle(&self, readings: &Readings, sample: usize) -> JointAngle {
        let JointAngle(at_sync) = self.gearing.from_drive(Counts(readings.position));
        let JointAngle(one) = self.gearing.from_drive(Counts(1));
        JointAngle(at_sync + readings.steps[sample] * one)
    }

    fn check(&self, readings: &Readings, _now: Instant) -> Result<(), CanFault> {
        let status = Statusword(readings.statusword);
        let (state, statusword) = (status.state(), status.0);
        if state != DriveState::OperationEnabled {
            return Err(CanFault::NotEnabled { state, statusword });
        }
        if status.internal_limit() || !status.mode_bit_12() || status.mode_bit_13() {
            return Err(CanFault::DriveLimit { statusword });
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

    fn approach_speed_rad_s(&self) -> f64 {
        APPROACH_SPEED_RAD_S
    }

    fn period_complete(&mut self, readings: &Readings) {
        self.seen = Statusword(readings.statusword).state();
    }

    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.confirm_no_power(link)?;
        // From here on it need not mind us, and sends nothing but heartbeats.
        for node in self.monitored_nodes() {
            link.nmt(NmtCommand::EnterPreOperational, node.node)?;
        }
        Ok(link.write(self.motor.node, Object::entry(0x1016, 1), 0u32)?)
    }
}

/// A stretched cycle would make a real motor jerk from target to target.
fn check_emulated(link: &mut Link, node: u8) -> Result<(), CanFault> {
    let name = link.read_bytes(node, Object::plain(0x1008))?;
    if name.starts_with(b"canbench") { Ok(()) } else { Err(CanFault::NotTheBench { node }) }
}
