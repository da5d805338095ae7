//! The marginal likelihood of a session whose torque is linear in what is unknown.
//!
//! Own coordinates of the trials are random effects: a trial lies about its condition, a condition about a regression on log velocity
//! and log torque. Everything is Gaussian given the spreads, so that the integral over all unknowns is a determinant. The unknowns of
//! one condition (its trials and its mean) form a block; regression and common coordinates are the border of an arrowhead.

use nalgebra::{DMatrix, DVector};

use super::gaussian::{log_determinant, twice_log_diagonal};
use super::linearisation::LinearTrial;

/// Prior of the spreads within and between conditions: scaled inverse chi-square with these degrees of freedom, about this standard
/// deviation of a logarithm. As in the fit of a session: a person's stiffness varies by 2 to 3 % from trial to trial.
const SPREAD_WEIGHT: f64 = 4.0;
const SPREAD_SD: f64 = 0.03;

/// Degrees of freedom of the prior of the noise's variance beside that of the holds. The hold predicts the variance of the noise in the
/// ramp to a fifth: the variance of a scaled inverse chi-square of this many degrees of freedom.
const NOISE_WEIGHT: f64 = 50.0;

/// Standard deviations of the prior of the regression: none to speak of for the level, and exponents of velocity and torque between
/// minus and plus one (section 3 of de Vlugt et al. 2011).
const LEVEL_SD: f64 = 100.0;
const EXPONENT_SD: f64 = 1.0;

/// Degrees of freedom of the prior of the variance of a free law: next to nothing is known of its size.
const LAW_WEIGHT: f64 = 1.0;

/// Number of regressors of a condition: 1, log velocity and log torque.
pub const REGRESSORS: usize = 3;

/// What does not change while a model is fitted.
#[derive(Debug, Clone)]
pub struct Design {
    /// For each condition, its trials.
    pub conditions: Vec<Vec<usize>>,
    /// For each condition, its regressors.
    pub regressors: Vec<[f64; REGRESSORS]>,
    /// Number of own coordinates of a trial.
    pub own: usize,
    /// Priors of the common coordinates: mean and precision matrix.
    pub common_mean: DVector<f64>,
    /// Precision of the common coordinates, but for those of a free law.
    pub common_precision: DMatrix<f64>,
    /// Normal prior of the difference of two own coordinates at mean velocity and torque: the coordinates, mean, standard deviation.
    pub ratio: Option<(usize, usize, f64, f64)>,
    /// The coefficients of a free law.
    pub law: Option<FreeLawPrior>,
    /// Factor of the prior variance of a trial about its condition: 1, or much more for a trial that does not belong.
    pub variance_factor: Vec<f64>,
    /// Information by which a step is held back, about the trials' own coordinates and, by their priors, about the common ones: 0 where
    /// the quadratic is to be exact.
    pub damping: f64,
}

/// Prior of the coefficients of a free law: normal, of a smooth covariance whose size is estimated.
#[derive(Debug, Clone)]
pub struct FreeLawPrior {
    /// First common coordinate of the coefficients.
    pub first: usize,
    /// Precision of the coefficients for a variance of one.
    pub precision: DMatrix<f64>,
    /// Logarithm of the determinant of this precision.
    pub log_determinant: f64,
    /// Variance about which the prior of the size lies.
    pub variance: f64,
}

/// Estimated variances.
#[derive(Debug, Clone)]
pub struct Spreads {
    /// Of a trial about its condition, by own coordinate.
    pub trial: DVector<f64>,
    /// Of a condition about the regression.
    pub condition: DVector<f64>,
    /// Of the noise, by that of the holds.
    pub noise: f64,
    /// Of the coefficients of a free law.
    pub law: f64,
}

impl Spreads {
    /// Where the estimation starts: a little above the prior.
    pub fn start(own: usize, law_variance: f64) -> Self {
        let spread = DVector::from_element(own, 4.0 * SPREAD_SD * SPREAD_SD);
        Self { trial: spread.clone(), condition: spread, noise: 1.0, law: law_variance }
    }

