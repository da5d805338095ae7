//! What the base model may lack: the catalogue of mechanisms.
//!
//! A mechanism is one file that says what it is called, what its parameters mean, and what it adds to the mechanics, to
//! the sensors or to the dependence on the trial. The same value switches it on in the virtual wrist, in the fit and in
//! the diagnosis. To add one, write that file and add one line to the catalogue below.

#[macro_use]
mod catalogue;
mod history;

use serde::{Deserialize, Serialize};

pub use history::{History, hermite};

use super::Lever;
use super::plant::{Context, MEMORY, Plant, Torques};
use crate::number::{Number, Plain};

catalogue! {
    joint_damping::JointDamping,
    joint_friction::JointFriction,
    interface_hardening::InterfaceHardening,
    interface_slack::InterfaceSlack,
    stretch_reflex::StretchReflex,
    stress_relaxation::StressRelaxation,
    post_yield_viscosity::PostYieldViscosity,
    gradual_yield::GradualYield,
    stiffening::Stiffening,
    timed_yield::TimedYield,
    lever_inertia::LeverInertia,
    lever_stiffness::LeverStiffness,
    lever_damping::LeverDamping,
    servo_following::ServoFollowing,
    channel_skew::ChannelSkew,
    torque_lag::TorqueLag,
    torque_gain::TorqueGain,
    angle_gain::AngleGain,
    torque_saturation::TorqueSaturation,
    mains_hum::MainsHum,
    torque_drift::TorqueDrift,
    fatigue::Fatigue,
    thixotropy::Thixotropy,
    cocontraction::Cocontraction,
    outlier_trial::OutlierTrial,
    activation_scaling::ActivationScaling,
}

/// Where a mechanism acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MechanismClass {
    /// In the wrist.
    Plant,
    /// In the lever and the motor.
    Rig,
    /// In what the sensors make of it.
    Sensor,
    /// From trial to trial.
    Trial,
}

/// What a session must hold before a mechanism can be considered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataRequirement {
    /// A compliant lever.
    Lever,
    /// The flexor's EMG.
    FlexorEmg,
    /// The extensor's EMG.
    ExtensorEmg,
    /// The rest before each trial.
    Rest,
    /// Trials at more than one velocity.
    Velocities,
}

/// A parameter of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismParameter {
    /// Name with unit, as results print it.
    pub name: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// Least value that a fit may try.
    pub low: f64,
    /// Greatest value that a fit may try.
    pub high: f64,
    /// The value at which the mechanism has no effect; `None` where only a limit has none.
    pub absent: Option<f64>,
    /// A plausible value, where a fit starts.
    pub typical: f64,
    /// Estimated by least squares together with the base parameters; else by other means, or not at all.
    pub fitted: bool,
}

impl MechanismParameter {
    /// A fitted parameter that is the same in all trials.
    pub const fn new(
        name: &'static str,
        meaning: &'static str,
        range: (f64, f64),
        absent: Option<f64>,
        typical: f64,
    ) -> Self {
        Self { name, meaning, low: range.0, high: range.1, absent, typical, fitted: true }
    }
}

/// What probes may depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeContext {
    /// The lever that the session states.
    pub lever: Option<super::Lever>,
    /// Highest torque measured in any window, N m.
    pub highest_torque_nm: f64,
}

/// What is known of a trial besides its signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariates<P = f64> {
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: P,
    /// Torque before the ramp, N m.
    pub torque_before_nm: P,
    /// Place in the session, from 0 (first trial) to 1 (last).
    pub progress: P,
    /// Rest before the trial, s.
    pub rest_s: P,
    /// Flexor EMG in the hold, less what is usual at this target torque, fraction of MVC.
    pub flexor_emg_excess_mvc: P,
    /// Extensor EMG in the hold, fraction of MVC.
    pub extensor_emg_mvc: P,
}

