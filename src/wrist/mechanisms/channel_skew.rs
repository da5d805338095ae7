//! The torque record lags (or leads) the angle record.

use super::channel_errors::ChannelErrors;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;

/// Delay between the torque channel and the angle channel.
pub struct ChannelSkew;

impl Mechanism for ChannelSkew {
    const ID: &'static str = "channel_skew";
    const TITLE: &'static str = "torque and angle are not recorded at the same time";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "delay_s",
        "how much the torque lags behind the angle",
        (-0.01, 0.01),
        Some(0.0),
        0.0005,
        Prior::Normal { mean: 0.0, sd: 0.001 },
    )];
    const EQUATION: &'static str = "T_recorded(t) = T_l(t - delay)";
    const SOURCE: &'static str = "Pure delay between the channels";
    const PRIOR_SOURCE: &'static str = "\
        Two or three samples at 2.5 kHz, or the group delay of one anti-aliasing filter, either way \
        (assumed)";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::AngleChannel, argument: None, sd: 0.0 };
    const ALTERS_ANGLE: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [-0.0005, 0.0005].map(|delay| vec![delay]).to_vec()
    }

    #[inline(always)]
    fn alter_channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.torque_delay_s = p[0];
    }
}
