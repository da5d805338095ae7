//! What moves the wrist and measures it: one command in, one sample out, each period.
//!
//! A rig comes up disarmed. Only the operator's word turns a [`Rig`] into its [`Armed`] form, and only that one moves,
//! so a program that forgets to ask does not build.

mod fault;

pub use fault::{Channel, Fault, Quantity};

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
        /// Which trial this is.
        trial: TrialKey,
    },
    /// Keep on as before: the motor is moving.
    Moving,
}

/// Which way the person pushes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Flexion: against the ramp.
    Flexion,
    /// Extension: with it.
    Extension,
}

/// Names a trial by its place in the schedule, so that a trial that is run again after an interruption draws the same
/// random numbers, and one that was rejected draws new ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialKey {
    /// Run for practice, before the measured trials.
    pub practice: bool,
    /// Place in the order drawn, from 1.
    pub position: u32,
    /// How often it was rejected before.
    pub rejections: u32,
    /// Ramp velocity, rad/s. A person is not told; a virtual person's muscle needs it.
    pub velocity_rad_s: f64,
}

/// The operator has said that the motor may move.
#[derive(Debug)]
pub struct OperatorsWord(());

impl OperatorsWord {
    /// To be called where the operator has just said so, and nowhere else.
    pub fn given() -> Self {
        Self(())
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
    fn arm(self, word: OperatorsWord, limits: &Limits) -> Result<Self::Armed, (Self, Fault)>;
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

    /// From now on, EMG is given in units `factors` times as large (FCR, ECR): the maximal effort was measured.
    fn rescale_emg(&mut self, factors: [f64; 2]);

    /// Takes the power off the motor.
    fn disarm(self) -> Self::Disarmed;
}
