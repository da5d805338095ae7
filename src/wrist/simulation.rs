//! Input, settings and output of a simulation of whole trials.

use super::mechanics::Kinematics;
use super::mechanisms::{Covariates, MechanismKind};
use super::plant::{BASE_PARAMETERS, Lever};
use crate::signal::Section;

/// What the model needs to know of a trial.
#[derive(Debug, Clone)]
pub struct TrialInput {
    /// The recorded motor angle as a change from the hold, with speeds, at every sample from well before the onset.
    pub motion: Vec<Kinematics<f64>>,
    /// Index of the onset in `motion`.
    pub onset: usize,
    /// What else is known of it.
    pub covariates: Covariates,
}

/// Trials to simulate alike.
#[derive(Debug, Clone, Copy)]
pub struct SimulationSettings<'a> {
    /// The lever; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// ActiveMechanisms switched on.
    pub kinds: &'a [MechanismKind],
    /// Time between samples, s.
    pub period_s: f64,
    /// How many samples from the onset on are wanted.
    pub samples: usize,
    /// How many samples before the onset the simulation starts.
    pub lead_samples: usize,
    /// How many samples, the onset's the last, make the level that is taken off the prediction; none if zero.
    pub baseline_samples: usize,
    /// Runge-Kutta steps a sample.
    pub substeps: usize,
    /// The filter that the predicted torque goes through.
    pub filter: &'a [Section],
    /// Which parameters derivatives are wanted for.
    pub derivatives: &'a [usize],
    /// Which vector instructions to use.
    pub width: VectorWidth,
}

impl SimulationSettings<'_> {
    /// Length of a trial's parameter vector: the base parameters, then those of the mechanisms.
    pub fn parameter_count(&self) -> usize {
        BASE_PARAMETERS.len() + self.kinds.iter().map(|kind| kind.parameter_count()).sum::<usize>()
    }
}

/// How many trials go through the model at once. The results have the same bits whichever it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorWidth {
    /// One at a time, on any processor.
    One,
    /// Four at a time (AVX2).
    #[cfg(target_arch = "x86_64")]
    Four,
    /// Eight at a time (AVX-512).
    #[cfg(target_arch = "x86_64")]
    Eight,
}

impl VectorWidth {
    /// The widths that this processor can do, the fastest first.
    pub fn available() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            let mut widths = Vec::new();
            if has_avx_512() {
                widths.push(Self::Eight);
            }
            if is_x86_feature_detected!("avx2") {
                widths.push(Self::Four);
            }
            widths.push(Self::One);
            widths
        }
        #[cfg(not(target_arch = "x86_64"))]
        vec![Self::One]
    }

    /// The fastest that this processor can do.
    pub fn fastest() -> Self {
        static FASTEST: std::sync::OnceLock<VectorWidth> = std::sync::OnceLock::new();
        *FASTEST.get_or_init(|| Self::available()[0])
    }
}

/// Predicted torques and their derivatives.
#[derive(Debug, Clone, Default)]
pub struct SimulatedTorque {
    /// Measured torque as predicted, N m: trial by trial, sample by sample from the onset on.
    pub torque_nm: Vec<f64>,
    /// Its derivatives: trial by trial, sample by sample, in the order of [`SimulationSettings::derivatives`].
    pub slopes: Vec<f64>,
}

/// Whether the processor has all that the widest vectors are compiled for.
#[cfg(target_arch = "x86_64")]
pub(super) fn has_avx_512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw")
}
