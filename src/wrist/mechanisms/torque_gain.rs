//! A calibration error of the torque.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;

/// Wrong scale of the torque channel.
pub struct TorqueGain;

impl Mechanism for TorqueGain {
    const ID: &'static str = "torque_gain";
    const TITLE: &'static str = "the torque is recorded too large or too small";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "factor",
        "recorded over true torque",
        (0.3, 3.0),
        Some(1.0),
        1.05,
        Prior::LogNormal { median: 1.0, log_sd: 0.1 },
    )];
    const EQUATION: &'static str = "T_recorded = factor T_l";
    const SOURCE: &'static str = "Calibration factor";
    const PRIOR_SOURCE: &'static str = "\
        A calibration is seldom off by more than 20 % (assumed; a calibrated gauge itself is within 1 %, \
        so a larger error is one of unit, arm or amplifier)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::TorqueChannel, argument: None, sd: 0.0 };

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.87, 1.15].map(|factor| vec![factor]).to_vec()
    }

    #[inline(always)]
    fn alter_measurement<T: Number>(
        p: &[T],
        _states: &OwnStates<'_, T>,
        _trial: &Covariates<T::Plain>,
        torque: T,
        _rates: &mut [T],
    ) -> T {
        torque * p[0]
    }
}
