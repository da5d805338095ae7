//! The model of a session: trials that know better than one alone, trials that are really different, and sessions without a model.

use super::*;

/// A wrist twice as stiff.
fn stiffer(velocity_rad_s: f64, torque_nm: f64) -> [f64; 6] {
    let mut truth = truth(velocity_rad_s, torque_nm);
    truth[K_SRS] *= 2.2;
    truth[K_DEC] *= 2.2;
    truth
}

/// A session in which the trials chosen by `is_other` are those of another wrist.
fn with_other_wrist(other: fn(f64, f64) -> [f64; 6], is_other: impl Fn(usize) -> bool) -> Observations {
    let own = SyntheticSession::new(3);
    let mut session = own.session();
    let others = SyntheticSession { truth: other, ..own }.session();
    for (index, (trial, other)) in session.trials.iter_mut().zip(others.trials).enumerate() {
        if is_other(index) {
            trial.record = other.record;
        }
    }
    Observations::new(&session, PreprocessingSettings::default()).unwrap()
}

fn independent(observations: &Observations) -> Fit {
    Fit::new(observations, &Model::paper(), Weighting::MeasuredNoise)
}

fn refusal(observations: &Observations, weighting: Weighting) -> NoSessionModel {
    SessionFit::new(observations, &Fit::new(observations, &Model::paper(), weighting)).unwrap_err()
}

#[test]
fn trials_that_alone_take_a_wrong_optimum_take_the_right_one_together() {
    let (mut alone, mut together) = (0, 0);
    for seed in 1..=4 {
        let observations =
            SyntheticSession { noise_nm: 0.06, seed, ..SyntheticSession::new(3) }.observations();
        let fit = independent(&observations);
        let session = SessionFit::new(&observations, &fit).unwrap();
        let is_off = |fit: &Fit, trial: usize| {
            let own = &observations.trials[trial];
            relative_error(fit.parameters[trial][X_E], truth(own.velocity_rad_s, own.torque_nm)[X_E]) > 0.4
        };
        alone += (0..observations.trials.len()).filter(|trial| is_off(&fit, *trial)).count();
        together += (0..observations.trials.len()).filter(|trial| is_off(&session.fit, *trial)).count();
    }
    assert!(alone > 0, "the noise is too small for the test to show anything");
    assert_eq!(together, 0, "{alone} alone");
}

#[test]
fn a_window_that_ends_before_the_yield_leaves_a_fit_that_describes_the_trials_or_none() {
    for (seed, window_s) in [(1, 0.03), (1, 0.025), (2, 0.02), (3, 0.015)] {
        let session = SyntheticSession { seed, ..SyntheticSession::new(2) }.session();
        let settings = PreprocessingSettings { window_s, ..PreprocessingSettings::default() };
        let observations = Observations::new(&session, settings).unwrap();
        let alone = independent(&observations);
        let together = match SessionFit::new(&observations, &alone) {
            Ok(session) => session.fit,
            Err(reason) => {
                assert_eq!(reason, NoSessionModel::LeavesMore);
                continue;
            }
        };
        let squares = |fit: &Fit| -> f64 {
            let trials = predictions(&observations, fit).into_iter().enumerate();
            let whiten = |(trial, own): (usize, Prediction)| {
                fit.objective.whiten(observations.noise_index[trial], &own.residual_nm).norm_squared()
            };
            trials.map(whiten).sum()
        };
        // The trials' own optima fit the noise with six parameters each, of more than 35 values.
        let [alone, together] = [&alone, &together].map(squares);
        assert!(together < 2.0 * alone, "{together} beside {alone}, window of {window_s} s");
    }
}

#[test]
fn intervals_of_trials_and_condition_means_hold_the_truth() {
    let (mut trials, mut means, mut count) = (0, 0, 0);
    for seed in 11..=34 {
        let observations =
            SyntheticSession { noise_nm: 0.06, seed, ..SyntheticSession::new(3) }.observations();
        let session = SessionFit::new(&observations, &independent(&observations)).unwrap();
        let (estimates, conditions) = session_estimates(&observations, &session);
        let holds = |value: f64, se: f64, truth: f64| libm::log(value / truth).abs() < 1.96 * se;
        for estimate in &estimates {
            let expected = truth(estimate.velocity_rad_s, estimate.torque_nm)[K_SRS];
            trials += usize::from(holds(estimate.values[K_SRS], estimate.se[K_SRS].unwrap(), expected));
            count += 1;
        }
        for condition in &conditions {
            let expected = truth(condition.velocity_rad_s, condition.torque_nm)[K_SRS];
            means +=
                usize::from(holds(condition.mean[K_SRS].unwrap(), condition.se[K_SRS].unwrap(), expected));
        }
    }
    // Trials of a session share their errors: 24 sessions say little more than 24 independent numbers of each parameter would.
    assert!(trials * 100 >= count * 88 && means * 300 >= count * 85, "{trials} of {count}, {means} means");
}

#[test]
fn a_trial_that_is_really_different_stays_so() {
    let observations = with_other_wrist(stiffer, |index| index == 7);
    let session = SessionFit::new(&observations, &independent(&observations)).unwrap();
    let number = 8;
    for (trial, own) in observations.trials.iter().enumerate() {
        let expected = if own.number == number { stiffer } else { truth };
        let expected = expected(own.velocity_rad_s, own.torque_nm)[K_SRS];
        let found = session.fit.parameters[trial][K_SRS];
        assert!(relative_error(found, expected) < 0.08, "trial {}: {found} for {expected}", own.number);
    }
}

