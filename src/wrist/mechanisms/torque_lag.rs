//! A low-pass in the torque channel that the angle channel does not have.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext, longest_step_of_a_lag};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::plant::Lever;

/// Low-pass filter of the torque channel.
pub struct TorqueLag;

impl Mechanism for TorqueLag {
    const ID: &'static str = "torque_lag";
    const TITLE: &'static str = "a low-pass in the torque channel alone";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[MechanismParameter::new(
        "cutoff_hz",
        "cut-off of the first-order low-pass",
        (10.0, 5000.0),
        None,
        150.0,
        Prior::LogNormal { median: 150.0, log_sd: 0.7 },
    )];
    const EQUATION: &'static str = "dT_recorded/dt = 2 pi cutoff (T_l - T_recorded)";
    const SOURCE: &'static str = "First-order low-pass";
    const PRIOR_SOURCE: &'static str =
        "Low-pass of a strain-gauge amplifier: common settings are 50 to 500 Hz (assumed)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::TorqueChannel, argument: Some(Argument::PastTorque), sd: 0.1 };
    const STATES: usize = 1;

    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((80.0, 160.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [60.0, 200.0].map(|cutoff| vec![cutoff]).to_vec()
    }

    fn longest_step_s(p: &[f64], _speed_rad_s: f64) -> f64 {
        longest_step_of_a_lag(1.0 / (std::f64::consts::TAU * p[0]))
    }

    #[inline(always)]
    fn alter_measurement<T: Number>(
        p: &[T],
        states: &OwnStates<'_, T>,
        _trial: &Covariates<T::Plain>,
        torque: T,
        rates: &mut [T],
    ) -> T {
        let lagged = states.now(0);
        rates[0] = (torque - lagged) * p[0].scale(std::f64::consts::TAU);
        lagged
    }
}
