//! A wrist from sample to sample: its linear part exactly, the yield as a cubic.
//!
//! Eq. 1-7 are linear but for the torque that the yield takes away (Eq. 2). Over a step this torque is taken as the cubic with its values
//! and slopes at both ends, where those at the end follow from a first guess of the state there. What mechanisms do in addition is in
//! [`extended`](super::extended).

use super::further_channel::FurtherValues;
use super::integrate::HermiteSegment;
use super::linear_response::{FORCE, LinearResponse};
use super::mechanics::Kinematics;
use super::plant::{BASE_PARAMETERS, Lever, Plant};
use super::yield_loss::{BaseYield, Loss, YieldLoss};
use crate::number::{Jet, Number, Plain};

/// A state, in which each angle (rad) is followed by its speed (rad per step).
pub(super) type Angles<P, const STATES: usize, const ALL: usize> = [Jet<P, ALL>; STATES];

/// A wrist over steps of one length, with `ALL` derivatives of a state, of which the first `LINEAR` are those of the linear part.
#[derive(Debug, Clone, Copy)]
pub(super) struct Propagator<P, Y, const STATES: usize, const LINEAR: usize, const ALL: usize> {
    response: LinearResponse<P, STATES, LINEAR>,
    pub yield_loss: Y,
    /// 1 / I_l; `None` for a rigid lever.
    inverse_lever_inertia: Option<Jet<P, LINEAR>>,
    step_s: f64,
}

/// The motor at one time.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotorAtSample<T> {
    /// Angle, rad.
    pub angle: T,
    /// Angular acceleration, rad/s2.
    pub acceleration: T,
}

/// A wrist that moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingWrist<P, const STATES: usize, const ALL: usize> {
    pub state: Angles<P, STATES, ALL>,
    pub loss: Loss<P, ALL>,
    /// Whether the yield takes nothing away in any lane.
    pub is_silent: bool,
}

impl<P: Plain, const STATES: usize, const ALL: usize> MovingWrist<P, STATES, ALL> {
    /// At rest; the first step finds out how near the yield is.
    #[inline(always)]
    pub fn at_rest() -> Self {
        Self { state: [Jet::constant(0.0); STATES], loss: Loss::none(), is_silent: false }
    }
}

impl<P: Plain, const STATES: usize, const LINEAR: usize, const ALL: usize>
    Propagator<P, BaseYield<P, ALL>, STATES, LINEAR, ALL>
{
    /// The base model with its six `parameters`, for steps of `step_s`.
    #[inline(always)]
    pub fn base(lever: Option<Lever>, parameters: &[P; BASE_PARAMETERS.len()], step_s: f64) -> Self {
        let mut linear = [Jet::constant(0.0); BASE_PARAMETERS.len()];
        let mut index = 0;
        while index < linear.len() {
            linear[index] = Jet::variable(parameters[index], index);
            index += 1;
        }
        Self::new(&Plant::base(lever, &linear), BaseYield::new(parameters), step_s)
    }
}

