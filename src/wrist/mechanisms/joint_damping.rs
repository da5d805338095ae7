//! Damping b_j in the joint that is not negligible (Eq. 7).

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::{JOINT_DAMPING_NM_S_PER_RAD, Plant};

/// Viscous damping of the wrist joint.
pub struct JointDamping;

impl Mechanism for JointDamping {
    const ID: &'static str = "joint_damping";
    const TITLE: &'static str = "damping in the joint";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "b_j_nm_s_per_rad",
        "joint damping b_j",
        (0.0, 2.0),
        Some(JOINT_DAMPING_NM_S_PER_RAD),
        0.05,
        Prior::HalfNormal { sd: 0.2 },
    )];
    const EQUATION: &'static str = "T_j = b_j theta_j' + T_j,elas";
    const SOURCE: &'static str = "Eq. 7 of de Vlugt et al. 2011, where b_j is fixed at a negligible value";
    const PRIOR_SOURCE: &'static str = "\
        The passive wrist is nearly free of damping (section 2.3 of de Vlugt et al. 2011: negligible); \
        with active muscles a few 0.1 N m s/rad at most (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Speed), sd: 0.4 };
    const ALTERS_LINEAR_PART: bool = true;

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        plant.joint_damping = p[0];
    }
}
