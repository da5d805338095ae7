//! Spreads and regression of a session by expectation maximisation, from quadratic approximations of the trials' costs.

use nalgebra::{DMatrix, DVector, Vector3};

use super::session_priors::{EXPONENT_SD, LEVEL_SD, SPREAD_DEGREES, SPREAD_SD};
use super::summary::OptimumSummary;
use crate::fit::linalg::cholesky;
use crate::statistics::{log_determinant_of_factor, probabilities};

/// Degrees of freedom of the trials' distribution around their condition: heavy tails, so that a trial that is really different stays
/// so (Lange, Little and Taylor 1989).
const DEGREES_OF_FREEDOM: f64 = 4.0;

/// The 0.1 % quantile of chi-square with [`SPREAD_DEGREES`] degrees of freedom.
const SPREAD_TAIL: f64 = 0.090_804;

/// Prior of the ratio of two parameters at mean velocity and torque: normal on a logarithmic scale.
#[derive(Debug, Clone, Copy)]
pub struct RatioPrior {
    /// Coordinate of the numerator, and of the denominator.
    pub coordinates: [usize; 2],
    /// Median of the ratio.
    pub median: f64,
    /// Standard deviation of its logarithm.
    pub log_sd: f64,
}

/// A normal prior of a sum of unknowns.
pub struct LinearPrior {
    /// The unknowns, by index, with their factors.
    pub terms: Vec<(usize, f64)>,
    /// By how much the sum is away from its mean at present.
    pub deviation: f64,
    /// Inverse of its variance.
    pub precision: f64,
}

const MAX_ITERATIONS: usize = 200;

/// Change of the logarithm of a variance in one iteration below which the iteration ends.
const VARIANCE_TOLERANCE: f64 = 3e-3;

/// A trial: its condition, and its optima.
#[derive(Debug, Clone)]
pub struct TrialSummary {
    /// Index of the condition.
    pub condition: usize,
    /// At least one.
    pub optima: Vec<OptimumSummary>,
}

/// What is known of the parameters of one trial, given all trials.
#[derive(Debug, Clone)]
pub struct TrialPosterior {
    /// Probability of each of its optima.
    pub probabilities: Vec<f64>,
    /// Mean of the coordinates at each optimum.
    pub means: Vec<DVector<f64>>,
    /// Mean over the optima.
    pub mean: DVector<f64>,
    /// Expected square of the distance from the mean of the condition, by coordinate.
    squared_distance: DVector<f64>,
}

impl TrialPosterior {
    /// Index of the most probable optimum.
    pub fn most_probable(&self) -> usize {
        let order = |a: &usize, b: &usize| self.probabilities[*a].total_cmp(&self.probabilities[*b]);
        (0..self.probabilities.len()).rev().max_by(order).unwrap_or(0)
    }

    /// Variance of a coordinate from one optimum to another.
    pub fn variance_between_optima(&self, coordinate: usize) -> f64 {
        let square = |own: &DVector<f64>| libm::pow(own[coordinate] - self.mean[coordinate], 2.0);
        self.means.iter().zip(&self.probabilities).map(|(own, probability)| probability * square(own)).sum()
    }
}

/// Regression, spreads, and the posterior of every condition and trial.
#[derive(Debug, Clone)]
pub struct Hierarchy {
    /// Regressors of each condition: 1, and centred log velocity and log torque.
    regressors: Vec<Vector3<f64>>,
    ratio_prior: Option<RatioPrior>,
    /// Scales of the trials about their condition, squared; by coordinate.
    pub trial_variance: DVector<f64>,
    /// Variances of the conditions about the regression; by coordinate.
    pub condition_variance: DVector<f64>,
    /// Weights of each trial: small where it is unlike the others; by coordinate.
    pub weights: Vec<DVector<f64>>,
    /// Regression coefficients: for each regressor, one value by coordinate.
    pub coefficients: DVector<f64>,
    /// Means of the conditions.
    pub condition_means: Vec<DVector<f64>>,
    /// Covariances of these means.
    pub condition_covariances: Vec<DMatrix<f64>>,
    /// Expected squares of the distances of the conditions from the regression, by coordinate.
    squared_distances: Vec<DVector<f64>>,
    /// Logarithm of the determinant of the covariance of all conditions and coefficients.
    log_determinant: f64,
    /// Posterior of each trial.
    pub trials: Vec<TrialPosterior>,
}

