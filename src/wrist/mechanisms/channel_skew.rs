//! The torque record is late (or early) against the angle record.

use super::{ChannelErrors, MechanismClass, Mechanism, MechanismParameter, ProbeContext};
use crate::number::Number;

/// See the module.
pub struct ChannelSkew;

impl Mechanism for ChannelSkew {
    const ID: &'static str = "channel_skew";
    const TITLE: &'static str = "torque and angle are not recorded at the same time";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("delay_s", "how much the torque lags behind the angle", (-0.01, 0.01), Some(0.0), 0.0005),
    ];
    const SOURCE: &'static str = "Pure delay between the channels";
    const ALTERS_ANGLE: bool = true;
    const EXACT: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [-0.0005, 0.0005].map(|delay| vec![delay]).to_vec()
    }

    #[inline(always)]
    fn channels<T: Number>(p: &[T], channels: &mut ChannelErrors<T>) {
        channels.torque_delay_s = p[0];
    }
}
