//! A lever whose damping b_l differs from the value that the session states.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{Lever, Plant};

/// Damping of the lever, unlike the value that the session states.
pub struct LeverDamping;

impl Mechanism for LeverDamping {
    const ID: &'static str = "lever_damping";
    const TITLE: &'static str = "the lever's damping is not as assumed";
    const CLASS: MechanismClass = MechanismClass::Rig;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "damping_nm_s_per_rad",
        "b_l",
        (0.001, 20.0),
        None,
        0.4,
        Prior::LogNormal { median: 0.4, log_sd: 0.5 },
    )];
    const EQUATION: &'static str = "b_l = damping";
    const SOURCE: &'static str = "b_l of Table 1 of de Vlugt et al. 2011";
    const PRIOR_SOURCE: &'static str = "\
        About the value that the session states, within 50 %: structural damping is not on a drawing \
        (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Handle, argument: None, sd: 0.0 };
    const ALTERS_LINEAR_PART: bool = true;
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Lever];

    /// The value that the session states.
    fn starting_value(parameter: usize, lever: Option<Lever>) -> f64 {
        lever.map_or(Self::PARAMETERS[parameter].typical, |lever| lever.damping_nm_s_per_rad)
    }

    /// About the value that the session states.
    fn prior(parameter: usize, session: &ProbeContext) -> Prior {
        let stated = Self::starting_value(parameter, session.lever);
        Prior::LogNormal { median: stated, log_sd: 0.5 }
    }

    fn hidden_range(lever: Option<Lever>) -> Option<(f64, f64)> {
        lever.map(|lever| (1.5 * lever.damping_nm_s_per_rad, 2.0 * lever.damping_nm_s_per_rad))
    }

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        let factors = |lever: Lever| [0.75, 1.3].map(|factor| vec![factor * lever.damping_nm_s_per_rad]);
        session.lever.into_iter().flat_map(factors).collect()
    }

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        if let Some(lever) = &mut plant.lever {
            lever.damping = p[0];
        }
    }
}
