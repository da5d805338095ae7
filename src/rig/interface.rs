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

/// How punctual the periods of a rig were over a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Punctuality {
    /// Periods in which the motor did not get its target: points of the grid that were slept through, and periods whose
    /// frames came after their deadline.
    pub lost_periods: u64,
    /// Longest time between the targets of two successive periods, us.
    pub longest_gap_us: u64,
    /// Latest begin of a period, us after its point of the grid.
    pub latest_us: u64,
}

impl Punctuality {
    /// Adds a later stretch of time: lost periods are summed up, the longest and the latest are kept.
    pub fn add(&mut self, later: Self) {
        self.lost_periods += later.lost_periods;
        self.longest_gap_us = self.longest_gap_us.max(later.longest_gap_us);
        self.latest_us = self.latest_us.max(later.latest_us);
    }
}

/// How a rig knows where its start position is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The motor found it by itself, by a switch, an index or an absolute encoder: it is the same place every time.
    Found,
    /// The present place of the handle was taken for the start position when the rig was armed.
    SetHere,
    /// The motor still has the origin of an earlier arming.
    Kept,
}

impl Origin {
    /// Of a motor that takes the present place for its start position, or finds it; `is_kept` says that it has one already.
    pub(crate) fn at_arming(takes_present_place: bool, is_kept: bool) -> Self {
        match (takes_present_place, is_kept) {
            (false, _) => Self::Found,
            (true, false) => Self::SetHere,
            (true, true) => Self::Kept,
        }
    }
}

/// A rig that cannot move.
pub trait Rig: Sized {
    /// The same rig, able to move.
    type Armed: Armed<Disarmed = Self>;

    /// Sets and checks the limits, takes the motor to its start position and makes it able to move.
    ///
    /// # Errors
    /// The rig, still disarmed, and why.
    fn arm(self, consent: ArmingConsent, limits: &Limits) -> Result<Self::Armed, (Self, Fault)>;

    /// Whether it could not be confirmed, when the rig was disarmed, that the motor has no power.
    fn power_may_be_on(&self) -> bool {
        false
    }
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

    /// How punctual the periods were since this was asked last; `None` if nothing is tied to a clock. Asked after each
    /// [`Armed::exchange`], so it must not block or allocate.
    fn take_punctuality(&mut self) -> Option<Punctuality> {
        None
    }

    /// How the rig knew its start position when it was armed; `None` if it always does.
    fn origin(&self) -> Option<Origin> {
        None
    }

    /// From now on, EMG is given in units `factors` times as large (FCR, ECR): the maximal effort was measured.
    fn rescale_emg(&mut self, factors: [f64; 2]);

    /// Takes the power off the motor.
    fn disarm(self) -> Self::Disarmed;
}
