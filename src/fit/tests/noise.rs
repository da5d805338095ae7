//! Where the noise is measured, and what follows when it cannot be.

use super::*;

#[test]
fn holds_of_half_a_second_tell_the_noise() {
    let observations = SyntheticSession::new(1).observations();
    assert_eq!(observations.noise_source, Some(NoiseSource::Holds));
    // 0.02 N m of white noise, of which the filter passes what lies below 50 Hz, and the level before takes part.
    let sd = observations.noise_covariances[0].last_sample_sd_nm();
    assert!((0.002..0.01).contains(&sd), "{sd} N m");
}

#[test]
fn without_holds_the_repetitions_tell_the_noise() {
    let mut synthetic = SyntheticSession::new(3);
    synthetic.hold_s = 0.045;
    let observations = synthetic.observations();
    assert_eq!(observations.noise_source, Some(NoiseSource::Repetitions));
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    assert!(
        matches!(fit.objective, Objective::LeastSquares),
        "what differs between repetitions does not weigh"
    );
    let with_holds = SyntheticSession::new(3).observations();
    let reference = Fit::new(&with_holds, &Model::paper(), Weighting::Plain);
    let median = |observations: &Observations, fit: &Fit| {
        let mut all: Vec<f64> = estimates(observations, fit).iter().filter_map(|e| e.se[3]).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let ratio = median(&observations, &fit) / median(&with_holds, &reference);
    assert!((0.5..2.0).contains(&ratio), "standard errors of k_srs {ratio} times those from holds");
}

#[test]
fn without_holds_and_repetitions_there_are_no_standard_errors_but_eq_9() {
    let mut synthetic = SyntheticSession::new(1);
    synthetic.hold_s = 0.045;
    let observations = synthetic.observations();
    assert_eq!(observations.noise_source, None);
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    for estimate in estimates(&observations, &fit) {
        assert_eq!(estimate.se, [None; 6]);
        assert!(estimate.sem.iter().all(Option::is_some));
    }
}