    fn negative_log_prior(&self, design: &Design) -> f64 {
        let inverse_chi_square = |weight: f64, centre: f64, variance: f64| {
            let relative = centre / variance;
            0.5 * weight * (relative - libm::log(relative))
        };
        let spreads = self.trial.iter().chain(self.condition.iter());
        let mut cost: f64 =
            spreads.map(|own| inverse_chi_square(SPREAD_WEIGHT, SPREAD_SD * SPREAD_SD, *own)).sum();
        cost += inverse_chi_square(NOISE_WEIGHT, 1.0, self.noise);
        if let Some(law) = &design.law {
            cost += inverse_chi_square(LAW_WEIGHT, law.variance, self.law);
        }
        cost
    }
}

/// Values of the unknowns.
#[derive(Debug, Clone)]
pub struct Point {
    /// Own coordinates of each trial.
    pub own: Vec<DVector<f64>>,
    /// Mean of each condition.
    pub means: Vec<DVector<f64>>,
    /// Coefficients of the regression: for each regressor one value by own coordinate.
    pub coefficients: DVector<f64>,
    /// Common coordinates.
    pub common: DVector<f64>,
}

impl Point {
    /// Moved by `part` of the step of `solution`.
    pub fn moved(&self, solution: &Quadratic, part: f64) -> Self {
        let add = |values: &[DVector<f64>], steps: &[DVector<f64>]| {
            values.iter().zip(steps).map(|(value, step)| value + step * part).collect()
        };
        Self {
            own: add(&self.own, &solution.step.own),
            means: add(&self.means, &solution.step.means),
            coefficients: &self.coefficients + &solution.step.coefficients * part,
            common: &self.common + &solution.step.common * part,
        }
    }
}

/// What a linear session says of all unknowns together, beyond the priors: products of residuals and derivatives.
#[derive(Debug, Clone)]
pub struct Products {
    trials: Vec<TrialProducts>,
    squares: f64,
    count: usize,
}

#[derive(Debug, Clone)]
struct TrialProducts {
    own: DMatrix<f64>,
    mixed: DMatrix<f64>,
    common: DMatrix<f64>,
    own_residual: DVector<f64>,
    common_residual: DVector<f64>,
}

impl Products {
    /// The products of `trials`.
    pub fn new(trials: &[LinearTrial]) -> Self {
        let products = |trial: &LinearTrial| TrialProducts {
            own: trial.own.tr_mul(&trial.own),
            mixed: trial.own.tr_mul(&trial.common),
            common: trial.common.tr_mul(&trial.common),
            own_residual: trial.own.tr_mul(&trial.residual),
            common_residual: trial.common.tr_mul(&trial.residual),
        };
        Self {
            trials: trials.iter().map(products).collect(),
            squares: trials.iter().map(|trial| trial.residual.norm_squared()).sum(),
            count: trials.iter().map(|trial| trial.residual.len()).sum(),
        }
    }

    /// The same with one more common coordinate, of which the whitened predictions change by `change`.
    pub fn with_column(&self, trials: &[LinearTrial], change: &[DVector<f64>]) -> Self {
        let mut with = self.clone();
        for ((own, trial), column) in with.trials.iter_mut().zip(trials).zip(change) {
            let place = own.common_residual.len();
            let mixed = trial.own.tr_mul(column);
            let common = trial.common.tr_mul(column);
            let grown = |matrix: &DMatrix<f64>, rows: usize| matrix.clone().resize(rows, place + 1, 0.0);
            own.mixed = grown(&own.mixed, own.mixed.nrows());
            own.mixed.set_column(place, &mixed);
            own.common = grown(&own.common, place + 1);
            own.common.view_mut((0, place), (place, 1)).copy_from(&common);
            own.common.view_mut((place, 0), (1, place)).copy_from(&common.transpose());
            own.common[(place, place)] = column.norm_squared();
            own.common_residual = own.common_residual.push(column.dot(&trial.residual));
        }
        with
    }

