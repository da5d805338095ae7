//! The mechanics: two inertias between three compliances (Fig. 2 and Eq. 1-7 of de Vlugt et al. 2011).
//!
//! All angles and torques are changes from the steady state before the ramp, as in section 2.4 of the paper.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mechanisms::Extension;
use super::sparse_coefficient::{Coefficient, Dense, DerivativeStructure, Sparse};
use crate::number::Number;

/// Joint damping b_j of the base model, N m s/rad (section 2.3: negligible, fixed for numerical stability).
pub const JOINT_DAMPING_NM_S_PER_RAD: f64 = 1e-5;

/// Smoothness a_s of the yield in Eq. 2, 1/(N m).
pub const YIELD_SMOOTHNESS_PER_NM: f64 = 100.0;

/// The compliant lever between motor and handle (Table 1 of the paper, fixed parameters).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lever {
    /// I_l, kg m2.
    pub inertia_kg_m2: f64,
    /// b_l, N m s/rad.
    pub damping_nm_s_per_rad: f64,
    /// k_l, N m/rad.
    pub stiffness_nm_per_rad: f64,
}

/// The six parameters that a fit estimates, in the order of every parameter vector of the crate.
pub const BASE_PARAMETERS: [&str; 6] =
    ["i_j_kg_m2", "b_h_nm_s_per_rad", "k_h_nm_per_rad", "k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"];

/// Every coefficient of the mechanics, over any number type.
#[derive(Debug, Clone, Copy)]
pub struct Plant<T> {
    /// I_l, b_l, k_l; `None` for a rigid lever.
    pub lever: Option<LeverCoefficients<T>>,
    /// I_j, kg m2.
    pub joint_inertia: T,
    /// b_h, N m s/rad.
    pub interface_damping: T,
    /// k_h, N m/rad.
    pub interface_stiffness: T,
    /// k_srs, N m/rad.
    pub short_range_stiffness: T,
    /// k_dec, N m/rad.
    pub stiffness_decrement: T,
    /// x_e, rad.
    pub elastic_limit: T,
    /// b_j, N m s/rad.
    pub joint_damping: T,
    /// a_s, 1/(N m).
    pub smoothness: T,
}

/// The lever's constants as coefficients.
#[derive(Debug, Clone, Copy)]
pub struct LeverCoefficients<T> {
    /// I_l, kg m2.
    pub inertia: T,
    /// b_l, N m s/rad.
    pub damping: T,
    /// k_l, N m/rad.
    pub stiffness: T,
}

impl<T: Number> Plant<T> {
    /// The base model with the six parameters in the order of [`BASE_PARAMETERS`].
    #[inline(always)]
    pub fn base(lever: Option<Lever>, parameters: &[T]) -> Self {
        let lever = match lever {
            None => None,
            Some(lever) => Some(LeverCoefficients {
                inertia: T::constant(lever.inertia_kg_m2),
                damping: T::constant(lever.damping_nm_s_per_rad),
                stiffness: T::constant(lever.stiffness_nm_per_rad),
            }),
        };
        Self {
            lever,
            joint_inertia: parameters[0],
            interface_damping: parameters[1],
            interface_stiffness: parameters[2],
            short_range_stiffness: parameters[3],
            stiffness_decrement: parameters[4],
            elastic_limit: parameters[5],
            joint_damping: T::constant(JOINT_DAMPING_NM_S_PER_RAD),
            smoothness: T::constant(YIELD_SMOOTHNESS_PER_NM),
        }
    }
}

/// Angle and speed of the motor at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Kinematics<T> {
    /// theta_m, rad.
    pub theta: T,
    /// Its rate, rad/s.
    pub omega: T,
}

impl<P: crate::number::Plain> Kinematics<P> {
    /// The same motion, for numbers with derivatives.
    #[inline(always)]
    pub fn lift<T: Number<Plain = P>>(self) -> Kinematics<T> {
        Kinematics { theta: T::lift(self.theta), omega: T::lift(self.omega) }
    }
}

/// States that mechanisms may add (a Maxwell branch, a reflex's lag, a sensor's lag).
pub const MEMORY: usize = 4;

/// Where the moving parts are.
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
    /// States of the mechanisms.
    pub memory: [T; MEMORY],
}

