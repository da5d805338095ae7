//! The base model from sample to sample: the linear part exactly, the yield as a cubic.
//!
//! Eq. 1-7 are linear but for the torque that the yield takes away (Eq. 2). Over a step this torque is taken as the cubic with its values
//! and slopes at both ends, where those at the end follow from a first guess of the state there. Mechanisms alter the equations, and are
//! integrated step by step (see [`Integrator`](super::Integrator)).

use super::further_channel::FurtherValues;
use super::integrate::HermiteSegment;
use super::linear_response::{FORCE, LINEAR_PARAMETERS, LinearResponse};
use super::plant::{BASE_PARAMETERS, JOINT_DAMPING_NM_S_PER_RAD, Lever, YIELD_SMOOTHNESS_PER_NM};
use crate::number::{Jet, Number, Plain};

/// Number of parameters of the base model.
const PARAMETERS: usize = BASE_PARAMETERS.len();

/// Indices of k_dec and x_e.
const DECREMENT: usize = LINEAR_PARAMETERS;
const LIMIT: usize = LINEAR_PARAMETERS + 1;

/// Below minus this, log(1 + exp(x)) and its slope count as zero. They are below 3e-9 there, less than 1e-10 N m.
const SILENT: f64 = 20.0;

/// A state, in which each angle (rad) is followed by its speed (rad per step).
type Angles<P, const STATES: usize, const ALL: usize> = [Jet<P, ALL>; STATES];

/// The base model of a wrist over steps of one length, with `ALL` derivatives of a state and `LINEAR` of the linear part: six and four, or
/// none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Propagator<P, const STATES: usize, const LINEAR: usize, const ALL: usize> {
    response: LinearResponse<P, STATES, LINEAR>,
    /// a_s k_dec, k_dec and x_e.
    slope: P,
    decrement: P,
    elastic_limit: P,
    /// log(1 + exp(-a_s k_dec x_e)): Eq. 2 as a change from the steady state.
    at_rest: Jet<P, ALL>,
    /// 1 / I_l; `None` for a rigid lever.
    inverse_lever_inertia: Option<f64>,
    step_s: f64,
}

/// The torque that the yield takes away at one time, N m, and its change per step.
#[derive(Debug, Clone, Copy)]
struct Loss<P, const ALL: usize> {
    torque: Jet<P, ALL>,
    rate: Jet<P, ALL>,
}

/// A wrist that moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingWrist<P, const STATES: usize, const ALL: usize> {
    state: Angles<P, STATES, ALL>,
    loss: Loss<P, ALL>,
    /// Whether the yield takes nothing away in any lane.
    is_silent: bool,
}

impl<P: Plain, const STATES: usize, const ALL: usize> MovingWrist<P, STATES, ALL> {
    /// At rest; the first step finds out how near the yield is.
    #[inline(always)]
    pub fn at_rest() -> Self {
        let zero = Jet::constant(0.0);
        Self { state: [zero; STATES], loss: Loss { torque: zero, rate: zero }, is_silent: false }
    }
}

