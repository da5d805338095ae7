//! The quadratic approximation of the posterior, by elimination along the arrowhead.

use nalgebra::{DMatrix, DVector};

use super::design::{Design, EXPONENT_SD, LEVEL_SD, Point, REGRESSORS, cost};
use super::products::Products;
use super::spreads::{ExpectedSquares, Spreads};
use crate::diagnose::evidence::linearisation::LinearTrial;
use crate::fit::inverse_of;
use crate::statistics::log_determinant_of_factor;

/// The quadratic approximation of the negative logarithm of posterior density at a point, for given spreads.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// Its value at the point.
    pub cost: f64,
    /// By how much its minimum lies below.
    pub decrease: f64,
    /// From the point to the minimum.
    pub step: Point,
    /// Covariance of the common coordinates.
    pub common_covariance: DMatrix<f64>,
    /// Variance of each own coordinate of each trial.
    pub own_variance: Vec<DVector<f64>>,
    /// Logarithm of the evidence: the integral over all unknowns.
    pub log_evidence: f64,
    /// Expected sums of squares at the minimum.
    pub expected: ExpectedSquares,
    elimination: Elimination,
}

/// What is left of the elimination along the arrowhead, for one more unknown.
#[derive(Debug, Clone)]
struct Elimination {
    blocks: Vec<EliminatedBlock>,
    border_covariance: DMatrix<f64>,
}

/// The unknowns of a condition, eliminated.
#[derive(Debug, Clone)]
struct EliminatedBlock {
    inverse: DMatrix<f64>,
    towards: DMatrix<f64>,
    alone: DVector<f64>,
}

/// One more common unknown, about zero.
#[derive(Debug, Clone, Copy)]
pub struct AddedColumn {
    /// What it adds to the logarithm of the evidence.
    pub log_evidence: f64,
    /// Its most probable value.
    pub value: f64,
}

