//! The trait of a mechanism: what its file declares.

use serde::{Deserialize, Serialize};

use super::channel_errors::ChannelErrors;
use super::covariates::{Covariates, DataRequirement};
use super::parameter::MechanismParameter;
use super::place::LawSpace;
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};
use crate::wrist::plant::{Lever, Plant};

/// Standard deviation of the relative change of a mechanism's size with the order of the trials, with torque and with velocity, each over
/// half its range: amplifiers warm, joints bed in. Assumed.
pub const SIZE_DRIFT_SD: f64 = 0.1;

/// Longest step of an integration through a first-order lag of `time_constant_s`, s: its error is below 1e-4 N m.
///
/// A torque that rises steadily is late by the time constant, and a step leaves a part of that which goes with the fourth power of the
/// step in time constants. So the same error allows a faster lag more of them.
pub(super) fn longest_step_of_a_lag(time_constant_s: f64) -> f64 {
    /// A lag of this time constant, s, allows a step of half of it: measured against 256 steps.
    const TIME_CONSTANT_S: f64 = 3.5e-4;
    0.5 * time_constant_s * libm::sqrt(libm::sqrt(TIME_CONSTANT_S / time_constant_s))
}

/// Where a mechanism acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MechanismClass {
    /// In the wrist.
    Plant,
    /// In the lever or the motor.
    Rig,
    /// In the sensors.
    Sensor,
    /// From trial to trial.
    Trial,
}

/// Where a session shows a mechanism, which decides how a diagnosis looks for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EvidenceSource {
    /// In the torque within the trials: a score test on the residuals, then a fit with the mechanism.
    Trace,
    /// In how k_srs differs between trials: a regression on a covariate. A score test within the trials is made as well.
    AcrossTrials,
    /// In the hold before the ramp: a sinusoid of the mains, which is subtracted before the fit. One mechanism at most.
    Hold,
    /// In the law that the elastic limits of the trials follow over velocity and torque.
    LimitLaw,
    /// In single trials that differ from their repetitions. One mechanism at most.
    SingleTrials,
}

/// What the priors and the probe values of a mechanism may depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeContext {
    /// The lever that the session states; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// Highest torque measured in any window, N m.
    pub highest_torque_nm: f64,
    /// Length of the analysis window from the onset, s.
    pub window_s: f64,
}

/// One way in which reality may differ from Eq. 1-7.
///
/// A mechanism's file declares the constants and overrides the methods that it needs; a method that is not overridden does
/// nothing. `p` holds the mechanism's parameters in the order of [`Mechanism::PARAMETERS`].
pub trait Mechanism {
    /// Identifier in results and model files.
    const ID: &'static str;
    /// Description in a few words.
    const TITLE: &'static str;
    /// Where it acts.
    const CLASS: MechanismClass;
    /// Where a session shows it.
    const EVIDENCE: EvidenceSource;
    /// Its parameters.
    const PARAMETERS: &'static [MechanismParameter];
    /// Values of its last parameter, which no fit changes, for which its law is compared. They are equally probable, and the first is
    /// that of a file that gives none. Empty for a mechanism with one law.
    const LAWS: &'static [f64] = &[];
    /// Its equation in plain text: `x'` is the rate of x, `x += y` adds y to a torque of Eq. 3-7.
    const EQUATION: &'static str;
    /// Source of its functional form.
    const SOURCE: &'static str;
    /// Source of the priors of its parameters; "assumed" where there is none.
    const PRIOR_SOURCE: &'static str;
    /// Where it acts, and how far its real law may differ from its equation.
    const LAW_SPACE: LawSpace;
    /// Standard deviation of the relative change of its size with the torque of the trials, over half the range of the torques; by default
    /// that of joints that bed in and amplifiers that warm.
    const TORQUE_SCALING_SD: f64 = SIZE_DRIFT_SD;
    /// Data that a session must hold.
    const NEEDS: &'static [DataRequirement] = &[];
    /// Number of states that it adds to the model. Without [`Mechanism::ADDS_TORQUE`] they are states of the torque channel, whose rates
    /// are linear in them and in the torque.
    const STATES: usize = 0;
    /// Whether its torque sets in as sharply as the yield.
    const FOLLOWS_YIELD: bool = false;
    /// Whether it asks for its states at past times.
    const READS_PAST: bool = false;
    /// Whether it overrides [`Mechanism::add_torques`].
    const ADDS_TORQUE: bool = false;
    /// Whether it alters more of the plant than k_dec, x_e and a_s.
    const ALTERS_LINEAR_PART: bool = false;
    /// Whether it overrides [`Mechanism::alter_channels`].
    const ALTERS_ANGLE: bool = false;
    /// How long before the onset it may begin to act, s.
    const BEFORE_ONSET_S: f64 = 0.0;
    /// Index of the parameter that is the frequency (Hz) of a sinusoid to subtract from the records before a fit.
    const SUBTRACTED_FREQUENCY: Option<usize> = None;

