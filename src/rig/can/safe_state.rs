//! Brings the motor to a safe state, and removes its power. A reaction that itself meets a fault gives way to the next
//! stronger one: hold, quick stop, no power. If the bus does not carry a command any more, the program's heartbeat ends, and the
//! drive's own watchdog stops the motor.

use std::time::Duration;

use super::braking_watch::{BrakingWatch, PERIODS_TO_OBEY};
use super::canopen::{Link, NmtCommand};
use super::cycle::{Cycle, PeriodCommand};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, PowerState, leave_to_watchdog};
use super::fault::CanFault;
use super::file::{SafeState, SafeStates};
use super::motor_state::MotorState;
use crate::rig::FaultClass;

/// How long the motor holds its angle so that the subject can let go, before the power is removed.
const HOLD_DURATION: Duration = Duration::from_millis(500);
/// Periods that a motor may take to begin a quick stop and to report its end, beside the time of the ramp.
const QUICK_STOP_PERIODS: u32 = 5;

/// The safe state that the rig file gives for the class of a fault.
pub fn state_for(fault: &CanFault, states: &SafeStates) -> SafeState {
    match fault.class() {
        FaultClass::Limit => states.limit,
        FaultClass::Sensor => states.sensor,
        FaultClass::Drive => states.drive,
        FaultClass::Bus => states.bus,
        FaultClass::Cycle => states.cycle,
    }
}

/// Brings the motor to rest and removes its power. Returns the faults that were met on the way.
pub fn reach(
    state: SafeState,
    link: &mut Link,
    drive: &mut dyn Drive,
    cycle: &mut Cycle,
    stats: &mut CycleStats,
) -> Vec<CanFault> {
    let mut stop = Stop { link, drive, cycle, stats };
    let mut met = Vec::new();
    let mut state = state;
    // A motor that heard nothing for so long has stopped by itself; it must not be given power again.
    if stop.cycle.is_given_up_by_motor(stop.link.now()) {
        state = SafeState::TorqueOff;
    }
    if state == SafeState::Hold
        && let Err(fault) = stop.hold()
    {
        stop.cycle.excuse(&fault);
        state = if fault.bus_is_dead() { SafeState::TorqueOff } else { SafeState::QuickStop };
        met.push(fault);
    }
    if state == SafeState::QuickStop
        && let Err(fault) = stop.brake()
    {
        met.push(fault);
    }
    met.extend(stop.remove_power().err());
    met
}

/// What a reaction to a fault works on.
struct Stop<'a> {
    link: &'a mut Link,
    drive: &'a mut dyn Drive,
    cycle: &'a mut Cycle,
    stats: &'a mut CycleStats,
}

