//! The elimination along the arrowhead against one matrix over all unknowns.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::super::design::{Design, Point, REGRESSORS, cost};
use super::super::products::Products;
use super::super::spreads::{FreeLawPrior, Spreads};
use crate::diagnose::evidence::linearisation::LinearTrial;
use crate::random::Stream;
use crate::statistics::log_determinant_of_factor;

const OWN: usize = 2;
const COMMON: usize = 4;

/// What one session is compared on.
struct Session {
    design: Design,
    spreads: Spreads,
    point: Point,
    trials: Vec<LinearTrial>,
}

/// A session of random numbers: conditions of three trials, one, none and two. The trial that is alone tells nothing of one of its own
/// coordinates, and the last one has no residuals.
fn random_session(seed: u64) -> Session {
    let mut stream = Stream::new(seed, "dense");
    let lengths = [5, 3, 8, 6, 5, 0];
    let mut random = |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| stream.normal());
    let mut trials: Vec<LinearTrial> = lengths
        .iter()
        .map(|length| LinearTrial {
            residual: random(*length, 1).column(0).into_owned(),
            own: random(*length, OWN) * 20.0,
            common: random(*length, COMMON),
        })
        .collect();
    trials[3].own.column_mut(1).fill(0.0);
    let mut vectors = |size: usize, count: usize| -> Vec<DVector<f64>> {
        (0..count).map(|_| random(size, 1).column(0).into_owned()).collect()
    };
    let regressors = vectors(2, 4);
    let law = DMatrix::from_row_slice(2, 2, &[3.0, -1.0, -1.0, 2.0]);
    let mut common_precision = DMatrix::zeros(COMMON, COMMON);
    for (i, j, value) in [(0, 0, 4.0), (0, 3, 1.0), (3, 0, 1.0), (3, 3, 9.0)] {
        common_precision[(i, j)] = value;
    }
    let point = Point {
        own: vectors(OWN, lengths.len()),
        means: vectors(OWN, regressors.len()),
        coefficients: vectors(REGRESSORS * OWN, 1).remove(0),
        common: vectors(COMMON, 1).remove(0),
    };
    let design = Design {
        conditions: vec![vec![0, 4, 2], vec![3], vec![], vec![1, 5]],
        regressors: regressors.iter().map(|own| [1.0, own[0], own[1]]).collect(),
        own: OWN,
        common_mean: vectors(COMMON, 1).remove(0),
        common_precision,
        ratio: Some((1, 0, 0.4, 0.2)),
        law: Some(FreeLawPrior { first: 1, precision: law, log_determinant: libm::log(5.0), variance: 0.3 }),
        variance_factor: vec![1.0, 1.0, 100.0, 1.0, 1.0, 1.0],
    };
    let spreads = Spreads {
        trial: DVector::from_vec(vec![2e-3, 0.3]),
        condition: DVector::from_vec(vec![0.02, 1.4]),
        noise: 1.3,
        law: 0.6,
    };
    Session { design, spreads, point, trials }
}

/// A combination of the unknowns whose prior has the mean 0.
struct Deviation {
    /// Places of the unknowns, with their factors.
    combination: Vec<(usize, f64)>,
    variance: f64,
    /// Of which own coordinate it is.
    coordinate: usize,
    /// Factor of the variance, if it is a trial's.
    factor: Option<f64>,
}

