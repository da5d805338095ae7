//! A low-pass in the torque channel that the angle channel does not have.

use super::covariates::Covariates;
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext, longest_step_of_a_lag};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::{Lanes, Number};
use crate::wrist::plant::Lever;

/// Orders of a low-pass whose responses differ most for the same delay: a resistor with a capacitor, and a filter of flat delay, which a
/// mean over some samples and Bessel filters of higher order are much like.
const ORDERS: [f64; 2] = [1.0, 2.0];

/// The square of the quality factor of a Bessel low-pass of second order.
const SQUARED_QUALITY_OF_SECOND_ORDER: f64 = 1.0 / 3.0;

/// The square of a quality factor below which a low-pass is one of first order: the second pole is a hundred times as fast.
const LEAST_SQUARED_QUALITY: f64 = 0.01;

/// Low-pass filter of the torque channel.
pub struct TorqueLag;

impl Mechanism for TorqueLag {
    const ID: &'static str = "torque_lag";
    const TITLE: &'static str = "a low-pass in the torque channel alone";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "cutoff_hz",
            "cut-off of the first-order low-pass of the same delay",
            (10.0, 5000.0),
            None,
            150.0,
            Prior::LogNormal { median: 150.0, log_sd: 0.7 },
        ),
        MechanismParameter {
            fitted: false,
            ..MechanismParameter::new(
                "order",
                "order of the low-pass",
                (1.0, 2.0),
                None,
                1.0,
                Prior::LogNormal { median: 1.4, log_sd: 0.3 },
            )
        },
    ];
    const LAWS: &'static [f64] = &ORDERS;
    const EQUATION: &'static str = "\
        T_recorded = T_l - T_recorded' / w - (order - 1) / 3 T_recorded'' / w^2, w = 2 pi cutoff";
    const SOURCE: &'static str = "Low-pass of first order, or Bessel low-pass of second order (Thomson 1949)";
    const PRIOR_SOURCE: &'static str = "\
        Low-pass of a strain-gauge amplifier: common settings are 50 to 500 Hz (assumed); \
        both orders are equally probable";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::TorqueChannel, argument: Some(Argument::PastTorque), sd: 0.1 };
    const STATES: usize = 2;

    fn hidden_range(_lever: Option<Lever>) -> Option<(f64, f64)> {
        Some((80.0, 160.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [60.0, 200.0].map(|cutoff_hz| vec![cutoff_hz, ORDERS[0]]).to_vec()
    }

    fn longest_step_s(p: &[f64], _speed_rad_s: f64) -> f64 {
        let squared_quality = SQUARED_QUALITY_OF_SECOND_ORDER * (p[1] - 1.0);
        // Time constant of the faster pole, in units of the delay; of two that are conjugate, of both.
        let fastest = match squared_quality {
            q if q <= LEAST_SQUARED_QUALITY => 1.0,
            q if q < 0.25 => 2.0 * q / (1.0 + libm::sqrt(1.0 - 4.0 * q)),
            q => libm::sqrt(q),
        };
        longest_step_of_a_lag(fastest / (std::f64::consts::TAU * p[0]))
    }

    /// State 0 is the recorded torque, state 1 its rate, in units of w.
    #[inline(always)]
    fn alter_measurement<T: Number>(
        p: &[T],
        states: &OwnStates<'_, T>,
        _trial: &Covariates<T::Plain>,
        torque: T,
        rates: &mut [T],
    ) -> T {
        let (zero, one) = (T::Plain::splat(0.0), T::Plain::splat(1.0));
        let squared_quality = (p[1].plain() - one) * T::Plain::splat(SQUARED_QUALITY_OF_SECOND_ORDER);
        let above = squared_quality - T::Plain::splat(LEAST_SQUARED_QUALITY);
        let is_second = above.where_positive(one, zero);
        let (recorded, rate, w) = (states.now(0), states.now(1), p[0].scale(std::f64::consts::TAU));
        let behind = torque - recorded;
        rates[0] = (behind.times(one - is_second) + rate.times(is_second)) * w;
        rates[1] = ((behind - rate) * w).times(one / above.where_positive(squared_quality, one));
        recorded
    }
}
