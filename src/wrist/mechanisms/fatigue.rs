//! Short range stiffness that falls with the order of the trials.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::Plant;

/// Short range stiffness that falls during the session.
pub struct Fatigue;

impl Mechanism for Fatigue {
    const ID: &'static str = "fatigue";
    const TITLE: &'static str = "stiffness falls with trial order";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::AcrossTrials;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "fraction",
        "part of k_srs lost from the first trial to the last",
        (-0.9, 0.9),
        Some(0.0),
        0.05,
        Prior::Normal { mean: 0.0, sd: 0.15 },
    )];
    const EQUATION: &'static str = "k_srs,trial = k_srs (1 - fraction progress)";
    const SOURCE: &'static str = "Linear in the place in the session";
    const PRIOR_SOURCE: &'static str = "\
        Stiffness changes by some 10 to 20 % over a session of submaximal holds, in either direction \
        (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let one = T::constant(1.0);
        plant.short_range_stiffness = plant.short_range_stiffness * (one - p[0].times(trial.progress));
    }
}
