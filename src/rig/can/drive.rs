//! What every kind of motor can do, whatever protocol it speaks.

use std::time::Instant;

use super::bus::{Arrival, Frame};
use super::canopen::{Link, MonitoredNode, NmtCommand};
use super::fault::CanFault;
use super::file::CanRigFile;
use super::finding::ObjectFinding;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::pdo_decoder::Readings;
use super::target_motion::Profile;
use super::units::JointAngle;
use crate::rig::Origin;

/// Step of a 16-bit angle over 25 rad, the coarsest that a motor without a gear reports, rad.
const COARSEST_RESOLUTION_RAD: f64 = 4e-4;

/// How near to the start position counts as there, rad at the handle: the slack of a gear, or a count of a coarse encoder.
pub const HANDLE_AT_START_RAD: f64 = 0.005;

/// A motor on the bus.
pub trait Drive: std::fmt::Debug + Send {
    /// Checks the identity; writes limits, watchdogs and frames, and reads back what can be read. The motor has no power.
    ///
    /// # Errors
    /// Whatever is refused, not taken or not answered; the motor stays without power.
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault>;

    /// Objects that were missing or refused at the last `prepare`; a motor without an object dictionary has none.
    fn findings(&self) -> &[ObjectFinding] {
        &[]
    }

    /// The line for the rig file that names this motor, if small motions have proved it since the program was started.
    fn proved(&self) -> Option<&str> {
        None
    }

    /// The nodes whose heartbeats are monitored.
    fn monitored_nodes(&self) -> Vec<MonitoredNode>;

    /// Finds the start position under supervision. Afterwards the cycle can give the motor power.
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

    /// Handles a frame that is not in the rig file. Returns whether it is this motor's.
    ///
    /// # Errors
    /// What the motor reports in it.
    fn handle_frame(&mut self, frame: &Frame, arrival: Arrival) -> Result<bool, CanFault>;

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

    /// Speed and acceleration of the way to the start position that the cycle goes.
    fn approach(&self) -> Profile;

    /// Deceleration of the drive's own quick-stop ramp, rad/s2 at the handle; `None` for a motor that is stopped by targets
    /// that come to rest.
    fn stops_by_itself(&self) -> Option<f64> {
        None
    }

    /// Whether the motor, according to its latest frames, does what it was asked: a drive must leave its powered state by itself as
    /// soon as it gets a quick stop, and has no power as soon as that is taken.
    fn obeys(&self, _readings: &Readings, _request: DriveRequest) -> bool {
        true
    }

    /// Identifier of the motor's own answer in each period, if it is no frame of the rig file.
    fn reply_id(&self) -> Option<u16> {
        None
    }

    /// Step of the measured angle, rad at the handle.
    fn angle_resolution_rad(&self) -> f64 {
        COARSEST_RESOLUTION_RAD
    }

    /// Stores the motor's state from the complete frames of a period, for the next target.
    fn period_complete(&mut self, readings: &Readings);

    /// Whether arming takes the present place of the handle for the start position, unless the motor already has an origin
    /// from this session.
    fn takes_present_position(&self) -> bool;

    /// Whether the motor moves at every arming to find its start position, where nobody knows yet how far that is.
    fn homes_by_moving(&self) -> bool {
        false
    }

    /// Whether the motor itself shows that it lost its origin since it was armed last. One that does not is armed again only where
    /// the operator says that the handle stands at the start position, and the motor reads the same.
    fn shows_lost_origin(&self) -> bool {
        false
    }

    /// Asks a motor that an earlier process armed whether it still has the origin of that arming, and where the handle is.
    /// The motor has no power; nothing is changed in it.
    ///
    /// # Errors
    /// The motor does not answer, or is another one.
    fn ask_origin(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<OriginReport, CanFault>;

    /// The origin of an earlier process still holds: [`Drive::start`] goes by it, and fails if the motor loses it before.
    /// To be called after [`Drive::ask_origin`] has said so.
    fn adopt_origin(&mut self, limits: &HandleLimits);

    /// How the start position was known when the motor was armed last.
    fn origin(&self) -> Origin;

    /// Removes the power and confirms it. Returns the disobedience of a motor that has no power, but did not let go when it was told.
    ///
    /// # Errors
    /// [`CanFault::PowerNotConfirmed`], or why it cannot be spoken to.
    fn power_off(&mut self, link: &mut Link) -> Result<Option<CanFault>, CanFault>;
}

/// Leaves a motor that does not obey to its own watchdog: the program's heartbeat ends and the nodes are stopped, so that nothing
/// keeps the power on. The operator is told to press the emergency stop before anybody asks the motor whether that helped.
pub fn leave_to_watchdog(link: &mut Link, nodes: &[u8]) {
    link.set_own_heartbeat(None);
    for node in nodes {
        let _ = link.nmt(NmtCommand::Stop, *node);
    }
    tracing::error!("the motor does not obey: PRESS THE EMERGENCY STOP");
}

/// What a motor says of the origin that an earlier process gave it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OriginReport {
    /// Whether it still has that origin; `None` if the motor cannot show it.
    pub is_kept: Option<bool>,
    /// The handle's angle from the origin that the motor has now, whichever that is; `None` if it was not told.
    pub angle: Option<JointAngle>,
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
    /// Nothing: the motor moves by itself, or has no power and is only looked at. It reports all the same.
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

/// Supervises a motor that moves without targets: to its home, or in the small motions that prove it.
pub trait MotionMonitor {
    /// The motor begins to move, or to be looked at. What was seen before does not count, and angles are not compared with the limits.
    fn begin(&mut self);

    /// Supervises one period. Returns what the frames said, and the angle at SYNC.
    ///
    /// # Errors
    /// A limit that is exceeded, a sensor without a measurement, or frames that stay away.
    fn period(&mut self, link: &mut Link, drive: &mut dyn Drive) -> Result<(Readings, JointAngle), CanFault>;
}
