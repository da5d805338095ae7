//! Homing (mode 6 of CiA 402): the drive finds its origin by the method that the rig file gives (object 6098h).
//!
//! Every method runs the same way here: the mode is set, the start bit is given, and statusword bits 10, 12 and 13 tell the end.
//! A method that takes the present position for the origin is used once only, and must not move the motor.

use std::time::{Duration, Instant};

use super::device::Cia402;
use super::power::LET_BITS_SETTLE;
use crate::rig::Origin;
use crate::rig::can::canopen::{Link, Object};
use crate::rig::can::cia402_state::{Controlword, DriveState, Mode, Statusword};
use crate::rig::can::drive::{Drive, HANDLE_AT_START_RAD, MotionMonitor};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::Homing;
use crate::rig::can::limits::HandleLimits;
use crate::rig::can::motion_proof::{SPEED_TOLERANCE, SpeedWatch};
use crate::rig::can::units::{Counts, JointAngle};

/// A handle that must stay where it is while the drive takes that place for its start position. Its angle may jump once: to what the
/// new origin makes of the same place.
struct RestWatch {
    /// Where the handle must stay, rad: in the old origin, then in the new one.
    place_rad: f64,
    latest_rad: f64,
    has_new_origin: bool,
}

impl RestWatch {
    fn new(angle_rad: f64) -> Self {
        Self { place_rad: angle_rad, latest_rad: angle_rad, has_new_origin: false }
    }

    fn check(&mut self, angle_rad: f64) -> Result<(), CanFault> {
        let step_rad = (angle_rad - std::mem::replace(&mut self.latest_rad, angle_rad)).abs();
        let moved_rad = (angle_rad - self.place_rad).abs();
        if moved_rad <= HANDLE_AT_START_RAD {
            return Ok(());
        }
        if self.has_new_origin || step_rad <= HANDLE_AT_START_RAD {
            return Err(CanFault::MovedWhileHoming { moved_rad });
        }
        (self.place_rad, self.has_new_origin) = (angle_rad, true);
        Ok(())
    }
}

/// How far the handle turns while the motor searches its home, whose place is not known before. The angle jumps when it is found: what
/// it was counted from has moved then, and not the handle.
struct TravelWatch {
    most_rad: f64,
    /// Highest speed that is no jump, rad/s.
    most_rad_s: f64,
    resolution_rad: f64,
    time_stretch: f64,
    latest: Option<(f64, Instant)>,
    range_rad: [f64; 2],
}

impl TravelWatch {
    /// A handle within its limits finds a home beyond them at most, and comes to rest from the speed of the search on either side.
    fn new(homing: &Homing, limits: &HandleLimits, resolution_rad: f64, time_stretch: f64) -> Self {
        let [low_rad, high_rad] = limits.angle_rad;
        let ends_rad = high_rad.max(homing.offset_rad) - low_rad.min(homing.offset_rad);
        let stopping_rad = homing.fast_rad_s.powi(2) / (2.0 * homing.acceleration_rad_s2);
        Self {
            most_rad: ends_rad + 2.0 * stopping_rad,
            most_rad_s: SPEED_TOLERANCE * homing.fast_rad_s,
            resolution_rad,
            time_stretch,
            latest: None,
            range_rad: [0.0; 2],
        }
    }

    /// The handle's angle in one more period, read at `now`.
    ///
    /// # Errors
    /// [`CanFault::HomingTooFar`]
    fn observe(&mut self, angle_rad: f64, now: Instant) -> Result<(), CanFault> {
        let [lowest_rad, highest_rad] = self.range_rad;
        self.range_rad = match self.latest.replace((angle_rad, now)) {
            None => [angle_rad; 2],
            Some((before_rad, then)) => {
                let elapsed_s = now.saturating_duration_since(then).as_secs_f64() / self.time_stretch;
                let step_rad = angle_rad - before_rad;
                let is_jump = step_rad.abs() > self.most_rad_s * elapsed_s + 2.0 * self.resolution_rad;
                let shift_rad = if is_jump { step_rad } else { 0.0 };
                [(lowest_rad + shift_rad).min(angle_rad), (highest_rad + shift_rad).max(angle_rad)]
            }
        };
        let moved_rad = self.range_rad[1] - self.range_rad[0];
        if moved_rad > self.most_rad {
            return Err(CanFault::HomingTooFar { moved_rad, most_rad: self.most_rad });
        }
        Ok(())
    }
}

