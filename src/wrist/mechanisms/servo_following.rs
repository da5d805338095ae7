//! The recorded angle is the command; the motor follows it with a finite bandwidth.

use super::{ProbeContext, ChannelErrors, MechanismClass, Mechanism, MechanismParameter};
use crate::wrist::Lever;
use crate::number::Number;

/// See the module.
pub struct ServoFollowing;

impl Mechanism for ServoFollowing {
    const ID: &'static str = "servo_following";
    const TITLE: &'static str = "the recorded angle is the command, not the motor's";
    const CLASS: MechanismClass = MechanismClass::Rig;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("bandwidth_hz", "natural frequency of the critically damped servo", (5.0, 2000.0), None, 100.0),
    ];
    const SOURCE: &'static str = "Two equal real poles at the bandwidth";
    const ALTERS_ANGLE: bool = true;

    fn delay_s(p: &[f64]) -> Option<f64> {
        Some(2.0 / (std::f64::consts::TAU * p[0]))
    }

    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        Some((100.0, 180.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [60.0, 200.0].map(|bandwidth| vec![bandwidth]).to_vec()
    }

    #[inline(always)]
    fn channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.following_hz = Some(p[0]);
    }
}