impl<T: Number> State<T> {
    /// At rest.
    #[inline(always)]
    pub fn rest() -> Self {
        let zero = T::constant(0.0);
        Self { theta_l: zero, omega_l: zero, theta_j: zero, omega_j: zero, memory: [zero; MEMORY] }
    }
}

/// The three torques of Fig. 2, N m, and what is measured of them.
#[derive(Debug, Clone, Copy)]
pub struct Torques<T> {
    /// T_l, in the lever (Eq. 5).
    pub lever: T,
    /// T_h, between handle and hand (Eq. 6).
    pub interface: T,
    /// T_j, in the joint (Eq. 7).
    pub joint: T,
    /// a_s k_dec (theta_j - x_e): below zero before the yield, above zero beyond.
    pub beyond: T,
    /// What the torque sensor in the lever shows: T_l, unless a mechanism alters it.
    pub measured: T,
}

/// The plant made ready for integration: what does not change within a trial is computed once.
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
            inverse_joint_inertia: C::sole(one / plant.joint_inertia),
            interface_damping: C::sole(plant.interface_damping),
            interface_stiffness: C::sole(plant.interface_stiffness),
            short_range_stiffness: C::sole(plant.short_range_stiffness),
            elastic_limit: C::sole(plant.elastic_limit),
            joint_damping: C::constant(plant.joint_damping),
            yield_slope: C::sole(yield_slope),
            inverse_smoothness: C::constant(one / plant.smoothness),
            yield_at_rest: (-(yield_slope * plant.elastic_limit)).softplus(),
        }
    }

    /// The elastic joint torque T_j,elas (Eq. 2) as a change from the steady state, and a_s k_dec (theta_j - x_e).
    #[inline(always)]
    pub fn elastic_torque(&self, theta_j: T) -> (T, T) {
        let beyond = self.yield_slope.of(self.elastic_limit.off(theta_j));
        let loss = self.inverse_smoothness.of(beyond.softplus() - self.yield_at_rest);
        (self.short_range_stiffness.of(theta_j) - loss, beyond)
    }

    /// Eq. 3-7: the torques in `state`, and into `rates`, at rest before the first call, how fast the state changes.
    #[inline(always)]
    pub fn rates<X: Extension<T>>(
        &self,
        extension: &X,
        state: &State<T>,
        motor: Kinematics<T>,
        time_s: f64,
        rates: &mut State<T>,
    ) -> Torques<T> {
        let (handle, lever_torque) = match self.lever {
            None => (motor, T::constant(0.0)),
            Some(lever) => {
                let torque = lever.damping.of(motor.omega - state.omega_l)
                    + lever.stiffness.of(motor.theta - state.theta_l); // Eq. 5
                (Kinematics { theta: state.theta_l, omega: state.omega_l }, torque)
            }
        };
        let interface = self.interface_damping.of(handle.omega - state.omega_j)
            + self.interface_stiffness.of(handle.theta - state.theta_j); // Eq. 6
        let (elastic, beyond) = self.elastic_torque(state.theta_j);
        let joint = self.joint_damping.of(state.omega_j) + elastic; // Eq. 7
        let mut torques = Torques { lever: lever_torque, interface, joint, beyond, measured: lever_torque };
        let moment = Context { plant: &self.plant, state, handle, time_s };
        if X::ACTIVE {
            extension.act(&moment, &mut torques, &mut rates.memory);
        }
        rates.omega_j = self.inverse_joint_inertia.of(torques.interface - torques.joint); // Eq. 4
        rates.theta_j = state.omega_j;
        if let Some(lever) = self.lever {
            rates.omega_l = lever.inverse_inertia.of(torques.lever - torques.interface); // Eq. 3
            rates.theta_l = state.omega_l;
        } else {
            torques.lever = torques.interface;
        }
        torques.measured = torques.lever;
        if X::ACTIVE {
            torques.measured = extension.measure(&moment, torques.lever, &mut rates.memory);
        }
        torques
    }
}

/// What a mechanism may look at while the wrist moves.
pub struct Context<'a, T> {
    /// The coefficients in force.
    pub plant: &'a Plant<T>,
    /// The moving parts.
    pub state: &'a State<T>,
    /// Angle and speed of the handle.
    pub handle: Kinematics<T>,
    /// Time since the onset, s.
    pub time_s: f64,
}