impl Design {
    /// The quadratic at `point`; `None` where a matrix is not positive definite or something is not finite.
    pub fn quadratic(&self, spreads: &Spreads, point: &Point, products: &Products) -> Option<Quadratic> {
        let (size, common) = (self.own, self.common_mean.len());
        let coefficients = REGRESSORS * size;
        let border = coefficients + common;
        let trial_precision = spreads.trial.map(|own| 1.0 / own);
        let condition_precision = spreads.condition.map(|own| 1.0 / own);
        let mut corner = DMatrix::zeros(border, border);
        let mut corner_gradient = DVector::zeros(border);
        for index in 0..coefficients {
            let sd = if index < size { LEVEL_SD } else { EXPONENT_SD };
            corner[(index, index)] += 1.0 / (sd * sd);
            corner_gradient[index] += point.coefficients[index] / (sd * sd);
        }
        if let Some((above, below, mean, sd)) = self.ratio {
            let precision = 1.0 / (sd * sd);
            let off = point.coefficients[above] - point.coefficients[below] - mean;
            for (one, sign) in [(above, 1.0), (below, -1.0)] {
                corner[(one, above)] += sign * precision;
                corner[(one, below)] -= sign * precision;
                corner_gradient[one] += sign * precision * off;
            }
        }
        let precision = self.precision(spreads);
        let off = &point.common - &self.common_mean;
        let mut view = corner.view_mut((coefficients, coefficients), (common, common));
        view += &precision;
        for place in 0..common {
            corner[(coefficients + place, coefficients + place)] += self.damping * precision[(place, place)];
        }
        let mut view = corner_gradient.rows_mut(coefficients, common);
        view += &precision * &off;
        let noise = 1.0 / spreads.noise;
        let mut view = corner.view_mut((coefficients, coefficients), (common, common));
        view += &products.common * noise;
        let mut view = corner_gradient.rows_mut(coefficients, common);
        view -= &products.common_residual * noise;
        let mut blocks = Vec::with_capacity(self.conditions.len());
        for (condition, trials) in self.conditions.iter().enumerate() {
            let mean_at = trials.len() * size;
            let count = mean_at + size;
            let mut matrix = DMatrix::zeros(count, count);
            let mut mixed = DMatrix::zeros(count, border);
            let mut gradient = DVector::zeros(count);
            for (place, trial) in trials.iter().enumerate() {
                let (at, own) = (place * size, &products.trials[*trial]);
                let mut view = matrix.view_mut((at, at), (size, size));
                view += &own.own * noise;
                (0..size).for_each(|k| matrix[(at + k, at + k)] += self.damping);
                let mut view = mixed.view_mut((at, coefficients), (size, common));
                view += &own.mixed * noise;
                let mut view = gradient.rows_mut(at, size);
                view -= &own.own_residual * noise;
                for k in 0..size {
                    let weight = trial_precision[k] / self.variance_factor[*trial];
                    let off = point.own[*trial][k] - point.means[condition][k];
                    matrix[(at + k, at + k)] += weight;
                    matrix[(mean_at + k, mean_at + k)] += weight;
                    matrix[(at + k, mean_at + k)] -= weight;
                    matrix[(mean_at + k, at + k)] -= weight;
                    gradient[at + k] += weight * off;
                    gradient[mean_at + k] -= weight * off;
                }
            }
            let off = &point.means[condition] - self.expected(condition, &point.coefficients);
            for k in 0..size {
                let weight = condition_precision[k];
                matrix[(mean_at + k, mean_at + k)] += weight;
                gradient[mean_at + k] += weight * off[k];
                for (a, one) in self.regressors[condition].iter().enumerate() {
                    mixed[(mean_at + k, a * size + k)] -= weight * one;
                    corner_gradient[a * size + k] -= weight * one * off[k];
                    for (b, other) in self.regressors[condition].iter().enumerate() {
                        corner[(a * size + k, b * size + k)] += weight * one * other;
                    }
                }
            }
            blocks.push((matrix, mixed, gradient));
        }
        let mut log_determinant = 0.0;
        let mut eliminated = Vec::with_capacity(blocks.len());
        let mut gradients = Vec::with_capacity(blocks.len());
        let mut schur = corner;
        let mut schur_gradient = corner_gradient.clone();
        for (matrix, mixed, gradient) in blocks {
            let factor = matrix.cholesky()?;
            log_determinant += log_determinant_of_factor(factor.l_dirty());
            let inverse = inverse_of(&factor);
            let towards = &inverse * &mixed;
            let alone = &inverse * &gradient;
            schur.gemm(-1.0, &mixed.transpose(), &towards, 1.0);
            schur_gradient.gemv_tr(-1.0, &mixed, &alone, 1.0);
            gradients.push(gradient);
            eliminated.push(EliminatedBlock { inverse, towards, alone });
        }
        // Sums of rounding errors must not make it unsymmetric.
        let schur = (&schur + schur.transpose()) * 0.5;
        let factor = schur.cholesky()?;
        log_determinant += log_determinant_of_factor(factor.l_dirty());
        let border_step = -factor.solve(&schur_gradient);
        let border_covariance = inverse_of(&factor);
        let mut decrease = -0.5 * corner_gradient.dot(&border_step);
        let trials = products.trials.len();
        let mut step = Point {
            own: vec![DVector::zeros(size); trials],
            means: Vec::new(),
            coefficients: border_step.rows(0, coefficients).into_owned(),
            common: border_step.rows(coefficients, common).into_owned(),
        };
        let mut own_variance = vec![DVector::zeros(size); trials];
        let mut expected = ExpectedSquares {
            trial: DVector::zeros(size),
            condition: DVector::zeros(size),
            residual: 0.0,
            law: 0.0,
            trials,
            conditions: self.conditions.len(),
            values: products.count(),
        };
        let common_covariance =
            border_covariance.view((coefficients, coefficients), (common, common)).into_owned();
        // Mean squares of the residuals: at the minimum, and what the uncertainty of the unknowns adds.
        let mut residual = products.squares() - 2.0 * products.common_residual.dot(&step.common)
            + step.common.dot(&(&products.common * &step.common))
            + products.common.dot(&common_covariance);
        for (condition, (block, gradient)) in eliminated.iter().zip(&gradients).enumerate() {
            let EliminatedBlock { inverse, towards, alone } = block;
            let members = &self.conditions[condition];
            let mean_at = members.len() * size;
            let own_step = -(alone + towards * &border_step);
            decrease -= 0.5 * gradient.dot(&own_step);
            let with_border = towards * &border_covariance;
            let covariance = inverse + &with_border * towards.transpose();
            for (place, trial) in members.iter().enumerate() {
                let at = place * size;
                let own = &products.trials[*trial];
                let moved = own_step.rows(at, size).into_owned();
                residual -= 2.0 * own.own_residual.dot(&moved);
                residual +=
                    moved.dot(&(&own.own * &moved)) + own.own.dot(&covariance.view((at, at), (size, size)));
                let cross = with_border.view((at, coefficients), (size, common));
                residual += 2.0 * moved.dot(&(&own.mixed * &step.common)) - 2.0 * own.mixed.dot(&cross);
                for k in 0..size {
                    let off =
                        point.own[*trial][k] + moved[k] - point.means[condition][k] - own_step[mean_at + k];
                    let variance = covariance[(at + k, at + k)] + covariance[(mean_at + k, mean_at + k)]
                        - 2.0 * covariance[(at + k, mean_at + k)];
                    expected.trial[k] += (off * off + variance) / self.variance_factor[*trial];
                    own_variance[*trial][k] = covariance[(at + k, at + k)];
                }
                step.own[*trial] = moved;
            }
            let mean_step = own_step.rows(mean_at, size).into_owned();
            let moved_coefficients = &point.coefficients + &step.coefficients;
            let off = &point.means[condition] + &mean_step - self.expected(condition, &moved_coefficients);
            let regressors = &self.regressors[condition];
            for k in 0..size {
                let mut variance = covariance[(mean_at + k, mean_at + k)];
                for (a, one) in regressors.iter().enumerate() {
                    variance += 2.0 * one * with_border[(mean_at + k, a * size + k)];
                    for (b, other) in regressors.iter().enumerate() {
                        variance += one * other * border_covariance[(a * size + k, b * size + k)];
                    }
                }
                expected.condition[k] += off[k] * off[k] + variance;
            }
            step.means.push(mean_step);
        }
        expected.residual = residual;
        if let Some(law) = &self.law {
            let size = law.precision.nrows();
            let at = (&point.common + &step.common).rows(law.first, size).into_owned();
            expected.law = at.dot(&(&law.precision * &at))
                + law
                    .precision
                    .component_mul(&common_covariance.view((law.first, law.first), (size, size)))
                    .sum();
        }
        let cost = cost(self, spreads, point, products.squares(), products.count());
        let log_evidence = decrease - cost - 0.5 * log_determinant
            + self.half_log_precision(spreads, self.log_common_precision()?);
        let finite = log_evidence.is_finite() && step.common.iter().all(|own| own.is_finite());
        finite.then_some(Quadratic {
            cost,
            decrease,
            step,
            common_covariance,
            own_variance,
            log_evidence,
            expected,
            elimination: Elimination { blocks: eliminated, border_covariance },
        })
    }
}

