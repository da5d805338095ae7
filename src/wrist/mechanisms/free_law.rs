//! Free laws: unknown smooth functions at a place of the model.
//!
//! A free law stands for a mechanism of which only the place and the argument are known. It acts in the equations of motion as
//! a mechanism of the catalogue does, and is linear in its coefficients. In the steady state before the ramp it adds nothing.

use std::ops::Range;

use super::channel_errors::ChannelErrors;
use super::covariates::{Covariates, DataRequirement};
use super::free_law_kind::FreeLawKind;
use super::mechanism::{MechanismClass, longest_step_of_a_lag};
use super::parameter::MechanismParameter;
use super::place::{Argument, LawSpace, Place};
use super::spline::{SPLINE_COEFFICIENTS, SPLINE_PARAMETERS, Spline};
use super::states::OwnStates;
use crate::number::{Lanes, Number};
use crate::wrist::mechanics::{Context, Torques};

/// Number of intervals into which the memory of a law of past speed is divided.
const SPEED_LAGS: usize = SPLINE_COEFFICIENTS;

/// Number of lags of a law of past torque.
const TORQUE_LAGS: usize = 4;

/// Ratio of the time constants of two neighbouring lags; the longest is the memory.
const LAG_RATIO: f64 = 3.0;

/// Place, argument and coefficients of a free law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FreeLaw {
    /// Where the law acts.
    pub place: Place,
    /// What it is a function of.
    pub argument: Argument,
    /// Indices of the coefficients among the parameters of the mechanism.
    pub coefficients: Range<usize>,
}

impl FreeLaw {
    /// The law at the argument `u`, for drawing; `parameters` are those of the mechanism.
    ///
    /// - Past speed: the weight of the speed at the lag `u` (s), N m s/rad.
    /// - Past torque: what a unit step of the torque adds at the time `u` (s) after it, N m/(N m).
    /// - Any other argument: h(u) - h(0), N m, or rad for the angle channel. The model subtracts h at rest instead, which differs
    ///   where the argument at rest is not zero: an angle beyond the yield of -x_e, the torque before the ramp.
    pub fn curve(&self, parameters: &[f64], u: f64) -> f64 {
        match self.argument {
            Argument::PastSpeed => {
                let interval = libm::floor(u / parameters[0] * SPEED_LAGS as f64);
                if (0.0..SPEED_LAGS as f64).contains(&interval) {
                    parameters[1 + interval as usize]
                } else {
                    0.0
                }
            }
            Argument::PastTorque => (0..TORQUE_LAGS)
                .map(|lag| -parameters[1 + lag] * libm::exp(-u / (parameters[0] * lag_fraction(lag))))
                .sum(),
            _ => Spline::new(parameters).change(u, 0.0),
        }
    }
}

/// Time constant of lag number `lag` of a law of past torque, as a fraction of the memory.
#[inline(always)]
fn lag_fraction(lag: usize) -> f64 {
    let mut fraction = 1.0;
    let mut longer = lag + 1;
    while longer < TORQUE_LAGS {
        fraction /= LAG_RATIO;
        longer += 1;
    }
    fraction
}

impl FreeLawKind {
    /// Place, argument and coefficients.
    pub(super) fn law(self) -> FreeLaw {
        let first = self.parameters().iter().take_while(|parameter| !parameter.fitted).count();
        FreeLaw {
            place: self.place(),
            argument: self.argument(),
            coefficients: first..self.parameters().len(),
        }
    }

    /// Where the law acts, among the classes of the catalogue.
    pub(super) fn class(self) -> MechanismClass {
        match self.place() {
            Place::Joint | Place::Interface => MechanismClass::Plant,
            Place::Handle => MechanismClass::Rig,
            Place::TorqueChannel | Place::AngleChannel => MechanismClass::Sensor,
            Place::Trials => MechanismClass::Trial,
        }
    }