/// All unknowns in one vector: own coordinates of trial after trial, means of the conditions, coefficients, common coordinates.
struct Dense<'a> {
    session: &'a Session,
    precision: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl<'a> Dense<'a> {
    fn new(session: &'a Session) -> Self {
        let count = Self::place_of_coefficient(session, REGRESSORS * OWN) + COMMON;
        let (precision, gradient) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let mut dense = Self { session, precision, gradient };
        let Session { design, spreads, point, trials } = session;
        for (number, trial) in trials.iter().enumerate() {
            let derivatives = dense.derivatives(number);
            dense.precision += derivatives.transpose() * &derivatives / spreads.noise;
            dense.gradient -= derivatives.transpose() * &trial.residual / spreads.noise;
        }
        for Deviation { combination, variance, .. } in dense.deviations() {
            dense.add(&combination, 1.0 / variance, 0.0);
        }
        for index in 0..REGRESSORS * OWN {
            let sd: f64 = if index < OWN { 100.0 } else { 1.0 };
            dense.add(&[(Self::place_of_coefficient(session, index), 1.0)], 1.0 / (sd * sd), 0.0);
        }
        let (above, below, mean, sd) = design.ratio.unwrap();
        let ratio = [(above, 1.0), (below, -1.0)]
            .map(|(index, sign)| (Self::place_of_coefficient(session, index), sign));
        dense.add(&ratio, 1.0 / (sd * sd), mean);
        let mut common = design.common_precision.clone();
        let law = design.law.as_ref().unwrap();
        let mut of_law = common.view_mut((law.first, law.first), law.precision.shape());
        of_law += &law.precision / spreads.law;
        let mut own = dense.precision.view_mut((count - COMMON, count - COMMON), (COMMON, COMMON));
        own += &common;
        let mut own = dense.gradient.rows_mut(count - COMMON, COMMON);
        own += common * (&point.common - &design.common_mean);
        dense
    }

    fn place_of_coefficient(session: &Session, index: usize) -> usize {
        OWN * (session.trials.len() + session.design.conditions.len()) + index
    }

    /// The same point, in one vector.
    fn point(&self) -> DVector<f64> {
        let Point { own, means, coefficients, common } = &self.session.point;
        let parts = own.iter().chain(means).chain([coefficients, common]);
        let values: Vec<f64> = parts.flat_map(|part| part.iter().copied()).collect();
        DVector::from_vec(values)
    }

    /// Adds a term `weight (combination - mean)^2 / 2`.
    fn add(&mut self, combination: &[(usize, f64)], weight: f64, mean: f64) {
        let point = self.point();
        let value: f64 = combination.iter().map(|(place, factor)| factor * point[*place]).sum();
        for (one, factor) in combination {
            self.gradient[*one] += weight * factor * (value - mean);
            for (other, by) in combination {
                self.precision[(*one, *other)] += weight * factor * by;
            }
        }
    }

    /// Derivatives of a trial's predictions.
    fn derivatives(&self, trial: usize) -> DMatrix<f64> {
        let own = &self.session.trials[trial];
        let mut all = DMatrix::zeros(own.residual.len(), self.gradient.len());
        all.columns_mut(OWN * trial, OWN).copy_from(&own.own);
        all.columns_mut(self.gradient.len() - COMMON, COMMON).copy_from(&own.common);
        all
    }

    /// Deviations of trials from their conditions and of conditions from the regression.
    fn deviations(&self) -> Vec<Deviation> {
        let Session { design, spreads, trials, .. } = self.session;
        let mut deviations = Vec::new();
        for (condition, members) in design.conditions.iter().enumerate() {
            for k in 0..OWN {
                let mean = OWN * (trials.len() + condition) + k;
                for trial in members {
                    let factor = design.variance_factor[*trial];
                    let combination = vec![(OWN * trial + k, 1.0), (mean, -1.0)];
                    let variance = spreads.trial[k] * factor;
                    deviations.push(Deviation { combination, variance, coordinate: k, factor: Some(factor) });
                }
                let mut combination = vec![(mean, 1.0)];
                for (a, regressor) in design.regressors[condition].iter().enumerate() {
                    combination.push((Self::place_of_coefficient(self.session, a * OWN + k), -regressor));
                }
                let variance = spreads.condition[k];
                deviations.push(Deviation { combination, variance, coordinate: k, factor: None });
            }
        }
        deviations
    }

    fn factor(&self) -> Cholesky<f64, Dyn> {
        self.precision.clone().cholesky().unwrap()
    }

    fn log_evidence(&self) -> f64 {
        let Session { design, spreads, point, trials } = self.session;
        let (factor, products) = (self.factor(), Products::new(trials));
        0.5 * self.gradient.dot(&factor.solve(&self.gradient))
            - cost(design, spreads, point, products.squares(), products.count())
            - 0.5 * log_determinant_of_factor(factor.l_dirty())
            + design.half_log_precision(spreads, design.log_common_precision().unwrap())
    }
}

fn assert_close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() < 1e-10 * (1.0 + expected.abs()),
        "{what}: {found} instead of {expected}"
    );
}

/// A step of the equations, in one vector.
fn in_one_vector(step: &Point) -> DVector<f64> {
    let parts = step.own.iter().chain(&step.means).chain([&step.coefficients, &step.common]);
    DVector::from_vec(parts.flat_map(|part| part.iter().copied()).collect())
}

