//! A cause of misfit that the diagnosis names, and the evidence for it.

use super::across_trials::covariate_regression::CovariateEffect;
use super::across_trials::outliers::Outlier;
use super::evidence::found_law::LawCheck;
use super::interval::Interval;
use super::mains_hum::DetectedHum;
use super::within_trial::cross_validation::Gain;
use crate::fit::Fit;
use crate::wrist::mechanisms::MechanismKind;

/// Evidence for a cause.
#[derive(Debug, Clone)]
pub enum CauseEvidence {
    /// The mechanism was added to the model, and the fit improved.
    WithinTrial {
        /// The fit without the mechanism.
        before: Box<Fit>,
        /// The fit with the mechanism.
        after: Box<Fit>,
        /// Decrease of twice the cost by the mechanism (chi-square units); `None` if the model without it alone was not compared.
        chi_square_gain: Option<f64>,
        /// Improvement on trials left out of the fit.
        gain: Gain,
    },
    /// Hum was found in the holds and subtracted from the records.
    Hold {
        /// The hum.
        hum: DetectedHum,
        /// The fit to the records with hum.
        before: Box<Fit>,
        /// The same model fitted to the records without hum.
        after: Box<Fit>,
        /// Improvement on the ramps.
        gain: Gain,
    },
    /// Rig trials measured the constant that it is about; all fits of the diagnosis use the measured value.
    RigTrials {
        /// The fit with the constant as the session states it.
        before: Box<Fit>,
        /// The fit with the constant as measured.
        after: Box<Fit>,
        /// How far the constant is from its stated value, in standard deviations of a sound rig's and of the measurement together.
        deviation_sds: f64,
    },
    /// The trials' stiffnesses depend on the mechanism's covariate.
    AcrossTrials(CovariateEffect),
    /// The stiffnesses of single trials differ from those of their repetitions.
    Outliers(Vec<Outlier>),
}

/// A mechanism that could be in place of a cause.
#[derive(Debug, Clone)]
pub struct AlternativeCause {
    /// The mechanism.
    pub kind: MechanismKind,
    /// Probability that it is the one in this place.
    pub probability: f64,
    /// Its parameters, where it takes the place.
    pub values: Vec<Interval>,
    /// The fits without and with it; `None` where that pair of models was not compared, or where the mechanism acts on the trials'
    /// stiffnesses rather than within the trials.
    pub fits: Option<Box<(Fit, Fit)>>,
}

/// A cause of misfit.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The mechanism.
    pub kind: MechanismKind,
    /// Posterior probability that it is at work.
    pub probability: f64,
    /// Probability of a likelihood ratio at least as large if this cause were not at work and all others of the answer were; `None` if that
    /// model was not compared.
    pub p_value: Option<f64>,
    /// Other mechanisms that could be in place of this one, the most probable first.
    pub alternatives: Vec<AlternativeCause>,
    /// The mechanism's parameters.
    pub values: Vec<Interval>,
    /// Its law beside what the session shows without a law, where a free law acts at its place.
    pub law: Option<LawCheck>,
    /// The evidence.
    pub evidence: CauseEvidence,
}
