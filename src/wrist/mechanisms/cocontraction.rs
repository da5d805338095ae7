//! Stiffness that the antagonist adds in proportion to its EMG.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant};

/// Stiffness of the antagonist.
pub struct Cocontraction;

impl Mechanism for Cocontraction {
    const ID: &'static str = "cocontraction";
    const TITLE: &'static str = "antagonist activity adds stiffness";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::AcrossTrials;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "stiffness_nm_per_rad_per_mvc",
        "stiffness per extensor EMG",
        (-500.0, 500.0),
        Some(0.0),
        20.0,
        Prior::Normal { mean: 0.0, sd: 150.0 },
    )];
    const EQUATION: &'static str = "k_srs,trial = k_srs + stiffness EMG_extensor";
    const SOURCE: &'static str = "Stiffness of the antagonist, proportional to its EMG";
    const PRIOR_SOURCE: &'static str = "\
        The agonist has some 15 N m/rad at a tenth of its maximum (section 3.3 of de Vlugt et al. 2011), \
        so of the order of 150 N m/rad per MVC; a sign that is wrong is possible with crosstalk";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::ExtensorEmg];

    /// Extensor activity of a virtual subject is about 2 % of MVC, with a standard deviation of a fifth of that between trials.
    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((200.0, 450.0))
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let added = p[0].times(trial.extensor_emg_mvc);
        plant.short_range_stiffness = plant.short_range_stiffness + added;
    }
}
