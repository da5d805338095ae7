//! What the cycle asks of an axis, in CANSimple.

use std::time::{Duration, Instant};

use super::axis::{AXIS_REPLY_TIMEOUT, AXIS_STATE_TIMEOUT, AxisCommand, Cansimple};
use super::endpoints::AxisLimits;
use super::frame::{CLOSED_LOOP_CONTROL, IDLE, PASSTHROUGH, POSITION_CONTROL, command, pair};
use crate::rig::can::bus::{Arrival, Frame};
use crate::rig::can::canopen::{CanopenError, ErrorPolicy, Link, MonitoredNode, cob};
use crate::rig::can::drive::{
    Drive, DriveRequest, HANDLE_AT_START_RAD, MotionMonitor, OriginReport, PowerState,
};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::{HandleLimits, LimitsConfirmed};
use crate::rig::can::pdo_decoder::Readings;
use crate::rig::can::target_motion::Profile;
use crate::rig::can::units::JointAngle;
use crate::rig::{Channel, Origin};

impl Drive for Cansimple {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault> {
        self.check.restart();
        self.probe = None;
        self.send_state(link, IDLE)?;
        self.check_version(link)?;
        if self.zeroed && !self.keeps_settings(link, file, limits)? {
            return Err(CanFault::OriginLost);
        }
        let axis_limits = AxisLimits::of(self, limits);
        self.prove_endpoints(link, axis_limits)?;
        let identity = self.identity(link)?;
        self.proof.identify(identity)?;
        self.write_settings(link, file, limits)?;
        self.send_command(link, command::CLEAR_ERRORS, &[0])?;
        let modes = pair(POSITION_CONTROL.to_le_bytes(), PASSTHROUGH.to_le_bytes());
        self.send_command(link, command::SET_CONTROLLER_MODE, &modes)?;
        self.sensors.prepare(link, file)?;
        Ok(LimitsConfirmed::by_reading_back())
    }

    fn proved(&self) -> Option<&str> {
        self.proof.line()
    }

    fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        self.sensors.monitored_nodes()
    }

    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        self.sensors.start(link)?;
        self.send_command(link, command::CLEAR_ERRORS, &[0])?;
        self.origin = Origin::at_arming(self.motor.zero_here, self.zeroed);
        let is_new = self.motor.zero_here && !self.zeroed;
        if is_new {
            self.send_command(link, command::SET_ABSOLUTE_POSITION, &0f32.to_le_bytes())?;
        }
        let angle_rad = self.look(link)?;
        // An axis of another firmware may take no position, and one with the old settings may have been restarted.
        if self.motor.zero_here && !(-HANDLE_AT_START_RAD..=HANDLE_AT_START_RAD).contains(&angle_rad) {
            return Err(if is_new {
                CanFault::OriginNotTaken { angle_rad }
            } else {
                CanFault::OriginNotConfirmed { angle_rad }
            });
        }
        self.zeroed = self.motor.zero_here;
        self.wait_for_heartbeat(link)?;
        link.set_error_policy(ErrorPolicy::Fault);
        limits.check_place(JointAngle(angle_rad))?;
        if self.proof.is_proved() {
            return Ok(());
        }
        let proved = self.prove_watchdog(link, limits, monitor);
        self.probe = None;
        self.next = AxisCommand::Silence;
        let left = self.send_state(link, IDLE);
        proved?;
        left?;
        // The errors that the watchdog left are gone before the cycle looks at them.
        self.wait_for_heartbeat(link)?;
        self.proof.pass();
        Ok(())
    }

    fn send_target(
        &mut self,
        _link: &mut Link,
        target: JointAngle,
        _shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault> {
        let turns = self.to_turns(target);
        if !turns.is_finite() && request != DriveRequest::None && request != DriveRequest::RemovePower {
            return Err(CanFault::NotANumber { channel: Channel::Angle });
        }
        self.next = match request {
            DriveRequest::None => AxisCommand::Silence,
            // It has no ramp of its own to stop on; asked for one, it is without power.
            DriveRequest::RemovePower | DriveRequest::QuickStop => AxisCommand::Idle,
            DriveRequest::Enable if self.wanted != CLOSED_LOOP_CONTROL => AxisCommand::Enable(turns),
            DriveRequest::Enable | DriveRequest::Follow => AxisCommand::Follow(turns),
        };
        Ok(())
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.has_replied = false;
        match self.probe.unwrap_or(self.next) {
            AxisCommand::Silence => {}
            AxisCommand::Idle => self.send_state(link, IDLE)?,
            // Only Enable closes the loop; a target to an axis that let go moves nothing.
            AxisCommand::Follow(turns) => self.send_position(link, turns)?,
            AxisCommand::Enable(turns) => {
                self.send_position(link, turns)?;
                self.send_state(link, CLOSED_LOOP_CONTROL)?;
                self.send_position(link, turns)?;
            }
        }
        link.send(&Frame::new(cob::SYNC, &[]))?;
        self.synced = link.now();
        Ok(())
    }

    fn handle_frame(&mut self, frame: &Frame, arrival: Arrival) -> Result<bool, CanFault> {
        if frame.id >> 5 != u16::from(self.motor.node) {
            return Ok(false);
        }
        match (frame.id & 0x1F, frame.data()) {
            (command::AXIS_HEARTBEAT, [a, b, c, d, state, ..]) => {
                self.errors = u32::from_le_bytes([*a, *b, *c, *d]);
                self.state = *state;
                self.heard = Some(arrival.latest);
            }
            (command::ENCODER_ESTIMATES, [a, b, c, d, _, _, _, _]) => {
                let turns = f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
                self.check.believe(self.handle_rad(turns), arrival)?;
                self.estimates.add(turns, arrival.latest);
                // One from before SYNC is no answer to it.
                self.has_replied = arrival.latest > self.synced;
            }
            // Newer firmware may mark the confirmation of a write with its opcode.
            (command::TX_SDO, [_, low, high, _, value @ ..]) => {
                let mut bytes = [0; 4];
                let length = value.len().min(4);
                bytes[..length].copy_from_slice(&value[..length]);
                self.endpoint = Some((u16::from_le_bytes([*low, *high]), bytes));
            }
            (command::GET_VERSION, [_, a, b, c, d, e, f, ..]) => {
                self.version = Some([*a, *b, *c, *d, *e, *f]);
            }
            (command::AXIS_HEARTBEAT | command::ENCODER_ESTIMATES, data) => {
                return Err(CanFault::Malformed { id: frame.id, length: data.len() as u8, expected: 8 });
            }
            _ => {}
        }
        Ok(true)
    }

    fn has_replied(&self) -> bool {
        self.has_replied
    }

    fn reply_id(&self) -> Option<u16> {
        Some(self.id(command::ENCODER_ESTIMATES))
    }

    fn angle(&self, _readings: &Readings, _sample: usize) -> JointAngle {
        JointAngle(self.handle_rad(self.estimates.turns_at(self.synced)))
    }

    fn check(&self, _readings: &Readings, now: Instant) -> Result<(), CanFault> {
        let silent = self.heard.map_or(Duration::MAX, |heard| now.saturating_duration_since(heard));
        if silent > Duration::from_millis(u64::from(self.motor.heartbeat_wait_ms)) {
            let after_ms = silent.as_millis().min(u128::from(u64::MAX)) as u64;
            return Err(CanopenError::HeartbeatLost { node: self.motor.node, after_ms }.into());
        }
        if self.errors != 0 || self.state != CLOSED_LOOP_CONTROL {
            return Err(CanFault::MotorError { code: self.errors });
        }
        Ok(())
    }

    fn power(&self, _readings: &Readings) -> PowerState {
        match (self.state, self.wanted) {
            (CLOSED_LOOP_CONTROL, CLOSED_LOOP_CONTROL) => PowerState::Following,
            (IDLE, _) => PowerState::Off,
            _ => PowerState::Changing,
        }
    }

    /// It goes there as soon as it is told.
    fn target_delay_periods(&self) -> usize {
        1
    }

    fn approach(&self) -> Profile {
        Profile::of_speed(self.motor.go_to_start_rad_s)
    }

    fn period_complete(&mut self, _readings: &Readings) {}

    fn takes_present_position(&self) -> bool {
        self.motor.zero_here
    }

    /// The motor has nothing that tells whether it was restarted.
    fn ask_origin(
        &mut self,
        link: &mut Link,
        _file: &CanRigFile,
        _limits: &HandleLimits,
    ) -> Result<OriginReport, CanFault> {
        self.check.restart();
        self.until(link, AXIS_REPLY_TIMEOUT, |axis| axis.check.angle_rad())?;
        Ok(OriginReport { is_kept: None, angle: self.check.angle_rad().map(JointAngle) })
    }

    fn adopt_origin(&mut self, _limits: &HandleLimits) {
        self.zeroed = true;
    }

    fn origin(&self) -> Origin {
        self.origin
    }

    fn power_off(&mut self, link: &mut Link) -> Result<Option<CanFault>, CanFault> {
        self.probe = None;
        self.send_state(link, IDLE)?;
        let asked = link.now();
        // A wrong position must not keep the program from seeing that the power is off.
        let deadline = asked + AXIS_STATE_TIMEOUT;
        while !(self.state == IDLE && self.heard > Some(asked)) {
            let Some(frame) = link.receive(deadline)? else { return Err(CanFault::PowerNotConfirmed) };
            let _ = self.handle_frame(&frame, link.arrival());
        }
        self.sensors.release(link)?;
        Ok(None)
    }
}
