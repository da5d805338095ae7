//! The bearing of the handle.

use super::setup::Setup;
use crate::wrist::{AddedDynamics, Context, LONGEST_STEP, LeverCoefficients, Torques};

/// Speed at which the friction has three quarters of its torque, rad/s. It stands for a step at rest, which no integration can follow: a
/// tenth of what one count of the encoder in one sample looks like. Assumed.
const FULL_AT_RAD_S: f64 = 0.01;

/// Most integration steps in a sample.
const MOST_SUBSTEPS: f64 = 256.0;

/// A bearing with Coulomb friction, smoothed over the speed.
#[derive(Debug, Clone, Copy)]
pub struct Bearing {
    friction_nm: f64,
}

impl Bearing {
    /// The bearing of a rig of `setup`.
    pub fn new(setup: &Setup) -> Self {
        Self { friction_nm: setup.bearing_friction_nm }
    }

    /// Whether it rubs at all.
    pub fn rubs(self) -> bool {
        self.friction_nm != 0.0
    }

    /// Torque against a handle that turns with `omega_l` rad/s, N m.
    pub fn friction_nm(self, omega_l: f64) -> f64 {
        self.friction_nm * libm::tanh(omega_l / FULL_AT_RAD_S)
    }

    /// Integration steps in a sample that a handle in this bearing needs on a lever whose stiffness is `further_nm_per_rad` larger.
    pub fn substeps(
        self,
        lever: Option<LeverCoefficients<f64>>,
        further_nm_per_rad: f64,
        period_s: f64,
    ) -> usize {
        let fastest = lever.map_or(0.0, |lever| {
            let swing = libm::sqrt((lever.stiffness + further_nm_per_rad) / lever.inertia);
            swing.max((lever.damping + self.friction_nm / FULL_AT_RAD_S) / lever.inertia)
        });
        libm::ceil(fastest * period_s / LONGEST_STEP).clamp(2.0, MOST_SUBSTEPS) as usize
    }
}

/// What acts on the wrist, and the bearing beside it.
pub struct InBearing<'a, X> {
    pub bearing: Bearing,
    pub wrist: &'a X,
}

impl<X: AddedDynamics<f64>> AddedDynamics<f64> for InBearing<'_, X> {
    const ACTIVE: bool = true;

    fn state_count(&self) -> usize {
        self.wrist.state_count()
    }

    fn add_torques(
        &self,
        context: &Context<'_, f64>,
        added: &[f64],
        torques: &mut Torques<f64>,
        rates: &mut [f64],
    ) {
        self.wrist.add_torques(context, added, torques, rates);
        // On the handle alone: what is added to both torques of the joint does not turn it.
        let friction_nm = self.bearing.friction_nm(context.handle.omega);
        torques.interface += friction_nm;
        torques.joint += friction_nm;
    }

    fn alter_measurement(&self, added: &[f64], time_s: f64, torque: f64, rates: &mut [f64]) -> f64 {
        self.wrist.alter_measurement(added, time_s, torque, rates)
    }
}
