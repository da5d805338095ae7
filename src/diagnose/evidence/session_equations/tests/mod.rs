mod dense;

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::diagnose::evidence::linearisation::LinearTrial;
use crate::fit::{EXPONENT_SD, LEVEL_SD};
use crate::random::Stream;
use crate::statistics::log_determinant_of_factor;

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
    };
    let mut random = |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| stream.normal());
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
    -0.5 * (residual.dot(&factor.solve(&residual)) + log_determinant_of_factor(factor.l_dirty()))
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
        let expected = log_density(&design, &trials, &spreads) - spreads.negative_log_prior(None);
        assert!((found - expected).abs() < 1e-6, "{found} instead of {expected}");
    }
}

#[test]
fn the_evidence_of_a_linear_session_does_not_depend_on_the_point_it_is_taken_about() {
    let mut stream = Stream::new(2, "evidence");
    let (design, trials, point) = session(&mut stream);
    let spreads = Spreads::start(1, 1.0);
    let here = design.quadratic(&spreads, &point, &Products::new(&trials)).unwrap();
    let there = point.moved(&here.step, 0.7);
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
        spreads = quadratic.expected_squares(&design, &spreads, &point, &products).spreads(None, &spreads).0;
    }
}

#[test]
fn one_more_column_adds_what_a_session_with_one_more_common_coordinate_has() {
    let (design, trials, point) = session(&mut Stream::new(4, "evidence"));
    let change: Vec<DVector<f64>> =
        (0..3).map(|trial| DVector::from_fn(VALUES, |i, _| (trial + i) as f64 - 2.0)).collect();
    let mut wide = trials.clone();
    for (own, column) in wide.iter_mut().zip(&change) {
        own.common = own.common.clone().resize_horizontally(3, 0.0);
        own.common.set_column(2, column);
    }
    let sd = 0.5;
    let mut wide_design = design.clone();
    wide_design.common_mean = design.common_mean.push(0.0);
    wide_design.common_precision = design.common_precision.clone().resize(3, 3, 0.0);
    wide_design.common_precision[(2, 2)] = 1.0 / (sd * sd);
    let mut wide_point = point.clone();
    wide_point.common = point.common.push(0.0);
    let spreads = Spreads { noise: 1.3, ..Spreads::start(1, 1.0) };
    let narrow = design.quadratic(&spreads, &point, &Products::new(&trials)).unwrap();
    let added = narrow.with_column(&design, &trials, spreads.noise, &change, sd);
    let all = wide_design.quadratic(&spreads, &wide_point, &Products::new(&wide)).unwrap();
    assert!((narrow.log_evidence + added.log_evidence - all.log_evidence).abs() < 1e-9);
    assert!((added.value - all.step.common[2]).abs() < 1e-9);
}
