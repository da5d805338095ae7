//! Stiffness that grows with the joint angle: k_srs (1 + c theta_j).

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Short range stiffness that grows with the joint angle.
pub struct Stiffening;

impl Mechanism for Stiffening {
    const ID: &'static str = "stiffening";
    const TITLE: &'static str = "stiffness grows with the joint angle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "coefficient_per_rad",
        "relative growth of k_srs with the joint angle",
        (-10.0, 30.0),
        Some(0.0),
        4.0,
        Prior::Normal { mean: 0.0, sd: 6.0 },
    )];
    const EQUATION: &'static str = "T_j += k_srs c theta_j^2 / 2";
    const SOURCE: &'static str = "First-order dependence of stiffness on angle";
    const PRIOR_SOURCE: &'static str =
        "Stiffness changes by up to a third over 0.05 rad, in either direction (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Angle), sd: 0.2 };
    const ADDS_TORQUE: bool = true;

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        let angle = context.state.theta_j;
        torques.joint = torques.joint + context.plant.short_range_stiffness * p[0] * angle * angle.scale(0.5);
    }
}
