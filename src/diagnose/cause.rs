//! A named cause, and what it rests on.

use super::across_trials::covariate_regression::Trend;
use super::across_trials::outliers::Outlier;
use super::mains_hum::Hum;
use super::within_trial::cross_validation::Gain;
use crate::fit::Fit;
use crate::wrist::mechanisms::MechanismKind;

/// What a cause rests on.
#[derive(Debug, Clone)]
pub enum Evidence {
    /// It was added to the model and fitted.
    Trace {
        /// The fit before it was added.
        before: Box<Fit>,
        /// The fit with it.
        after: Box<Fit>,
        /// Loss of the sum of squares, in units of the noise.
        worth: f64,
        /// Gain on data held out.
        gain: Gain,
    },
    /// It is in the holds already, and was taken out of the records.
    Hold {
        /// What was found.
        hum: Hum,
        /// The fit with it in the records.
        before: Box<Fit>,
        /// The same model fitted to the records without it.
        after: Box<Fit>,
        /// Gain on the ramps.
        gain: Gain,
    },
    /// The trials' stiffnesses go with it.
    Trend(Trend),
    /// Single trials stand apart.
    Outliers(Vec<Outlier>),
}

/// A named cause.
#[derive(Debug, Clone)]
pub struct Cause {
    /// Which mechanism.
    pub kind: MechanismKind,
    /// Probability of evidence as strong where it is absent, over the whole catalogue.
    pub p_value: f64,
    /// Other mechanisms that the data do not rule out in its place.
    pub indistinguishable: Vec<MechanismKind>,
    /// What it rests on.
    pub evidence: Evidence,
}