impl<P: Plain> Covariates<P> {
    /// The covariates of up to `P::LANES` trials side by side; the last fills the lanes that are left.
    pub fn gather(trials: &[Covariates]) -> Self {
        let field = |read: fn(&Covariates) -> f64| {
            let mut values = [0.0; 16];
            for (lane, value) in values.iter_mut().enumerate().take(P::LANES) {
                *value = read(&trials[lane.min(trials.len() - 1)]);
            }
            P::load(&values)
        };
        Self {
            velocity_rad_s: field(|c| c.velocity_rad_s),
            torque_before_nm: field(|c| c.torque_before_nm),
            progress: field(|c| c.progress),
            rest_s: field(|c| c.rest_s),
            flexor_emg_excess_mvc: field(|c| c.flexor_emg_excess_mvc),
            extensor_emg_mvc: field(|c| c.extensor_emg_mvc),
        }
    }
}

impl Default for Covariates {
    fn default() -> Self {
        Self {
            velocity_rad_s: 0.0,
            torque_before_nm: 0.0,
            progress: 0.0,
            rest_s: 0.0,
            flexor_emg_excess_mvc: 0.0,
            extensor_emg_mvc: 0.0,
        }
    }
}

/// How the recorded angle relates to the motor's.
#[derive(Debug, Clone, Copy)]
pub struct ChannelErrors<T> {
    /// How much the torque record lags behind the angle record, s.
    pub torque_delay_s: T,
    /// Recorded angle over true angle.
    pub angle_gain: T,
    /// The record is the command; the motor follows it with this bandwidth, Hz. `None`: the record is the motor's angle.
    pub following_hz: Option<T>,
}

impl<T: Number> ChannelErrors<T> {
    /// Recorded as it is.
    #[inline(always)]
    pub fn faithful() -> Self {
        Self { torque_delay_s: T::constant(0.0), angle_gain: T::constant(1.0), following_hz: None }
    }
}

/// One way in which reality may differ from Eq. 1-7. Every method does nothing unless the mechanism's file says otherwise;
/// `p` are the mechanism's parameters in the order of [`Mechanism::PARAMETERS`].
pub trait Mechanism {
    /// The id that results print.
    const ID: &'static str;
    /// What it is, in a few words.
    const TITLE: &'static str;
    /// Where it acts.
    const CLASS: MechanismClass;
    /// Its parameters.
    const PARAMETERS: &'static [MechanismParameter];
    /// Where its form comes from.
    const SOURCE: &'static str;
    /// What data it needs.
    const NEEDS: &'static [DataRequirement] = &[];
    /// How many states it adds.
    const MEMORY: usize = 0;
    /// It alters how the recorded angle becomes the motor's.
    const ALTERS_ANGLE: bool = false;
    /// It is a constant that is other than assumed: there is no law that could be another.
    const EXACT: bool = false;
    /// How long before the onset it may begin to act, s.
    const BEFORE_ONSET_S: f64 = 0.0;

    /// For a lag, its mean delay, s: another law of the same delay spreads it otherwise.
    fn delay_s(p: &[f64]) -> Option<f64> {
        let _ = p;
        None
    }

    /// What it is in a wrist that does not know of the ramp until it begins: what would begin before it begins with it.
    fn from_the_onset(p: &mut [f64]) {
        let _ = p;
    }

    /// Values at which a diagnosis looks whether the mechanism would help; by default the typical ones.
    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        let _ = session;
        vec![Self::PARAMETERS.iter().map(|parameter| parameter.typical).collect()]
    }

    /// Between which values of the first parameter a game hides it in a virtual wrist, or `None` if it cannot be; by default
    /// from two to four times as far from no effect as the typical value.
    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        let first = Self::PARAMETERS.first()?;
        let absent = first.absent?;
        Some((absent + 2.0 * (first.typical - absent), absent + 4.0 * (first.typical - absent)))
    }

    /// Alters the coefficients of a trial.
    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let _ = (p, plant, trial);
    }

    /// Alters the way from the recorded angle to the motor's.
    #[inline(always)]
    fn channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        let _ = (p, channels);
    }

    /// Adds torques, and gives the rates of its states (`memory[slot]`, ...).
    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        history: &History<T>,
        slot: usize,
        torques: &mut Torques<T>,
        rates: &mut [T; MEMORY],
    ) {
        let _ = (p, moment, history, slot, torques, rates);
    }

    /// Alters the measured torque (a change from the steady state), and gives the rates of its states.
    #[inline(always)]
    fn measure<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        trial: &Covariates<T::Plain>,
        slot: usize,
        torque: T,
        rates: &mut [T; MEMORY],
    ) -> T {
        let _ = (p, moment, trial, slot, rates);
        torque
    }

    /// What the torque channel shows in addition, at any time of the session, N m.
    fn disturbance(p: &[f64], session_time_s: f64) -> f64 {
        let _ = (p, session_time_s);
        0.0
    }
}

