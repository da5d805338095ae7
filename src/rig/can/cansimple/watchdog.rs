//! The axis's own watchdog is seen to act, before a limb is in the handle.

use std::time::Duration;

use super::axis::{AXIS_STATE_TIMEOUT, AxisCommand, Cansimple};
use super::endpoints::AxisLimits;
use super::frame::{CLOSED_LOOP_CONTROL, IDLE, command};
use crate::rig::can::canopen::Link;
use crate::rig::can::drive::MotionMonitor;
use crate::rig::can::fault::CanFault;
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::units::JointAngle;

/// Part of the current limit while the watchdog is proved: it holds a handle that nobody pushes.
const PROOF_PART: f64 = 0.3;
/// Time of silence that proves the watchdog, in times of it.
const AXIS_SILENCE: f64 = 1.5;
/// Periods in which the program only looks.
const AXIS_LOOK_PERIODS: u32 = 8;

impl Cansimple {
    /// Holds the handle where it is, with little current, and falls silent: the watchdog must take the power.
    pub(super) fn prove_watchdog(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        let axis_limits = AxisLimits::of(self, limits);
        self.set_limits(link, axis_limits.part(PROOF_PART))?;
        self.limits_read(link, axis_limits.part(PROOF_PART))?;
        let mut angle = JointAngle(self.check.angle_rad().unwrap_or(f64::NAN));
        // Its time begins now, not when the axis was first asked.
        monitor.begin();
        for _ in 0..AXIS_LOOK_PERIODS {
            self.probe = Some(AxisCommand::Silence);
            (_, angle) = monitor.period(link, self)?;
            limits.check_place(angle)?;
        }
        let hold = self.to_turns(angle);
        let deadline = link.now() + AXIS_STATE_TIMEOUT;
        self.probe = Some(AxisCommand::Enable(hold));
        while self.state != CLOSED_LOOP_CONTROL {
            if link.now() > deadline {
                return Err(CanFault::MotorError { code: self.errors });
            }
            limits.check_place(monitor.period(link, self)?.1)?;
            self.probe = Some(AxisCommand::Follow(hold));
        }
        let heartbeat = Duration::from_millis(u64::from(self.motor.heartbeat_ms));
        let silence = self.motor_waits.mul_f64(AXIS_SILENCE) + 2 * heartbeat;
        let end = link.now() + silence;
        self.probe = Some(AxisCommand::Silence);
        while link.now() < end && self.state == CLOSED_LOOP_CONTROL {
            limits.check_place(monitor.period(link, self)?.1)?;
        }
        if self.state == CLOSED_LOOP_CONTROL {
            let [motor_waits_ms, silent_ms] = [self.motor_waits, silence].map(|time| time.as_millis() as u64);
            return Err(CanFault::WatchdogNotSeen { motor_waits_ms, silent_ms });
        }
        self.send_state(link, IDLE)?;
        self.send_command(link, command::CLEAR_ERRORS, &[0])?;
        self.set_limits(link, axis_limits)?;
        self.limits_read(link, axis_limits)
    }
}
