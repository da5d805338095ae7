//! Stiffness that follows the EMG of the flexor rather than the target torque.

use super::{MechanismClass, Covariates, Mechanism, DataRequirement, MechanismParameter};
use crate::number::Number;
use crate::wrist::Lever;
use crate::wrist::plant::Plant;

/// See the module.
pub struct ActivationScaling;

impl Mechanism for ActivationScaling {
    const ID: &'static str = "activation_scaling";
    const TITLE: &'static str = "stiffness follows the EMG rather than the target torque";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("slope_nm_per_rad_per_mvc", "stiffness per flexor EMG in excess of what the target asks", (-500.0, 500.0), Some(0.0), 30.0),
    ];
    const SOURCE: &'static str = "Linear in the flexor EMG";
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::FlexorEmg];

    /// The flexor's EMG differs by about 1 % of its greatest from trial to trial in a virtual person.
    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        Some((120.0, 240.0))
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let added = p[0].times(trial.flexor_emg_excess_mvc);
        plant.short_range_stiffness = plant.short_range_stiffness + added;
    }
}
