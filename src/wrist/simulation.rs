//! Input, settings and output of a simulation of whole trials.

use super::further_channel::ScaledChannel;
use super::history::History;
use super::integrate::substeps;
use super::mechanics::Kinematics;
use super::mechanisms::{ActiveMechanisms, Covariates, MechanismKind};
use super::plant::{BASE_PARAMETERS, Lever, Plant};
use crate::signal::Section;

/// A trial as the model needs it: the motion of the motor and the covariates.
#[derive(Debug, Clone)]
pub struct TrialInput {
    /// The recorded motor angle as a change from the hold, with speeds, at every sample from well before the onset.
    pub motion: Vec<Kinematics<f64>>,
    /// Index of the onset in `motion`.
    pub onset: usize,
    /// What is known of the trial besides its motion.
    pub covariates: Covariates,
}

/// Settings of a simulation, common to its trials.
#[derive(Debug, Clone, Copy)]
pub struct SimulationSettings<'a> {
    /// The lever; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// ActiveMechanisms switched on.
    pub kinds: &'a [MechanismKind],
    /// Time between samples, s.
    pub period_s: f64,
    /// Number of samples to simulate from the onset on.
    pub samples: usize,
    /// Number of samples before the onset at which the simulation starts.
    pub lead_samples: usize,
    /// Number of samples, the last at the onset, whose mean is subtracted from the prediction; 0 subtracts nothing.
    pub baseline_samples: usize,
    /// Steps per sample, at least those of [`steps_per_sample`](super::steps_per_sample).
    pub substeps: usize,
    /// Sections of the filter for the predicted torque.
    pub filter: &'a [Section],
    /// Further channels to predict, each behind the torque's filter.
    pub further: &'a [ScaledChannel],
    /// Indices of the parameters to differentiate by.
    pub derivatives: &'a [usize],
    /// Which vector instructions to use.
    pub width: VectorWidth,
}

impl TrialInput {
    /// The motor's highest speed, rad/s.
    pub(super) fn highest_speed_rad_s(&self) -> f64 {
        self.motion.iter().fold(0.0, |highest, knot| knot.omega.abs().max(highest))
    }
}

impl SimulationSettings<'_> {
    /// Length of a trial's parameter vector: the base parameters, then those of the mechanisms.
    pub fn parameter_count(&self) -> usize {
        BASE_PARAMETERS.len() + self.kinds.iter().map(|kind| kind.parameter_count()).sum::<usize>()
    }

    /// Number of values of a trial: the samples of the torque, then those of each further channel.
    pub fn rows(&self) -> usize {
        self.samples * (1 + self.further.len())
    }
}

/// Runge-Kutta steps per sample that the model needs at these `parameters` for a [`trace`](super::trace); see [`substeps`].
pub fn runge_kutta_steps(
    lever: Option<Lever>,
    kinds: &[MechanismKind],
    trial: &TrialInput,
    parameters: &[f64],
    period_s: f64,
) -> usize {
    let plant = altered_plant(lever, kinds, trial, parameters);
    let history = History::new(0.0, period_s, 0);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let active = ActiveMechanisms { kinds, parameters: added, trial: &trial.covariates, history: &history };
    substeps(&plant, active.longest_step_s(trial.highest_speed_rad_s()), period_s)
}

/// The plant of a trial as mechanisms alter it.
pub(super) fn altered_plant(
    lever: Option<Lever>,
    kinds: &[MechanismKind],
    trial: &TrialInput,
    parameters: &[f64],
) -> Plant<f64> {
    let history = History::new(0.0, 1.0, 0);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let active = ActiveMechanisms { kinds, parameters: added, trial: &trial.covariates, history: &history };
    let mut plant = Plant::base(lever, parameters);
    active.alter_plant(&mut plant);
    plant
}

/// Number of trials that are simulated at once. The results have the same bits with every width.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorWidth {
    /// One at a time, on any processor.
    One,
    /// Four at a time (AVX2 and FMA).
    #[cfg(target_arch = "x86_64")]
    Four,
    /// Eight at a time (AVX-512).
    #[cfg(target_arch = "x86_64")]
    Eight,
}

impl VectorWidth {
    /// The widths that this processor supports, the fastest first.
    pub fn available() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            let mut widths = Vec::new();
            if has_avx_512() {
                widths.push(Self::Eight);
            }
            if has_avx_2() {
                widths.push(Self::Four);
            }
            widths.push(Self::One);
            widths
        }
        #[cfg(not(target_arch = "x86_64"))]
        vec![Self::One]
    }

    /// The fastest width that this processor supports.
    pub fn fastest() -> Self {
        static FASTEST: std::sync::OnceLock<VectorWidth> = std::sync::OnceLock::new();
        *FASTEST.get_or_init(|| Self::available()[0])
    }
}

/// Simulated torques and their derivatives.
#[derive(Debug, Clone, Default)]
pub struct SimulatedTorque {
    /// Predicted measured torque, N m: trial by trial, sample by sample from the onset on. The torque of a trial is followed by its
    /// further channels, each scaled to N m.
    pub torque_nm: Vec<f64>,
    /// Its derivatives: trial by trial, value by value, in the order of [`SimulationSettings::derivatives`].
    pub slopes: Vec<f64>,
}

/// Whether the processor has all instructions that vectors of four are compiled for.
#[cfg(target_arch = "x86_64")]
pub(super) fn has_avx_2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Whether the processor has all instructions that the widest vectors are compiled for.
#[cfg(target_arch = "x86_64")]
pub(super) fn has_avx_512() -> bool {
    has_avx_2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw")
}
