//! Velocity-proportional torque beyond the elastic limit.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Viscosity of the muscle beyond the elastic limit.
pub struct PostYieldViscosity;

impl Mechanism for PostYieldViscosity {
    const ID: &'static str = "post_yield_viscosity";
    const TITLE: &'static str = "viscosity beyond the elastic limit";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "coefficient_nm_s_per_rad",
        "torque per speed beyond x_e",
        (0.0, 2.0),
        Some(0.0),
        0.15,
        Prior::HalfNormal { sd: 0.3 },
    )];
    const EQUATION: &'static str = "T_j += c theta_j' / (1 + exp(-a_s k_dec (theta_j - x_e)))";
    const SOURCE: &'static str =
        "Rack and Westbury 1974: beyond the short range the muscle acts like a viscous damper";
    const PRIOR_SOURCE: &'static str = "\
        Torque after the yield of up to about 1 N m at 3 rad/s (assumed; Rack and Westbury 1974 show \
        that it is viscous)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Speed), sd: 0.4 };
    const ADDS_TORQUE: bool = true;
    const FOLLOWS_YIELD: bool = true;

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        torques.joint = torques.joint + p[0] * context.state.omega_j * torques.beyond.logistic();
    }
}