impl<P: Plain, Y: YieldLoss<P, ALL>, const STATES: usize, const LINEAR: usize, const ALL: usize>
    Propagator<P, Y, STATES, LINEAR, ALL>
{
    /// For steps of `step_s`.
    #[inline(always)]
    pub fn new(plant: &Plant<Jet<P, LINEAR>>, yield_loss: Y, step_s: f64) -> Self {
        // A closure would be compiled without the vector instructions of the surrounding function.
        #[allow(clippy::manual_map)]
        let inverse_lever_inertia = match plant.lever {
            Some(lever) => Some(Jet::constant(1.0) / lever.inertia),
            None => None,
        };
        Self { response: LinearResponse::new(plant, step_s), yield_loss, inverse_lever_inertia, step_s }
    }

    /// The torque in the lever, N m, with the motor at `motor`.
    #[inline(always)]
    pub fn torque(&self, state: &Angles<P, STATES, ALL>, motor: Kinematics<Jet<P, ALL>>) -> Jet<P, ALL> {
        // At a rigid lever the motor turns the hand itself.
        let driven = if self.inverse_lever_inertia.is_some() { 0 } else { STATES - 2 };
        let speed = motor.omega.scale(self.step_s);
        Self::torque_between(
            &self.response.coupling,
            [motor.theta - state[driven], speed - state[driven + 1]],
        )
    }

    /// What the further channels show with the motor at `motor`, where the lever has the torque `lever_torque` and add
    /// `added_interface` to that between handle and hand. At a rigid lever the handle moves with the motor.
    #[inline(always)]
    pub fn further_values(
        &self,
        state: &Angles<P, STATES, ALL>,
        motor: MotorAtSample<Jet<P, ALL>>,
        lever_torque: Jet<P, ALL>,
        added_interface: Jet<P, ALL>,
    ) -> FurtherValues<Jet<P, ALL>> {
        let theta_j = state[STATES - 2];
        match self.inverse_lever_inertia {
            None => FurtherValues {
                theta_l: motor.angle,
                alpha_l: motor.acceleration,
                torque_h: lever_torque,
                theta_j,
            },
            Some(inverse_inertia) => {
                let torque_h = Self::torque_between(
                    &self.response.interface,
                    [state[0] - theta_j, state[1] - state[STATES - 1]],
                ) + added_interface;
                let zero = Jet::constant(0.0);
                FurtherValues {
                    theta_l: state[0],
                    alpha_l: zero.plus_product(inverse_inertia, lever_torque - torque_h),
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
        let mut to = self.coasted(&wrist.state);
        self.push_recorded_motor(&mut to, motor);
        if wrist.is_silent && !self.yield_loss.is_near(to[joint].value) {
            wrist.state = to;
            return;
        }
        let Loss { torque, rate } = wrist.loss;
        let zero = Jet::constant(0.0);
        let mut guess = to;
        self.push_joint(&mut guess, &[torque, rate, zero, zero], joint, 2);
        let end = self.yield_loss.at(guess[joint], guess[joint + 1]);
        self.push_joint(&mut to, &wrist.loss.until(&end), 0, FORCE);
        wrist.state = to;
        wrist.loss = self.yield_loss.at(to[joint], to[joint + 1]);
        wrist.is_silent = !self.yield_loss.is_near(to[joint].value);
    }

    /// A step later, if nothing acts on the wrist.
    #[inline(always)]
    pub fn coasted(&self, from: &Angles<P, STATES, ALL>) -> Angles<P, STATES, ALL> {
        let mut to = [Jet::constant(0.0); STATES];
        let mut row = 0;
        while row < STATES {
            let mut column = 0;
            while column < STATES {
                to[row] = to[row].plus_product(self.response.transition[row][column], from[column]);
                column += 1;
            }
            row += 1;
        }
        to
    }

    /// Adds what the motor does, whose angle is the polynomial `motor` in the fraction of the step, rad, and depends on no parameter.
    #[inline(always)]
    pub fn push_recorded_motor(&self, to: &mut Angles<P, STATES, ALL>, motor: &[P; FORCE]) {
        let mut row = 0;
        while row < STATES {
            let mut power = 0;
            while power < FORCE {
                to[row] = to[row].plus_scaled(self.response.motor[row][power], motor[power]);
                power += 1;
            }
            row += 1;
        }
    }

    /// Adds what the motor does, whose angle is the polynomial `motor` in the fraction of the step, rad.
    #[inline(always)]
    pub fn push_motor(&self, to: &mut Angles<P, STATES, ALL>, motor: &[Jet<P, ALL>; FORCE]) {
        Self::push(&self.response.motor, to, motor, 0, FORCE);
    }

    /// Adds what a torque on the joint does, a polynomial in the fraction of the step, N m, of which the first `coefficients` are not zero;
    /// to the state from `first_row` on.
    #[inline(always)]
    pub fn push_joint(
        &self,
        to: &mut Angles<P, STATES, ALL>,
        torque: &[Jet<P, ALL>; FORCE],
        first_row: usize,
        coefficients: usize,
    ) {
        Self::push(&self.response.joint_torque, to, torque, first_row, coefficients);
    }

    /// Adds what a torque on the handle does, a polynomial in the fraction of the step, N m.
    #[inline(always)]
    pub fn push_handle(&self, to: &mut Angles<P, STATES, ALL>, torque: &[Jet<P, ALL>; FORCE]) {
        Self::push(&self.response.handle_torque, to, torque, 0, FORCE);
    }

    #[inline(always)]
    fn push(
        response: &[[Jet<P, LINEAR>; FORCE]; STATES],
        to: &mut Angles<P, STATES, ALL>,
        force: &[Jet<P, ALL>; FORCE],
        first_row: usize,
        coefficients: usize,
    ) {
        let mut row = first_row;
        while row < STATES {
            let mut power = 0;
            while power < coefficients {
                to[row] = to[row].plus_product(response[row][power], force[power]);
                power += 1;
            }
            row += 1;
        }
    }
}

/// The polynomial of the motor's angle over step number `step` of `steps`, from that over the whole sample.
#[inline(always)]
pub(super) fn part_of_sample<T: Number>(whole: &HermiteSegment<T>, step: usize, steps: usize) -> [T; FORCE] {
    let whole = whole.coefficients();
    if steps == 1 {
        return whole;
    }
    let (x, part) = (step as f64 / steps as f64, 1.0 / steps as f64);
    let [a, b, c, d] = whole;
    [
        a + b.scale(x) + c.scale(x * x) + d.scale(x * x * x),
        (b + c.scale(2.0 * x) + d.scale(3.0 * x * x)).scale(part),
        (c + d.scale(3.0 * x)).scale(part * part),
        d.scale(part * part * part),
    ]
}