/// The largest spread that a single person's session is taken to have, as standard deviation of a logarithm: beyond it lies 0.1 % of
/// the prior.
pub fn largest_spread() -> f64 {
    SPREAD_SD * libm::sqrt(SPREAD_DEGREES / SPREAD_TAIL)
}

/// One optimum of a trial under the prior that its condition gives it.
struct Conditional {
    /// Covariance of the coordinates given the condition's mean.
    covariance: DMatrix<f64>,
    /// Mean of the coordinates given the condition's mean: `offset + shrinkage * mean`.
    offset: DVector<f64>,
    shrinkage: DMatrix<f64>,
    /// Information about the condition's mean, and information vector.
    information: DMatrix<f64>,
    vector: DVector<f64>,
    probability: f64,
}

impl Hierarchy {
    /// Before any trial is known: conditions with these log velocities and log torques, and spreads at twice their prior's.
    pub fn new(
        log_conditions: &[[f64; 2]],
        trials: &[TrialSummary],
        ratio_prior: Option<RatioPrior>,
    ) -> Self {
        let count = log_conditions.len() as f64;
        let mean = [0, 1].map(|which| log_conditions.iter().map(|own| own[which]).sum::<f64>() / count);
        let size = trials[0].optima[0].at.len();
        let spread = DVector::from_element(size, 4.0 * SPREAD_SD * SPREAD_SD);
        Self {
            regressors: log_conditions
                .iter()
                .map(|own| Vector3::new(1.0, own[0] - mean[0], own[1] - mean[1]))
                .collect(),
            ratio_prior,
            trial_variance: spread.clone(),
            condition_variance: spread,
            weights: vec![DVector::from_element(size, 1.0); trials.len()],
            coefficients: DVector::zeros(3 * size),
            condition_means: Vec::new(),
            condition_covariances: Vec::new(),
            squared_distances: Vec::new(),
            log_determinant: 0.0,
            trials: Vec::new(),
        }
    }

    /// The same with these means of the conditions, from which the trials shall start.
    pub fn about(mut self, condition_means: Vec<DVector<f64>>) -> Self {
        self.condition_means = condition_means;
        self
    }

    /// Iterates from the present spreads to those of largest marginal likelihood; `None` if an approximation is not finite.
    pub fn estimate(mut self, trials: &[TrialSummary]) -> Option<Self> {
        for _ in 0..MAX_ITERATIONS {
            self.expect(trials)?;
            if self.maximise() < VARIANCE_TOLERANCE {
                break;
            }
        }
        self.expect(trials)?;
        Some(self)
    }

    /// Mean and standard deviation of the prior of a coordinate of a trial.
    pub fn prior(&self, trial: usize, condition: usize, coordinate: usize) -> (f64, f64) {
        let variance = self.trial_variance[coordinate] / self.weights[trial][coordinate];
        (self.condition_means[condition][coordinate], libm::sqrt(variance))
    }

    /// Precision of the prior of a trial's coordinates.
    pub fn prior_precision(&self, trial: usize) -> DVector<f64> {
        self.weights[trial].component_div(&self.trial_variance)
    }

    /// Regressors of each condition: 1, and centred log velocity and log torque.
    pub fn regressors(&self) -> &[Vector3<f64>] {
        &self.regressors
    }

