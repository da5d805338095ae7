//! Comparison with printed results of published data; `tests/study` compares the tables with statsmodels and pingouin.

use super::*;

/// Reaction times of Maxwell and Delaney (1990): noise absent or present, stimulus tilted by 0, 4 or 8 degrees.
const REACTION_TIMES_MS: [[f64; 6]; 10] = [
    [420.0, 420.0, 480.0, 480.0, 600.0, 780.0],
    [420.0, 480.0, 480.0, 360.0, 480.0, 600.0],
    [480.0, 480.0, 540.0, 660.0, 780.0, 780.0],
    [420.0, 540.0, 540.0, 480.0, 780.0, 900.0],
    [540.0, 660.0, 540.0, 480.0, 660.0, 720.0],
    [360.0, 420.0, 360.0, 360.0, 480.0, 540.0],
    [480.0, 480.0, 600.0, 540.0, 720.0, 840.0],
    [480.0, 600.0, 660.0, 540.0, 720.0, 900.0],
    [540.0, 600.0, 540.0, 480.0, 720.0, 780.0],
    [480.0, 420.0, 540.0, 540.0, 660.0, 780.0],
];

fn reaction_times() -> MeanCovariance {
    MeanCovariance::of(6, REACTION_TIMES_MS.iter().map(|subject| subject.as_slice()))
}

#[track_caller]
fn assert_near(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{found}, expected {expected}");
}

#[test]
fn the_reaction_times_of_maxwell_and_delaney_give_their_table() {
    let effects = anova(&reaction_times(), FactorLevels { first: 2, second: 3 }).unwrap();
    let [noise, angle, both] = effects.as_slice() else { panic!("three effects: {effects:?}") };
    for (effect, f, df, p_gg, generalised) in [
        (noise, 33.765957, [1.0, 9.0], 2.559737e-4, 0.386602),
        (angle, 40.719101, [2.0, 18.0], 3.401705e-7, 0.390118),
        (both, 45.310345, [2.0, 18.0], 3.453931e-7, 0.188266),
    ] {
        assert_near(effect.f, f, 1e-7);
        assert_eq!(effect.df, df);
        assert_near(effect.p_gg, p_gg, 1e-6);
        assert_near(effect.generalised_eta_squared, generalised, 1e-5);
    }
    assert_near(noise.p, 2.559737e-4, 1e-6);
    assert_near(angle.p, 2.086763e-7, 1e-6);
    assert_near(angle.epsilon_gg, 0.961637, 1e-6);
    assert_near(both.epsilon_gg, 0.903977, 1e-6);
    // Huynh and Feldt's corrections of both lie above 1 and are cut there.
    assert_eq!((angle.epsilon_hf, both.epsilon_hf), (1.0, 1.0));
    assert!(noise.mauchly.is_none(), "two levels are always spherical");
    let (of_angle, of_both) = (angle.mauchly.unwrap(), both.mauchly.unwrap());
    assert_near(of_angle.w, 0.960106, 1e-6);
    assert_near(of_angle.p, 0.849722, 1e-5);
    assert_near(of_both.w, 0.893777, 1e-6);
    assert_near(of_both.p, 0.638142, 1e-5);
    assert_near(angle.partial_eta_squared, 289_920.0 / (289_920.0 + angle.ss_error), 1e-12);
}

#[test]
fn a_factor_with_one_level_has_no_line() {
    let six = anova(&reaction_times(), FactorLevels { first: 1, second: 6 }).unwrap();
    assert_eq!(six.len(), 1);
    assert_eq!(six[0].factors, [false, true]);
}

#[test]
fn a_quantity_equal_in_all_cells_but_for_rounding_has_no_effects() {
    let subjects: [[f64; 4]; 3] =
        [0.1, 0.2, 0.7].map(|own| [own, own * (1.0 + 3e-16), (own * 3.0) / 3.0, own]);
    let moments = MeanCovariance::of(4, subjects.iter().map(|subject| subject.as_slice()));
    assert_eq!(anova(&moments, FactorLevels { first: 2, second: 2 }), Some(Vec::new()));
    // Such a slope once had t = 28 and p = 1.8e-8.
    assert!(moments.contrast(&[-0.5, -0.5, 0.5, 0.5]).is_none());
    assert!(moments.contrast(&[0.25; 4]).is_some());
}

#[test]
fn one_subject_has_no_analysis_of_variance() {
    let one = MeanCovariance::of(6, [REACTION_TIMES_MS[0].as_slice()]);
    assert!(anova(&one, FactorLevels { first: 2, second: 3 }).is_none());
    assert!(one.contrast(&[1.0, 0.0, 0.0, 0.0, 0.0, -1.0]).is_none());
}

#[test]
fn with_fewer_subjects_than_contrasts_there_is_no_test_of_sphericity() {
    let few = MeanCovariance::of(6, REACTION_TIMES_MS[..3].iter().map(|subject| subject.as_slice()));
    let effects = anova(&few, FactorLevels { first: 1, second: 6 }).unwrap();
    assert!(effects[0].mauchly.is_none());
    assert!(effects[0].p_gg.is_finite() && effects[0].epsilon_hf <= 1.0);
}

#[test]
fn moments_do_not_depend_on_an_offset() {
    let shifted: Vec<[f64; 6]> =
        REACTION_TIMES_MS.iter().map(|subject| subject.map(|value| value + 1e9)).collect();
    let shifted = MeanCovariance::of(6, shifted.iter().map(|subject| subject.as_slice()));
    let own = reaction_times().covariance().unwrap();
    let difference = (shifted.covariance().unwrap() - &own).norm();
    assert!(difference < 1e-5 * own.norm(), "{difference}");
}

