//! Intervals: what a profile's ends cost, and what a bootstrap scatters by.

use super::*;

fn fitted() -> (Observations, Fit) {
    let observations = SyntheticSession::new(1).observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    (observations, fit)
}

#[test]
fn at_the_ends_of_a_profile_the_whole_fit_has_lost_what_95_percent_of_noise_can_make() {
    let (observations, fit) = fitted();
    let least = fit.cost();
    let profiles = profiles(&observations, &fit);
    let mut looked_at = 0;
    for trial in [0, 5, 11] {
        for (place, parameter) in PROFILED_PARAMETERS.into_iter().enumerate() {
            let interval = profiles[trial][place].expect("each trial has its own");
            let value = fit.parameters[trial][parameter];
            for end in [interval.low, interval.high].into_iter().flatten() {
                // All trials refitted with this one held there: no part of the profile's own shortcut.
                let Transform::Logarithmic { coordinate, factor } =
                    fit.parameterisation.transforms[trial][parameter]
                else {
                    panic!("a trial's own")
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
                let fall = 2.0 * (held.cost() - least);
                assert!((3.5..4.2).contains(&fall), "trial {trial}: {value} to {end} costs {fall}");
                looked_at += 1;
            }
            assert!(
                interval.low.is_none_or(|low| low < value) && interval.high.is_none_or(|high| high > value)
            );
        }
    }
    assert!(looked_at >= 6, "only {looked_at} ends are closed");
}

#[test]
fn a_plain_fit_has_no_profile_since_nothing_says_what_a_loss_is_worth() {
    let observations = SyntheticSession::new(1).observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::Plain);
    assert!(profiles(&observations, &fit).iter().all(|own| own.iter().all(Option::is_none)));
}

#[test]
fn a_bootstrap_scatters_as_the_standard_errors_say() {
    let (observations, fit) = fitted();
    let scatter = bootstrap(&observations, &fit, 200, 1);
    let estimates = estimates(&observations, &fit);
    for parameter in [0, 1, 2, 3] {
        let mut ratios: Vec<f64> = estimates
            .iter()
            .zip(&scatter)
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
fn a_bootstrap_is_the_same_whatever_the_number_of_threads() {
    let (observations, fit) = fitted();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bootstrap(&observations, &fit, 6, 7))
    };
    assert_eq!(with(1), with(3));
}