    /// The priors of the coefficients.
    pub fn coefficient_priors(&self) -> Vec<LinearPrior> {
        let size = self.trial_variance.len();
        let single = |index: usize| {
            let sd = if index < size { LEVEL_SD } else { EXPONENT_SD };
            let deviation = self.coefficients[index];
            LinearPrior { terms: vec![(index, 1.0)], deviation, precision: 1.0 / (sd * sd) }
        };
        let mut priors: Vec<LinearPrior> = (0..3 * size).map(single).collect();
        if let Some(RatioPrior { coordinates: [above, below], median, log_sd }) = self.ratio_prior {
            priors.push(LinearPrior {
                terms: vec![(above, 1.0), (below, -1.0)],
                deviation: self.coefficients[above] - self.coefficients[below] - libm::log(median),
                precision: 1.0 / (log_sd * log_sd),
            });
        }
        priors
    }

    /// What the regression expects of a condition.
    fn expected_mean(&self, regressors: &Vector3<f64>) -> DVector<f64> {
        let size = self.trial_variance.len();
        let of_regressor = |a: usize| self.coefficients.rows(a * size, size) * regressors[a];
        of_regressor(0) + of_regressor(1) + of_regressor(2)
    }

    /// Standard deviation of a new trial about the regression, by coordinate.
    pub fn spread(&self, coordinate: usize) -> f64 {
        libm::sqrt(self.trial_variance[coordinate] + self.condition_variance[coordinate])
    }

    /// Regression, conditions and trials, given the spreads.
    fn expect(&mut self, trials: &[TrialSummary]) -> Option<()> {
        let size = self.trial_variance.len();
        let conditionals: Vec<Vec<Conditional>> =
            (0..trials.len()).map(|trial| self.conditionals(trial, &trials[trial])).collect::<Option<_>>()?;
        let mut information = vec![DMatrix::zeros(size, size); self.regressors.len()];
        let mut vectors = vec![DVector::zeros(size); self.regressors.len()];
        for (trial, optima) in trials.iter().zip(&conditionals) {
            for optimum in optima {
                information[trial.condition] += &optimum.information * optimum.probability;
                vectors[trial.condition] += &optimum.vector * optimum.probability;
            }
        }
        self.expect_conditions(&information, &vectors)?;
        self.trials = trials
            .iter()
            .zip(conditionals)
            .map(|(trial, optima)| {
                let (mean, covariance) =
                    (&self.condition_means[trial.condition], &self.condition_covariances[trial.condition]);
                posterior(optima, mean, covariance)
            })
            .collect();
        Some(())
    }

    /// Negative logarithm of the evidence, up to a constant: trials integrated about their optima, conditions and coefficients about
    /// their means, and spreads and weights at their estimates. It compares places to which the whole session may have gone.
    pub fn negative_log_evidence(&self, trials: &[TrialSummary]) -> Option<f64> {
        let mut cost = 0.0;
        for (trial, summary) in trials.iter().enumerate() {
            let (_, log_evidence) = self.weighed_conditionals(trial, summary)?;
            cost -= log_evidence;
            for (weight, variance) in self.weights[trial].iter().zip(self.trial_variance.iter()) {
                cost += 0.5 * libm::log(variance / weight);
                cost +=
                    0.5 * DEGREES_OF_FREEDOM * weight - (0.5 * DEGREES_OF_FREEDOM - 1.0) * libm::log(*weight);
            }
        }
        for (mean, regressors) in self.condition_means.iter().zip(&self.regressors) {
            let off = mean - self.expected_mean(regressors);
            cost += 0.5 * off.component_mul(&off).component_div(&self.condition_variance).sum();
            cost += 0.5 * self.condition_variance.map(libm::log).sum();
        }
        let square = |prior: LinearPrior| 0.5 * prior.precision * prior.deviation * prior.deviation;
        cost += self.coefficient_priors().into_iter().map(square).sum::<f64>();
        cost -= 0.5 * self.log_determinant;
        for variance in self.trial_variance.iter().chain(self.condition_variance.iter()) {
            let relative = SPREAD_SD * SPREAD_SD / variance;
            cost += 0.5 * SPREAD_DEGREES * (relative - libm::log(relative));
        }
        cost.is_finite().then_some(cost)
    }

