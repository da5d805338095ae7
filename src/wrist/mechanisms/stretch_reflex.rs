//! Torque from the delayed, rectified stretch velocity through a first-order lag.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass, ProbeContext, longest_step_of_a_lag};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::prior::Prior;
use super::states::OwnStates;
use crate::number::Number;
use crate::wrist::mechanics::{Context, Torques};

/// A reflex that begins later before the end of the window is not looked for, s: its torque has not risen yet.
const SHORTEST_PART_S: f64 = 0.005;

/// The shortest latency, s.
const SHORTEST_LATENCY_S: f64 = 0.012;

/// Time constants within which a first-order lag has given 95 % of its response: other twitches last about as long.
const TIME_CONSTANTS_OF_A_TWITCH: f64 = 3.0;

/// Stretch reflex with its torque inside the analysed window.
pub struct StretchReflex;

impl Mechanism for StretchReflex {
    const ID: &'static str = "stretch_reflex";
    const TITLE: &'static str = "a stretch reflex inside the window";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::Trace;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "gain_nm_s_per_rad",
            "torque per stretch velocity",
            (0.0, 20.0),
            Some(0.0),
            0.3,
            Prior::HalfNormal { sd: 0.5 },
        ),
        MechanismParameter::new(
            "latency_s",
            "delay between stretch and torque",
            (SHORTEST_LATENCY_S, 0.2),
            None,
            0.025,
            Prior::LogNormal { median: 0.04, log_sd: 0.3 },
        ),
        MechanismParameter::new(
            "time_constant_s",
            "lag of the activation",
            (0.002, 0.1),
            None,
            0.01,
            Prior::LogNormal { median: 0.02, log_sd: 0.5 },
        ),
    ];
    const EQUATION: &'static str =
        "T_j += gain r(t - latency), dr/dt = (max(0, theta_j') - r) / time_constant";
    const SOURCE: &'static str = "Delayed, half-wave rectified stretch velocity through a first-order lag";
    const PRIOR_SOURCE: &'static str = "\
        Short-latency reflex of flexor carpi radialis 30 to 55 ms after the stretch \
        (doi:10.1046/j.1365-201x.1999.00608.x), two thirds of the mass; its EMG 20 ms after at the \
        earliest: about 1 % of the mass is below 20 ms; activation lag of 10 to 40 ms and gain assumed. \
        The gain may be the same at all torques or go with the torque (Matthews 1986, \
        doi:10.1113/jphysiol.1986.sp016066)";
    const LAW_SPACE: LawSpace =
        LawSpace { place: Place::Joint, argument: Some(Argument::PastSpeed), sd: 0.2 };
    const ADDS_TORQUE: bool = true;
    const READS_PAST: bool = true;
    /// Torques of 0.9 to 2.1 N m change a gain that goes with the torque by 0.4 over half their range.
    const TORQUE_SCALING_SD: f64 = 0.4;
    const STATES: usize = 1;

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        // Latency and time constant: early and late, fast and slow.
        let early = [(0.015, 0.005), (0.02, 0.01), (0.025, 0.005), (0.03, 0.01)];
        let later = std::iter::successors(Some(0.036), |latency| Some(1.2 * latency))
            .take_while(|latency| *latency < session.window_s - SHORTEST_PART_S)
            .map(|latency| (latency, 0.01));
        later.chain(early).map(|(latency, lag)| vec![0.3, latency, lag]).collect()
    }

    fn law_lags_s(p: &[f64]) -> Option<[f64; 2]> {
        Some([SHORTEST_LATENCY_S, p[1] + TIME_CONSTANTS_OF_A_TWITCH * p[2]])
    }

    fn longest_step_s(p: &[f64], _speed_rad_s: f64) -> f64 {
        longest_step_of_a_lag(p[2])
    }

    #[inline(always)]
    fn add_torques<T: Number>(
        p: &[T],
        context: &Context<'_, T>,
        states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        rates: &mut [T],
    ) {
        rates[0] = (context.state.omega_j.positive_part() - states.now(0)) / p[2];
        torques.joint = torques.joint + p[0] * states.delayed(0, context.time_s, p[1]);
    }
}
