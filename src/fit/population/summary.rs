//! What the torque of one trial says about its own parameters, near one of its optima.

use nalgebra::{DMatrix, DVector};

use crate::fit::parameters::component::BorderPrior;
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::solver::normal_equations::GaussNewtonEquations;

/// A quadratic approximation of the cost of a trial's torque about an optimum. What the trial shares with others (I_j) is at its best
/// for each value of the trial's own coordinates; priors of these are not part of the cost.
#[derive(Debug, Clone)]
pub struct OptimumSummary {
    /// The trial's own coordinates at the optimum.
    pub at: DVector<f64>,
    /// The cost there.
    pub cost: f64,
    /// Gradient of the cost there; not zero where a prior or a bound acts.
    pub gradient: DVector<f64>,
    /// Gauss-Newton matrix of the cost there.
    pub information: DMatrix<f64>,
}

impl OptimumSummary {
    /// Summary of `block` of the normal equations, whose coordinates have the indices `own` and the values `at`. `others` is the
    /// information about the border from the other blocks.
    pub fn new(
        equations: &GaussNewtonEquations,
        block: usize,
        others: &BorderPrior,
        parameterisation: &Parameterisation,
        own: &[usize],
        at: Vec<f64>,
    ) -> Self {
        let (mut cost, mut gradient, mut information) = equations.block_alone(block, others);
        for (position, coordinate) in own.iter().enumerate() {
            if let Some((mean, sd)) = parameterisation.coordinates[*coordinate].prior {
                let deviation = (at[position] - mean) / sd;
                cost -= 0.5 * deviation * deviation;
                gradient[position] -= deviation / sd;
                information[(position, position)] -= 1.0 / (sd * sd);
            }
        }
        Self { at: DVector::from_vec(at), cost, gradient, information }
    }

    /// The cost that the approximation gives at `point`.
    pub fn cost_at(&self, point: &DVector<f64>) -> f64 {
        let by = point - &self.at;
        self.cost + self.gradient.dot(&by) + 0.5 * by.dot(&(&self.information * &by))
    }

    /// Information vector: the information times the point at which the approximation has its minimum.
    pub fn information_vector(&self) -> DVector<f64> {
        &self.information * &self.at - &self.gradient
    }
}