    /// The optima of a trial given the mean of its condition.
    fn conditionals(&self, trial: usize, summary: &TrialSummary) -> Option<Vec<Conditional>> {
        self.weighed_conditionals(trial, summary).map(|(conditionals, _)| conditionals)
    }

    /// The same, with the logarithm of the evidence of all optima together.
    fn weighed_conditionals(&self, trial: usize, summary: &TrialSummary) -> Option<(Vec<Conditional>, f64)> {
        let precision = self.prior_precision(trial);
        let prior = DMatrix::from_diagonal(&precision);
        let mut log_evidence = Vec::new();
        let mut conditionals = Vec::new();
        for optimum in &summary.optima {
            let factor = cholesky(&optimum.information + &prior)?;
            let covariance = factor.inverse();
            let shrinkage = &covariance * &prior;
            let offset = &covariance * optimum.information_vector();
            let mut cost = optimum.cost;
            if let Some(mean) = self.condition_means.get(summary.condition) {
                let point = &offset + &shrinkage * mean;
                let off = &point - mean;
                cost = optimum.cost_at(&point) + 0.5 * off.dot(&precision.component_mul(&off));
            }
            log_evidence.push(-cost - 0.5 * log_determinant_of_factor(factor.l_dirty()));
            conditionals.push(Conditional {
                information: &prior - &prior * &shrinkage,
                vector: &prior * &offset,
                covariance,
                offset,
                shrinkage,
                probability: 0.0,
            });
        }
        let (found, evidence) = probabilities(&log_evidence);
        conditionals.iter_mut().zip(found).for_each(|(own, probability)| own.probability = probability);
        evidence.is_finite().then_some((conditionals, evidence))
    }

    /// Regression and conditions from the information that the trials of each condition give about its mean.
    fn expect_conditions(&mut self, information: &[DMatrix<f64>], vectors: &[DVector<f64>]) -> Option<()> {
        let size = self.trial_variance.len();
        let level = 1.0 / (LEVEL_SD * LEVEL_SD);
        let exponent = 1.0 / (EXPONENT_SD * EXPONENT_SD);
        let mut normal = DMatrix::from_fn(3 * size, 3 * size, |i, j| {
            if i != j {
                0.0
            } else if i < size {
                level
            } else {
                exponent
            }
        });
        let mut right = DVector::zeros(3 * size);
        if let Some(RatioPrior { coordinates: [above, below], median, log_sd }) = self.ratio_prior {
            let precision = 1.0 / (log_sd * log_sd);
            for (one, sign) in [(above, 1.0), (below, -1.0)] {
                normal[(one, above)] += sign * precision;
                normal[(one, below)] -= sign * precision;
                right[one] += sign * precision * libm::log(median);
            }
        }
        let precision = DMatrix::from_diagonal(&self.condition_variance.map(|variance| 1.0 / variance));
        let (mut covariances, mut log_determinant) = (Vec::new(), 0.0);
        for ((own, vector), regressors) in information.iter().zip(vectors).zip(&self.regressors) {
            let factor = cholesky(own + &precision)?;
            log_determinant -= log_determinant_of_factor(factor.l_dirty());
            let covariance = factor.inverse();
            let about_regression = &precision - &precision * &covariance * &precision;
            let of_regression = &precision * &covariance * vector;
            for a in 0..3 {
                let mut part = right.rows_mut(a * size, size);
                part += &of_regression * regressors[a];
                for b in 0..3 {
                    let mut block = normal.view_mut((a * size, b * size), (size, size));
                    block += &about_regression * (regressors[a] * regressors[b]);
                }
            }
            covariances.push(covariance);
        }
        let factor = cholesky(normal)?;
        self.log_determinant = log_determinant - log_determinant_of_factor(factor.l_dirty());
        self.coefficients = factor.solve(&right);
        let of_coefficients = factor.inverse();
        self.condition_means.clear();
        self.condition_covariances.clear();
        self.squared_distances.clear();
        for ((covariance, vector), regressors) in covariances.iter().zip(vectors).zip(&self.regressors) {
            let design =
                DMatrix::from_fn(
                    size,
                    3 * size,
                    |i, j| if j % size == i { regressors[j / size] } else { 0.0 },
                );
            let expected = &design * &self.coefficients;
            let of_expected = &design * &of_coefficients * design.transpose();
            let towards = covariance * &precision;
            let mean = covariance * vector + &towards * &expected;
            let away = DMatrix::identity(size, size) - &towards;
            let distance = covariance + &away * &of_expected * away.transpose();
            let off = &mean - expected;
            self.squared_distances.push(off.component_mul(&off) + distance.diagonal());
            self.condition_means.push(mean);
            self.condition_covariances.push(covariance + &towards * of_expected * towards.transpose());
        }
        Some(())
    }

