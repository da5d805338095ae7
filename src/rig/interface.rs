//! The two traits of a rig, disarmed and armed.

use super::command::Command;
use super::fault::Fault;
use super::sample::Sample;
use crate::protocol::Limits;

/// The operator has said that the motor may move.
#[derive(Debug)]
pub struct ArmingConsent(());

impl ArmingConsent {
    /// To be called where the operator has just said so, and nowhere else.
    pub fn given() -> Self {
        Self(())
    }
}

/// How a loop keeps its time, and how its bus fares.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Vitals {
    /// Periods so far.
    pub periods: u64,
    /// How late 99 % of them began at most, us.
    pub late_p99_us: u64,
    /// The latest beginning, us.
    pub latest_us: u64,
    /// Periods whose readings came too late, and points in time that were slept through.
    pub missed: u64,
    /// Load of the bus, 0 to 1, if there is one.
    pub bus_load: Option<f64>,
    /// Errors seen on the bus.
    pub bus_errors: u64,
}

/// A rig that cannot move.
pub trait Rig: Sized {
    /// The same rig, able to move.
    type Armed: Armed<Disarmed = Self>;

    /// Sets and checks the limits, takes the motor to its start position and makes it able to move.
    ///
    /// # Errors
    /// The rig, still disarmed, and why.
    fn arm(self, word: ArmingConsent, limits: &Limits) -> Result<Self::Armed, (Self, Fault)>;
}

/// A rig that moves when it is told to.
pub trait Armed: Sized {
    /// The same rig, unable to move.
    type Disarmed: Rig<Armed = Self>;

    /// One period: carries out the command and measures at its end.
    ///
    /// # Errors
    /// What went wrong, after the motor was made safe.
    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault>;

    /// How its loop and its bus fare; `None` if it has neither, and somebody else keeps the time. Asked for now and then.
    fn vitals(&self) -> Option<Vitals> {
        None
    }

    /// From now on, EMG is given in units `factors` times as large (FCR, ECR): the maximal effort was measured.
    fn rescale_emg(&mut self, factors: [f64; 2]);

    /// Takes the power off the motor.
    fn disarm(self) -> Self::Disarmed;
}
