//! A dead zone between hand and handle: k_h acts only beyond it.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Dead zone of the interface between hand and handle.
pub struct InterfaceSlack;

impl Mechanism for InterfaceSlack {
    const ID: &'static str = "interface_slack";
    const TITLE: &'static str = "a dead zone between hand and handle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "half_width_rad",
        "half-width of the dead zone",
        (0.0, 0.02),
        Some(0.0),
        0.0005,
        Prior::HalfNormal { sd: 0.0007 },
    )];
    const EQUATION: &'static str =
        "T_h = b_h d' + k_h (max(0, d - w) - max(0, -d - w)), d = theta_l - theta_j, w = half_width";
    const SOURCE: &'static str = "Dead zone in series with k_h";
    const PRIOR_SOURCE: &'static str =
        "Play of a firm grip: some 0.1 mm on either side, at a radius of 0.1 m (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::Interface, argument: Some(Argument::Deflection), sd: 0.1 };
    const ADDS_TORQUE: bool = true;

    /// The corners of the dead zone are passed within a step.
    fn longest_step_s(_p: &[f64], _speed_rad_s: f64) -> f64 {
        2.5e-4
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        let deflection = context.handle.theta - context.state.theta_j;
        // The part of the deflection without spring torque: all of it within the dead zone, half a width beyond.
        let (above, below) = ((deflection - p[0]).positive_part(), (-deflection - p[0]).positive_part());
        torques.interface =
            torques.interface - context.plant.interface_stiffness * (deflection - above + below);
    }
}