    /// Spreads and weights from the present expectations. Returns the largest change of the logarithm of a variance.
    fn maximise(&mut self) -> f64 {
        let prior = SPREAD_DEGREES * SPREAD_SD * SPREAD_SD;
        let variance = |sum: f64, count: usize| (prior + sum) / (SPREAD_DEGREES + count as f64);
        let mut change = 0.0f64;
        for coordinate in 0..self.trial_variance.len() {
            let trials = self.trials.iter().zip(&self.weights);
            let of_trials =
                trials.map(|(trial, weights)| weights[coordinate] * trial.squared_distance[coordinate]).sum();
            let of_conditions = self.squared_distances.iter().map(|own| own[coordinate]).sum();
            let new = variance(of_trials, self.trials.len());
            change = change.max(libm::log(new / self.trial_variance[coordinate]).abs());
            self.trial_variance[coordinate] = new;
            let new = variance(of_conditions, self.squared_distances.len());
            change = change.max(libm::log(new / self.condition_variance[coordinate]).abs());
            self.condition_variance[coordinate] = new;
        }
        for (trial, weights) in self.trials.iter().zip(&mut self.weights) {
            let relative = trial.squared_distance.component_div(&self.trial_variance);
            *weights = relative.map(|square| (DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + square));
        }
        change
    }
}