    /// Data that a session must hold.
    pub(super) fn needs(self) -> &'static [DataRequirement] {
        if self.place() == Place::Handle { &[DataRequirement::Lever] } else { &[] }
    }

    /// Place and argument. A free law is its own discrepancy, so the spread is zero.
    pub(super) fn law_space(self) -> LawSpace {
        LawSpace { place: self.place(), argument: Some(self.argument()), sd: 0.0 }
    }

    /// Starting value of a fit: no effect. A constant of the law starts at its typical value.
    pub(super) fn starting_value(self, parameter: usize) -> f64 {
        let MechanismParameter { absent, typical, .. } = self.parameters()[parameter];
        absent.unwrap_or(typical)
    }

    /// Number of states that the law adds.
    #[inline(always)]
    pub(super) const fn state_count(self) -> usize {
        match self {
            Self::JointPastSpeed => 1,
            Self::TorqueChannelPastTorque => TORQUE_LAGS,
            _ => 0,
        }
    }

    /// The longest step of an integration that the law's states allow, s.
    pub(super) fn longest_step_s(self, p: &[f64]) -> f64 {
        match self {
            Self::TorqueChannelPastTorque => longest_step_of_a_lag(p[0] * lag_fraction(0)),
            _ => f64::INFINITY,
        }
    }

    /// Alters how the recorded angle becomes the motor's angle.
    #[inline(always)]
    pub(super) fn alter_channels<T: Number>(self, p: &[T], channels: &mut ChannelErrors<T>) {
        if matches!(self, Self::AngleChannelAngle) {
            let mut law = [T::constant(0.0); SPLINE_PARAMETERS];
            law.copy_from_slice(p);
            channels.angle_law = Some(law);
        }
    }

    /// Adds torques and writes the rates of the law's states.
    #[inline(always)]
    pub(super) fn add_torques<T: Number>(
        self,
        p: &[T],
        context: &Context<'_, T>,
        states: &OwnStates<'_, T>,
        torques: &mut Torques<T>,
        rates: &mut [T],
    ) {
        let (state, handle, zero) = (context.state, context.handle, T::constant(0.0));
        // One evaluation of the spline serves all arguments, so that it is compiled once.
        let (u, rest) = match self {
            Self::JointAngle => (state.theta_j, zero),
            Self::JointSpeed => (state.omega_j, zero),
            Self::JointAngleBeyondYield => {
                let limit = context.plant.elastic_limit;
                (state.theta_j - limit, -limit)
            }
            Self::JointTime => (T::constant(context.time_s.max(0.0)), zero),
            Self::InterfaceDeflection => (handle.theta - state.theta_j, zero),
            Self::InterfaceSpeed => (handle.omega - state.omega_j, zero),
            Self::HandleAngle => (handle.theta, zero),
            Self::HandleSpeed => (handle.omega, zero),
            Self::JointPastSpeed => {
                rates[0] = state.omega_j;
                torques.joint = torques.joint + response_to_past_speed(p, states, context.time_s);
                return;
            }
            Self::TorqueChannelTorque
            | Self::TorqueChannelTime
            | Self::TorqueChannelPastTorque
            | Self::AngleChannelAngle => return,
        };
        let added = Spline::new(p).change(u, rest);
        match self.place() {
            Place::Interface => torques.interface = torques.interface + added,
            Place::Handle => torques.lever = torques.lever + added,
            _ => torques.joint = torques.joint + added,
        }
    }

    /// Alters the measured torque and writes the rates of the law's states.
    #[inline(always)]
    pub(super) fn alter_measurement<T: Number>(
        self,
        p: &[T],
        states: &OwnStates<'_, T>,
        trial: &Covariates<T::Plain>,
        time_s: f64,
        torque: T,
        rates: &mut [T],
    ) -> T {
        let (u, rest) = match self {
            Self::TorqueChannelTorque => {
                // The model's torque is a change from the steady state.
                let before = T::lift(trial.torque_before_nm);
                (torque + before, before)
            }
            Self::TorqueChannelTime => (T::constant(time_s.max(0.0)), T::constant(0.0)),
            Self::TorqueChannelPastTorque => {
                return torque + response_to_past_torque(p, states, torque, rates);
            }
            _ => return torque,
        };
        torque + Spline::new(p).change(u, rest)
    }
}

/// The sum over k of c_k times the mean speed of the joint between the lags (k - 1) w and k w, w a part of the memory. State 0 is
/// the travel of the joint.
#[inline(always)]
fn response_to_past_speed<T: Number>(p: &[T], states: &OwnStates<'_, T>, time_s: f64) -> T {
    let width = p[0].plain() * T::Plain::splat(1.0 / SPEED_LAGS as f64);
    let per_width = T::Plain::splat(1.0) / width;
    let mut response = T::constant(0.0);
    let (mut later, mut delay) = (states.now(0), width);
    let mut lag = 0;
    while lag < SPEED_LAGS {
        let earlier = states.delayed(0, time_s, T::lift(delay));
        response = response + p[1 + lag] * (later - earlier).times(per_width);
        later = earlier;
        delay = delay + width;
        lag += 1;
    }
    response
}

/// The sum over k of c_k (z_k - torque), z_k the torque behind first-order lags whose time constants are spread over the memory.
#[inline(always)]
fn response_to_past_torque<T: Number>(p: &[T], states: &OwnStates<'_, T>, torque: T, rates: &mut [T]) -> T {
    let mut response = T::constant(0.0);
    let mut lag = 0;
    while lag < TORQUE_LAGS {
        let behind = states.now(lag) - torque;
        let time_constant = p[0].plain() * T::Plain::splat(lag_fraction(lag));
        rates[lag] = -behind.times(T::Plain::splat(1.0) / time_constant);
        response = response + p[1 + lag] * behind;
        lag += 1;
    }
    response
}
