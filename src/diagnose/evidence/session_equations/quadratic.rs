//! The quadratic approximation of the posterior.

use nalgebra::{DMatrix, DVector};

use super::arrowhead::{ArrowheadFactor, ArrowheadVector};
use super::design::{Design, Point, cost};
use super::products::{Products, ResidualProducts};
use super::spreads::Spreads;

/// The quadratic approximation of the negative logarithm of posterior density at a point, for given spreads.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// Its value at the point.
    pub cost: f64,
    /// By how much its minimum lies below.
    pub decrease: f64,
    /// From the point to the minimum.
    pub step: Point,
    /// Logarithm of the evidence: the integral over all unknowns.
    pub log_evidence: f64,
    pub(super) factor: ArrowheadFactor,
    /// The factor's inverse times the gradient at the point.
    pub(super) solved_gradient: ArrowheadVector,
}

impl Design {
    /// The quadratic at `point`; `None` where a matrix is not positive definite or something is not finite.
    pub fn quadratic(&self, spreads: &Spreads, point: &Point, products: &Products) -> Option<Quadratic> {
        let factor = self.factor(spreads, products)?;
        let mut solved = self.gradient(spreads, point, &products.residuals);
        factor.solve_forward(self, &mut solved);
        let step = self.step_of(&factor, solved.clone());
        let cost = cost(self, spreads, point, products.squares(), products.count());
        let decrease = 0.5 * solved.dot(&solved);
        let log_evidence = decrease - cost - 0.5 * factor.log_determinant()
            + self.half_log_precision(spreads, self.log_common_precision()?);
        let finite = log_evidence.is_finite() && step.common.iter().all(|own| own.is_finite());
        finite.then_some(Quadratic { cost, decrease, step, log_evidence, factor, solved_gradient: solved })
    }

    /// The factor of the posterior's precision, which does not depend on residuals; `None` if it is not positive definite.
    pub fn factor(&self, spreads: &Spreads, products: &Products) -> Option<ArrowheadFactor> {
        ArrowheadFactor::new(self, spreads, products, 0.0)
    }

    /// From `point`, with these `residuals`, to the minimum of the quadratic that has this `factor`; `None` if it is not finite.
    pub fn step(
        &self,
        factor: &ArrowheadFactor,
        spreads: &Spreads,
        point: &Point,
        residuals: &ResidualProducts,
    ) -> Option<Point> {
        let mut solved = self.gradient(spreads, point, residuals);
        factor.solve_forward(self, &mut solved);
        let step = self.step_of(factor, solved);
        step.common.iter().all(|own| own.is_finite()).then_some(step)
    }

    /// A step that is held back by the information `damping` about the trials' own coordinates and, by their priors, about the common
    /// ones; `None` where a matrix is not positive definite or something is not finite.
    pub fn damped_step(
        &self,
        spreads: &Spreads,
        point: &Point,
        products: &Products,
        damping: f64,
    ) -> Option<Point> {
        let factor = ArrowheadFactor::new(self, spreads, products, damping)?;
        self.step(&factor, spreads, point, &products.residuals)
    }

    /// The step whose gradient, times the factor's inverse, is `solved`.
    fn step_of(&self, factor: &ArrowheadFactor, mut solved: ArrowheadVector) -> Point {
        factor.solve_backward(self, &mut solved);
        let columns = |values: &DMatrix<f64>| values.column_iter().map(|own| -own).collect();
        let common = self.common_mean.len();
        Point {
            own: columns(&solved.own),
            means: columns(&solved.means),
            coefficients: -solved.border.rows(common, solved.border.len() - common),
            common: -solved.border.rows(0, common),
        }
    }

    /// Gradient of the negative logarithm of posterior density.
    fn gradient(&self, spreads: &Spreads, point: &Point, residuals: &ResidualProducts) -> ArrowheadVector {
        let (size, common) = (self.own, self.common_mean.len());
        let mut own = &residuals.own / -spreads.noise;
        let mut means = DMatrix::zeros(size, self.conditions.len());
        let mut border = self.border_gradient(spreads, point);
        border.rows_mut(0, common).axpy(-1.0 / spreads.noise, &residuals.common, 1.0);
        for (condition, trials) in self.conditions.iter().enumerate() {
            for k in 0..size {
                for trial in trials {
                    let weight = self.trial_precision(spreads, *trial, k);
                    let pull = weight * (point.own[*trial][k] - point.means[condition][k]);
                    own[(k, *trial)] += pull;
                    means[(k, condition)] -= pull;
                }
                let expected = self.expected(condition, &point.coefficients, k);
                let pull = (point.means[condition][k] - expected) / spreads.condition[k];
                means[(k, condition)] += pull;
                for (a, regressor) in self.regressors[condition].iter().enumerate() {
                    border[common + a * size + k] -= regressor * pull;
                }
            }
        }
        ArrowheadVector { own, means, border }
    }

    /// Gradient of the priors of common coordinates and coefficients.
    fn border_gradient(&self, spreads: &Spreads, point: &Point) -> DVector<f64> {
        let common = self.common_mean.len();
        let mut off = DVector::zeros(common + point.coefficients.len());
        off.rows_mut(0, common).copy_from(&(&point.common - &self.common_mean));
        off.rows_mut(common, point.coefficients.len()).copy_from(&point.coefficients);
        let mut gradient = self.border_precision(spreads) * off;
        if let Some((above, below, mean, sd)) = self.ratio {
            gradient[common + above] -= mean / (sd * sd);
            gradient[common + below] += mean / (sd * sd);
        }
        gradient
    }
}

impl Quadratic {
    /// Covariance of the common coordinates.
    pub fn common_covariance(&self) -> DMatrix<f64> {
        let common = self.step.common.len();
        self.factor.border_covariance().view((0, 0), (common, common)).into_owned()
    }
}