impl Quadratic {
    /// What one more common unknown adds, of a normal prior about zero with standard deviation `sd`, by which the whitened predictions of
    /// `trials` change by `change`. The quadratic is that of `design` and `trials` with the variance `noise`.
    pub fn with_column(
        &self,
        design: &Design,
        trials: &[LinearTrial],
        noise: f64,
        change: &[DVector<f64>],
        sd: f64,
    ) -> AddedColumn {
        let border = self.elimination.border_covariance.nrows();
        let mut towards_border = DVector::zeros(border);
        let mut precision = 1.0 / (sd * sd);
        let mut gradient = 0.0;
        for (trial, column) in trials.iter().zip(change) {
            let common = trial.common.ncols();
            let mut own = towards_border.rows_mut(border - common, common);
            own.gemv_tr(1.0 / noise, &trial.common, column, 1.0);
            precision += column.norm_squared() / noise;
            gradient -= column.dot(&trial.residual) / noise;
        }
        for (block, members) in self.elimination.blocks.iter().zip(&design.conditions) {
            let mut own = DVector::zeros(block.alone.len());
            for (place, trial) in members.iter().enumerate() {
                let mut part = own.rows_mut(place * design.own, design.own);
                part.gemv_tr(1.0 / noise, &trials[*trial].own, &change[*trial], 0.0);
            }
            precision -= own.dot(&(&block.inverse * &own));
            gradient -= own.dot(&block.alone);
            towards_border.gemv_tr(-1.0, &block.towards, &own, 1.0);
        }
        precision -= towards_border.dot(&(&self.elimination.border_covariance * &towards_border));
        gradient += towards_border.rows(0, border - self.step.common.len()).dot(&self.step.coefficients)
            + towards_border
                .rows(border - self.step.common.len(), self.step.common.len())
                .dot(&self.step.common);
        AddedColumn {
            log_evidence: 0.5 * gradient * gradient / precision - 0.5 * libm::log(precision * sd * sd),
            value: -gradient / precision,
        }
    }
}
