//! The mechanics: two inertias between three compliances (Fig. 2 and Eq. 1-7 of de Vlugt et al. 2011).
//!
//! All angles and torques are changes from the steady state before the ramp, as in section 2.4 of the paper.

use super::plant::Plant;
use crate::number::{Number, Plain};

/// Angle and angular velocity at one time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Kinematics<T> {
    /// Angle, rad.
    pub theta: T,
    /// Angular velocity, rad/s.
    pub omega: T,
}

impl<P: Plain> Kinematics<P> {
    /// The same angle and speed as constants of another number type.
    #[inline(always)]
    pub fn lift<T: Number<Plain = P>>(self) -> Kinematics<T> {
        Kinematics { theta: T::lift(self.theta), omega: T::lift(self.omega) }
    }
}

/// Angles and angular velocities of the two inertias.
#[derive(Debug, Clone, Copy)]
pub struct State<T> {
    /// Handle angle theta_l, rad.
    pub theta_l: T,
    /// Its rate, rad/s.
    pub omega_l: T,
    /// Joint angle theta_j, rad.
    pub theta_j: T,
    /// Its rate, rad/s.
    pub omega_j: T,
}

impl<T: Number> State<T> {
    /// All angles and velocities zero.
    #[inline(always)]
    pub fn rest() -> Self {
        let zero = T::constant(0.0);
        Self { theta_l: zero, omega_l: zero, theta_j: zero, omega_j: zero }
    }
}

/// The three torques of Fig. 2 and the measured torque, N m.
#[derive(Debug, Clone, Copy)]
pub struct Torques<T> {
    /// T_l, in the lever (Eq. 5).
    pub lever: T,
    /// T_h, between handle and hand (Eq. 6).
    pub interface: T,
    /// T_j, in the joint (Eq. 7).
    pub joint: T,
    /// a_s k_dec (theta_j - x_e), without unit: below zero before the yield, above zero beyond.
    pub beyond: T,
    /// Torque that the sensor in the lever shows: T_l, unless a mechanism alters it.
    pub measured: T,
}

/// The plant prepared for integration: quantities that are constant within a trial are computed once.
#[derive(Debug, Clone, Copy)]
pub struct Mechanics<T> {
    /// The coefficients.
    pub plant: Plant<T>,
    /// 1 / I_l; `None` for a rigid lever.
    inverse_lever_inertia: Option<T>,
    /// 1 / I_j.
    inverse_joint_inertia: T,
    /// a_s k_dec, and 1 / a_s.
    yield_slope: T,
    inverse_smoothness: T,
    /// log(1 + exp(-a_s k_dec x_e)): Eq. 2 is not exactly zero at theta_j = 0, but the change from the steady state is.
    yield_at_rest: T,
}

impl<T: Number> Mechanics<T> {
    /// Prepares `plant`, as mechanisms may have altered it.
    #[inline(always)]
    pub fn new(plant: Plant<T>) -> Self {
        let one = T::constant(1.0);
        let yield_slope = plant.smoothness * plant.stiffness_decrement;
        // A closure would be compiled without the vector instructions of the surrounding function.
        #[allow(clippy::manual_map)]
        let inverse_lever_inertia = match plant.lever {
            Some(lever) => Some(one / lever.inertia),
            None => None,
        };
        Self {
            plant,
            inverse_lever_inertia,
            inverse_joint_inertia: one / plant.joint_inertia,
            yield_slope,
            inverse_smoothness: one / plant.smoothness,
            yield_at_rest: (-(yield_slope * plant.elastic_limit)).softplus(),
        }
    }

    /// The elastic joint torque T_j,elas (Eq. 2) as a change from the steady state, and a_s k_dec (theta_j - x_e).
    #[inline(always)]
    pub fn elastic_torque(&self, theta_j: T) -> (T, T) {
        let beyond = self.yield_slope * (theta_j - self.plant.elastic_limit);
        let loss = self.inverse_smoothness * (beyond.softplus() - self.yield_at_rest);
        (self.plant.short_range_stiffness * theta_j - loss, beyond)
    }

