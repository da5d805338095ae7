//! Tests of the noise estimate: its source, and a fit without any estimate.

use super::*;

#[test]
fn noise_is_estimated_from_holds_of_half_a_second() {
    let observations = SyntheticSession::new(1).observations();
    assert_eq!(observations.noise_source, Some(NoiseSource::Holds));
    // White noise of 0.02 N m, of which the filter passes the part below 50 Hz; the mean before the ramp adds its own noise.
    let sd = observations.noise_covariances[0].last_sample_sd_nm();
    assert!((0.002..0.01).contains(&sd), "{sd} N m");
}

#[test]
fn without_holds_noise_is_estimated_from_repetitions() {
    let mut synthetic = SyntheticSession::new(3);
    synthetic.hold_s = 0.045;
    let observations = synthetic.observations();
    assert_eq!(observations.noise_source, Some(NoiseSource::Repetitions));
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    assert!(
        matches!(fit.objective, Objective::LeastSquares),
        "differences between repetitions must not weight residuals"
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
fn without_holds_and_repetitions_only_eq_9_gives_standard_errors() {
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
