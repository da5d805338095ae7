//! The recorded angle is the command, and the motor follows it with a finite bandwidth.

use super::channel_errors::ChannelErrors;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::Lever;

/// Recorded command instead of the motor's angle.
pub struct ServoFollowing;

impl Mechanism for ServoFollowing {
    const ID: &'static str = "servo_following";
    const TITLE: &'static str = "the recorded angle is the command, not the motor's";
    const CLASS: MechanismClass = MechanismClass::Rig;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "bandwidth_hz",
        "natural frequency of the critically damped servo",
        (5.0, 2000.0),
        None,
        100.0,
        Prior::LogNormal { median: 120.0, log_sd: 0.7 },
    )];
    const EQUATION: &'static str = "theta_m(s) = theta_recorded(s) / (1 + s / (2 pi f))^2, f = bandwidth";
    const SOURCE: &'static str = "Two equal real poles at the bandwidth";
    const PRIOR_SOURCE: &'static str =
        "Position bandwidth of industrial servo drives, some 50 to 250 Hz (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::AngleChannel, argument: Some(Argument::PastSpeed), sd: 0.1 };
    const ALTERS_ANGLE: bool = true;

    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((100.0, 180.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [60.0, 200.0].map(|bandwidth| vec![bandwidth]).to_vec()
    }

    #[inline(always)]
    fn alter_channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.following_hz = Some(p[0]);
    }
}
