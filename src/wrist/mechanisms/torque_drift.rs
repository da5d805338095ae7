//! Voluntary torque that starts to change about the onset.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Voluntary torque that is not steady at the onset.
pub struct TorqueDrift;

impl Mechanism for TorqueDrift {
    const ID: &'static str = "torque_drift";
    const TITLE: &'static str = "the voluntary torque is not steady at the onset";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "slope_nm_per_s",
            "slope of the torque",
            (-50.0, 50.0),
            Some(0.0),
            1.0,
            Prior::Normal { mean: 0.0, sd: 2.0 },
        ),
        MechanismParameter::new(
            "start_s",
            "when it starts, from the onset",
            (-Self::BEFORE_ONSET_S, 0.03),
            None,
            0.005,
            Prior::Normal { mean: 0.005, sd: 0.01 },
        ),
    ];
    const EQUATION: &'static str = "T_j += slope max(0, t - start)";
    const SOURCE: &'static str = "Linear change of the muscle's torque from a moment on";
    const PRIOR_SOURCE: &'static str =
        "Voluntary torque changes by up to some 0.1 N m in 40 ms, about the onset (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Joint, argument: Some(Argument::Time), sd: 0.1 };
    const ADDS_TORQUE: bool = true;
    const BEFORE_ONSET_S: f64 = 0.02;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [-0.005, 0.005, 0.02].map(|start| vec![1.0, start]).to_vec()
    }

    fn start_at_onset(p: &mut [f64]) {
        p[1] = p[1].max(0.0);
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        _states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        _rates: &mut [T],
    ) {
        torques.joint = torques.joint + p[0] * (T::constant(context.time_s) - p[1]).positive_part();
    }
}