/// Periods in which everything that is measured must have come before the drive gets power: enough to see a sample counter go on.
const LOOK_PERIODS: u32 = 8;

/// Looks at position, torque and all other channels while the drive has no power.
///
/// # Errors
/// [`CanFault::NotMeasured`] for a frame that stays away; or a channel without a number, a counter that stands, a torque beyond its limit.
fn look_before_power(
    link: &mut Link,
    drive: &mut dyn Drive,
    monitor: &mut dyn MotionMonitor,
) -> Result<(), CanFault> {
    monitor.begin();
    for _ in 0..LOOK_PERIODS {
        monitor.period(link, drive).map_err(|fault| match fault {
            CanFault::MissedCycle { id, in_a_row, tolerated } => {
                CanFault::NotMeasured { id, in_a_row, tolerated }
            }
            other => other,
        })?;
    }
    Ok(())
}

impl Cia402 {
    /// Where the drive has the handle (6064h), rad; asked for.
    pub(super) fn ask_angle(&self, link: &mut Link) -> Result<f64, CanFault> {
        let counts = link.read(self.motor.node, Object::plain(0x6064))?.number() as i32;
        Ok(self.gearing.from_drive(Counts(counts)).0)
    }

    /// Whether the drive still has the origin of a homing that is done once.
    ///
    /// # Errors
    /// [`CanFault::OriginLost`]
    pub(super) fn check_origin(&self) -> Result<(), CanFault> {
        if self.homed && self.was_restarted && self.motor.homing.takes_present_position() {
            return Err(CanFault::OriginLost);
        }
        Ok(())
    }

    /// Lets the drive find its origin. A method that takes the present position is used once: after a fault the motor
    /// may stand anywhere.
    ///
    /// # Errors
    /// The drive left its state, reported a homing error (bit 13), took too long, or lost the origin that it had. With a method
    /// that takes the present position: the motor moved, or has it elsewhere in the end. With one that searches: it went too far.
    pub(super) fn home(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        let homing = self.motor.homing;
        if self.homed && homing.takes_present_position() {
            self.origin = Origin::Kept;
            return self.check_origin();
        }
        self.homed = false;
        self.set_mode(link, Mode::Homing)?;
        let mut rest = match homing.takes_present_position() {
            true => Some(RestWatch::new(self.ask_angle(link)?)),
            false => None,
        };
        look_before_power(link, self, monitor)?;
        self.go_to_state(link, DriveState::OperationEnabled)?;
        self.control(link, Controlword::ENABLE_AND_GO)?;
        monitor.begin();
        let deadline = link.now() + Duration::from_secs_f64(homing.timeout_s);
        // The drive is told its speeds in a unit that only it knows for sure.
        let resolution_rad = self.gearing.count_rad().abs();
        let mut speed = SpeedWatch::new(homing.fast_rad_s, resolution_rad, link.time_stretch());
        let mut travel = TravelWatch::new(&homing, limits, resolution_rad, link.time_stretch());
        // Until the first periods are over, the bits may be those of before.
        for period in 0u64.. {
            let (readings, JointAngle(angle_rad)) = monitor.period(link, self)?;
            speed.observe(angle_rad, link.now())?;
            match rest.as_mut() {
                Some(rest) => rest.check(angle_rad)?,
                None => travel.observe(angle_rad, link.now())?,
            }
            let status = Statusword(readings.statusword);
            if status.state() != DriveState::OperationEnabled {
                return Err(self.not_reached(link, DriveState::OperationEnabled, status));
            }
            self.check_remote(status)?;
            if status.mode_bit_13() || link.now() > deadline {
                self.control(link, Controlword::SHUTDOWN)?;
                return Err(CanFault::HomingFailed { timeout_s: homing.timeout_s, statusword: status.0 });
            }
            if period >= LET_BITS_SETTLE && status.mode_bit_12() && status.target_reached() {
                break;
            }
        }
        if let Some(mut rest) = rest {
            let (angle_rad, expected_rad) = (self.ask_angle(link)?, homing.offset_rad);
            rest.check(angle_rad)?;
            if (angle_rad - expected_rad).abs() > HANDLE_AT_START_RAD {
                return Err(CanFault::OriginMisplaced { angle_rad, expected_rad });
            }
        }
        (self.homed, self.was_restarted) = (true, false);
        self.origin = Origin::at_arming(homing.takes_present_position(), false);
        self.go_to_state(link, DriveState::ReadyToSwitchOn)
    }
}