#[test]
fn evidence_minimum_and_covariance_are_those_of_one_matrix_over_all_unknowns() {
    for seed in 1..6 {
        let session = random_session(seed);
        let Session { design, spreads, point, trials } = &session;
        let dense = Dense::new(&session);
        let quadratic = design.quadratic(spreads, point, &Products::new(trials)).unwrap();
        assert_close(quadratic.log_evidence, dense.log_evidence(), "evidence");
        let step = -dense.factor().solve(&dense.gradient);
        assert_close(quadratic.decrease, -0.5 * dense.gradient.dot(&step), "decrease");
        assert!((in_one_vector(&quadratic.step) - &step).amax() < 1e-10 * (1.0 + step.amax()));
        let first = dense.gradient.len() - COMMON;
        let covariance = dense.factor().inverse().view((first, first), (COMMON, COMMON)).into_owned();
        assert!((quadratic.common_covariance() - &covariance).amax() < 1e-10 * covariance.amax());
    }
}

#[test]
fn expected_squares_are_those_of_one_matrix_over_all_unknowns() {
    for seed in 1..6 {
        let session = random_session(seed);
        let Session { design, spreads, point, trials } = &session;
        let dense = Dense::new(&session);
        let products = Products::new(trials);
        let quadratic = design.quadratic(spreads, point, &products).unwrap();
        let found = quadratic.expected_squares(design, spreads, point, &products);
        let covariance = dense.factor().inverse();
        let step = -&covariance * &dense.gradient;
        let minimum = dense.point() + &step;
        let mut expected = [DVector::zeros(OWN), DVector::zeros(OWN)];
        for Deviation { combination, coordinate, factor, .. } in dense.deviations() {
            let mut row = DVector::zeros(minimum.len());
            combination.iter().for_each(|(place, by)| row[*place] = *by);
            let off = row.dot(&minimum);
            let square = off * off + row.dot(&(&covariance * &row));
            expected[usize::from(factor.is_none())][coordinate] += square / factor.unwrap_or(1.0);
        }
        for (found, expected) in [&found.trial, &found.condition].into_iter().zip(&expected) {
            found
                .iter()
                .zip(expected)
                .for_each(|(found, expected)| assert_close(*found, *expected, "spreads"));
        }
        let mut residual = 0.0;
        for (number, trial) in trials.iter().enumerate() {
            let derivatives = dense.derivatives(number);
            residual += (&trial.residual - &derivatives * &step).norm_squared();
            residual += (&derivatives * &covariance * derivatives.transpose()).trace();
        }
        assert_close(found.residual, residual, "residuals");
        let law = design.law.as_ref().unwrap();
        let first = minimum.len() - COMMON + law.first;
        let at = minimum.rows(first, 2);
        let of_law =
            at.dot(&(&law.precision * at)) + law.precision.dot(&covariance.view((first, first), (2, 2)));
        assert_close(found.law, of_law, "law");
    }
}

#[test]
fn a_damped_step_is_that_of_one_matrix_over_all_unknowns() {
    const DAMPING: f64 = 0.7;
    let session = random_session(7);
    let Session { design, spreads, point, trials } = &session;
    let mut dense = Dense::new(&session);
    let count = dense.gradient.len();
    (0..OWN * trials.len()).for_each(|place| dense.precision[(place, place)] += DAMPING);
    for place in 0..COMMON {
        let own = count - COMMON + place;
        dense.precision[(own, own)] += DAMPING * design.precision(spreads)[(place, place)];
    }
    let found = design.damped_step(spreads, point, &Products::new(trials), DAMPING).unwrap();
    let step = -dense.factor().solve(&dense.gradient);
    assert!((in_one_vector(&found) - &step).amax() < 1e-10 * (1.0 + step.amax()));
}

#[test]
fn a_session_without_own_coordinates_has_a_quadratic() {
    let Session { mut design, mut spreads, mut point, trials } = random_session(8);
    let none = || DVector::zeros(0);
    (design.own, design.ratio) = (0, None);
    (spreads.trial, spreads.condition) = (none(), none());
    point.own.fill(none());
    point.means.fill(none());
    point.coefficients = none();
    let alone =
        |trial: &LinearTrial| LinearTrial { own: DMatrix::zeros(trial.residual.len(), 0), ..trial.clone() };
    let products = Products::new(&trials.iter().map(alone).collect::<Vec<_>>());
    let found = design.quadratic(&spreads, &point, &products).unwrap();
    let precision = design.precision(&spreads);
    let gradient = &precision * (&point.common - &design.common_mean)
        - trials.iter().map(|own| own.common.tr_mul(&own.residual)).sum::<DVector<f64>>() / spreads.noise;
    let normal = precision
        + trials.iter().map(|own| own.common.tr_mul(&own.common)).sum::<DMatrix<f64>>() / spreads.noise;
    let step = -normal.cholesky().unwrap().solve(&gradient);
    assert!((&found.step.common - &step).amax() < 1e-12 * (1.0 + step.amax()));
    assert!(found.expected_squares(&design, &spreads, &point, &products).residual > 0.0);
}
