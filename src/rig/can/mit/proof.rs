//! The small motion that proves, before a limb is in the handle, what a motor in MIT mode cannot be asked for: that the
//! ranges of its fields are those of the rig file, and that it lets go by itself when it hears nothing.
//!
//! 1. Scale. A soft spring pulls the shaft a few hundredths of a radian. The torque that the motor reports must be the one that
//!    the command makes of the position and speed that it reports, and its speed must add up to the way. A firmware of other
//!    ranges fails in one of the two; it is found while the torque is still small.
//! 2. Watchdog. A still softer spring pulls the shaft for a while; then it is pulled again, by a single command and silence.
//!    A motor that lets go stays behind the first way. Only positions are compared: a reply's torque may be that of the
//!    command that it answers.

use super::device::{Mit, MitCommand};
use super::frame::{MitReply, MotorCommand};
use crate::rig::can::canopen::Link;
use crate::rig::can::drive::MotionMonitor;
use crate::rig::can::fault::CanFault;
use crate::rig::can::limits::HandleLimits;

/// The way, rad at the handle, and in steps of the position's field.
const WAY_RAD: f64 = 0.02;
const WAY_STEPS: f64 = 12.0;
/// The shaft must have moved by so many steps for anything to be said.
const NEEDED_STEPS: f64 = 5.0;
/// Highest torque, N m at the handle, and as part of the motor's limit.
const PULL_NM: f64 = 1.5;
const PULL_PART: f64 = 0.25;
/// Damping of the first motion, N m s/rad; it is kept small so that the coarse speed says little about the torque.
const SCALE_KD: f64 = 1.0;
/// Part by which the torque may be off: what a motor's torque constant is known to.
const SCALE_TOLERANCE: f64 = 0.35;
/// Part by which the way by position and the way by speed may differ.
const WAY_TOLERANCE: f64 = 0.25;
/// Periods in a row that must be off before the motion is broken off.
const OFF_PERIODS: u32 = 2;
/// Times of silence, in times of the watchdog.
const MIT_SILENCE: f64 = 2.5;
/// A motor that let go has come no further than this part of the way.
const LET_GO_PART: f64 = 0.8;
/// Periods in which the program only looks.
const MIT_LOOK_PERIODS: u32 = 8;
/// How long the handle may take to come to rest, s.
const REST_S: f64 = 3.0;
/// Least number of periods of the first motion's rise.
const RISE_PERIODS: f64 = 10.0;

/// Proves ranges and watchdog. The motor may be in motor mode afterwards.
///
/// # Errors
/// What is not proved, or what the monitor found.
pub(super) fn prove(
    mit: &mut Mit,
    link: &mut Link,
    limits: &HandleLimits,
    monitor: &mut dyn MotionMonitor,
) -> Result<(), CanFault> {
    let mut motion = SmallMotion { mit, link, limits, monitor };
    motion.mit.probe = None;
    // Its time begins now, not when the motor was first asked.
    motion.monitor.begin();
    let at_rest = motion.look()?;
    let plan = Pull::new(motion.mit, limits, &at_rest)?;
    motion.enter()?;
    motion.prove_scale(&plan, &at_rest)?;
    motion.let_go()?;
    motion.prove_watchdog(&plan)
}

/// Where the shaft is pulled, and how hard, at the motor.
#[derive(Debug, Clone, Copy)]
struct Pull {
    /// Signed way, rad.
    way_rad: f64,
    /// Speed of the first motion, rad/s.
    speed_rad_s: f64,
    /// Highest torque, N m.
    torque_nm: f64,
}

impl Pull {
    fn new(mit: &Mit, limits: &HandleLimits, here: &MitReply) -> Result<Self, CanFault> {
        let ratio = mit.motor.gear_ratio;
        let angle_rad = mit.handle_rad(here);
        let [low_rad, high_rad] = limits.angle_rad;
        let way_rad = WAY_RAD.max(WAY_STEPS * mit.ranges.position_step_rad() / ratio.abs());
        let (room_rad, sign) = if high_rad - angle_rad > angle_rad - low_rad {
            (high_rad - angle_rad, 1.0)
        } else {
            (angle_rad - low_rad, -1.0)
        };
        if way_rad > 0.9 * room_rad {
            return Err(CanFault::NoRoomForProof { needed_rad: way_rad / 0.9, room_rad });
        }
        Ok(Self {
            way_rad: sign * way_rad * ratio,
            speed_rad_s: mit.motor.go_to_start_rad_s.min(limits.speed_rad_s) * ratio.abs(),
            torque_nm: PULL_NM.min(PULL_PART * limits.motor_torque_nm) / ratio.abs(),
        })
    }

