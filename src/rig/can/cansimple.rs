//! ODrive's CANSimple: identifier = node << 5 | command, little-endian, position in turns, speed in turns/s.
//!
//! Limits and the watchdog are parameters ("endpoints") that are written and read back by number; the numbers change
//! with each firmware and come from the manufacturer's `flat_endpoints.json`.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::bus::Frame;
use super::canopen::{CanopenError, ErrorPolicy, Link, MonitoredNode, cob};
use super::drive::{Drive, DriveRequest, MotionMonitor, PowerState};
use super::fault::CanFault;
use super::file::{CanRigFile, CansimpleMotor};
use super::limits::{HandleLimits, LimitsConfirmed};
use super::pdo_decoder::Readings;
use super::sensors::Sensors;
use super::units::JointAngle;

mod command {
    pub const AXIS_HEARTBEAT: u16 = 0x01;
    pub const RX_SDO: u16 = 0x04;
    pub const TX_SDO: u16 = 0x05;
    pub const SET_AXIS_STATE: u16 = 0x07;
    pub const ENCODER_ESTIMATES: u16 = 0x09;
    pub const SET_CONTROLLER_MODE: u16 = 0x0B;
    pub const SET_INPUT_POS: u16 = 0x0C;
    pub const CLEAR_ERRORS: u16 = 0x18;
    pub const SET_ABSOLUTE_POSITION: u16 = 0x19;
}

const IDLE: u8 = 1;
const CLOSED_LOOP_CONTROL: u8 = 8;
const POSITION_CONTROL: u32 = 3;
const PASSTHROUGH: u32 = 1;
/// How long an axis may take for an answer, or to change its state.
const AXIS_REPLY_TIMEOUT: Duration = Duration::from_millis(300);
const AXIS_STATE_TIMEOUT: Duration = Duration::from_secs(2);

/// One axis.
#[derive(Debug)]
pub struct Cansimple {
    motor: CansimpleMotor,
    sensors: Sensors,
    zeroed: bool,
    target_turns: Option<f32>,
    wanted: u8,
    state: u8,
    errors: u32,
    /// When its latest heartbeat arrived.
    heard: Option<Instant>,
    has_replied: bool,
    position_turns: f64,
    endpoint: Option<(u16, [u8; 4])>,
}

impl Cansimple {
    /// The axis of a rig file; nothing is sent yet.
    pub fn new(motor: &CansimpleMotor, file: &CanRigFile) -> Self {
        Self {
            motor: motor.clone(),
            sensors: Sensors::new(file),
            zeroed: false,
            target_turns: None,
            wanted: IDLE,
            state: 0,
            errors: 0,
            heard: None,
            has_replied: false,
            position_turns: f64::NAN,
            endpoint: None,
        }
    }

    fn id(&self, command: u16) -> u16 {
        u16::from(self.motor.node) << 5 | command
    }

    fn send_command(&self, link: &mut Link, command: u16, data: &[u8]) -> Result<(), CanFault> {
        Ok(link.send(&Frame::new(self.id(command), data))?)
    }

    /// Writes an endpoint and reads it back.
    fn write(&mut self, link: &mut Link, endpoint: u16, value: [u8; 4]) -> Result<(), CanFault> {
        let [low, high] = endpoint.to_le_bytes();
        let [a, b, c, d] = value;
        self.send_command(link, command::RX_SDO, &[1, low, high, 0, a, b, c, d])?;
        self.send_command(link, command::RX_SDO, &[0, low, high, 0])?;
        self.endpoint = None;
        let (node, index) = (self.motor.node, endpoint);
        let read = self
            .until(link, AXIS_REPLY_TIMEOUT, |axis| axis.endpoint.filter(|(number, _)| *number == endpoint))?
            .ok_or(CanopenError::SdoSilent { node, index, sub: 0 })?
            .1;
        if read == value {
            return Ok(());
        }
        let [written, read] = [value, read].map(u32::from_le_bytes);
        Err(CanopenError::ValueNotAccepted { node, index, sub: 0, written, read }.into())
    }

    /// Listens until something is so, or `None` after a while.
    fn until<T>(
        &mut self,
        link: &mut Link,
        time: Duration,
        condition: impl Fn(&Self) -> Option<T>,
    ) -> Result<Option<T>, CanFault> {
        let deadline = link.now() + time;
        loop {
            if let Some(found) = condition(self) {
                return Ok(Some(found));
            }
            match link.receive(deadline)? {
                Some(frame) => drop(self.handle_frame(&frame, link.now())?),
                None => return Ok(condition(self)),
            }
        }
    }

    fn to_turns(&self, angle: JointAngle) -> f32 {
        (angle.0 * self.motor.gear_ratio / TAU) as f32
    }

