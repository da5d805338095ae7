//! A torque channel that clips at a level.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;

/// Saturation of the torque channel.
pub struct TorqueSaturation;

impl Mechanism for TorqueSaturation {
    const ID: &'static str = "torque_saturation";
    const TITLE: &'static str = "the torque channel clips";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "level_nm",
        "largest torque the channel shows",
        (0.5, 100.0),
        None,
        5.0,
        Prior::LogNormal { median: 5.0, log_sd: 0.3 },
    )];
    const EQUATION: &'static str = "T_recorded = min(T, level), T = T_0 + T_l";
    const SOURCE: &'static str = "Clipping of the measured torque";
    const PRIOR_SOURCE: &'static str = "\
        About the highest torque of the session, within 30 %: a level far above it has no effect, one \
        far below would be seen by eye (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::TorqueChannel, argument: Some(Argument::Torque), sd: 0.05 };

    /// About the highest torque of the session.
    fn prior(_parameter: usize, session: &ProbeContext) -> Prior {
        Prior::LogNormal { median: session.highest_torque_nm, log_sd: 0.3 }
    }

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.8, 0.95].map(|part| vec![part * session.highest_torque_nm]).to_vec()
    }

    #[inline(always)]
    fn alter_measurement<T: Number>(
        p: &[T],
        _states: &OwnStates<'_, T>,
        trial: &Covariates<T::Plain>,
        torque: T,
        _rates: &mut [T],
    ) -> T {
        // The level limits the torque itself; the model's torque is a change from the steady state.
        let room = p[0] - T::lift(trial.torque_before_nm);
        torque - (torque - room).positive_part()
    }
}