    /// A spring that is at most so stiff that the whole way makes the highest torque.
    fn kp(&self, wanted: f64, mit: &Mit) -> f64 {
        wanted.min(self.torque_nm / self.way_rad.abs()).min(mit.ranges.kp)
    }
}

/// A motor, its bus, and who supervises it.
struct SmallMotion<'a> {
    mit: &'a mut Mit,
    link: &'a mut Link,
    limits: &'a HandleLimits,
    monitor: &'a mut dyn MotionMonitor,
}

impl SmallMotion<'_> {
    /// One period in which the motor is told this.
    fn period(&mut self, command: MitCommand) -> Result<MitReply, CanFault> {
        self.mit.probe = Some(command);
        let (_, angle) = self.monitor.period(self.link, self.mit)?;
        self.limits.check_place(angle)?;
        self.mit.reply.ok_or(CanFault::MissedCycle { in_a_row: 1, tolerated: 0, id: self.mit.motor.reply_id })
    }

    fn periods(&self, time_s: f64) -> u32 {
        (time_s / self.mit.period.as_secs_f64()).ceil() as u32
    }

    /// Angle, speed and torque before there is any power. The reply's speed is the mean: what it says of a shaft at rest.
    fn look(&mut self) -> Result<MitReply, CanFault> {
        let step_rad = self.mit.ranges.position_step_rad();
        let (mut reply, mut still, mut speed_rad_s) = (self.period(MitCommand::Leave)?, 0, 0.0);
        let mut from_rad = reply.position_rad;
        for _ in 0..self.periods(REST_S).max(4 * MIT_LOOK_PERIODS) {
            reply = self.period(MitCommand::Leave)?;
            if (reply.position_rad - from_rad).abs() > 2.5 * step_rad {
                (still, speed_rad_s, from_rad) = (0, 0.0, reply.position_rad);
                continue;
            }
            still += 1;
            speed_rad_s += reply.speed_rad_s / f64::from(MIT_LOOK_PERIODS);
            if still == MIT_LOOK_PERIODS {
                return Ok(MitReply { speed_rad_s, ..reply });
            }
        }
        Err(CanFault::HandleNotAtRest)
    }

    fn enter(&mut self) -> Result<(), CanFault> {
        self.period(MitCommand::Enter).map(drop)
    }

    /// Without power, until the shaft is where it comes to rest by itself.
    fn let_go(&mut self) -> Result<MitReply, CanFault> {
        let mut reply = self.period(MitCommand::Leave)?;
        for _ in 0..self.periods(0.1).max(MIT_LOOK_PERIODS) {
            reply = self.period(MitCommand::Leave)?;
        }
        Ok(reply)
    }

    fn prove_scale(&mut self, plan: &Pull, at_rest: &MitReply) -> Result<(), CanFault> {
        let period_s = self.mit.period.as_secs_f64();
        // The pull begins without speed: what is wrong is found while it is still small.
        let rise_s = (2.0 * plan.way_rad.abs() / plan.speed_rad_s).max(RISE_PERIODS * period_s);
        let pulled_part = |time_s: f64| (time_s / rise_s).min(1.0).powi(2);
        let kd = SCALE_KD.min(self.mit.ranges.kd);
        let kp = plan.kp(f64::INFINITY, self.mit);
        let ranges = self.mit.ranges;
        let slack_nm = 4.0 * ranges.torque_step_nm()
            + 2.0 * kp * ranges.position_step_rad()
            + 2.0 * kd * ranges.speed_step_rad_s();
        let periods = self.periods(2.0 * rise_s);
        let (mut expected_nm, mut off, mut added_rad) = (0.0, 0, 0.0);
        let (mut torques, mut products) = (0.0, 0.0);
        let mut before = *at_rest;
        let mut command =
            MotorCommand { position_rad: at_rest.position_rad, kp, kd, ..MotorCommand::default() };
        for period in 1..=periods {
            let part = pulled_part(f64::from(period) * period_s);
            let asked = MotorCommand { position_rad: at_rest.position_rad + part * plan.way_rad, ..command };
            let reply = self.period(MitCommand::Act(asked))?;
            // The reply is that of the command before.
            if period > 1 {
                expected_nm = ranges
                    .rounded(&command)
                    .torque_at(reply.position_rad, reply.speed_rad_s - at_rest.speed_rad_s);
                let newest_nm = ranges
                    .rounded(&asked)
                    .torque_at(reply.position_rad, reply.speed_rad_s - at_rest.speed_rad_s);
                let (low_nm, high_nm) = (expected_nm.min(newest_nm), expected_nm.max(newest_nm));
                let off_nm = reply.torque_nm - reply.torque_nm.clamp(low_nm, high_nm);
                let allowed_nm = slack_nm + SCALE_TOLERANCE * reply.torque_nm.abs().max(expected_nm.abs());
                off = if off_nm.abs() > allowed_nm { off + 1 } else { 0 };
                if off >= OFF_PERIODS {
                    let (measured, expected) = (reply.torque_nm, expected_nm);
                    return Err(CanFault::WrongScale { what: "torque (N m)", measured, expected });
                }
                torques += expected_nm * expected_nm;
                products += expected_nm * reply.torque_nm;
            }
            added_rad += (0.5 * (reply.speed_rad_s + before.speed_rad_s) - at_rest.speed_rad_s) * period_s;
            let turned_rad = reply.position_rad - at_rest.position_rad;
            let allowed_rad = WAY_TOLERANCE * turned_rad.abs().max(added_rad.abs())
                + 3.0 * ranges.position_step_rad()
                + 0.1 * ranges.speed_step_rad_s() * period_s * f64::from(period)
                + ranges.speed_step_rad_s() * period_s;
            if (added_rad - turned_rad).abs() > allowed_rad {
                let (measured, expected) = (turned_rad, added_rad);
                return Err(CanFault::WrongScale {
                    what: "way by position and by speed (rad)",
                    measured,
                    expected,
                });
            }
            (before, command) = (reply, asked);
        }
        self.check_moved(before.position_rad - at_rest.position_rad)?;
        // Back, so that nothing is let go under tension.
        for period in (0..periods / 2).rev() {
            let part = pulled_part(f64::from(period) * period_s);
            let position_rad = at_rest.position_rad + part * plan.way_rad;
            self.period(MitCommand::Act(MotorCommand { position_rad, ..command }))?;
        }
        let ratio = products / torques;
        if !((1.0 - SCALE_TOLERANCE)..(1.0 + SCALE_TOLERANCE)).contains(&ratio) {
            let (measured, expected) = (ratio * expected_nm, expected_nm);
            return Err(CanFault::WrongScale { what: "torque (N m)", measured, expected });
        }
        Ok(())
    }

    fn prove_watchdog(&mut self, plan: &Pull) -> Result<(), CanFault> {
        let wait_s = self.mit.motor_waits.as_secs_f64();
        let kd = self.mit.ranges.kd.min(5.0);
        // So soft that a shaft without a load is not there yet when the watchdog acts.
        let kp = plan.kp(kd / wait_s, self.mit);
        let periods = self.periods(MIT_SILENCE * wait_s);
        let pull = |position_rad: f64| {
            MitCommand::Act(MotorCommand { position_rad, kp, kd, ..MotorCommand::default() })
        };

        let from = self.let_go()?.position_rad;
        self.enter()?;
        let mut driven = from;
        for _ in 0..periods {
            driven = self.period(pull(from + plan.way_rad))?.position_rad;
        }
        self.check_moved(driven - from)?;
        for _ in 0..periods {
            self.period(pull(from))?;
        }
        let again = self.let_go()?.position_rad;
        self.enter()?;
        self.period(pull(again + plan.way_rad))?;
        for _ in 0..periods {
            self.period(MitCommand::Silence)?;
        }
        let silent = self.period(MitCommand::Leave)?.position_rad;
        let (driven_rad, silent_rad) =
            ((driven - from) * plan.way_rad.signum(), (silent - again) * plan.way_rad.signum());
        let step_rad = self.mit.ranges.position_step_rad();
        if silent_rad < LET_GO_PART * driven_rad && driven_rad - silent_rad > 2.0 * step_rad {
            return Ok(());
        }
        Err(CanFault::WatchdogNotSeen {
            motor_waits_ms: self.mit.motor_waits.as_millis() as u64,
            silent_ms: (MIT_SILENCE * wait_s * 1e3) as u64,
        })
    }

    fn check_moved(&self, moved_rad: f64) -> Result<(), CanFault> {
        let needed_rad = NEEDED_STEPS * self.mit.ranges.position_step_rad();
        if moved_rad.abs() >= needed_rad {
            return Ok(());
        }
        let ratio = self.mit.motor.gear_ratio.abs();
        Err(CanFault::NotMovedForProof { moved_rad: moved_rad.abs() / ratio, needed_rad: needed_rad / ratio })
    }
}
