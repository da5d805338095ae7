//! What an error of a constant that nobody measured would do to the estimates of a session, by fits with the constant changed.

use rayon::prelude::*;
use serde::Serialize;

use crate::dataset::RigQuantity;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::model::parameter_index::{K_SRS, X_E};
use crate::fit::population::session_fit::SessionFit;

/// The error that is asked about, as a part of the constant.
pub const ASSUMED_ERROR: f64 = 0.2;

/// The constants that are asked about.
const ASKED: [RigQuantity; 5] = [
    RigQuantity::LeverInertia,
    RigQuantity::LeverDamping,
    RigQuantity::LeverStiffness,
    RigQuantity::TorqueGain,
    RigQuantity::AngleGain,
];

/// What an error of one constant does to k_srs and x_e.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AssumedConstant {
    /// The constant.
    pub constant: RigQuantity,
    /// The value in the fit, in the unit of the constant.
    pub assumed: f64,
    /// Change of the mean k_srs, %, if the constant is smaller in truth by [`ASSUMED_ERROR`], and if it is larger; `None` if no fit says.
    pub k_srs_percent: [Option<f64>; 2],
    /// The same of x_e.
    pub x_e_percent: [Option<f64>; 2],
}

/// The fit whose estimates are asked about.
#[derive(Debug, Clone, Copy)]
pub enum AskedFit<'a> {
    /// Each trial on its own.
    Trials(&'a Fit),
    /// The session as a whole.
    Session(&'a SessionFit),
}

impl AskedFit<'_> {
    /// The fit to the same session with other constants, from the optimum of this one.
    fn refitted_to(self, observations: &Observations) -> Option<Fit> {
        match self {
            Self::Trials(fit) => Some(fit.refitted_to(observations)),
            Self::Session(session) => session.refitted_to(observations).ok().map(|own| own.fit),
        }
    }
}

/// What an error of each constant would do that this rig has and `is_measured` does not say to be measured.
pub fn assumed_constants(
    observations: &Observations,
    fit: AskedFit,
    is_measured: impl Fn(RigQuantity) -> bool,
) -> Vec<AssumedConstant> {
    let constants = observations.constants;
    let asked: Vec<(RigQuantity, f64)> = ASKED
        .iter()
        .filter(|own| !is_measured(**own))
        .filter_map(|own| Some((*own, constants.value(*own)?)))
        .collect();
    // The optimum itself, since the values of a session are medians about it.
    let Some(here) = fit.refitted_to(observations) else { return Vec::new() };
    let change = |(constant, assumed): &(RigQuantity, f64)| {
        let there = [-ASSUMED_ERROR, ASSUMED_ERROR].map(|error| {
            let changed = constants.with(*constant, assumed * (1.0 + error));
            fit.refitted_to(&observations.with_constants(changed))
        });
        let percent = |parameter: usize| {
            there
                .each_ref()
                .map(|there| there.as_ref().and_then(|there| percent_between(&here, there, parameter)))
        };
        AssumedConstant {
            constant: *constant,
            assumed: *assumed,
            k_srs_percent: percent(K_SRS),
            x_e_percent: percent(X_E),
        }
    };
    asked.par_iter().map(change).collect()
}

/// Change of the mean of a parameter over the trials that determine it in both fits, %.
fn percent_between(from: &Fit, to: &Fit, parameter: usize) -> Option<f64> {
    let trials: Vec<usize> = (0..from.parameters.len())
        .filter(|trial| !from.at_bound(*trial, parameter) && !to.at_bound(*trial, parameter))
        .collect();
    let sum = |fit: &Fit| trials.iter().map(|trial| fit.parameters[*trial][parameter]).sum::<f64>();
    let percent = 100.0 * (sum(to) / sum(from) - 1.0);
    percent.is_finite().then_some(percent)
}
