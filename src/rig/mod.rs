//! What moves the wrist and measures it: one command in, one sample out, each period.
//!
//! A rig comes up disarmed. Only the operator's word turns a [`Rig`] into its [`Armed`] form, and only that one moves,
//! so a program that forgets to ask does not build.

#[cfg(any(unix, windows))]
pub mod can;
mod fault;
mod limit_monitor;
pub mod virtual_wrist;

pub use fault::{Channel, DeviceFault, Fault, FaultClass, Quantity};
pub use limit_monitor::{Exceeded, LimitMonitor, MotionLimits};

use crate::protocol::Limits;

/// What was measured at one sample instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Motor angle from the start position, rad.
    pub theta_m_rad: f64,
    /// Torque in the lever, offset included, N m.
    pub torque_l_nm: f64,
    /// EMG of the flexor carpi radialis, band-passed and not rectified, fraction of MVC.
    pub emg_fcr_mvc: f64,
    /// EMG of the extensor carpi radialis, the antagonist, fraction of MVC.
    pub emg_ecr_mvc: f64,
}

/// What a rig is told each period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// What the motor does.
    pub motor: Motor,
    /// What the person is shown.
    pub cue: Cue,
}

/// What the motor does until the next sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motor {
    /// Be at this angle at the next sample.
    Follow {
        /// Angle from the start position, rad.
        angle_rad: f64,
    },
    /// Go to the safe state of the rig and stay there.
    Safe,
}

/// What the person is shown. Only people look at it: the drive of a motor does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cue {
    /// Rest; nothing is asked.
    Rest,
    /// Let go entirely: the offset is being measured.
    Relax,
    /// As hard as possible, in this direction.
    Effort(Direction),
    /// Bring the shown torque to the target and keep it there.
    Target {
        /// The target torque, N m.
        target_nm: f64,
        /// The torque on the display, offset removed and smoothed, N m.
        shown_nm: f64,
        /// The trial that this is for.
        trial: Upcoming,
    },
    /// Keep on as before: the motor is moving.
    Moving,
}

/// Which way the person pushes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Flexion: against the ramp.
    Flexion,
    /// Extension: with it.
    Extension,
}

/// Names a trial by its place in the schedule, so that a trial that is run again after an interruption draws the same
/// random numbers, and one that was rejected draws new ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialKey {
    /// Run for practice, before the measured trials.
    pub practice: bool,
    /// Place in the order drawn, from 1.
    pub position: u32,
    /// How often it was rejected before.
    pub rejections: u32,
}

/// A trial before its ramp. A person is told nothing of it; a virtual person's muscle needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upcoming {
    /// Which trial.
    pub key: TrialKey,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Its place in the schedule, from 0 (first) to 1 (last).
    pub progress: f64,
    /// Rest since the motor was last home, s.
    pub rest_s: f64,
}

/// The operator has said that the motor may move.
#[derive(Debug)]
pub struct ArmingConsent(());

/// How many steps a radian, a newton metre, a second and the MVC are divided into in a record.
///
/// The session is told what the record keeps, no more, so that a replay of the record is told the same.
pub mod resolution {
    /// Angles, 1/rad.
    pub const ANGLE_PER_RAD: f64 = 1e7;
    /// Torques, 1/(N m).
    pub const TORQUE_PER_NM: f64 = 1e5;
    /// EMG, 1/MVC.
    pub const EMG_PER_MVC: f64 = 1e5;
}

impl Sample {
    /// The sample as a record keeps it.
    pub fn rounded(&self) -> Self {
        let round = |value: f64, steps: f64| (value * steps).round_ties_even() / steps;
        Self {
            theta_m_rad: round(self.theta_m_rad, resolution::ANGLE_PER_RAD),
            torque_l_nm: round(self.torque_l_nm, resolution::TORQUE_PER_NM),
            emg_fcr_mvc: round(self.emg_fcr_mvc, resolution::EMG_PER_MVC),
            emg_ecr_mvc: round(self.emg_ecr_mvc, resolution::EMG_PER_MVC),
        }
    }
}

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
