//! A smoother transition at the elastic limit than a_s = 100 gives (Eq. 2).

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant, YIELD_SMOOTHNESS_PER_NM};

/// Yield of the muscle over a range of angles.
pub struct GradualYield;

impl Mechanism for GradualYield {
    const ID: &'static str = "gradual_yield";
    const TITLE: &'static str = "a yield more gradual than a_s = 100";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "smoothness_per_nm",
        "a_s in Eq. 2",
        (3.0, 100.0),
        Some(YIELD_SMOOTHNESS_PER_NM),
        20.0,
        Prior::LogNormal { median: 25.0, log_sd: 0.8 },
    )];
    const EQUATION: &'static str =
        "T_j,elas = k_srs theta_j - ln(1 + exp(a_s k_dec (theta_j - x_e))) / a_s, a_s = smoothness";
    const SOURCE: &'static str = "a_s of Eq. 2 of de Vlugt et al. 2011, there fixed at 100";
    const PRIOR_SOURCE: &'static str = "\
        Yield spread over a torque of some 0.04 N m, within a factor of two to three (assumed): fibres \
        do not yield at one length";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::Joint, argument: Some(Argument::AngleBeyondYield), sd: 0.2 };

    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((4.0, 8.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [8.0, 25.0].map(|smoothness| vec![smoothness]).to_vec()
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        plant.smoothness = p[0];
    }
}
