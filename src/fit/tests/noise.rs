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

/// The model yielded where the filtered angle passed the elastic limit: x_e was 9 of 64 mrad less, and k_dec a third.
#[test]
fn a_session_recorded_through_a_low_pass_has_the_wrist_of_one_without() {
    let session = SyntheticSession { noise_nm: 0.005, ..SyntheticSession::new(2) }.session();
    for zero_phase in [false, true] {
        let recorded = FilterSpec::Butterworth { order: 3, cutoff_hz: 50.0, zero_phase };
        let sections = recorded.sections(session.sample_rate_hz).unwrap();
        let through = |channel: &Vec<f64>| match zero_phase {
            true => signal::filter_both_ways(&sections, &sections, channel),
            false => signal::filter(&sections, channel),
        };
        let mut filtered = session.clone();
        filtered.recorded_filter = Some(recorded);
        for trial in &mut filtered.trials {
            trial.record.theta_m_rad = through(&trial.record.theta_m_rad);
            trial.record.torque_l_nm = through(&trial.record.torque_l_nm);
        }
        let fitted = |session: &Session| {
            let observations = Observations::new(session, PreprocessingSettings::default()).unwrap();
            let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
            SessionFit::new(&observations, &fit).unwrap().fit.parameters
        };
        for (own, plain) in fitted(&filtered).iter().zip(fitted(&session)) {
            for (parameter, tolerance) in [(I_J, 0.02), (K_SRS, 0.03), (X_E, 0.06)] {
                let off = relative_error(own[parameter], plain[parameter]);
                assert!(off < tolerance, "{zero_phase}: parameter {parameter}, {own:?} for {plain:?}");
            }
        }
    }
}
