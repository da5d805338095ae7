//! The axis: what it was told, what it reported, and how it is spoken to.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::estimates::Estimates;
use super::frame::{IDLE, command, pair};
use crate::rig::Origin;
use crate::rig::can::bus::Frame;
use crate::rig::can::canopen::{CanopenError, Link};
use crate::rig::can::drive::Drive;
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::{CanRigFile, CansimpleMotor};
use crate::rig::can::position_check::PositionCheck;
use crate::rig::can::proved_motor::ProvedMotor;
use crate::rig::can::sensors::Sensors;
use crate::rig::can::units::JointAngle;

/// How long an axis may take for an answer, or to change its state.
pub(super) const AXIS_REPLY_TIMEOUT: Duration = Duration::from_millis(300);
pub(super) const AXIS_STATE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long the confirmation of a write may take.
pub(super) const CONFIRMATION_TIMEOUT: Duration = Duration::from_millis(50);
/// Steps of an encoder, rad at the handle: what a believed reading may be off beyond its speed.
const ENCODER_SLACK_RAD: f64 = 0.002;

/// What goes to the axis with the next SYNC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AxisCommand {
    /// Nothing; the axis reports by itself.
    Silence,
    /// A target, turns.
    Follow(f32),
    /// A target, and then the power: the target is there before the loop closes.
    Enable(f32),
    /// No power.
    Idle,
}

/// One axis.
#[derive(Debug)]
pub struct Cansimple {
    pub(super) motor: CansimpleMotor,
    pub(super) sensors: Sensors,
    pub(super) motor_waits: Duration,
    /// It took the start position in this process.
    pub(super) zeroed: bool,
    /// How the start position was known at the latest arming.
    pub(super) origin: Origin,
    /// Whether the watchdog was seen to act.
    pub(super) proof: ProvedMotor,
    /// What the proof sends, instead of what the cycle asks for.
    pub(super) probe: Option<AxisCommand>,
    pub(super) next: AxisCommand,
    pub(super) wanted: u8,
    pub(super) state: u8,
    pub(super) errors: u32,
    /// When its latest heartbeat arrived.
    pub(super) heard: Option<Instant>,
    pub(super) has_replied: bool,
    pub(super) check: PositionCheck,
    pub(super) estimates: Estimates,
    /// When SYNC was sent.
    pub(super) synced: Instant,
    /// The latest answer about an endpoint.
    pub(super) endpoint: Option<(u16, [u8; 4])>,
    /// Whether the firmware confirms writes; `None` before the first.
    pub(super) confirms_writes: Option<bool>,
    /// Hardware and firmware.
    pub(super) version: Option<[u8; 6]>,
}

impl Cansimple {
    /// The axis of a rig file; nothing is sent yet.
    pub fn new(motor: &CansimpleMotor, file: &CanRigFile, now: Instant) -> Self {
        // Frames may be read up to a period after one another's time.
        let shortest = Duration::from_millis(u64::from(motor.encoder_ms));
        Self {
            motor: motor.clone(),
            sensors: Sensors::new(file),
            motor_waits: Duration::from_millis(u64::from(file.master.motor_waits_ms)),
            zeroed: false,
            origin: Origin::Found,
            proof: ProvedMotor::new(motor.proved_with_free_handle.as_deref()),
            probe: None,
            next: AxisCommand::Silence,
            wanted: IDLE,
            state: 0,
            errors: 0,
            heard: None,
            has_replied: false,
            check: PositionCheck::new(file.limits.speed_rad_s, ENCODER_SLACK_RAD, shortest),
            estimates: Estimates::default(),
            synced: now,
            endpoint: None,
            confirms_writes: None,
            version: None,
        }
    }

    pub(super) fn id(&self, command: u16) -> u16 {
        u16::from(self.motor.node) << 5 | command
    }

    pub(super) fn send_command(&self, link: &mut Link, command: u16, data: &[u8]) -> Result<(), CanFault> {
        Ok(link.send(&Frame::new(self.id(command), data))?)
    }

    pub(super) fn send_state(&mut self, link: &mut Link, state: u8) -> Result<(), CanFault> {
        self.wanted = state;
        self.send_command(link, command::SET_AXIS_STATE, &u32::from(state).to_le_bytes())
    }

    pub(super) fn send_position(&self, link: &mut Link, turns: f32) -> Result<(), CanFault> {
        self.send_command(link, command::SET_INPUT_POS, &pair(turns.to_le_bytes(), [0; 4]))
    }

    /// Listens until something is so, or `None` after a while.
    pub(super) fn until<T>(
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
                Some(frame) => drop(self.handle_frame(&frame, link.arrival())?),
                None => return Ok(condition(self)),
            }
        }
    }

    pub(super) fn to_turns(&self, angle: JointAngle) -> f32 {
        (angle.0 * self.motor.gear_ratio / TAU) as f32
    }

    pub(super) fn handle_rad(&self, turns: f64) -> f64 {
        turns * TAU / self.motor.gear_ratio
    }

    /// Two reports from now on: the position is one on the present scale, and the shaft's speed is known.
    pub(super) fn look(&mut self, link: &mut Link) -> Result<f64, CanFault> {
        self.check.restart();
        self.estimates.restart();
        for _ in 0..2 {
            self.has_replied = false;
            self.until(link, AXIS_STATE_TIMEOUT, |axis| axis.has_replied.then_some(()))?.ok_or(
                CanopenError::HeartbeatLost {
                    node: self.motor.node,
                    after_ms: AXIS_STATE_TIMEOUT.as_millis() as u64,
                },
            )?;
        }
        Ok(self.check.angle_rad().unwrap_or(f64::NAN))
    }

    /// A heartbeat after now.
    pub(super) fn wait_for_heartbeat(&mut self, link: &mut Link) -> Result<(), CanFault> {
        let before = link.now();
        let heard = self.until(link, AXIS_STATE_TIMEOUT, |axis| (axis.heard > Some(before)).then_some(()))?;
        let after_ms = AXIS_STATE_TIMEOUT.as_millis() as u64;
        heard.ok_or(CanopenError::HeartbeatLost { node: self.motor.node, after_ms }.into())
    }
}
