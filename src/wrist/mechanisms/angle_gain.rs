//! A calibration error of the angle.

use super::channel_errors::ChannelErrors;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;

/// Wrong scale of the angle channel.
pub struct AngleGain;

impl Mechanism for AngleGain {
    const ID: &'static str = "angle_gain";
    const TITLE: &'static str = "the angle is recorded too large or too small";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "factor",
        "recorded over true angle",
        (0.3, 3.0),
        Some(1.0),
        1.05,
        Prior::LogNormal { median: 1.0, log_sd: 0.1 },
    )];
    const EQUATION: &'static str = "theta_recorded = factor theta_m";
    const SOURCE: &'static str = "Calibration factor";
    const PRIOR_SOURCE: &'static str = "\
        A calibration is seldom off by more than 20 % (assumed; an encoder itself is exact, so an error \
        is one of gear or unit)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::AngleChannel, argument: None, sd: 0.0 };
    const ALTERS_ANGLE: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.87, 1.15].map(|factor| vec![factor]).to_vec()
    }

    #[inline(always)]
    fn alter_channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.angle_gain = p[0];
    }
}