    /// The same of a session whose residuals are `residuals`.
    pub fn with_residuals(mut self, trials: &[LinearTrial], residuals: &[DVector<f64>]) -> Self {
        for ((own, trial), residual) in self.trials.iter_mut().zip(trials).zip(residuals) {
            own.own_residual = trial.own.tr_mul(residual);
            own.common_residual = trial.common.tr_mul(residual);
        }
        self.squares = residuals.iter().map(DVector::norm_squared).sum();
        self
    }

    /// Sum of squares of the residuals.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// Number of residuals.
    pub fn count(&self) -> usize {
        self.count
    }
}

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
    expected: Expected,
}

/// Expected sums of squares, from which the spreads follow.
#[derive(Debug, Clone)]
struct Expected {
    trial: DVector<f64>,
    condition: DVector<f64>,
    residual: f64,
    law: f64,
    trials: usize,
    conditions: usize,
    values: usize,
}

/// The cost at `point`, where the session has the sum of squares `squares` in `count` values.
pub fn cost(design: &Design, spreads: &Spreads, point: &Point, squares: f64, count: usize) -> f64 {
    let mut cost = 0.5 * squares / spreads.noise + 0.5 * count as f64 * libm::log(spreads.noise);
    for (condition, trials) in design.conditions.iter().enumerate() {
        for trial in trials {
            let off = &point.own[*trial] - &point.means[condition];
            cost += 0.5 * off.component_mul(&off).component_div(&spreads.trial).sum()
                / design.variance_factor[*trial];
        }
        let off = &point.means[condition] - design.expected(condition, &point.coefficients);
        cost += 0.5 * off.component_mul(&off).component_div(&spreads.condition).sum();
    }
    for (index, coefficient) in point.coefficients.iter().enumerate() {
        let sd = if index < design.own { LEVEL_SD } else { EXPONENT_SD };
        cost += 0.5 * (coefficient / sd) * (coefficient / sd);
    }
    if let Some((above, below, mean, sd)) = design.ratio {
        let off = (point.coefficients[above] - point.coefficients[below] - mean) / sd;
        cost += 0.5 * off * off;
    }
    let off = &point.common - &design.common_mean;
    cost += 0.5 * off.dot(&(design.precision(spreads) * &off));
    cost + spreads.negative_log_prior(design)
}

impl Design {
    /// The regression's value for a condition.
    fn expected(&self, condition: usize, coefficients: &DVector<f64>) -> DVector<f64> {
        let mut expected = DVector::zeros(self.own);
        for (a, regressor) in self.regressors[condition].iter().enumerate() {
            expected += coefficients.rows(a * self.own, self.own) * *regressor;
        }
        expected
    }

    /// Precision of the common coordinates.
    fn precision(&self, spreads: &Spreads) -> DMatrix<f64> {
        let mut precision = self.common_precision.clone();
        if let Some(law) = &self.law {
            let size = law.precision.nrows();
            let mut own = precision.view_mut((law.first, law.first), (size, size));
            own += &law.precision / spreads.law;
        }
        precision
    }

    /// Half the logarithm of the determinant of the prior's precision.
    fn half_log_precision(&self, spreads: &Spreads, fixed: f64) -> f64 {
        let trials: usize = self.conditions.iter().map(Vec::len).sum();
        let log_sum = |variances: &DVector<f64>| variances.iter().map(|own| libm::log(*own)).sum::<f64>();
        let mut twice = fixed - trials as f64 * log_sum(&spreads.trial);
        let factors: f64 = self.variance_factor.iter().map(|own| libm::log(*own)).sum();
        twice -= self.own as f64 * factors;
        twice -= self.conditions.len() as f64 * log_sum(&spreads.condition);
        twice -=
            2.0 * self.own as f64 * (libm::log(LEVEL_SD) + (REGRESSORS - 1) as f64 * libm::log(EXPONENT_SD));
        if let Some(law) = &self.law {
            twice += law.log_determinant - law.precision.nrows() as f64 * libm::log(spreads.law);
        }
        0.5 * twice
    }

    /// The same with one more common coordinate, about zero with standard deviation `sd`.
    pub fn with_column(&self, sd: f64) -> Self {
        let place = self.common_mean.len();
        let mut with = self.clone();
        with.common_mean = with.common_mean.push(0.0);
        with.common_precision = with.common_precision.resize(place + 1, place + 1, 0.0);
        with.common_precision[(place, place)] = 1.0 / (sd * sd);
        with
    }

