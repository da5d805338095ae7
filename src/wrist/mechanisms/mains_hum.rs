//! Hum of the mains in the torque channel.
//!
//! It is there before the ramp as well as after, so its phase and amplitude in a trial are read off the hold and taken out
//! of the record before the fit; see `signal::hum`.

use super::{MechanismClass, Mechanism, MechanismParameter};

/// See the module.
pub struct MainsHum;

impl Mechanism for MainsHum {
    const ID: &'static str = "mains_hum";
    const TITLE: &'static str = "hum of the mains in the torque";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter { fitted: false, ..MechanismParameter::new("amplitude_nm", "amplitude", (0.0, 5.0), Some(0.0), 0.03) },
        MechanismParameter { fitted: false, ..MechanismParameter::new("frequency_hz", "50 or 60", (45.0, 65.0), None, 50.0) },
    ];
    const SOURCE: &'static str = "Sinusoid at the frequency of the mains, amplitude and phase per trial";

    fn disturbance(p: &[f64], session_time_s: f64) -> f64 {
        p[0] * libm::sin(std::f64::consts::TAU * p[1] * session_time_s)
    }
}