#[test]
fn trials_of_two_persons_are_no_session() {
    let observations = with_other_wrist(stiffer, |index| index % 2 == 0);
    let reason = refusal(&observations, Weighting::MeasuredNoise);
    assert!(
        matches!(reason, NoSessionModel::SpreadBeyondPerson { .. } | NoSessionModel::TwoGroups { .. }),
        "{reason}"
    );
    assert!(reason.to_string().contains("persons"), "{reason}");
}

/// A wrist that is stiffer by 15 %.
fn somewhat_stiffer(velocity_rad_s: f64, torque_nm: f64) -> [f64; 6] {
    let mut truth = truth(velocity_rad_s, torque_nm);
    truth[K_SRS] *= 1.15;
    truth[K_DEC] *= 1.15;
    truth
}

#[test]
fn the_last_third_of_a_second_person_who_is_fifteen_percent_stiffer_is_noticed() {
    let observations = with_other_wrist(somewhat_stiffer, |index| index >= 24);
    let reason = refusal(&observations, Weighting::MeasuredNoise);
    let NoSessionModel::TwoGroups { smaller, trials, difference, .. } = reason else { panic!("{reason}") };
    assert_eq!((smaller, trials), ((25..=36).collect(), 36));
    assert!((0.1..0.2).contains(&difference), "{difference}");
    let one = with_other_wrist(truth, |_| false);
    assert!(SessionFit::new(&one, &independent(&one)).is_ok());
}

#[test]
fn a_session_of_two_conditions_that_is_wrong_as_a_whole_says_where_else_it_may_be() {
    let (mut wrong, mut unmarked) = (0, 0);
    for seed in 1..=20 {
        let whole = SyntheticSession { noise_nm: 0.06, seed, ..SyntheticSession::new(3) }.observations();
        let slow: Vec<usize> = (0..whole.trials.len())
            .filter(|trial| {
                whole.trials[*trial].velocity_rad_s < 1.5 && whole.trials[*trial].torque_nm != 1.5
            })
            .collect();
        let observations = whole.subset(&slow);
        let Ok(session) = SessionFit::new(&observations, &independent(&observations)) else { continue };
        for (estimate, trial) in session_estimates(&observations, &session).0.iter().zip(&observations.trials)
        {
            let expected = truth(trial.velocity_rad_s, trial.torque_nm)[X_E];
            if relative_error(estimate.values[X_E], expected) > 0.4 {
                wrong += 1;
                unmarked += usize::from(estimate.other_optima.is_empty());
            }
        }
    }
    assert!(wrong > 0, "the noise is too small for the test to show anything");
    assert!(10 * unmarked <= wrong, "{unmarked} of {wrong}");
}

#[test]
fn a_session_without_repetitions_or_conditions_or_noise_has_no_model() {
    let once = SyntheticSession::new(1).observations();
    assert_eq!(refusal(&once, Weighting::MeasuredNoise), NoSessionModel::NoRepetitions);
    let several = SyntheticSession::new(3).observations();
    let one_condition: Vec<usize> =
        (0..several.trials.len()).filter(|trial| several.trials[*trial].condition == 4).collect();
    assert_eq!(
        refusal(&several.subset(&one_condition), Weighting::MeasuredNoise),
        NoSessionModel::OneCondition
    );
    assert_eq!(refusal(&several.subset(&[5]), Weighting::MeasuredNoise), NoSessionModel::OneCondition);
    assert_eq!(refusal(&several, Weighting::Plain), NoSessionModel::UnknownNoise);
}

#[test]
fn a_model_without_parameters_of_single_trials_has_no_session_model() {
    let observations = SyntheticSession::new(2).observations();
    let mut model = Model::paper();
    model.base[X_E].scope = Scope::Condition;
    let fit = Fit::new(&observations, &model, Weighting::MeasuredNoise);
    assert_eq!(SessionFit::new(&observations, &fit).unwrap_err(), NoSessionModel::OtherModel);
}

#[test]
fn an_encoder_so_coarse_that_it_biases_the_fit_is_told() {
    let mut session = SyntheticSession::new(3).session();
    let step = std::f64::consts::TAU / 8192.0;
    for (index, trial) in session.trials.iter_mut().enumerate() {
        let rest = step * (index as f64 * 0.618).fract();
        for theta in &mut trial.record.theta_m_rad {
            *theta = step * libm::round((*theta + rest) / step);
        }
    }
    let observations = Observations::new(&session, PreprocessingSettings::default()).unwrap();
    let reason = refusal(&observations, Weighting::MeasuredNoise);
    assert!(matches!(reason, NoSessionModel::CoarseAngle { .. }), "{reason}");
}

#[test]
fn values_at_a_bound_are_not_averaged() {
    let observations = SyntheticSession::new(2).observations();
    let fit = independent(&observations);
    let mut estimates = estimates_without_profiles(&observations, &fit);
    let own = estimates[0].values[X_E];
    estimates[1].determined[X_E] = false;
    assert_eq!(by_condition(&estimates)[0].mean[X_E], Some(own));
    estimates[0].determined[X_E] = false;
    assert_eq!(by_condition(&estimates)[0].mean[X_E], None);
}