impl<P: Plain, const STATES: usize, const LINEAR: usize, const ALL: usize>
    Propagator<P, STATES, LINEAR, ALL>
{
    /// For steps of `step_s`. `parameters` are the six of the base model.
    #[inline(always)]
    pub fn new(lever: Option<Lever>, parameters: &[P; PARAMETERS], step_s: f64) -> Self {
        let mut linear = [Jet::constant(0.0); LINEAR_PARAMETERS];
        let mut index = 0;
        while index < LINEAR_PARAMETERS {
            linear[index] = Jet::variable(parameters[index], index);
            index += 1;
        }
        let response = LinearResponse::new(lever, &linear, JOINT_DAMPING_NM_S_PER_RAD, step_s);
        let decrement = Jet::<P, ALL>::variable(parameters[DECREMENT], DECREMENT);
        let limit = Jet::<P, ALL>::variable(parameters[LIMIT], LIMIT);
        let slope = decrement.scale(YIELD_SMOOTHNESS_PER_NM);
        Self {
            response,
            slope: slope.value,
            decrement: decrement.value,
            elastic_limit: limit.value,
            at_rest: (-(slope * limit)).softplus(),
            inverse_lever_inertia: lever.map(|lever| 1.0 / lever.inertia_kg_m2),
            step_s,
        }
    }

    /// The torque in the lever, N m, at the start of the motor's motion `motor`.
    #[inline(always)]
    pub fn torque(&self, wrist: &MovingWrist<P, STATES, ALL>, motor: &HermiteSegment<P>) -> Jet<P, ALL> {
        let motor = motor.at(0.0);
        let (driven, coupling) = (&wrist.state[..2], &self.response.coupling);
        Self::torque_between(
            coupling,
            [Jet::lift(motor.theta) - driven[0], Jet::lift(motor.omega).scale(self.step_s) - driven[1]],
        )
    }

    /// What the further channels show at the start of the motor's motion `motor`, where the lever has the torque `lever_torque`. At a
    /// rigid lever the handle moves with the motor.
    #[inline(always)]
    pub fn further_values(
        &self,
        wrist: &MovingWrist<P, STATES, ALL>,
        motor: &HermiteSegment<P>,
        lever_torque: Jet<P, ALL>,
    ) -> FurtherValues<Jet<P, ALL>> {
        let state = &wrist.state;
        let theta_j = state[STATES - 2];
        match self.inverse_lever_inertia {
            None => FurtherValues {
                theta_l: Jet::lift(motor.at(0.0).theta),
                alpha_l: Jet::lift(motor.acceleration_at_start()),
                torque_h: lever_torque,
                theta_j,
            },
            Some(inverse_inertia) => {
                let torque_h = Self::torque_between(
                    &self.response.interface,
                    [state[0] - theta_j, state[1] - state[STATES - 1]],
                );
                FurtherValues {
                    theta_l: state[0],
                    alpha_l: (lever_torque - torque_h).scale(inverse_inertia),
                    torque_h,
                    theta_j,
                }
            }
        }
    }

    /// The torque of a spring and a damper for a difference of angle and of speed per step.
    #[inline(always)]
    fn torque_between(coupling: &[Jet<P, LINEAR>; 2], difference: [Jet<P, ALL>; 2]) -> Jet<P, ALL> {
        Jet::constant(0.0).plus_product(coupling[0], difference[0]).plus_product(coupling[1], difference[1])
    }

    /// Moves the wrist by one step, in which the motor's angle is the polynomial `motor` in the fraction of the step, rad.
    #[inline(always)]
    pub fn step(&self, wrist: &mut MovingWrist<P, STATES, ALL>, motor: &[P; FORCE]) {
        let joint = STATES - 2;
        let mut to = [Jet::constant(0.0); STATES];
        let mut row = 0;
        while row < STATES {
            let mut sum = Jet::constant(0.0);
            let mut from = 0;
            while from < STATES {
                sum = sum.plus_product(self.response.transition[row][from], wrist.state[from]);
                from += 1;
            }
            let mut power = 0;
            while power < FORCE {
                sum = sum.plus_scaled(self.response.motor[row][power], motor[power]);
                power += 1;
            }
            to[row] = sum;
            row += 1;
        }
        if wrist.is_silent && !self.is_near(to[joint].value) {
            wrist.state = to;
            return;
        }
        let Loss { torque, rate } = wrist.loss;
        let mut guess = [to[joint], to[joint + 1]];
        let mut which = 0;
        while which < 2 {
            let of_torque = &self.response.joint_torque[joint + which];
            guess[which] = guess[which].plus_product(of_torque[0], torque).plus_product(of_torque[1], rate);
            which += 1;
        }
        let end = self.loss(guess[0], guess[1]);
        let rise = end.torque - torque;
        let force =
            [torque, rate, rise.scale(3.0) - rate.scale(2.0) - end.rate, rate + end.rate - rise.scale(2.0)];
        let mut row = 0;
        while row < STATES {
            let mut power = 0;
            while power < FORCE {
                to[row] = to[row].plus_product(self.response.joint_torque[row][power], force[power]);
                power += 1;
            }
            row += 1;
        }
        wrist.state = to;
        wrist.loss = self.loss(to[joint], to[joint + 1]);
        wrist.is_silent = !self.is_near(to[joint].value);
    }

    /// Whether the yield takes anything away at the joint angle `angle` in any lane.
    #[inline(always)]
    fn is_near(&self, angle: P) -> bool {
        (self.slope * (angle - self.elastic_limit) + P::splat(SILENT)).any_positive()
    }

    /// What the yield takes away at this angle and speed of the joint.
    #[inline(always)]
    fn loss(&self, angle: Jet<P, ALL>, speed: Jet<P, ALL>) -> Loss<P, ALL> {
        let past = angle.value - self.elastic_limit;
        let beyond = angle
            .times(self.slope)
            .with_slope(DECREMENT, past * P::splat(YIELD_SMOOTHNESS_PER_NM))
            .with_slope(LIMIT, -self.slope);
        let beyond = Jet { value: self.slope * past, slope: beyond.slope };
        let is_near = beyond.value + P::splat(SILENT);
        let (one, zero) = (P::splat(1.0), P::splat(0.0));
        let counts = is_near.where_positive(one, zero);
        let (softplus, logistic) = P::softplus_and_slope(beyond.value);
        let value = beyond.chain(softplus, logistic);
        let torque = (value - self.at_rest).times(counts * P::splat(1.0 / YIELD_SMOOTHNESS_PER_NM));
        // d/dx of the torque is k_dec logistic(beyond) times the speed.
        let part = beyond.chain(logistic, logistic * (one - logistic));
        let stiffness = part.times(self.decrement).with_slope(DECREMENT, part.value);
        let rate = (stiffness * speed).times(counts);
        Loss { torque, rate }
    }
}

/// The polynomial of the motor's angle over step number `step` of `steps`, from that over the whole sample.
#[inline(always)]
pub(super) fn part_of_sample<P: Plain>(whole: &HermiteSegment<P>, step: usize, steps: usize) -> [P; FORCE] {
    let whole = whole.coefficients();
    if steps == 1 {
        return whole;
    }
    let (x, part) = (step as f64 / steps as f64, 1.0 / steps as f64);
    let [a, b, c, d] = whole;
    let by = |value: P, factor: f64| value * P::splat(factor);
    [
        a + by(b, x) + by(c, x * x) + by(d, x * x * x),
        by(b + by(c, 2.0 * x) + by(d, 3.0 * x * x), part),
        by(c + by(d, 3.0 * x), part * part),
        by(d, part * part * part),
    ]
}
