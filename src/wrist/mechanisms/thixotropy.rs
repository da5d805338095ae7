//! Short range stiffness that a movement lowers and rest restores.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant};

/// Short range stiffness that depends on the rest before the trial.
pub struct Thixotropy;

impl Mechanism for Thixotropy {
    const ID: &'static str = "thixotropy";
    const TITLE: &'static str = "stiffness depends on the rest before the trial";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::AcrossTrials;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "amount",
            "part of k_srs missing right after a movement",
            (-0.9, 0.9),
            Some(0.0),
            0.1,
            Prior::Normal { mean: 0.0, sd: 0.2 },
        ),
        MechanismParameter::new(
            "time_constant_s",
            "how fast it comes back at rest",
            (0.5, 60.0),
            None,
            5.0,
            Prior::LogNormal { median: 5.0, log_sd: 0.8 },
        ),
    ];
    const EQUATION: &'static str = "k_srs,trial = k_srs (1 - amount exp(-rest / time_constant))";
    const SOURCE: &'static str = "Lakie et al. 1984: exponential recovery with rest";
    const PRIOR_SOURCE: &'static str = "\
        Movement lowers the stiffness of a relaxed muscle much (Lakie and Campbell 2019), and changes an \
        active one much less (assumed); at the ankle short range stiffness recovers exponentially over \
        rests of 1 to 32 s";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Rest];

    /// None: a protocol has one rest for all trials, so the mechanism would have no effect.
    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        None
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [2.0, 5.0, 12.0].map(|time_constant| vec![0.1, time_constant]).to_vec()
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        let missing = p[0] * (-(T::lift(trial.rest_s) / p[1])).exp();
        plant.short_range_stiffness = plant.short_range_stiffness * (T::constant(1.0) - missing);
    }
}
