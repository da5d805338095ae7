//! Tests of intervals: the cost at the ends of a profile, and the spread of a bootstrap.

use super::*;

fn fitted() -> (Observations, Fit) {
    let observations = SyntheticSession::new(1).observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    (observations, fit)
}

#[test]
fn at_the_ends_of_a_profile_the_cost_of_the_whole_fit_has_risen_by_the_95_percent_quantile() {
    let (observations, fit) = fitted();
    let least = fit.cost();
    let profiles = profiles(&observations, &fit);
    let mut closed_ends = 0;
    for trial in [0, 5, 11] {
        for (place, parameter) in PROFILED_PARAMETERS.into_iter().enumerate() {
            let interval = profiles[trial][place].expect("every trial has its own k_dec and x_e");
            let value = fit.parameters[trial][parameter];
            for end in [interval.low, interval.high].into_iter().flatten() {
                // A refit of all trials with this parameter held, without the approximation by a block subproblem.
                let Transform::Logarithmic { coordinate, factor } =
                    fit.parameterisation.transforms[trial][parameter]
                else {
                    panic!("a parameter of a single trial")
                };
                let mut parameterisation = fit.parameterisation.clone();
                let place = libm::log(end / factor);
                (
                    parameterisation.coordinates[coordinate].low,
                    parameterisation.coordinates[coordinate].high,
                ) = (place, place);
                let mut start = fit.solution.coordinates.clone();
                start[coordinate] = place;
                let held = solve(
                    &observations,
                    &parameterisation,
                    &fit.kinds,
                    &fit.objective,
                    &start,
                    SolverOptions::default(),
                );
                let increase = 2.0 * (held.cost() - least);
                assert!((3.5..4.2).contains(&increase), "trial {trial}: {value} to {end} costs {increase}");
                closed_ends += 1;
            }
            assert!(
                interval.low.is_none_or(|low| low < value) && interval.high.is_none_or(|high| high > value)
            );
        }
    }
    assert!(closed_ends >= 6, "only {closed_ends} ends are closed");
}

#[test]
fn an_unweighted_fit_has_no_profile_intervals() {
    let observations = SyntheticSession::new(1).observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::Plain);
    assert!(profiles(&observations, &fit).iter().all(|own| own.iter().all(Option::is_none)));
}

#[test]
fn the_spread_of_a_bootstrap_agrees_with_the_standard_errors() {
    let (observations, fit) = fitted();
    let spread = bootstrap(&observations, &fit, 200, 1);
    let estimates = estimates(&observations, &fit);
    for parameter in [0, 1, 2, 3] {
        let mut ratios: Vec<f64> = estimates
            .iter()
            .zip(&spread)
            .filter_map(|(own, found)| {
                Some(found.sd[parameter]? / (own.se[parameter]? * own.values[parameter]))
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        let median = ratios[ratios.len() / 2];
        assert!((0.75..1.35).contains(&median), "{}: {median}", BOOTSTRAPPED_QUANTITIES[parameter]);
    }
}

#[test]
fn a_bootstrap_does_not_depend_on_the_number_of_threads() {
    let (observations, fit) = fitted();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bootstrap(&observations, &fit, 6, 7))
    };
    assert_eq!(with(1), with(3));
}