impl Stop<'_> {
    /// The target comes to rest from the motion that it had, then stays: the measured angle moves nothing.
    fn hold(&mut self) -> Result<(), CanFault> {
        let end = self.link.now() + HOLD_DURATION;
        let deceleration = self.deceleration_rad_s2();
        let mut target = self.cycle.target_motion();
        while self.link.now() < end || !target.is_at_rest() {
            target.decelerate(deceleration, self.cycle.period_s());
            self.period(target.angle_rad, DriveRequest::Follow, MotorState::Holding)?;
            if self.cycle.take_standstill() {
                target = self.cycle.target_motion();
            }
            if self.is_off() {
                break;
            }
        }
        Ok(())
    }

    /// The motor brakes: on its own ramp, or by targets that come to rest. A drive that does not begin its ramp, or does not become
    /// slower on it, is left no time.
    fn brake(&mut self) -> Result<(), CanFault> {
        let own_ramp = self.drive.stops_by_itself();
        let deceleration = own_ramp.unwrap_or_else(|| self.deceleration_rad_s2());
        // It cannot be faster than its limit for long: beyond it, the power is removed.
        let ramp_s = self.cycle.limits().speed_rad_s / deceleration;
        let pending = QUICK_STOP_PERIODS + self.drive.target_delay_periods() as u32;
        let periods = (ramp_s / self.cycle.period_s()).ceil() as u32 + pending;
        let mut target = self.cycle.target_motion();
        let resolution_rad = self.drive.angle_resolution_rad();
        let mut watch =
            BrakingWatch::new(deceleration, resolution_rad, self.cycle.period_s(), target.speed_rad_s);
        let mut at_rest_for = 0;
        for _ in 0..periods {
            let request = if own_ramp.is_some() {
                DriveRequest::QuickStop
            } else {
                target.decelerate(deceleration, self.cycle.period_s());
                at_rest_for = if target.is_at_rest() { at_rest_for + 1 } else { 0 };
                DriveRequest::Follow
            };
            self.period(target.angle_rad, request, MotorState::QuickStopping)?;
            if self.cycle.take_standstill() {
                target = self.cycle.target_motion();
            }
            if self.is_off() || at_rest_for > pending {
                break;
            }
            if !self.cycle.has_new_readings() {
                watch.skip();
            } else if own_ramp.is_some() {
                watch.observe(self.measured_rad(), self.obeys(DriveRequest::QuickStop))?;
            }
        }
        Ok(())
    }

    /// As gently as the drive's own ramp, as hard as the room to the angle limit needs, and within the acceleration limit.
    fn deceleration_rad_s2(&self) -> f64 {
        let motion = self.cycle.target_motion();
        let limits = self.cycle.limits();
        let [low_rad, high_rad] = limits.angle_rad;
        let end_rad = if motion.speed_rad_s < 0.0 { low_rad } else { high_rad };
        // The step of the period under way is gone already.
        let step_rad = motion.speed_rad_s.abs() * self.cycle.period_s();
        let room_rad = ((end_rad - motion.angle_rad).abs() - step_rad).max(f64::MIN_POSITIVE);
        let needed = motion.speed_rad_s.powi(2) / (2.0 * room_rad);
        let gentle = self.drive.stops_by_itself().unwrap_or(limits.acceleration_rad_s2);
        gentle.max(needed).min(limits.acceleration_rad_s2)
    }

    /// Takes the power, even from a drive that shows none: it may have been told to take it since. A drive that shows in its frames that it keeps it is left to its own watchdog; what comes of it is asked for
    /// when the power is confirmed to be off.
    fn remove_power(&mut self) -> Result<(), CanFault> {
        let at_rad = self.cycle.target_motion().angle_rad;
        let mut seen = 0;
        for sent in 0..PERIODS_TO_OBEY {
            if sent > 0 && self.is_off() {
                return Ok(());
            }
            // Sent even if the periods before failed.
            match self.period(at_rad, DriveRequest::RemovePower, MotorState::QuickStopping) {
                Err(fault) if fault.bus_is_dead() => return Ok(()),
                // Readings beyond a limit are readings all the same.
                Err(fault) if fault.class() != FaultClass::Limit => {}
                _ => seen += u32::from(self.cycle.has_new_readings()),
            }
        }
        if seen < PERIODS_TO_OBEY || self.obeys(DriveRequest::RemovePower) {
            return Ok(());
        }
        let nodes: Vec<u8> = self.drive.monitored_nodes().iter().map(|node| node.node).collect();
        leave_to_watchdog(self.link, &nodes);
        Err(CanFault::PowerKept { periods: seen })
    }

    fn obeys(&self, request: DriveRequest) -> bool {
        self.drive.obeys(self.cycle.readings(), request)
    }

    fn measured_rad(&self) -> f64 {
        self.drive.angle(self.cycle.readings(), self.cycle.samples() - 1).0
    }

    fn period(&mut self, target_rad: f64, request: DriveRequest, state: MotorState) -> Result<(), CanFault> {
        let command = PeriodCommand { target_rad, shown_nm: 0.0, request };
        self.cycle.run(self.link, self.drive, self.stats, command, state)
    }

    fn is_off(&self) -> bool {
        self.drive.power(self.cycle.readings()) == PowerState::Off
    }
}

/// Removes the power and confirms it. A drive that does not answer is stopped by NMT, and by the end of the heartbeat.
/// Returns the disobedience of a motor that let go only when it was left to its own watchdog.
///
/// # Errors
/// Why it could not be confirmed.
pub fn power_off(link: &mut Link, drive: &mut dyn Drive) -> Result<Option<CanFault>, CanFault> {
    let outcome = drive.power_off(link);
    if outcome.is_err() {
        link.set_own_heartbeat(None);
        for node in drive.monitored_nodes() {
            let _ = link.nmt(NmtCommand::Stop, node.node);
        }
    }
    outcome
}
