//! What every kind of motor can do, whatever protocol it speaks.

use std::time::Instant;

use super::bus::Frame;
use super::canopen::{Link, MonitoredNode};
use super::fault::CanFault;
use super::file::CanRigFile;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::pdo_decoder::Readings;
use super::units::JointAngle;

/// A motor on the bus.
pub trait Drive: std::fmt::Debug + Send {
    /// Checks the identity; writes limits, watchdogs and frames, and reads back what can be read. The motor has no power.
    ///
    /// # Errors
    /// Whatever is refused, not taken or not has_replied; the motor stays without power.
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault>;

    /// The nodes whose heartbeats are monitored.
    fn monitored_nodes(&self) -> Vec<MonitoredNode>;

    /// Finds the start position and moves there under supervision. Afterwards the cycle can give the motor power.
    ///
    /// # Errors
    /// What went wrong; the motor may have power.
    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault>;

    /// Sends, or stores for SYNC, the target of the next period.
    ///
    /// # Errors
    /// The bus is gone.
    fn send_target(
        &mut self,
        link: &mut Link,
        target: JointAngle,
        shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault>;

    /// Sends SYNC, and before it the target of a motor that does not act on SYNC.
    ///
    /// # Errors
    /// The bus is gone.
    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault>;

    /// Handles a frame that is not in the rig file, which arrived by `now`. Returns whether it is this motor's.
    ///
    /// # Errors
    /// What the motor reports in it.
    fn handle_frame(&mut self, frame: &Frame, now: Instant) -> Result<bool, CanFault>;

    /// Whether the motor's own answer in this period has come.
    fn has_replied(&self) -> bool;

    /// Angle of the handle at a sample of the period; the last sample is at SYNC.
    fn angle(&self, readings: &Readings, sample: usize) -> JointAngle;

    /// Checks what the motor reports of itself. Valid only while the motor must follow its target.
    ///
    /// # Errors
    /// What it says.
    fn check(&self, readings: &Readings, now: Instant) -> Result<(), CanFault>;

    /// Whether the motor has power, according to its latest frames.
    fn power(&self, readings: &Readings) -> PowerState;

    /// Periods from sending a target to the motor being there.
    fn target_delay_periods(&self) -> usize;

    /// Speed of the last stretch to the start position, which the cycle goes, rad/s.
    fn approach_speed_rad_s(&self) -> f64;

    /// Stores the motor's state from the complete frames of a period, for the next target.
    fn period_complete(&mut self, readings: &Readings);

    /// Removes the power and confirms it.
    ///
    /// # Errors
    /// [`CanFault::PowerNotConfirmed`], or why it cannot be spoken to.
    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault>;
}

/// What the motor is asked to do with a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveRequest {
    /// Go to its powered state, step by step, and stay at the present angle.
    Enable,
    /// Reach the target at the next SYNC.
    Follow,
    /// Stop on the quick-stop ramp.
    QuickStop,
    /// Remove the power.
    RemovePower,
    /// Nothing: the motor moves by itself.
    None,
}

/// Whether a motor has power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerState {
    /// It follows its target.
    Following,
    /// It has power and stops, or is on the way to following.
    Changing,
    /// It has none.
    Off,
}

/// Supervises a motor that moves by itself, to its home or to the start position.
pub trait MotionMonitor {
    /// The motor begins to look for its home. Until it is found, angles have no meaning.
    fn homing(&mut self);

    /// The motor begins to move from `from` to the start position. After a fault it may come from outside the limits, but may
    /// not go further out than by `slack_rad`.
    fn moving_from(&mut self, from: JointAngle, slack_rad: f64);

    /// Supervises one period. Returns what the frames said, and the angle at SYNC.
    ///
    /// # Errors
    /// A limit that is exceeded, a sensor without a measurement, or frames that stay away.
    fn period(&mut self, link: &mut Link, drive: &mut dyn Drive) -> Result<(Readings, JointAngle), CanFault>;
}