/// What is added to the base model while the wrist moves.
pub trait Extension<T: Number> {
    /// Whether there is anything at all.
    const ACTIVE: bool;

    /// How many states are added.
    fn memory(&self) -> usize;

    /// Adds torques and the rates of the added states.
    fn act(&self, moment: &Context<'_, T>, torques: &mut Torques<T>, rates: &mut [T; MEMORY]);

    /// Alters the measured torque.
    fn measure(&self, moment: &Context<'_, T>, torque: T, rates: &mut [T; MEMORY]) -> T;
}

/// The base model: nothing is added.
pub struct NoExtension;

impl<T: Number> Extension<T> for NoExtension {
    const ACTIVE: bool = false;

    #[inline(always)]
    fn memory(&self) -> usize {
        0
    }

    #[inline(always)]
    fn act(&self, _: &Context<'_, T>, _: &mut Torques<T>, _: &mut [T; MEMORY]) {}

    #[inline(always)]
    fn measure(&self, _: &Context<'_, T>, torque: T, _: &mut [T; MEMORY]) -> T {
        torque
    }
}

/// ActiveMechanisms switched on, with their parameters.
pub struct ActiveMechanisms<'a, T: Number> {
    /// Which, in order.
    pub kinds: &'a [MechanismKind],
    /// Their parameters, one after the other.
    pub parameters: &'a [T],
    /// What is known of the trial.
    pub trial: &'a Covariates<T::Plain>,
    /// The added states at the history samples.
    pub history: &'a History<T>,
}

impl<T: Number> ActiveMechanisms<'_, T> {
    /// The coefficients of the trial.
    #[inline(always)]
    pub fn shape(&self, plant: &mut Plant<T>) {
        let mut first = 0;
        for kind in self.kinds {
            let count = kind.parameter_count();
            kind.shape(&self.parameters[first..first + count], plant, self.trial);
            first += count;
        }
    }

    /// The way from the recorded angle to the motor's.
    #[inline(always)]
    pub fn channels(&self) -> ChannelErrors<T> {
        let mut channels = ChannelErrors::faithful();
        let mut first = 0;
        for kind in self.kinds {
            let count = kind.parameter_count();
            kind.channels(&self.parameters[first..first + count], &mut channels);
            first += count;
        }
        channels
    }
}

impl<T: Number> Extension<T> for ActiveMechanisms<'_, T> {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn memory(&self) -> usize {
        self.kinds.iter().map(|kind| kind.memory()).sum()
    }

    #[inline(always)]
    fn act(&self, moment: &Context<'_, T>, torques: &mut Torques<T>, rates: &mut [T; MEMORY]) {
        let (mut first, mut slot) = (0, 0);
        for kind in self.kinds {
            let count = kind.parameter_count();
            kind.act(&self.parameters[first..first + count], moment, self.history, slot, torques, rates);
            first += count;
            slot += kind.memory();
        }
    }

    #[inline(always)]
    fn measure(&self, moment: &Context<'_, T>, torque: T, rates: &mut [T; MEMORY]) -> T {
        let (mut first, mut slot, mut torque) = (0, 0, torque);
        for kind in self.kinds {
            let count = kind.parameter_count();
            let p = &self.parameters[first..first + count];
            torque = kind.measure(p, moment, self.trial, slot, torque, rates);
            first += count;
            slot += kind.memory();
        }
        torque
    }
}
