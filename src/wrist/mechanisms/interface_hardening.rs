//! Hand-handle stiffness that grows with its deflection: k_h (1 + strength d^2).

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Interface stiffness that grows with the square of the deflection.
pub struct InterfaceHardening;

impl Mechanism for InterfaceHardening {
    const ID: &'static str = "interface_hardening";
    const TITLE: &'static str = "the hand-handle interface stiffens as it is deflected";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "strength_per_rad2",
        "relative growth of k_h with the square of the deflection",
        (0.0, 200000.0),
        Some(0.0),
        2000.0,
        Prior::HalfNormal { sd: 4000.0 },
    )];
    const EQUATION: &'static str = "T_h = b_h d' + k_h d (1 + strength d^2), d = theta_l - theta_j";
    const SOURCE: &'static str = "Cubic spring; skin and foam stiffen under load";
    const PRIOR_SOURCE: &'static str = "\
        Skin and padding double the stiffness at a deflection of 15 mrad or more, about 1.5 mm at a \
        radius of 0.1 m (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::Interface, argument: Some(Argument::Deflection), sd: 0.2 };
    const ADDS_TORQUE: bool = true;

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        let deflection = context.handle.theta - context.state.theta_j;
        let growth = p[0] * deflection * deflection;
        torques.interface = torques.interface + context.plant.interface_stiffness * deflection * growth;
    }
}
