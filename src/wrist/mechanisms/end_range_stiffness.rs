//! Passive tissue that resists beyond an angle of the joint, near the end of its range of motion.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Stiffness of the joint beyond an angle.
pub struct EndRangeStiffness;

impl Mechanism for EndRangeStiffness {
    const ID: &'static str = "end_range_stiffness";
    const TITLE: &'static str = "passive tissue resists near the end of the range";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "stiffness_nm_per_rad",
            "stiffness beyond the angle",
            (0.0, 500.0),
            Some(0.0),
            30.0,
            Prior::HalfNormal { sd: 30.0 },
        ),
        MechanismParameter::new(
            "start_rad",
            "angle at which it begins",
            (0.0, 0.14),
            None,
            0.04,
            Prior::Normal { mean: 0.05, sd: 0.03 },
        ),
    ];
    const EQUATION: &'static str = "T_j += stiffness max(0, theta_j - start)";
    const SOURCE: &'static str = "Example of docs/how-to/add-a-mechanism.md";
    const PRIOR_SOURCE: &'static str = "Twice k_srs, anywhere in the second half of a ramp (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Angle), sd: 0.2 };
    const ADDS_TORQUE: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.03, 0.05].map(|start| vec![30.0, start]).to_vec()
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        torques.joint = torques.joint + p[0] * (context.state.theta_j - p[1]).positive_part();
    }
}
