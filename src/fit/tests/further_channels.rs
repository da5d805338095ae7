//! Tests of fits to sessions with further channels.

use super::*;
use FurtherChannel::{HandTorque, HandleAcceleration, HandleAngle, JointAngle};

fn synthetic(seed: u64, further: &[FurtherChannel]) -> SyntheticSession {
    SyntheticSession { seed, further: further.to_vec(), trembles: true, ..SyntheticSession::new(3) }
}

fn fitted(synthetic: &SyntheticSession, weighting: Weighting) -> (Observations, Fit) {
    let observations = synthetic.observations();
    let fit = Fit::new(&observations, &Model::paper(), weighting);
    (observations, fit)
}

/// Relative standard errors of one trial.
fn relative_se(observations: &Observations, fit: &Fit, trial: usize) -> [Option<f64>; 6] {
    uncertainties(observations, fit, &predictions(observations, fit))[trial].se
}

#[test]
fn a_trial_has_the_samples_of_every_channel_in_torques_of_the_same_noise() {
    let observations = synthetic(1, &[HandleAngle, HandTorque]).observations();
    let samples = observations.samples;
    assert_eq!(observations.rows(), 3 * samples);
    assert!((observations.further_step[0] - 3.14e-4).abs() < 1e-9 && observations.further_step[1] == 0.0);
    let noise = observations.noise_samples().count() / 3;
    for trial in &observations.trials {
        assert_eq!(trial.measured_nm.len(), 3 * samples);
    }
    // The load cell has the noise of the gauge, so its scale is about one; a quantised angle shows less in the hold than in motion.
    let scale = observations.further[1].nm_per_unit;
    assert!((0.8..1.25).contains(&scale), "{scale}");
    let covariance = &observations.noise_covariances[0].covariance;
    let sd = |channel: usize| covariance[((channel + 1) * noise - 1, (channel + 1) * noise - 1)].sqrt();
    assert!(sd(2) / sd(0) > 0.7 && sd(2) / sd(0) < 1.4, "{} and {} N m", sd(2), sd(0));
    // The tremor is in both.
    let shared = covariance[(noise - 1, 3 * noise - 1)] / (sd(0) * sd(2));
    assert!((0.3..1.0).contains(&shared), "correlation {shared}");
}

#[test]
fn a_session_whose_further_channels_are_removed_fits_like_one_that_never_had_them() {
    let without = SyntheticSession { trembles: true, ..SyntheticSession::new(1) }.session();
    let mut stripped =
        SyntheticSession { trembles: true, further: vec![HandleAngle], ..SyntheticSession::new(1) }.session();
    stripped.trials.iter_mut().for_each(|trial| trial.record.theta_l_rad = None);
    let fit = |session: &Session| {
        let observations = Observations::new(session, PreprocessingSettings::default()).unwrap();
        Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise).parameters
    };
    assert_eq!(without.digest(), stripped.digest());
    assert!(fit(&without) == fit(&stripped));
}

#[test]
fn standard_errors_do_not_grow_when_a_sensor_is_added() {
    let (without, fit) = fitted(&synthetic(2, &[]), Weighting::MeasuredNoise);
    let trials = without.trials.len();
    let median_of = |own: &[[Option<f64>; 6]], parameter: usize| {
        upper_median(own.iter().filter_map(|se| se[parameter])).unwrap()
    };
    let all = |observations: &Observations, fit: &Fit| -> Vec<[Option<f64>; 6]> {
        (0..trials).map(|trial| relative_se(observations, fit, trial)).collect()
    };
    let alone = all(&without, &fit);
    for sensor in FurtherChannel::ALL {
        let (with, fit) = fitted(&synthetic(2, &[sensor]), Weighting::MeasuredNoise);
        let with = all(&with, &fit);
        for parameter in 0..6 {
            let (before, after) = (median_of(&alone, parameter), median_of(&with, parameter));
            // The optimum moves, and a standard error with it.
            assert!(after <= 1.01 * before, "{sensor:?}, parameter {parameter}: {before} becomes {after}");
        }
    }
}

/// Fractions of 288 trials whose parameters lie within two standard errors of the truth. The inertia and the interface are one for a
/// session, so that there are eight values of them.
#[test]
fn standard_errors_with_further_channels_are_those_of_repeated_sessions() {
    for sensors in [vec![HandleAngle], vec![HandTorque], vec![HandleAcceleration, JointAngle]] {
        let mut squares: [Vec<f64>; 6] = Default::default();
        for seed in 0..8 {
            let (observations, fit) = fitted(&synthetic(100 + seed, &sensors), Weighting::MeasuredNoise);
            for (index, trial) in observations.trials.iter().enumerate() {
                let truth = truth(trial.velocity_rad_s, trial.torque_nm);
                let se = relative_se(&observations, &fit, index);
                for (parameter, se) in se.into_iter().enumerate() {
                    let Some(se) = se else { continue };
                    let value = fit.parameters[index][parameter];
                    squares[parameter].push(((value - truth[parameter]) / (se * value)).powi(2));
                }
            }
        }
        for (parameter, squares) in squares.iter().enumerate() {
            let within =
                squares.iter().filter(|square| **square < 3.84).count() as f64 / squares.len() as f64;
            let least = if parameter < 3 { 0.6 } else { 0.88 };
            assert!(
                squares.len() > 270 && within >= least,
                "{sensors:?}, parameter {parameter}: {within} of {} within two standard errors",
                squares.len()
            );
        }
    }
}

#[test]
fn the_variance_accounted_for_is_that_of_the_torque() {
    let (observations, fit) = fitted(&synthetic(3, &[HandleAcceleration]), Weighting::MeasuredNoise);
    for (estimate, own) in
        estimates_without_profiles(&observations, &fit).iter().zip(predictions(&observations, &fit))
    {
        let place = observations.trials.iter().position(|trial| trial.number == estimate.trial).unwrap();
        let measured = &observations.trials[place].measured_nm[..observations.samples];
        let residual = measured.iter().zip(&own.torque_nm).map(|(m, p)| m - p);
        let vaf = 1.0 - residual.map(|e| e * e).sum::<f64>() / measured.iter().map(|m| m * m).sum::<f64>();
        assert!((estimate.vaf - vaf).abs() < 1e-12 && vaf > 0.99, "{vaf}");
    }
}
