//! A calibration error of the torque.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::states::OwnStates;
use crate::number::Number;

/// Wrong scale of the torque channel.
pub struct TorqueGain;

impl Mechanism for TorqueGain {
    const ID: &'static str = "torque_gain";
    const TITLE: &'static str = "the torque is recorded too large or too small";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] =
        &[MechanismParameter::new("factor", "recorded over true torque", (0.3, 3.0), Some(1.0), 1.05)];
    const EQUATION: &'static str = "T_recorded = factor T_l";
    const SOURCE: &'static str = "Calibration factor";
    const KNOWN_FORM: bool = true;

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
