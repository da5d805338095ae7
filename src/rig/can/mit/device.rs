//! The motor: what it was told, what it reported, and how it is spoken to.

use std::time::{Duration, Instant};

use super::frame::{FieldRanges, LEAVE, MitReply, MotorCommand, ZERO};
use super::trusted_motion::{Agility, TrustedMotion};
use crate::rig::Origin;
use crate::rig::can::bus::Frame;
use crate::rig::can::canopen::Link;
use crate::rig::can::drive::Drive;
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::{CanRigFile, MitMotor};
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::position_check::PositionCheck;
use crate::rig::can::proved_motor::ProvedMotor;
use crate::rig::can::sensors::Sensors;

/// How long a motor may take to reply to a special frame.
pub(super) const MIT_REPLY_TIMEOUT: Duration = Duration::from_millis(100);
pub(super) const MIT_ATTEMPTS: usize = 5;
/// Part of the torque limit that motions which nobody expects may take; the rest is for following the target.
pub(super) const UNEXPECTED_PART: f64 = 0.5;

/// What goes to the motor with the next SYNC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MitCommand {
    /// LEAVE: no power, and the motor reports.
    Leave,
    /// Motor mode, without any torque.
    Enter,
    /// A command in motor mode.
    Act(MotorCommand),
    /// One towards a target, rad at the handle, at a speed, rad/s.
    Toward(f64, f64),
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
    /// On the bench the clock takes so many times longer than the motor.
    stretch: f64,
    /// Longest time between two commands; after it the motor is only told to let go.
    pub(super) longest_silence: Duration,
    pub(super) motor_waits: Duration,
    pub(super) zeroed: bool,
    /// How the start position was known at the latest arming.
    pub(super) origin: Origin,
    pub(super) proof: ProvedMotor,
    pub(super) in_motor_mode: bool,
    pub(super) following: bool,
    /// What the small motion sends, instead of what the cycle asks for.
    pub(super) probe: Option<MitCommand>,
    pub(super) next: MitCommand,
    /// Target that was sent last, rad at the handle, for the speed of the next.
    pub(super) target_rad: Option<f64>,
    pub(super) check: PositionCheck,
    /// What commands rest on.
    pub(super) motion: TrustedMotion,
    pub(super) has_replied: bool,
    pub(super) reply: Option<MitReply>,
    /// When the motor was last sent something.
    pub(super) sent: Instant,
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
            stretch: file.bench.map_or(1.0, |bench| bench.time_stretch),
            longest_silence: period.saturating_mul(tolerated).min(motor_waits),
            motor_waits,
            zeroed: false,
            origin: Origin::Found,
            proof: ProvedMotor::new(motor.proved_with_free_handle.as_deref()),
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
            motion: TrustedMotion::default(),
            has_replied: false,
            reply: None,
            sent: now,
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
        check_gains(&self.motor, limits, self.period)
    }

    /// Such a motor does not tell which it is: its identifiers, and what the small motions proved.
    pub(super) fn identity(&self) -> String {
        let (MitMotor { id, reply_id, gear_ratio, .. }, ranges) = (&self.motor, &self.ranges);
        format!(
            "mit {id} {reply_id}, P {} rad, V {} rad/s, KP {}, KD {}, T {} N m, gear {gear_ratio}, watchdog {} ms",
            ranges.position_rad,
            ranges.speed_rad_s,
            ranges.kp,
            ranges.kd,
            ranges.torque_nm,
            self.motor_waits.as_millis()
        )
    }

    /// How fast the shaft may change its motion. Before the limits are known the motor has no power.
    fn agility(&self) -> Option<Agility> {
        let limits = self.limits.as_ref()?;
        Some(Agility::new(limits, self.motor.gear_ratio, &self.ranges, self.period, self.stretch))
    }

    /// The next positions have nothing to do with those before.
    pub(super) fn forget_place(&mut self) {
        self.check.restart();
        self.motion.restart();
    }

    /// Judges the latest reply, whose position is that at the command that it answers.
    pub(super) fn judge_reply(&mut self, reply: &MitReply) {
        let Some(agility) = self.agility() else { return };
        // Small motions before arming have checks of their own.
        let has_power = self.in_motor_mode && self.probe.is_none();
        self.motion.observe(reply, self.sent, &agility, has_power);
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

    /// Whether a reply of the motor comes by the deadline, whatever it says of its position.
    pub(super) fn replies_by(&self, link: &mut Link, deadline: Instant) -> Result<bool, CanFault> {
        while let Some(frame) = link.receive(deadline)? {
            if frame.id == self.motor.reply_id && frame.data().first() == Some(&(self.motor.id as u8)) {
                return Ok(true);
            }
            if link.now() >= deadline {
                break;
            }
        }
        Ok(false)
    }

    /// Waits until the motor has not replied for half the time that it has for a reply. It does not as long as another program asks it.
    pub(super) fn becomes_silent(&self, link: &mut Link) -> Result<bool, CanFault> {
        let end = link.now() + MIT_REPLY_TIMEOUT;
        while link.now() < end {
            if !self.replies_by(link, link.now() + MIT_REPLY_TIMEOUT / 2)? {
                return Ok(true);
            }
        }
        Ok(false)
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
                    self.forget_place();
                }
                if self.handle_frame(&frame, link.arrival())? && self.has_replied {
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
        self.forget_place();
        let reply = self.ask(link, &LEAVE)?;
        let off_rad = reply.position_rad / self.motor.gear_ratio;
        if off_rad.abs() > 0.01 + 4.0 * self.ranges.position_step_rad() / self.motor.gear_ratio.abs() {
            return Err(CanFault::NotAtStart { off_rad });
        }
        self.zeroed = true;
        Ok(())
    }

    /// A command towards a target. From the motion that is expected, and from any that the shaft may have instead until the next
    /// command, it makes no more torque than the limit.
    fn toward(&self, target_rad: f64, wanted_rad_s: f64, now: Instant) -> Option<MotorCommand> {
        let (limits, agility, ratio) = (self.limits?, self.agility()?, self.motor.gear_ratio);
        let (here_rad, own_rad_s, deviation) = self.motion.expected(now, &agility)?;
        let torque_nm = (limits.motor_torque_nm / ratio).abs();
        let (kp, kd) = (self.motor.kp_nm_per_rad, self.motor.kd_nm_s_per_rad);
        let unexpected_nm = kp * deviation.position_rad + kd * deviation.speed_rad_s;
        // The longer the shaft has not been seen, the softer the motor: it may be anywhere.
        let (softer, left_nm) = if torque_nm >= self.ranges.torque_nm {
            (1.0, torque_nm)
        } else {
            let softer = (UNEXPECTED_PART * torque_nm / unexpected_nm).min(1.0);
            (softer, torque_nm - softer * unexpected_nm)
        };
        let (kp, kd) = (softer * kp, softer * kd);
        // The damping alone may not make more than half of what is left.
        let most_rad_s = if kd > 0.0 { 0.5 * left_nm / kd } else { f64::INFINITY };
        let asked_rad_s = wanted_rad_s.clamp(-limits.speed_rad_s, limits.speed_rad_s) * ratio;
        let speed_rad_s = asked_rad_s
            .clamp(own_rad_s - most_rad_s, own_rad_s + most_rad_s)
            .clamp(-self.ranges.speed_rad_s, self.ranges.speed_rad_s);
        let reach_rad = (left_nm - kd * (speed_rad_s - own_rad_s).abs()).max(0.0) / kp;
        let position_rad = (target_rad * ratio).clamp(here_rad - reach_rad, here_rad + reach_rad);
        Some(MotorCommand { position_rad, speed_rad_s, kp, kd, torque_nm: 0.0 })
    }

    /// What goes to the motor at a time; where the shaft is not known, it is told to let go.
    pub(super) fn command_at(&self, now: Instant) -> MitCommand {
        match self.probe.unwrap_or(self.next) {
            _ if self.has_been_silent(now) => MitCommand::Leave,
            MitCommand::Toward(target_rad, speed_rad_s) => {
                self.toward(target_rad, speed_rad_s, now).map_or(MitCommand::Leave, MitCommand::Act)
            }
            command => command,
        }
    }

    /// Angle of the handle that a reply means, rad.
    pub(super) fn handle_rad(&self, reply: &MitReply) -> f64 {
        reply.position_rad / self.motor.gear_ratio
    }

    /// After too long a silence the motor may have let go by itself; it is not switched on again.
    pub(super) fn has_been_silent(&self, now: Instant) -> bool {
        self.in_motor_mode
            && self.probe.is_none()
            && now.saturating_duration_since(self.sent) > self.longest_silence
    }
}

/// Whether the torque of the gains stays within its limit whatever the shaft does within the limits of its motion. A limit that
/// is all that the motor has holds by itself.
///
/// # Errors
/// [`CanFault::GainsTooHigh`]
pub(in crate::rig::can) fn check_gains(
    motor: &MitMotor,
    limits: &HandleLimits,
    period: Duration,
) -> Result<(), CanFault> {
    let (ranges, ratio) = (FieldRanges::of(motor), motor.gear_ratio.abs());
    let deviation = Agility::new(limits, ratio, &ranges, period, 1.0).usually_at_stake();
    let [of_kp_nm, of_kd_nm] = [
        motor.kp_nm_per_rad * deviation.position_rad * ratio,
        motor.kd_nm_s_per_rad * deviation.speed_rad_s * ratio,
    ];
    let (limit_nm, has_nm) = (limits.motor_torque_nm, ranges.torque_nm * ratio);
    if limit_nm >= has_nm || of_kp_nm + of_kd_nm <= UNEXPECTED_PART * limit_nm {
        return Ok(());
    }
    Err(CanFault::GainsTooHigh { of_kp_nm, of_kd_nm, most_nm: UNEXPECTED_PART * limit_nm, has_nm })
}
