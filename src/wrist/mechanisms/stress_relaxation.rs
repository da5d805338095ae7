//! A Maxwell branch in parallel with k_j: a spring whose torque decays.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext, longest_step_of_a_lag};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// Stress relaxation of the muscle, as one Maxwell element.
pub struct StressRelaxation;

impl Mechanism for StressRelaxation {
    const ID: &'static str = "stress_relaxation";
    const TITLE: &'static str = "stress relaxation in the muscle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "stiffness_nm_per_rad",
            "stiffness of the Maxwell branch",
            (0.0, 100.0),
            Some(0.0),
            15.0,
            Prior::HalfNormal { sd: 15.0 },
        ),
        MechanismParameter::new(
            "time_constant_s",
            "its relaxation time",
            (0.001, 0.5),
            None,
            0.01,
            Prior::LogNormal { median: 0.01, log_sd: 1.0 },
        ),
    ];
    const EQUATION: &'static str = "T_j += m, dm/dt = stiffness theta_j' - m / time_constant";
    const SOURCE: &'static str = "Maxwell element in parallel with k_j";
    const PRIOR_SOURCE: &'static str = "\
        A branch as stiff as k_srs itself at most; fast cross-bridge and tendon relaxation spans \
        milliseconds to tens of milliseconds (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::Joint, argument: Some(Argument::PastSpeed), sd: 0.2 };
    const ADDS_TORQUE: bool = true;
    const STATES: usize = 1;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.002, 0.006, 0.02].map(|time_constant| vec![15.0, time_constant]).to_vec()
    }

    fn longest_step_s(p: &[f64], _speed_rad_s: f64) -> f64 {
        longest_step_of_a_lag(p[1])
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        rates: &mut [T],
    ) {
        let branch = states.now(0);
        rates[0] = p[0] * context.state.omega_j - branch / p[1];
        torques.joint = torques.joint + branch;
    }
}
