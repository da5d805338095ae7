//! The motor: what it was told, what it reported, and how it is spoken to.

use std::time::{Duration, Instant};

use super::frame::{FieldRanges, LEAVE, MitReply, MotorCommand, ZERO};
use crate::rig::Origin;
use crate::rig::can::bus::Frame;
use crate::rig::can::canopen::Link;
use crate::rig::can::drive::Drive;
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::{CanRigFile, MitMotor};
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::position_check::PositionCheck;
use crate::rig::can::sensors::Sensors;

/// How long a motor may take to reply to a special frame.
pub(super) const MIT_REPLY_TIMEOUT: Duration = Duration::from_millis(100);
pub(super) const MIT_ATTEMPTS: usize = 5;
/// Periods in a row in which the reported speed must not be that of the position.
const DISAGREEMENTS: u32 = 3;
/// Part by which reported speed and the slope of the position may differ.
const REPORTED_SPEED_TOLERANCE: f64 = 0.3;

/// What goes to the motor with the next SYNC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MitCommand {
    /// LEAVE: no power, and the motor reports.
    Leave,
    /// Motor mode, without any torque.
    Enter,
    /// A command in motor mode.
    Act(MotorCommand),
    /// Nothing at all.
    Silence,
}

/// A motor in MIT mode.
#[derive(Debug)]
pub struct Mit {
    pub(super) motor: MitMotor,
    pub(super) ranges: FieldRanges,
    pub(super) sensors: Sensors,
    pub(super) limits: Option<HandleLimits>,
    pub(super) period: Duration,
    /// Longest time between two commands; after it the motor is only told to let go.
    pub(super) longest_silence: Duration,
    pub(super) motor_waits: Duration,
    pub(super) zeroed: bool,
    /// How the start position was known at the latest arming.
    pub(super) origin: Origin,
    /// The small motion was made.
    pub(super) is_proved: bool,
    pub(super) in_motor_mode: bool,
    pub(super) following: bool,
    /// What the small motion sends, instead of what the cycle asks for.
    pub(super) probe: Option<MitCommand>,
    pub(super) next: MitCommand,
    /// Latest target, rad at the handle, for the speed of the next.
    pub(super) target_rad: Option<f64>,
    pub(super) check: PositionCheck,
    /// The last angle that passed every check, rad at the handle.
    pub(super) trusted_rad: Option<f64>,
    pub(super) has_replied: bool,
    pub(super) reply: Option<MitReply>,
    /// When the motor was last sent something.
    pub(super) sent: Instant,
    /// Reply of the period before, and when the motor was asked for it.
    pub(super) before: Option<(MitReply, Instant)>,
    pub(super) disagreements: u32,
    /// What the reply says that must not be.
    pub(super) disagreement: Option<CanFault>,
}

impl Mit {
    /// The motor of a rig file; nothing is sent yet.
    pub fn new(motor: &MitMotor, file: &CanRigFile, now: Instant) -> Self {
        let ranges = FieldRanges::of(motor);
        let period = Duration::from_micros(u64::from(file.period_us));
        let motor_waits = Duration::from_millis(u64::from(file.master.motor_waits_ms));
        let tolerated = file.tolerate.missed_cycles_in_a_row.saturating_add(2);
        Self {
            motor: motor.clone(),
            ranges,
            sensors: Sensors::new(file),
            limits: None,
            period,
            longest_silence: period.saturating_mul(tolerated).min(motor_waits),
            motor_waits,
            zeroed: false,
            origin: Origin::Found,
            is_proved: motor.proved_with_free_handle,
            in_motor_mode: false,
            following: false,
            probe: None,
            next: MitCommand::Leave,
            target_rad: None,
            check: PositionCheck::new(
                file.limits.speed_rad_s,
                4.0 * ranges.position_step_rad() / motor.gear_ratio.abs(),
                period,
            ),
            trusted_rad: None,
            has_replied: false,
            reply: None,
            sent: now,
            before: None,
            disagreements: 0,
            disagreement: None,
        }
    }