    fn write_limits(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<(), CanFault> {
        let endpoints = self.motor.endpoints;
        let ratio = self.motor.gear_ratio.abs();
        let torque_nm = limits.motor_torque_nm / ratio;
        let float = |value: f64| (value as f32).to_le_bytes();
        let whole = |value: u16| u32::from(value).to_le_bytes();
        let writes = [
            (endpoints.vel_limit, float(limits.speed_rad_s * ratio / TAU)),
            (endpoints.torque_soft_max, float(torque_nm)),
            (endpoints.current_soft_max, float(torque_nm / self.motor.torque_constant_nm_per_a)),
            (endpoints.watchdog_timeout, float(f64::from(file.master.motor_waits_ms) * 1e-3)),
            (endpoints.heartbeat_msg_rate_ms, whole(self.motor.heartbeat_ms)),
            (endpoints.encoder_msg_rate_ms, whole(self.motor.encoder_ms)),
            // The watchdog last: every frame to the axis feeds it.
            (endpoints.enable_watchdog, [1, 0, 0, 0]),
        ];
        writes.into_iter().try_for_each(|(endpoint, value)| self.write(link, endpoint, value))
    }
}

impl Drive for Cansimple {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault> {
        self.send_command(link, command::SET_AXIS_STATE, &u32::from(IDLE).to_le_bytes())?;
        self.wanted = IDLE;
        self.write_limits(link, file, limits)?;
        self.send_command(link, command::CLEAR_ERRORS, &[0])?;
        let mut modes = [0u8; 8];
        modes[..4].copy_from_slice(&POSITION_CONTROL.to_le_bytes());
        modes[4..].copy_from_slice(&PASSTHROUGH.to_le_bytes());
        self.send_command(link, command::SET_CONTROLLER_MODE, &modes)?;
        self.sensors.prepare(link, file)?;
        Ok(LimitsConfirmed::by_reading_back())
    }

    fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        self.sensors.monitored_nodes()
    }

    fn start(
        &mut self,
        link: &mut Link,
        _limits: &HandleLimits,
        _lookout: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        self.sensors.start(link)?;
        self.send_command(link, command::CLEAR_ERRORS, &[0])?;
        if self.motor.zero_here && !self.zeroed {
            self.send_command(link, command::SET_ABSOLUTE_POSITION, &0f32.to_le_bytes())?;
            self.zeroed = true;
        }
        // Two reports after that, so that the position is one on the new scale, and no error that was cleared.
        for _ in 0..2 {
            self.has_replied = false;
            self.until(link, AXIS_STATE_TIMEOUT, |axis| axis.has_replied.then_some(()))?.ok_or(
                CanopenError::HeartbeatLost {
                    node: self.motor.node,
                    after_ms: AXIS_STATE_TIMEOUT.as_millis() as u64,
                },
            )?;
        }
        let before = link.now();
        self.until(link, AXIS_STATE_TIMEOUT, |axis| (axis.heard > Some(before)).then_some(()))?;
        link.set_error_policy(ErrorPolicy::Fault);
        Ok(())
    }

    fn send_target(
        &mut self,
        link: &mut Link,
        target: JointAngle,
        _shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault> {
        if request == DriveRequest::None {
            return Ok(());
        }
        self.target_turns = Some(self.to_turns(target));
        let wanted = if request == DriveRequest::RemovePower { IDLE } else { CLOSED_LOOP_CONTROL };
        if wanted != self.wanted {
            self.wanted = wanted;
            self.send_command(link, command::SET_AXIS_STATE, &u32::from(wanted).to_le_bytes())?;
        }
        Ok(())
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.has_replied = false;
        if let Some(turns) = self.target_turns.take() {
            let [a, b, c, d] = turns.to_le_bytes();
            self.send_command(link, command::SET_INPUT_POS, &[a, b, c, d, 0, 0, 0, 0])?;
        }
        Ok(link.send(&Frame::new(cob::SYNC, &[]))?)
    }

    fn handle_frame(&mut self, frame: &Frame, now: Instant) -> Result<bool, CanFault> {
        if frame.id >> 5 != u16::from(self.motor.node) {
            return Ok(false);
        }
        match (frame.id & 0x1F, frame.data()) {
            (command::AXIS_HEARTBEAT, [a, b, c, d, state, ..]) => {
                self.errors = u32::from_le_bytes([*a, *b, *c, *d]);
                self.state = *state;
                self.heard = Some(now);
            }
            (command::ENCODER_ESTIMATES, [a, b, c, d, _, _, _, _]) => {
                self.position_turns = f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
                self.has_replied = true;
            }
            (command::TX_SDO, [_, low, high, _, value @ ..]) => {
                let mut bytes = [0; 4];
                let length = value.len().min(4);
                bytes[..length].copy_from_slice(&value[..length]);
                self.endpoint = Some((u16::from_le_bytes([*low, *high]), bytes));
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

    fn angle(&self, _readings: &Readings, _sample: usize) -> JointAngle {
        JointAngle(self.position_turns * TAU / self.motor.gear_ratio)
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

    fn approach_speed_rad_s(&self) -> f64 {
        self.motor.go_to_start_rad_s
    }

    fn period_complete(&mut self, _readings: &Readings) {}

    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.wanted = IDLE;
        self.send_command(link, command::SET_AXIS_STATE, &u32::from(IDLE).to_le_bytes())?;
        let asked = link.now();
        self.until(link, AXIS_STATE_TIMEOUT, |axis| {
            (axis.state == IDLE && axis.heard > Some(asked)).then_some(())
        })?
        .ok_or(CanFault::PowerNotConfirmed)?;
        Ok(self.sensors.release(link)?)
    }
}
