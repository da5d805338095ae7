//! Hum of the mains in the torque channel.
//!
//! The hum is there before the ramp as well as after it. Its phase and amplitude in a trial are therefore estimated from the
//! hold and subtracted from the record before the fit; see [`Sinusoid`](crate::signal::Sinusoid).

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;

/// Sinusoid of the mains in the torque channel.
pub struct MainsHum;

impl Mechanism for MainsHum {
    const ID: &'static str = "mains_hum";
    const TITLE: &'static str = "hum of the mains in the torque";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Hold;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter {
            fitted: false,
            ..MechanismParameter::new(
                "amplitude_nm",
                "amplitude",
                (0.0, 5.0),
                Some(0.0),
                0.03,
                Prior::HalfNormal { sd: 0.03 },
            )
        },
        MechanismParameter {
            fitted: false,
            ..MechanismParameter::new(
                "frequency_hz",
                "50 or 60",
                (45.0, 65.0),
                None,
                50.0,
                Prior::LogNormal { median: 55.0, log_sd: 0.1 },
            )
        },
    ];
    const EQUATION: &'static str = "T_recorded = T_l + amplitude sin(2 pi frequency t)";
    const SOURCE: &'static str = "Sinusoid at the frequency of the mains, amplitude and phase per trial";
    const PRIOR_SOURCE: &'static str =
        "Pick-up of a few times the noise of the gauge (assumed); mains of 50 or 60 Hz";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::TorqueChannel, argument: None, sd: 0.0 };
    const SUBTRACTED_FREQUENCY: Option<usize> = Some(1);

    fn disturbance_nm(p: &[f64], session_time_s: f64) -> f64 {
        p[0] * libm::sin(std::f64::consts::TAU * p[1] * session_time_s)
    }
}