    /// Starting value of a fit for a parameter, in a rig with this lever; by default the typical value.
    fn starting_value(parameter: usize, lever: Option<Lever>) -> f64 {
        let _ = lever;
        Self::PARAMETERS[parameter].typical
    }

    /// Prior of a parameter in this session; by default that of [`Mechanism::PARAMETERS`].
    fn prior(parameter: usize, session: &ProbeContext) -> Prior {
        let _ = session;
        Self::PARAMETERS[parameter].prior
    }

    /// Parameter values at which a diagnosis tests whether the mechanism would help; by default the typical values.
    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        let _ = session;
        vec![Self::PARAMETERS.iter().map(|parameter| parameter.typical).collect()]
    }

    /// Moves the start of an effect that begins before the onset to the onset: a subject does not know of the ramp before.
    fn start_at_onset(p: &mut [f64]) {
        let _ = p;
    }

    /// Range of the first parameter in which `run --hide` draws it, or `None` if the mechanism cannot be hidden. By default
    /// from two to four times as far from no effect as the typical value.
    fn hidden_range(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        let first = Self::PARAMETERS.first()?;
        let absent = first.absent?;
        Some((absent + 2.0 * (first.typical - absent), absent + 4.0 * (first.typical - absent)))
    }

    /// Alters the coefficients of the plant in a trial.
    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let _ = (p, plant, trial);
    }

    /// Alters how the recorded angle becomes the motor's angle.
    #[inline(always)]
    fn alter_channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        let _ = (p, channels);
    }

    /// Adds torques (N m) and writes the rates of its states.
    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        rates: &mut [T],
    ) {
        let _ = (p, context, states, torques, rates);
    }

    /// Alters the measured torque (N m, a change from the steady state) and writes the rates of its states.
    #[inline(always)]
    fn alter_measurement<T: Number>(
        p: &[T],
        states: &OwnStates<'_, T>,
        trial: &Covariates<T::Plain>,
        torque: T,
        rates: &mut [T],
    ) -> T {
        let _ = (p, states, trial, rates);
        torque
    }

    /// Lags (s) at which the real law of the past may differ from the catalogued one, from the shortest to the longest; `None` if it may do so
    /// over the whole memory of a free law.
    fn law_lags_s(p: &[f64]) -> Option<[f64; 2]> {
        let _ = p;
        None
    }

    /// The longest step of an integration that its states allow, s, where the motor turns at up to `speed_rad_s`.
    fn longest_step_s(p: &[f64], speed_rad_s: f64) -> f64 {
        let _ = (p, speed_rad_s);
        f64::INFINITY
    }

    /// Torque that the torque channel shows in addition, at any time of the session, N m.
    fn disturbance_nm(p: &[f64], session_time_s: f64) -> f64 {
        let _ = (p, session_time_s);
        0.0
    }
}