    /// Whether the limits can be reached within the ranges of the motor's fields.
    pub(super) fn check_reach(&self, limits: &HandleLimits) -> Result<(), CanFault> {
        let ratio = self.motor.gear_ratio.abs();
        let torque_nm = limits.motor_torque_nm / ratio;
        let reach_rad = torque_nm / self.motor.kp_nm_per_rad;
        let angle_rad = limits.angle_rad.iter().fold(0.0, |most: f64, angle| most.max(angle.abs()));
        for (what, needed, range) in [
            ("position", angle_rad * ratio + reach_rad, self.ranges.position_rad),
            ("speed", limits.speed_rad_s * ratio, self.ranges.speed_rad_s),
            ("kp", self.motor.kp_nm_per_rad, self.ranges.kp),
            ("kd", self.motor.kd_nm_s_per_rad, self.ranges.kd),
        ] {
            // Written so that a number that is none is beyond as well.
            if needed.is_nan() || needed >= range * 1.000_001 {
                return Err(CanFault::BeyondMotorRange { what, needed, range });
            }
        }
        Ok(())
    }

    pub(super) fn send_raw(&mut self, link: &mut Link, data: &[u8; 8]) -> Result<(), CanFault> {
        self.sent = link.now();
        Ok(link.send(&Frame::new(self.motor.id, data))?)
    }

    /// No torque, whatever the motor was told before: a command without gains.
    pub(super) fn send_no_gains(&mut self, link: &mut Link) -> Result<(), CanFault> {
        let position_rad = self.reply.map_or(0.0, |reply| reply.position_rad);
        let frame = self.ranges.encode(&MotorCommand { position_rad, ..MotorCommand::default() })?;
        self.send_raw(link, &frame)
    }

    /// Takes the power: first the gains, so that nothing is left that could act when it is switched on again.
    pub(super) fn send_leave(&mut self, link: &mut Link) -> Result<(), CanFault> {
        let had_gains = std::mem::take(&mut self.in_motor_mode);
        self.following = false;
        let cleared = if had_gains { self.send_no_gains(link) } else { Ok(()) };
        self.send_raw(link, &LEAVE)?;
        cleared
    }

    /// Leaves motor mode and waits for the reply, or makes this position zero.
    pub(super) fn ask(&mut self, link: &mut Link, special: &[u8; 8]) -> Result<MitReply, CanFault> {
        for _ in 0..MIT_ATTEMPTS {
            // Nobody knows what it was told before.
            self.in_motor_mode = true;
            self.send_leave(link)?;
            if *special != LEAVE {
                self.send_raw(link, special)?;
            }
            // The replies to all of them: the last one counts.
            self.has_replied = false;
            let deadline = link.now() + MIT_REPLY_TIMEOUT;
            let mut quiet = deadline;
            while let Some(frame) = link.receive(quiet)? {
                // Its replies are on the old scale, then on the new one.
                if *special == ZERO {
                    self.check.restart();
                }
                if self.handle_frame(&frame, link.arrived())? && self.has_replied {
                    quiet = deadline.min(link.now() + MIT_REPLY_TIMEOUT / 10);
                }
            }
            if let Some(reply) = self.reply.filter(|_| self.has_replied) {
                return Ok(reply);
            }
        }
        Err(CanFault::MissedCycle { in_a_row: MIT_ATTEMPTS as u32, tolerated: 0, id: self.motor.reply_id })
    }

    /// The present position becomes the start position.
    pub(super) fn make_zero(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.ask(link, &ZERO)?;
        // What was on the way was on the old scale.
        self.check.restart();
        self.trusted_rad = None;
        let reply = self.ask(link, &LEAVE)?;
        let off_rad = reply.position_rad / self.motor.gear_ratio;
        if off_rad.abs() > 0.01 + 4.0 * self.ranges.position_step_rad() / self.motor.gear_ratio.abs() {
            return Err(CanFault::NotAtStart { off_rad });
        }
        self.zeroed = true;
        Ok(())
    }

