//! Stiffness that follows the EMG of the flexor rather than the target torque.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant};

/// Stiffness in proportion to the flexor EMG.
pub struct ActivationScaling;

impl Mechanism for ActivationScaling {
    const ID: &'static str = "activation_scaling";
    const TITLE: &'static str = "stiffness follows the EMG rather than the target torque";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::AcrossTrials;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "slope_nm_per_rad_per_mvc",
        "stiffness per flexor EMG in excess of what the target asks",
        (-500.0, 500.0),
        Some(0.0),
        30.0,
        Prior::Normal { mean: 0.0, sd: 100.0 },
    )];
    const EQUATION: &'static str = "k_srs,trial = k_srs + slope (EMG_flexor - EMG_flexor,usual)";
    const SOURCE: &'static str = "Linear in the flexor EMG";
    const PRIOR_SOURCE: &'static str = "\
        k_srs rises by 8 N m/rad from 0.9 to 2.1 N m (section 3.3 of de Vlugt et al. 2011), a step of \
        about a tenth of MVC, so of the order of 100 N m/rad per MVC";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::FlexorEmg];

    /// Flexor EMG of a virtual subject varies by about 1 % of MVC from trial to trial.
    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((120.0, 240.0))
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let added = p[0].times(trial.flexor_emg_excess_mvc);
        plant.short_range_stiffness = plant.short_range_stiffness + added;
    }
}
