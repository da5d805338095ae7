//! A lever whose stiffness k_l differs from the value that the session states.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant};

/// Stiffness of the lever, unlike the value that the session states.
pub struct LeverStiffness;

impl Mechanism for LeverStiffness {
    const ID: &'static str = "lever_stiffness";
    const TITLE: &'static str = "the lever's stiffness is not as assumed";
    const CLASS: MechanismClass = MechanismClass::Rig;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "stiffness_nm_per_rad",
        "k_l",
        (20.0, 100000.0),
        None,
        900.0,
        Prior::LogNormal { median: 900.0, log_sd: 0.5 },
    )];
    const EQUATION: &'static str = "k_l = stiffness";
    const SOURCE: &'static str = "k_l of Table 1 of de Vlugt et al. 2011";
    const PRIOR_SOURCE: &'static str =
        "About the value that the session states, within a factor of 1.6: a constant read off a drawing (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Handle, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Lever];

    /// The value that the session states.
    fn starting_value(parameter: usize, lever: Option<Lever>) -> f64 {
        lever.map_or(Self::PARAMETERS[parameter].typical, |lever| lever.stiffness_nm_per_rad)
    }

    /// About the value that the session states.
    fn prior(parameter: usize, session: &ProbeContext) -> Prior {
        let stated = Self::starting_value(parameter, session.lever);
        Prior::LogNormal { median: stated, log_sd: 0.5 }
    }

    fn hidden_range(lever: Option<Lever>) -> Option<(f64, f64)> {
        lever.map(|lever| (0.6 * lever.stiffness_nm_per_rad, 0.75 * lever.stiffness_nm_per_rad))
    }

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        let factors = |lever: Lever| [0.75, 1.3].map(|factor| vec![factor * lever.stiffness_nm_per_rad]);
        session.lever.into_iter().flat_map(factors).collect()
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        if let Some(lever) = &mut plant.lever {
            lever.stiffness = p[0];
        }
    }
}
