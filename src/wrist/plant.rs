//! The coefficients of the model: lever, hand-handle interface, joint and muscle (Table 1 of de Vlugt et al. 2011).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::number::{Jet, Number, Plain};

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

impl Lever {
    /// The constants that no lever has: the field, its value, and what is expected.
    pub fn impossible_constants(&self) -> impl Iterator<Item = (&'static str, f64, &'static str)> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let (inertia, damping, stiffness) =
            (self.inertia_kg_m2, self.damping_nm_s_per_rad, self.stiffness_nm_per_rad);
        let damped = damping.is_finite() && damping >= 0.0;
        let constants = [
            ("inertia_kg_m2", inertia, positive(inertia), "an inertia above 0"),
            ("damping_nm_s_per_rad", damping, damped, "a damping from 0 up"),
            ("stiffness_nm_per_rad", stiffness, positive(stiffness), "a stiffness above 0"),
        ];
        let wrong = constants.into_iter().filter(|(_, _, is_possible, _)| !is_possible);
        wrong.map(|(field, value, _, expected)| (field, value, expected))
    }
}

/// The six parameters that a fit estimates, in the order of every parameter vector of the crate.
pub const BASE_PARAMETERS: [&str; 6] =
    ["i_j_kg_m2", "b_h_nm_s_per_rad", "k_h_nm_per_rad", "k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad"];

/// Every coefficient of the mechanics (Eq. 1-7).
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

/// Coefficients of a compliant lever.
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

impl<P: Plain, const N: usize> Plant<Jet<P, N>> {
    /// The same coefficients with their first `M` derivatives alone.
    #[inline(always)]
    pub(super) fn with_derivatives<const M: usize>(&self) -> Plant<Jet<P, M>> {
        // A closure would be compiled without the vector instructions of the surrounding function.
        #[allow(clippy::manual_map)]
        let lever = match self.lever {
            None => None,
            Some(lever) => Some(LeverCoefficients {
                inertia: lever.inertia.with_derivatives(),
                damping: lever.damping.with_derivatives(),
                stiffness: lever.stiffness.with_derivatives(),
            }),
        };
        Plant {
            lever,
            joint_inertia: self.joint_inertia.with_derivatives(),
            interface_damping: self.interface_damping.with_derivatives(),
            interface_stiffness: self.interface_stiffness.with_derivatives(),
            short_range_stiffness: self.short_range_stiffness.with_derivatives(),
            stiffness_decrement: self.stiffness_decrement.with_derivatives(),
            elastic_limit: self.elastic_limit.with_derivatives(),
            joint_damping: self.joint_damping.with_derivatives(),
            smoothness: self.smoothness.with_derivatives(),
        }
    }
}