    /// The same with steps held back.
    pub fn damped(&self, damping: f64) -> Self {
        Self { damping, ..self.clone() }
    }

    /// The same without the prior of a ratio, which is about values and not about errors.
    pub fn without_ratio(&self) -> Self {
        Self { ratio: None, ..self.clone() }
    }

    /// The same where the common coordinates at `places` are known to be where they are at `point`.
    pub fn holding(&self, places: &[usize], point: &Point) -> Self {
        /// Precision of a coordinate that is known, far above what any data tell.
        const KNOWN: f64 = 1e14;
        let mut held = self.clone();
        for place in places {
            held.common_mean[*place] = point.common[*place];
            held.common_precision[(*place, *place)] += KNOWN;
        }
        held
    }

    /// Logarithm of the determinant of the common coordinates' precision, but for those of a free law.
    pub fn log_common_precision(&self) -> Option<f64> {
        let skip = self.law.as_ref().map(|law| law.first..law.first + law.precision.nrows());
        let kept: Vec<usize> = (0..self.common_mean.len())
            .filter(|place| skip.as_ref().is_none_or(|skip| !skip.contains(place)))
            .collect();
        let matrix =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| self.common_precision[(kept[i], kept[j])]);
        log_determinant(matrix)
    }

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
                let mut view = corner.view_mut((coefficients, coefficients), (common, common));
                view += &own.common * noise;
                let mut view = corner_gradient.rows_mut(coefficients, common);
                view -= &own.common_residual * noise;
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
        let mut schur = corner;
        let mut schur_gradient = corner_gradient.clone();
        for (matrix, mixed, gradient) in blocks {
            let factor = matrix.cholesky()?;
            log_determinant += twice_log_diagonal(factor.l_dirty());
            let towards = factor.solve(&mixed);
            let alone = factor.solve(&gradient);
            schur -= mixed.tr_mul(&towards);
            schur_gradient -= mixed.tr_mul(&alone);
            eliminated.push((factor, towards, alone, gradient));
        }
        // Sums of rounding errors must not make it unsymmetric.
        let schur = (&schur + schur.transpose()) * 0.5;
        let factor = schur.cholesky()?;
        log_determinant += twice_log_diagonal(factor.l_dirty());
        let border_step = -factor.solve(&schur_gradient);
        let border_covariance = factor.inverse();
        let mut decrease = -0.5 * corner_gradient.dot(&border_step);
        let trials = products.trials.len();
        let mut step = Point {
            own: vec![DVector::zeros(size); trials],
            means: Vec::new(),
            coefficients: border_step.rows(0, coefficients).into_owned(),
            common: border_step.rows(coefficients, common).into_owned(),
        };
        let mut own_variance = vec![DVector::zeros(size); trials];
        let mut expected = Expected {
            trial: DVector::zeros(size),
            condition: DVector::zeros(size),
            residual: 0.0,
            law: 0.0,
            trials,
            conditions: self.conditions.len(),
            values: products.count,
        };
        let common_covariance =
            border_covariance.view((coefficients, coefficients), (common, common)).into_owned();
        // Mean squares of the residuals: at the minimum, and what the uncertainty of the unknowns adds.
        let mut residual = products.squares;
        for (condition, (factor, towards, alone, gradient)) in eliminated.into_iter().enumerate() {
            let members = &self.conditions[condition];
            let mean_at = members.len() * size;
            let own_step = -(&alone + &towards * &border_step);
            decrease -= 0.5 * gradient.dot(&own_step);
            let with_border = &towards * &border_covariance;
            let covariance = factor.inverse() + &with_border * towards.transpose();
            for (place, trial) in members.iter().enumerate() {
                let at = place * size;
                let own = &products.trials[*trial];
                let moved = own_step.rows(at, size).into_owned();
                residual -= 2.0 * own.own_residual.dot(&moved);
                residual += moved.dot(&(&own.own * &moved))
                    + own.own.component_mul(&covariance.view((at, at), (size, size))).sum();
                let moved_common = &step.common;
                residual -= 2.0 * own.common_residual.dot(moved_common);
                residual += moved_common.dot(&(&own.common * moved_common))
                    + own.common.component_mul(&common_covariance).sum();
                let cross = -with_border.view((at, coefficients), (size, common));
                residual += 2.0 * moved.dot(&(&own.mixed * moved_common))
                    + 2.0 * own.mixed.component_mul(&cross).sum();
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
        let cost = cost(self, spreads, point, products.squares, products.count);
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
        })
    }
}