#[test]
fn the_judges_of_shrout_and_fleiss_have_their_published_reliability() {
    // Six targets, four judges (Shrout and Fleiss 1979, table 2): ICC(2,1) = 0.29, ICC(3,1) = 0.71.
    let ratings: [[f64; 4]; 6] = [
        [9.0, 2.0, 5.0, 8.0],
        [6.0, 1.0, 3.0, 2.0],
        [8.0, 4.0, 6.0, 8.0],
        [7.0, 1.0, 2.0, 6.0],
        [10.0, 5.0, 6.0, 9.0],
        [6.0, 2.0, 4.0, 7.0],
    ];
    let moments = MeanCovariance::of(4, ratings.iter().map(|target| target.as_slice()));
    let found = reliability(&moments).unwrap();
    assert_near(found.icc_agreement, 0.28976, 1e-4);
    assert_near(found.icc_consistency, 0.71484, 1e-4);
    assert_near(found.sem * found.sem, 1.01944, 1e-5);
    assert_near(found.smallest_detectable_change, 1.96 * 2f64.sqrt() * 1.01944f64.sqrt(), 1e-5);
    assert_near(found.f, 11.02725, 1e-5);
}

#[test]
fn holms_p_values_step_down_and_keep_their_order() {
    let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
    for (found, expected) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
        assert_near(*found, expected, 1e-12);
    }
    assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
    assert!(holm(&[]).is_empty());
}

#[test]
fn students_sleep_data_gives_his_t() {
    // Student 1908: extra sleep with two drugs; paired t = -4.0621, p = 0.002833; Welch t = -1.8608, df = 17.776, p = 0.07939.
    let first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
    let second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
    let pairs: Vec<[f64; 2]> = first.iter().zip(second).map(|(a, b)| [*a, b]).collect();
    let paired =
        MeanCovariance::of(2, pairs.iter().map(|pair| pair.as_slice())).contrast(&[1.0, -1.0]).unwrap();
    assert_near(paired.t(), -4.0621, 1e-4);
    assert_near(paired.p(), 0.002833, 1e-3);
    let (low, high) = paired.interval();
    assert_near(low, -2.4598858, 1e-6);
    assert_near(high, -0.7001142, 1e-6);
    let apart = welch(&first.into_iter().collect(), &second.into_iter().collect()).unwrap();
    assert_near(apart.t(), -1.8608, 1e-4);
    assert_near(apart.df, 17.776, 1e-4);
    assert_near(apart.p(), 0.07939, 1e-3);
    let differences: MeanVariance = pairs.iter().map(|[a, b]| a - b).collect();
    assert_near(differences.contrast().unwrap().t(), paired.t(), 1e-12);
}

#[test]
fn tails_are_those_of_the_tables_and_stay_exact_far_out() {
    assert_near(f_tail(4.964_603, [1.0, 10.0]), 0.05, 1e-6);
    assert_near(t_quantile(0.975, 7.0), 2.364_624_25, 1e-8);
    assert_near(chi_square_tail(3.841_459, 1.0), 0.05, 1e-6);
    // F(1, 2): P(F > f) = 1 - sqrt(f / (f + 2)), here about 1 / f.
    assert_near(f_tail(1e18, [1.0, 2.0]), 1e-18, 1e-6);
    assert!(f_tail(f64::NAN, [1.0, 2.0]).is_nan());
    let (low, high) = wilson(8, 10);
    assert_near(low, 0.490_162, 1e-5);
    assert_near(high, 0.943_318, 1e-5);
}

#[test]
fn rank_correlation_is_one_minus_one_tied_or_undefined() {
    assert_eq!(rank_correlation(&[1.0, 2.0, 5.0], &[0.1, 10.0, 11.0]), Some(1.0));
    assert_eq!(rank_correlation(&[1.0, 2.0, 5.0], &[3.0, 2.0, 1.0]), Some(-1.0));
    assert_eq!(rank_correlation(&[2.0, 2.0, 2.0], &[3.0, 2.0, 1.0]), None);
    let tied = rank_correlation(&[1.0, 1.0, 2.0], &[1.0, 2.0, 3.0]).unwrap();
    assert!((tied - 0.866).abs() < 1e-3, "{tied}");
}

#[test]
fn weighted_regression_ignores_an_observation_without_weight() {
    let mut equations = WeightedRegression::<2>::new(0.0);
    for (x, weight) in [(0.0, 1.0), (1.0, 2.0), (3.0, 0.5)] {
        equations.add(&nalgebra::Vector2::new(1.0, x), weight, 4.0 - 2.0 * x);
    }
    equations.add(&nalgebra::Vector2::new(1.0, 2.0), 0.0, 100.0);
    let found = equations.solve().unwrap();
    assert_near(found[0], 4.0, 1e-12);
    assert_near(found[1], -2.0, 1e-12);
    // Sum of weights 3.5, of weighted x 3.5, of weighted squares 6.5: variance of the slope 3.5 / (3.5 x 6.5 - 3.5^2).
    assert_near(equations.inverse().unwrap()[(1, 1)], 3.5 / 10.5, 1e-12);
    assert_eq!(WeightedRegression::<2>::new(0.0).solve(), None);
}

#[test]
fn slope_through_origin_is_that_of_a_line() {
    assert_eq!(slope_through_origin([(1.0, 2.0), (-2.0, -4.0)]), 2.0);
    assert!(slope_through_origin([(0.0, 1.0)]).is_nan());
}
