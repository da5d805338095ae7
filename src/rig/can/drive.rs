//! What every kind of motor can do, whatever it speaks.

use super::bus::Frame;
use super::canopen::{Link, Producer};
use super::fault::CanFault;
use super::file::RigFile;
use super::limits::{Confirmed, HandleLimits};
use super::lookout::Lookout;
use super::readings::Readings;
use super::units::JointAngle;

/// A motor on the bus.
pub trait Drive: std::fmt::Debug + Send {
    /// Who it is, its limits, watchdogs and frames: written, and read back where it can be read. It has no power.
    ///
    /// # Errors
    /// Whatever is refused, not taken or not answered; the motor stays without power.
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &RigFile,
        limits: &HandleLimits,
    ) -> Result<Confirmed, CanFault>;

    /// The nodes whose heartbeats are minded.
    fn producers(&self) -> Vec<Producer>;

    /// Finds the start position and goes there, looked on at all the way; ready to be given power by the cycle.
    ///
    /// # Errors
    /// What went wrong; the motor may have power.
    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        lookout: &mut Lookout<'_>,
    ) -> Result<(), CanFault>;

    /// What is sent ahead of SYNC, as soon as it is known.
    ///
    /// # Errors
    /// [`CanFault::BusGone`]
    fn send_target(
        &mut self,
        link: &mut Link,
        target: JointAngle,
        shown_nm: f64,
        wish: Wish,
    ) -> Result<(), CanFault>;

    /// SYNC, and for motors without it the target.
    ///
    /// # Errors
    /// [`CanFault::BusGone`]
    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault>;

    /// A frame that is none of the rig file's; whether it is this motor's.
    ///
    /// # Errors
    /// What the motor reports in it.
    fn take(&mut self, frame: &Frame) -> Result<bool, CanFault>;

    /// Whether the motor's own answer in this period has come.
    fn answered(&self) -> bool;

    /// Where the handle was at SYNC, and at each of the samples before.
    fn angle(&self, readings: &Readings, sample: usize) -> JointAngle;

    /// What the motor says of itself: nothing, or a fault. Only while it must be enabled.
    ///
    /// # Errors
    /// What it says.
    fn check(&self, readings: &Readings) -> Result<(), CanFault>;

    /// Whether it has power, as far as the latest frames tell.
    fn power(&self, readings: &Readings) -> Power;

    /// How many periods pass from a command to the motor being there.
    fn periods_to_target(&self) -> usize;

    /// Speed of the last stretch to the start position, which the cycle goes, rad/s.
    fn creep_rad_s(&self) -> f64;

    /// The frames of a period are complete: what they say of the motor's state, for the next target.
    fn saw(&mut self, readings: &Readings);

    /// Takes the power off and makes sure of it.
    ///
    /// # Errors
    /// [`CanFault::PowerNotConfirmed`], or why it cannot be spoken to.
    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault>;
}

/// What the motor is to do with a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Take on power, step by step, and stay where it is.
    Enable,
    /// Be there at the next SYNC.
    Follow,
    /// Stop on the quick-stop ramp.
    QuickStop,
    /// Let go.
    NoPower,
    /// Nothing is asked of it: it is moving by itself.
    Nothing,
}

/// Whether a motor has power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Power {
    /// It follows its target.
    Following,
    /// It has power and stops, or is on the way to following.
    Changing,
    /// It has none.
    Off,
}
