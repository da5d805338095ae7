//! The wrist model: Eq. 1-7 of de Vlugt et al. 2011.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
