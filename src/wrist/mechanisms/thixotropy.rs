//! Short range stiffness that a movement has lowered and rest restores.

use super::{ProbeContext, MechanismClass, Covariates, Mechanism, DataRequirement, MechanismParameter};
use crate::wrist::Lever;
use crate::number::Number;
use crate::wrist::plant::Plant;

/// See the module.
pub struct Thixotropy;

impl Mechanism for Thixotropy {
    const ID: &'static str = "thixotropy";
    const TITLE: &'static str = "stiffness depends on the rest before the trial";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("amount", "part of k_srs missing right after a movement", (-0.9, 0.9), Some(0.0), 0.1),
        MechanismParameter::new("time_constant_s", "how fast it comes back at rest", (0.5, 60.0), None, 5.0),
    ];
    const SOURCE: &'static str = "Lakie et al. 1984: exponential recovery with rest";
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Rest];

    /// A protocol has one rest for all trials, so that it would hide without doing anything.
    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        None
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [2.0, 5.0, 12.0].map(|time_constant| vec![0.1, time_constant]).to_vec()
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let missing = p[0] * (-(T::lift(trial.rest_s) / p[1])).exp();
        plant.short_range_stiffness = plant.short_range_stiffness * (T::constant(1.0) - missing);
    }
}