impl Quadratic {
    /// The spreads of largest marginal likelihood, given what is expected under the present ones (one step of expectation
    /// maximisation). Also the largest change of the logarithm of a variance.
    pub fn spreads(&self, design: &Design, present: &Spreads) -> (Spreads, f64) {
        let own = &self.expected;
        let estimate = |sum: f64, count: usize| {
            (SPREAD_WEIGHT * SPREAD_SD * SPREAD_SD + sum) / (SPREAD_WEIGHT + count as f64)
        };
        let next = Spreads {
            trial: own.trial.map(|sum| estimate(sum, own.trials)),
            condition: own.condition.map(|sum| estimate(sum, own.conditions)),
            noise: (NOISE_WEIGHT + own.residual) / (NOISE_WEIGHT + own.values as f64),
            law: design.law.as_ref().map_or(present.law, |law| {
                (LAW_WEIGHT * law.variance + own.law) / (LAW_WEIGHT + law.precision.nrows() as f64)
            }),
        };
        let change = |a: f64, b: f64| libm::log(a / b).abs();
        let of = |a: &DVector<f64>, b: &DVector<f64>| {
            a.iter().zip(b.iter()).map(|(a, b)| change(*a, *b)).fold(0.0, f64::max)
        };
        let largest = of(&next.trial, &present.trial)
            .max(of(&next.condition, &present.condition))
            .max(change(next.noise, present.noise))
            .max(change(next.law, present.law));
        (next, largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const VALUES: usize = 4;

    /// Three trials of one own coordinate in two conditions, with two common coordinates.
    fn session(stream: &mut Stream) -> (Design, Vec<LinearTrial>, Point) {
        let design = Design {
            conditions: vec![vec![0, 1], vec![2]],
            regressors: vec![[1.0, -0.4, 0.3], [1.0, 0.4, -0.3]],
            own: 1,
            common_mean: DVector::from_vec(vec![0.2, -0.1]),
            common_precision: DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 9.0]),
            ratio: None,
            law: None,
            variance_factor: vec![1.0, 100.0, 1.0],
            damping: 0.0,
        };
        let mut random =
            |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| stream.normal());
        let trials = (0..3)
            .map(|_| LinearTrial {
                residual: random(VALUES, 1).column(0).into_owned(),
                own: random(VALUES, 1),
                common: random(VALUES, 2),
            })
            .collect();
        let zero = |count: usize| DVector::zeros(count);
        let point = Point {
            own: vec![zero(1); 3],
            means: vec![zero(1); 2],
            coefficients: zero(3),
            common: design.common_mean.clone(),
        };
        (design, trials, point)
    }

    /// Logarithm of the density of the residuals, whose covariance is written down in full.
    fn log_density(design: &Design, trials: &[LinearTrial], spreads: &Spreads) -> f64 {
        let count = trials.len() * VALUES;
        let condition_of = |trial: usize| usize::from(trial == 2);
        let common = design.common_precision.clone().try_inverse().unwrap();
        let covariance = DMatrix::from_fn(count, count, |i, j| {
            let (a, b) = (i / VALUES, j / VALUES);
            let (own, other) = (&trials[a], &trials[b]);
            let (z, w) = (design.regressors[condition_of(a)], design.regressors[condition_of(b)]);
            let mut between = LEVEL_SD * LEVEL_SD + (z[1] * w[1] + z[2] * w[2]) * EXPONENT_SD * EXPONENT_SD;
            if condition_of(a) == condition_of(b) {
                between += spreads.condition[0];
            }
            if a == b {
                between += spreads.trial[0] * design.variance_factor[a];
            }
            let shared =
                (own.common.row(i % VALUES) * &common * other.common.row(j % VALUES).transpose())[(0, 0)];
            own.own[(i % VALUES, 0)] * between * other.own[(j % VALUES, 0)]
                + shared
                + if i == j { spreads.noise } else { 0.0 }
        });
        let residual = DVector::from_fn(count, |i, _| trials[i / VALUES].residual[i % VALUES]);
        let factor = covariance.cholesky().unwrap();
        -0.5 * (residual.dot(&factor.solve(&residual)) + twice_log_diagonal(factor.l_dirty()))
    }

    #[test]
    fn the_evidence_is_the_density_of_the_data_with_all_unknowns_integrated_out() {
        let (design, trials, point) = session(&mut Stream::new(1, "evidence"));
        let products = Products::new(&trials);
        for (trial, condition, noise) in [(1e-3, 1e-3, 1.0), (0.4, 0.02, 1.3), (0.01, 2.0, 0.6)] {
            let spreads = Spreads {
                trial: DVector::from_element(1, trial),
                condition: DVector::from_element(1, condition),
                noise,
                law: 1.0,
            };
            let found = design.quadratic(&spreads, &point, &products).unwrap().log_evidence;
            let expected = log_density(&design, &trials, &spreads) - spreads.negative_log_prior(&design);
            assert!((found - expected).abs() < 1e-6, "{found} instead of {expected}");
        }
    }

    #[test]
    fn the_evidence_of_a_linear_session_does_not_depend_on_the_point_it_is_taken_about() {
        let mut stream = Stream::new(2, "evidence");
        let (design, trials, point) = session(&mut stream);
        let spreads = Spreads::start(1, 1.0);
        let here = design.quadratic(&spreads, &point, &Products::new(&trials)).unwrap();
        let there = point.moved(&here, 0.7);
        let moved: Vec<LinearTrial> = trials
            .iter()
            .enumerate()
            .map(|(trial, own)| LinearTrial {
                residual: &own.residual
                    - &own.own * (&there.own[trial] - &point.own[trial])
                    - &own.common * (&there.common - &point.common),
                ..own.clone()
            })
            .collect();
        let again = design.quadratic(&spreads, &there, &Products::new(&moved)).unwrap();
        assert!((here.log_evidence - again.log_evidence).abs() < 1e-6);
        assert!(again.decrease < here.decrease);
    }

    #[test]
    fn spreads_of_largest_marginal_likelihood_are_reached() {
        let (design, trials, point) = session(&mut Stream::new(3, "evidence"));
        let products = Products::new(&trials);
        let mut spreads = Spreads::start(1, 1.0);
        let mut before = f64::NEG_INFINITY;
        for _ in 0..40 {
            let quadratic = design.quadratic(&spreads, &point, &products).unwrap();
            assert!(quadratic.log_evidence > before - 1e-9, "{before} to {}", quadratic.log_evidence);
            before = quadratic.log_evidence;
            spreads = quadratic.spreads(&design, &spreads).0;
        }
    }

    #[test]
    fn one_more_column_is_one_more_common_coordinate() {
        let (design, trials, point) = session(&mut Stream::new(4, "evidence"));
        let change: Vec<DVector<f64>> =
            (0..3).map(|trial| DVector::from_fn(VALUES, |i, _| (trial + i) as f64 - 2.0)).collect();
        let with = Products::new(&trials).with_column(&trials, &change);
        let mut wide = trials.clone();
        for (own, column) in wide.iter_mut().zip(&change) {
            own.common = own.common.clone().resize_horizontally(3, 0.0);
            own.common.set_column(2, column);
        }
        let design = design.with_column(0.5);
        let mut point = point;
        point.common = point.common.push(0.0);
        let spreads = Spreads::start(1, 1.0);
        let evidence =
            |products: &Products| design.quadratic(&spreads, &point, products).unwrap().log_evidence;
        assert!((evidence(&with) - evidence(&Products::new(&wide))).abs() < 1e-9);
    }
}