/// The posterior of a trial from those at its optima, and from mean and covariance of its condition.
fn posterior(optima: Vec<Conditional>, condition: &DVector<f64>, spread: &DMatrix<f64>) -> TrialPosterior {
    let size = condition.len();
    let means: Vec<DVector<f64>> =
        optima.iter().map(|optimum| &optimum.offset + &optimum.shrinkage * condition).collect();
    let mut mean = DVector::zeros(size);
    for (optimum, own) in optima.iter().zip(&means) {
        mean += own * optimum.probability;
    }
    let mut squared_distance = DVector::zeros(size);
    for (optimum, own) in optima.iter().zip(&means) {
        let away = DMatrix::identity(size, size) - &optimum.shrinkage;
        let distance = &optimum.covariance + &away * spread * away.transpose();
        let off = own - condition;
        squared_distance += (off.component_mul(&off) + distance.diagonal()) * optimum.probability;
    }
    let probabilities = optima.iter().map(|optimum| optimum.probability).collect();
    TrialPosterior { probabilities, means, mean, squared_distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Trials of one parameter: log value = 1 + 0.5 x + condition + trial, seen with an error of sd `error`.
    fn trials(repetitions: usize, spread: f64, error: f64, seed: u64) -> (Vec<[f64; 2]>, Vec<TrialSummary>) {
        let mut stream = Stream::new(seed, "hierarchy");
        let conditions: Vec<[f64; 2]> =
            (0..12).map(|i| [0.3 * f64::from(i % 4), 0.4 * f64::from(i / 4)]).collect();
        let mut trials = Vec::new();
        for (condition, own) in conditions.iter().enumerate() {
            for _ in 0..repetitions {
                let value = 1.0 + 0.5 * own[0] + spread * stream.normal() + error * stream.normal();
                trials.push(TrialSummary { condition, optima: vec![optimum(value, error, 0.0)] });
            }
        }
        (conditions, trials)
    }

    fn optimum(at: f64, error: f64, cost: f64) -> OptimumSummary {
        OptimumSummary {
            at: DVector::from_element(1, at),
            cost,
            gradient: DVector::zeros(1),
            information: DMatrix::from_element(1, 1, 1.0 / (error * error)),
        }
    }

    #[test]
    fn spread_and_exponent_are_found_behind_the_errors() {
        let (conditions, trials) = trials(8, 0.1, 0.05, 1);
        let found = Hierarchy::new(&conditions, &trials, None).estimate(&trials).unwrap();
        // The scale of a t distribution with 4 degrees of freedom that fits normal numbers of sd 0.1 is some 0.085.
        let scale = libm::sqrt(found.trial_variance[0]);
        assert!((0.07..0.11).contains(&scale), "{scale}");
        assert!((found.coefficients[1] - 0.5).abs() < 0.1, "{}", found.coefficients);
        assert!(found.coefficients[2].abs() < 0.1, "{}", found.coefficients);
    }

    #[test]
    fn trials_without_a_spread_share_one_value() {
        let (conditions, trials) = trials(3, 0.0, 0.2, 2);
        let found = Hierarchy::new(&conditions, &trials, None).estimate(&trials).unwrap();
        assert!(found.spread(0) < 0.06, "{}", found.spread(0));
        let se = libm::sqrt(found.condition_covariances[0][(0, 0)]);
        assert!(se < 0.1, "{se}, where each alone has 0.2");
    }

    #[test]
    fn of_two_optima_the_one_that_the_others_expect_is_probable() {
        let (conditions, mut trials) = trials(3, 0.03, 0.03, 3);
        let right = trials[5].optima[0].clone();
        // The wrong one explains the torque a little better.
        trials[5].optima.insert(0, optimum(right.at[0] + 0.7, 0.03, -0.5));
        let found = Hierarchy::new(&conditions, &trials, None).estimate(&trials).unwrap();
        assert_eq!(found.trials[5].most_probable(), 1);
        assert!(found.trials[5].probabilities[0] < 0.01, "{:?}", found.trials[5].probabilities);
    }

    #[test]
    fn of_two_places_of_the_session_the_one_that_the_ratio_prior_expects_has_more_evidence() {
        let cost = |log_ratio: f64| {
            let (conditions, mut trials) = trials(3, 0.03, 0.03, 4);
            for trial in &mut trials {
                let own = &mut trial.optima[0];
                own.at = DVector::from_vec(vec![own.at[0], own.at[0] + log_ratio]);
                own.gradient = DVector::zeros(2);
                own.information = DMatrix::from_diagonal_element(2, 2, own.information[(0, 0)]);
            }
            let prior = RatioPrior { coordinates: [1, 0], median: 0.6, log_sd: 0.5 };
            let found = Hierarchy::new(&conditions, &trials, Some(prior)).estimate(&trials).unwrap();
            found.negative_log_evidence(&trials).unwrap()
        };
        // Two standard deviations of the prior away.
        let difference = cost(libm::log(0.6) - 1.0) - cost(libm::log(0.6));
        assert!((difference - 2.0).abs() < 0.1, "{difference}");
    }

    #[test]
    fn the_ratio_of_two_parameters_that_the_data_leave_open_is_that_of_the_prior() {
        let (conditions, mut trials) = trials(3, 0.03, 0.03, 4);
        for trial in &mut trials {
            let own = &mut trial.optima[0];
            own.at = DVector::from_vec(vec![own.at[0], 9.0]);
            own.gradient = DVector::zeros(2);
            own.information = DMatrix::from_diagonal(&DVector::from_vec(vec![own.information[(0, 0)], 0.0]));
        }
        let prior = RatioPrior { coordinates: [1, 0], median: 0.6, log_sd: 0.5 };
        let found = Hierarchy::new(&conditions, &trials, Some(prior)).estimate(&trials).unwrap();
        let ratio = libm::exp(found.coefficients[1] - found.coefficients[0]);
        assert!((ratio - 0.6).abs() < 0.01, "{ratio}");
    }
}
