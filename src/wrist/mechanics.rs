//! The mechanics: two inertias between three compliances (Fig. 2 and Eq. 1-7 of de Vlugt et al. 2011).
//!
//! All angles and torques are changes from the steady state before the ramp, as in section 2.4 of the paper.

use super::plant::Plant;
use super::sparse_coefficient::{Coefficient, Dense, DerivativeStructure, Sparse};
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
pub struct Mechanics<T: Number, C: DerivativeStructure<T> = Dense> {
    /// The coefficients.
    pub plant: Plant<T>,
    lever: Option<LeverFactors<C::Constant>>,
    /// 1 / I_j, b_h, k_h, k_srs, x_e, b_j.
    inverse_joint_inertia: C::SingleParameter<0>,
    interface_damping: C::SingleParameter<1>,
    interface_stiffness: C::SingleParameter<2>,
    short_range_stiffness: C::SingleParameter<3>,
    elastic_limit: C::SingleParameter<5>,
    joint_damping: C::Constant,
    /// a_s k_dec.
    yield_slope: C::SingleParameter<4>,
    inverse_smoothness: C::Constant,
    /// log(1 + exp(-a_s k_dec x_e)): Eq. 2 is not exactly zero at theta_j = 0, but the change from the steady state is.
    yield_at_rest: T,
}

/// 1 / I_l, b_l and k_l.
#[derive(Debug, Clone, Copy)]
struct LeverFactors<F> {
    inverse_inertia: F,
    damping: F,
    stiffness: F,
}

impl<T: Number> Mechanics<T> {
    /// Prepares `plant`, as mechanisms may have altered it.
    #[inline(always)]
    pub fn new(plant: Plant<T>) -> Self {
        Self::prepared(plant)
    }
}

impl<T: Number> Mechanics<T, Sparse> {
    /// Prepares the `plant` of the base model, whose parameter number i carries at most the derivative number i.
    #[inline(always)]
    pub fn separate(plant: Plant<T>) -> Self {
        Self::prepared(plant)
    }
}

impl<T: Number, C: DerivativeStructure<T>> Mechanics<T, C> {
    #[inline(always)]
    fn prepared(plant: Plant<T>) -> Self {
        let one = T::constant(1.0);
        let yield_slope = plant.smoothness * plant.stiffness_decrement;
        Self {
            plant,
            lever: match plant.lever {
                Some(lever) => Some(LeverFactors {
                    inverse_inertia: C::constant(one / lever.inertia),
                    damping: C::constant(lever.damping),
                    stiffness: C::constant(lever.stiffness),
                }),
                None => None,
            },
            inverse_joint_inertia: C::single_parameter(one / plant.joint_inertia),
            interface_damping: C::single_parameter(plant.interface_damping),
            interface_stiffness: C::single_parameter(plant.interface_stiffness),
            short_range_stiffness: C::single_parameter(plant.short_range_stiffness),
            elastic_limit: C::single_parameter(plant.elastic_limit),
            joint_damping: C::constant(plant.joint_damping),
            yield_slope: C::single_parameter(yield_slope),
            inverse_smoothness: C::constant(one / plant.smoothness),
            yield_at_rest: (-(yield_slope * plant.elastic_limit)).softplus(),
        }
    }

    /// The elastic joint torque T_j,elas (Eq. 2) as a change from the steady state, and a_s k_dec (theta_j - x_e).
    #[inline(always)]
    pub fn elastic_torque(&self, theta_j: T) -> (T, T) {
        let beyond = self.yield_slope.multiply(self.elastic_limit.subtract_from(theta_j));
        let loss = self.inverse_smoothness.multiply(beyond.softplus() - self.yield_at_rest);
        (self.short_range_stiffness.multiply(theta_j) - loss, beyond)
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
        let (handle, lever_torque) = match self.lever {
            None => (motor, T::constant(0.0)),
            Some(lever) => {
                let torque = lever.damping.multiply(motor.omega - state.omega_l)
                    + lever.stiffness.multiply(motor.theta - state.theta_l); // Eq. 5
                (Kinematics { theta: state.theta_l, omega: state.omega_l }, torque)
            }
        };
        let interface = self.interface_damping.multiply(handle.omega - state.omega_j)
            + self.interface_stiffness.multiply(handle.theta - state.theta_j); // Eq. 6
        let (elastic, beyond) = self.elastic_torque(state.theta_j);
        let joint = self.joint_damping.multiply(state.omega_j) + elastic; // Eq. 7
        let mut torques = Torques { lever: lever_torque, interface, joint, beyond, measured: lever_torque };
        if X::ACTIVE {
            let context = Context { plant: &self.plant, state, handle, time_s };
            added_dynamics.add_torques(&context, added, &mut torques, added_rates);
        }
        rates.omega_j = self.inverse_joint_inertia.multiply(torques.interface - torques.joint); // Eq. 4
        rates.theta_j = state.omega_j;
        if let Some(lever) = self.lever {
            rates.omega_l = lever.inverse_inertia.multiply(torques.lever - torques.interface); // Eq. 3
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