    /// A command towards a target: no further from the last trusted angle than the torque limit allows, with the speed of
    /// the target, so that a ramp is followed at its speed.
    pub(super) fn toward(&self, target_rad: f64) -> Option<MotorCommand> {
        let (limits, trusted_rad) = (self.limits?, self.trusted_rad?);
        let ratio = self.motor.gear_ratio;
        let torque_nm = (limits.motor_torque_nm / ratio).abs();
        let (kp, kd) = (self.motor.kp_nm_per_rad, self.motor.kd_nm_s_per_rad);
        let before_rad = self.target_rad.unwrap_or(target_rad);
        let wanted_rad_s = (target_rad - before_rad) / self.period.as_secs_f64();
        let wanted_rad_s = wanted_rad_s.clamp(-limits.speed_rad_s, limits.speed_rad_s) * ratio;
        // The damping alone may not make more than half of the torque.
        let own_rad_s = self.reply.map_or(0.0, |reply| reply.speed_rad_s);
        let most_rad_s = if kd > 0.0 { 0.5 * torque_nm / kd } else { f64::INFINITY };
        let speed_rad_s = wanted_rad_s.clamp(own_rad_s - most_rad_s, own_rad_s + most_rad_s);
        let speed_rad_s = speed_rad_s.clamp(-self.ranges.speed_rad_s, self.ranges.speed_rad_s);
        let left_nm = (torque_nm - kd * (speed_rad_s - own_rad_s).abs()).max(0.0);
        let (reach_rad, here_rad) = (left_nm / kp, trusted_rad * ratio);
        let position_rad = (target_rad * ratio).clamp(here_rad - reach_rad, here_rad + reach_rad);
        Some(MotorCommand { position_rad, speed_rad_s, kp, kd, torque_nm: 0.0 })
    }

    /// Angle of the handle that a reply means, rad.
    pub(super) fn handle_rad(&self, reply: &MitReply) -> f64 {
        reply.position_rad / self.motor.gear_ratio
    }

    /// The reported speed must be the slope of the position; if it is not, one of the two ranges is wrong.
    pub(super) fn compare_speed(&mut self) {
        let Some(now) = self.reply.zip(Some(self.sent)) else { return };
        let Some((before, at)) = self.before.replace(now) else { return };
        let time_s = now.1.saturating_duration_since(at).as_secs_f64();
        let period_s = self.period.as_secs_f64();
        if !(0.5 * period_s..1.5 * period_s).contains(&time_s) {
            return;
        }
        let measured_rad_s = (now.0.position_rad - before.position_rad) / time_s;
        let reported_rad_s = 0.5 * (now.0.speed_rad_s + before.speed_rad_s);
        let acceleration = self.limits.map_or(0.0, |limits| limits.acceleration_rad_s2);
        let allowed_rad_s = REPORTED_SPEED_TOLERANCE * measured_rad_s.abs().max(reported_rad_s.abs())
            + 2.0 * self.ranges.speed_step_rad_s()
            + 2.0 * self.ranges.position_step_rad() / time_s
            + 0.5 * acceleration * self.motor.gear_ratio.abs() * time_s;
        let differs = (measured_rad_s - reported_rad_s).abs() > allowed_rad_s;
        self.disagreements = if differs { self.disagreements + 1 } else { 0 };
        if self.disagreements >= DISAGREEMENTS {
            self.disagreement = Some(CanFault::SpeedDisagrees { reported_rad_s, measured_rad_s });
        }
    }

    /// After too long a silence the motor may have let go by itself; it is not switched on again.
    pub(super) fn has_been_silent(&self, now: Instant) -> bool {
        self.in_motor_mode
            && self.probe.is_none()
            && now.saturating_duration_since(self.sent) > self.longest_silence
    }
}
