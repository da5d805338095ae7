//! Stiffness that the antagonist adds in proportion to its EMG.

use super::{MechanismClass, Covariates, Mechanism, DataRequirement, MechanismParameter};
use crate::number::Number;
use crate::wrist::Lever;
use crate::wrist::plant::Plant;

/// See the module.
pub struct Cocontraction;

impl Mechanism for Cocontraction {
    const ID: &'static str = "cocontraction";
    const TITLE: &'static str = "antagonist activity adds stiffness";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("stiffness_nm_per_rad_per_mvc", "stiffness per extensor EMG", (-500.0, 500.0), Some(0.0), 20.0),
    ];
    const SOURCE: &'static str = "Stiffness of the antagonist, proportional to its EMG";
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::ExtensorEmg];

    /// Extensors are at about 2 % of their greatest activity in a virtual person, a fifth more or less from trial to trial.
    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        Some((200.0, 450.0))
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let added = p[0].times(trial.extensor_emg_mvc);
        plant.short_range_stiffness = plant.short_range_stiffness + added;
    }
}
