//! A calibration error of the angle.

use super::channel_errors::ChannelErrors;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use crate::number::Number;

/// Wrong scale of the angle channel.
pub struct AngleGain;

impl Mechanism for AngleGain {
    const ID: &'static str = "angle_gain";
    const TITLE: &'static str = "the angle is recorded too large or too small";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] =
        &[MechanismParameter::new("factor", "recorded over true angle", (0.3, 3.0), Some(1.0), 1.05)];
    const EQUATION: &'static str = "theta_recorded = factor theta_m";
    const SOURCE: &'static str = "Calibration factor";
    const ALTERS_ANGLE: bool = true;
    const KNOWN_FORM: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.87, 1.15].map(|factor| vec![factor]).to_vec()
    }

    #[inline(always)]
    fn alter_channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.angle_gain = p[0];
    }
}