    /// The torques (Eq. 3-7) at `state` and at the added states `added`; writes the rates of both into `rates` and
    /// `added_rates`. `rates` must be at rest before the first call. `time_s` counts from the onset.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn rates<X: AddedDynamics<T>>(
        &self,
        added_dynamics: &X,
        state: &State<T>,
        added: &[T],
        motor: Kinematics<T>,
        time_s: f64,
        rates: &mut State<T>,
        added_rates: &mut [T],
    ) -> Torques<T> {
        let plant = &self.plant;
        let (handle, lever_torque) = match plant.lever {
            None => (motor, T::constant(0.0)),
            Some(lever) => {
                let torque = lever.damping * (motor.omega - state.omega_l)
                    + lever.stiffness * (motor.theta - state.theta_l); // Eq. 5
                (Kinematics { theta: state.theta_l, omega: state.omega_l }, torque)
            }
        };
        let interface = plant.interface_damping * (handle.omega - state.omega_j)
            + plant.interface_stiffness * (handle.theta - state.theta_j); // Eq. 6
        let (elastic, beyond) = self.elastic_torque(state.theta_j);
        let joint = plant.joint_damping * state.omega_j + elastic; // Eq. 7
        let mut torques = Torques { lever: lever_torque, interface, joint, beyond, measured: lever_torque };
        if X::ACTIVE {
            let context = Context { plant, state, handle, time_s };
            added_dynamics.add_torques(&context, added, &mut torques, added_rates);
        }
        rates.omega_j = self.inverse_joint_inertia * (torques.interface - torques.joint); // Eq. 4
        rates.theta_j = state.omega_j;
        if let Some(inverse_inertia) = self.inverse_lever_inertia {
            rates.omega_l = inverse_inertia * (torques.lever - torques.interface); // Eq. 3
            rates.theta_l = state.omega_l;
        } else {
            torques.lever = torques.interface;
        }
        torques.measured = torques.lever;
        if X::ACTIVE {
            torques.measured = added_dynamics.alter_measurement(added, time_s, torques.lever, added_rates);
        }
        torques
    }
}

/// What a mechanism may read at one evaluation of the equations.
pub struct Context<'a, T> {
    /// The coefficients in force.
    pub plant: &'a Plant<T>,
    /// Angles and speeds of handle and joint.
    pub state: &'a State<T>,
    /// Angle and speed of the handle; at a rigid lever those of the motor.
    pub handle: Kinematics<T>,
    /// Time since the onset, s.
    pub time_s: f64,
}

/// What is added to the base model in every evaluation of the equations.
pub trait AddedDynamics<T: Number> {
    /// Whether anything is added.
    const ACTIVE: bool;

    /// Number of added states.
    fn state_count(&self) -> usize;

    /// Adds torques (N m) and writes the rates of the added states.
    fn add_torques(&self, context: &Context<'_, T>, added: &[T], torques: &mut Torques<T>, rates: &mut [T]);

    /// Alters the measured torque (N m) at `time_s` after the onset and writes the rates of the added states.
    fn alter_measurement(&self, added: &[T], time_s: f64, torque: T, rates: &mut [T]) -> T;
}

/// The base model: nothing is added.
pub struct NoAddedDynamics;

impl<T: Number> AddedDynamics<T> for NoAddedDynamics {
    const ACTIVE: bool = false;

    #[inline(always)]
    fn state_count(&self) -> usize {
        0
    }

    #[inline(always)]
    fn add_torques(&self, _: &Context<'_, T>, _: &[T], _: &mut Torques<T>, _: &mut [T]) {}

    #[inline(always)]
    fn alter_measurement(&self, _: &[T], _: f64, torque: T, _: &mut [T]) -> T {
        torque
    }
}
