//! Tests of a calibration: its constants correct the records, and its errors reach the standard errors.

use nalgebra::DMatrix;

use super::*;
use crate::dataset::{CalibratedQuantity, RigCalibration, RigQuantity};
use crate::signal::{Section, filter};

/// A calibration with these values and standard errors, uncorrelated.
fn calibration(known: &[(RigQuantity, f64, f64)]) -> RigCalibration {
    let stated = RigConstants::stated(Some(LEVER));
    let quantity = |name: RigQuantity| {
        let own = known.iter().find(|(quantity, ..)| *quantity == name);
        CalibratedQuantity {
            name,
            value: own.map(|(_, value, _)| *value),
            se: own.map(|(.., se)| *se),
            stated: stated.value(name),
            reason: own.is_none().then(|| "no load tells it".to_owned()),
            above: None,
        }
    };
    let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(quantity).to_vec();
    let variances: Vec<f64> = quantities.iter().filter_map(|own| own.se).map(|se| se * se).collect();
    let covariance = |row: usize| {
        (0..variances.len()).map(|column| if row == column { variances[row] } else { 0.0 }).collect()
    };
    let covariance = (0..variances.len()).map(covariance).collect();
    RigCalibration::new("test".into(), "rig".into(), quantities, covariance)
}

/// Two samples of delay, which need no interpolation to make.
const LATE_SAMPLES: usize = 2;

/// Channels that are wrong in every way at once.
fn wrong_channels() -> RigConstants {
    RigConstants {
        torque_gain: 1.08,
        torque_offset_nm: 0.3,
        torque_nonlinearity_per_nm2: 0.0005,
        angle_gain: 0.95,
        torque_delay_s: LATE_SAMPLES as f64 * PERIOD_S,
        torque_cutoff_hz: Some(180.0),
        ..RigConstants::stated(Some(LEVER))
    }
}

/// The torque that a channel records, N m, without delay and low-pass.
fn recorded_torque_nm(constants: &RigConstants, true_nm: f64) -> f64 {
    let cubed = true_nm * true_nm * true_nm;
    constants.torque_offset_nm
        + constants.torque_gain * (true_nm + constants.torque_nonlinearity_per_nm2 * cubed)
}

/// What a rig with these constants records of a session.
fn recorded_with(mut session: Session, constants: RigConstants) -> Session {
    for trial in &mut session.trials {
        let record = &mut trial.record;
        let recorded: Vec<f64> =
            record.torque_l_nm.iter().map(|torque| recorded_torque_nm(&constants, *torque)).collect();
        let low_pass = constants.torque_cutoff_hz.map(|own| Section::first_order_low_pass(own, PERIOD_S));
        let passed = filter(low_pass.as_slice(), &recorded);
        let late = (constants.torque_delay_s / PERIOD_S).round() as usize;
        record.torque_l_nm = (0..passed.len()).map(|sample| passed[sample.saturating_sub(late)]).collect();
        record.theta_m_rad.iter_mut().for_each(|angle| *angle *= constants.angle_gain);
    }
    session
}

fn quiet() -> SyntheticSession {
    SyntheticSession { noise_nm: 0.002, ..SyntheticSession::new(2) }
}

#[test]
fn a_calibration_undoes_what_the_channels_did() {
    let clean = quiet().session();
    let constants = wrong_channels();
    let recorded = recorded_with(clean.clone(), constants);
    let fit = |constants: RigConstants| {
        let settings = PreprocessingSettings::default();
        let observations = Observations::of_rig(&recorded, settings, constants).unwrap();
        Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise)
    };
    let stated = RigConstants::stated(Some(LEVER));
    let clean = Observations::new(&clean, PreprocessingSettings::default()).unwrap();
    let clean = Fit::new(&clean, &Model::paper(), Weighting::MeasuredNoise);
    // The middle trial: a single one may have another optimum.
    let off = |fit: &Fit, parameter: usize| {
        let of_trial = |(own, clean): (&Vec<f64>, &Vec<f64>)| (own[parameter] / clean[parameter] - 1.0).abs();
        upper_median(fit.parameters.iter().zip(&clean.parameters).map(of_trial)).unwrap()
    };
    let (with, without) = (fit(constants), fit(stated));
    for parameter in [I_J, K_SRS, X_E] {
        let (with, without) = (off(&with, parameter), off(&without, parameter));
        assert!(with < 0.05 && without > 3.0 * with, "{parameter}: {with} with, {without} without");
    }
}

#[test]
fn constants_changed_in_the_observations_are_those_read_with_the_session() {
    // A large offset and a nonlinearity at once would be of second order.
    let wrong = RigConstants { torque_offset_nm: 0.0, ..wrong_channels() };
    let session = recorded_with(quiet().session(), wrong);
    let of_rig = |constants: RigConstants| {
        Observations::of_rig(&session, PreprocessingSettings::default(), constants).unwrap()
    };
    let stated = RigConstants::stated(Some(LEVER));
    let changed = of_rig(stated).with_constants(wrong);
    let read = of_rig(wrong);
    for (one, other) in changed.trials.iter().zip(&read.trials) {
        for (a, b) in one.measured_nm.iter().zip(&other.measured_nm) {
            assert!((a - b).abs() < 5e-3, "{a} and {b} N m");
        }
        for (a, b) in one.input.motion.iter().zip(&other.input.motion) {
            assert!((a.theta - b.theta).abs() < 1e-9 && (a.omega - b.omega).abs() < 1e-6);
        }
        assert!((one.torque_0_nm - other.torque_0_nm).abs() < 1e-4);
    }
    assert_eq!(changed.prediction_sections, read.prediction_sections);
    assert_eq!(changed.constants, read.constants);
    assert!((changed.angle_noise_rad - read.angle_noise_rad).abs() < 1e-15);
}

/// What the errors of `calibration` do to the fit of each trial on its own.
fn of_trials(observations: &Observations, fit: &Fit, calibration: &RigCalibration) -> ConstantEffects {
    ConstantEffects::new(observations, AskedFit::Trials(fit), calibration).unwrap()
}

/// Constants that are all known, with errors that matter.
fn known() -> [(RigQuantity, f64, f64); 8] {
    [
        (RigQuantity::LeverInertia, 0.0016, 0.000_05),
        (RigQuantity::LeverDamping, 0.4, 0.02),
        (RigQuantity::LeverStiffness, 900.0, 20.0),
        (RigQuantity::TorqueGain, 1.0, 0.01),
        (RigQuantity::TorqueNonlinearity, 0.0, 0.000_1),
        (RigQuantity::AngleGain, 1.0, 0.01),
        (RigQuantity::TorqueDelay, 0.0, 2e-5),
        (RigQuantity::TorqueCutoff, 400.0, 20.0),
    ]
}

/// Checks the effects against fits from scratch with each constant changed: the typical difference is a small part of the typical effect.
fn assert_agree(effects: &ConstantEffects, from_scratch: impl Fn(RigConstants) -> Fit, of: RigConstants) {
    for (quantity, changes) in effects.quantities.iter().zip(&effects.per_se) {
        let (_, value, se) = *known().iter().find(|own| own.0 == *quantity).unwrap();
        let [low, high] = [-se, se].map(|by| from_scratch(of.with(*quantity, value + by)).parameters);
        for parameter in [I_J, K_SRS, X_E] {
            let expected = |trial: usize| 0.5 * libm::log(high[trial][parameter] / low[trial][parameter]);
            let sum = |of: &dyn Fn(usize) -> f64| (0..changes.len()).map(of).map(|x| x * x).sum::<f64>();
            let size = sum(&expected).sqrt();
            let apart = sum(&|trial| changes[trial][parameter] - expected(trial)).sqrt();
            assert!(apart < 0.15 * size.max(1e-3), "{quantity:?}, parameter {parameter}: {apart} of {size}");
        }
    }
}

#[test]
fn the_effect_of_each_constant_is_that_of_fits_from_scratch_with_the_constant_changed() {
    let calibration = calibration(&known());
    let constants = RigConstants::calibrated(&calibration, Some(LEVER)).unwrap();
    let session = SyntheticSession { noise_nm: 0.005, ..quiet() }.session();
    let session = recorded_with(session, constants);
    let observations = Observations::of_rig(&session, PreprocessingSettings::default(), constants).unwrap();
    let of_trials = |constants: RigConstants| {
        Fit::new(&observations.with_constants(constants), &Model::paper(), Weighting::MeasuredNoise)
    };
    let fit = of_trials(constants);
    let effects = ConstantEffects::new(&observations, AskedFit::Trials(&fit), &calibration).unwrap();
    assert_eq!(effects.quantities.len(), 8);
    assert_agree(&effects, of_trials, constants);
    let of_session = |constants: RigConstants| {
        SessionFit::new(&observations.with_constants(constants), &of_trials(constants)).unwrap()
    };
    let together = of_session(constants);
    let effects = ConstantEffects::new(&observations, AskedFit::Session(&together), &calibration).unwrap();
    assert_agree(&effects, |own| of_session(own).fit, constants);
}

#[test]
fn what_is_common_to_the_trials_does_not_shrink_with_repetitions() {
    let calibration = calibration(&[(RigQuantity::TorqueGain, 1.0, 0.03)]);
    let observations = quiet().observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let results = |calibration: Option<&RigCalibration>| {
        let session = Err(NoSessionModel::NotAsked);
        let settings = PreprocessingSettings::default();
        Results::new("T", &observations, (&fit, &session), settings, Weighting::MeasuredNoise, calibration)
    };
    let (with, without) = (results(Some(&calibration)), results(None));
    for (own, noise_alone) in with.conditions.iter().zip(&without.conditions) {
        // The lever, which stays as it is, takes a part of a torque that is recorded too large.
        let of_rig = own.se_of_rig[K_SRS].unwrap();
        assert!((0.001..0.04).contains(&of_rig), "{:?}", own.se_of_rig);
        let expected = libm::hypot(noise_alone.se[K_SRS].unwrap(), of_rig);
        assert!((own.se[K_SRS].unwrap() - expected).abs() < 1e-12);
    }
    let of_json = &with.json["trials"][0];
    assert_eq!(of_json["se_relative"]["k_srs_nm_per_rad"], with.estimates[0].se[K_SRS].unwrap());
    assert!(of_json["se_of_rig_relative"]["k_srs_nm_per_rad"].as_f64().unwrap() > 0.001);
    // Of a condition the part from the rig is as large as of its trials.
    let of_trial = |trial: usize| with.estimates[trial].se_of_rig[K_SRS].unwrap();
    let of_trials = 0.5 * (of_trial(0) + of_trial(1));
    assert!((with.conditions[0].se_of_rig[K_SRS].unwrap() / of_trials - 1.0).abs() < 0.05, "two repetitions");
    assert!(of_json["change_by_se_of_constant"]["torque_gain"]["k_srs_nm_per_rad"].is_number());
    assert_eq!(with.json["rig"]["lever"], "assumed");
    assert_eq!(without.json["trials"][0]["se_of_rig_relative"]["k_srs_nm_per_rad"], 0.0);
    let assumed = without.json["rig"]["assumed"].as_array().unwrap();
    assert_eq!(assumed.len(), 5, "every constant is assumed");
    assert_eq!(with.json["rig"]["assumed"].as_array().unwrap().len(), 4, "the torque gain is measured");
    let gain = assumed.iter().find(|own| own["constant"] == "torque_gain").unwrap();
    let percent = gain["k_srs_percent"][1].as_f64().unwrap();
    assert!(percent.is_finite() && percent.abs() > 1.0, "{percent} %");
}

#[test]
fn a_standard_error_whose_part_from_the_calibration_is_unknown_is_none_and_not_too_small() {
    let calibration = calibration(&[(RigQuantity::TorqueGain, 1.0, 0.03)]);
    let observations = quiet().observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let found = || {
        let own = estimates_without_profiles(&observations, &fit);
        let conditions = by_condition(&own);
        (own, conditions)
    };
    let mut effects = of_trials(&observations, &fit, &calibration);
    let (known, _) = with_rig_errors(found(), Some(&effects));
    effects.per_se[0][1][K_SRS] = f64::NAN;
    let (estimates, conditions) = with_rig_errors(found(), Some(&effects));
    assert_eq!((estimates[1].se[K_SRS], estimates[1].se_of_rig[K_SRS]), (None, None));
    assert_eq!((conditions[0].se[K_SRS], conditions[0].se_of_rig[K_SRS]), (None, None));
    let remark = estimates[1].remarks.last().unwrap();
    assert!(remark.starts_with("no standard error of k_srs_nm_per_rad: "), "{remark}");
    assert_eq!(estimates[1].se[X_E], known[1].se[X_E], "the other parameters have theirs");
    assert_eq!((&estimates[0], &estimates[2]), (&known[0], &known[2]), "so have the other trials");
    assert!(conditions[1].se[K_SRS].is_some());

    let (without_fits, conditions) = with_rig_errors(found(), None);
    assert!(without_fits.iter().all(|own| own.se == [None; 6] && !own.remarks.is_empty()));
    assert!(conditions.iter().all(|own| own.se[K_SRS].is_none()));
}

/// Part of the 95 % intervals of I_j, k_srs and x_e that hold the truth, over sessions whose rigs differ from their calibration as it says:
/// with the errors of the constants in the standard errors, and without.
fn coverage(sessions: u64) -> [(f64, f64); 3] {
    let known = [
        (RigQuantity::LeverInertia, 0.0016, 0.000_03),
        (RigQuantity::LeverStiffness, 900.0, 18.0),
        (RigQuantity::TorqueGain, 1.0, 0.008),
        (RigQuantity::AngleGain, 1.0, 0.005),
    ];
    let calibration = calibration(&known);
    let mut stream = crate::random::Stream::new(5, "constants of rigs");
    let (mut held, mut count) = ([(0.0, 0.0); 3], [0.0; 3]);
    for seed in 0..sessions {
        let mut true_constants = RigConstants::stated(Some(LEVER));
        for (quantity, value, se) in known {
            true_constants = true_constants.with(quantity, value + se * stream.normal());
        }
        let lever = true_constants.lever.unwrap();
        let clean = SyntheticSession { seed, noise_nm: 0.005, lever, ..SyntheticSession::new(2) }.session();
        let session = recorded_with(clean, true_constants);
        let constants = RigConstants::calibrated(&calibration, session.lever).unwrap();
        let settings = PreprocessingSettings::default();
        let observations = Observations::of_rig(&session, settings, constants).unwrap();
        let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
        let effects = of_trials(&observations, &fit, &calibration);
        for (trial, own) in estimates_without_profiles(&observations, &fit).iter().enumerate() {
            let expected = truth(own.velocity_rad_s, own.torque_nm);
            for (place, parameter) in [I_J, K_SRS, X_E].into_iter().enumerate() {
                let Some(se) = own.se[parameter] else { continue };
                let off = libm::log(own.values[parameter] / expected[parameter]).abs();
                let whole = libm::hypot(se, effects.se(parameter, trial).unwrap());
                held[place].0 += f64::from(off < 1.96 * whole);
                held[place].1 += f64::from(off < 1.96 * se);
                count[place] += 1.0;
            }
        }
    }
    std::array::from_fn(|place| (held[place].0 / count[place], held[place].1 / count[place]))
}

#[test]
fn intervals_that_contain_the_errors_of_the_constants_hold_the_truth_as_often_as_they_say() {
    // The errors of a session's trials are one draw: of twenty draws 95 % hold within some 10 %.
    let parts = coverage(20);
    for (with, without) in parts {
        assert!(with > 0.82, "with and without: {parts:?}");
        assert!(without < with, "with and without: {parts:?}");
    }
    assert!(parts[0].1 < 0.6 && parts[1].1 < 0.8, "without them they hold it far less often: {parts:?}");
}

#[test]
fn a_lever_that_is_a_fifth_off_biases_the_stiffness_no_longer() {
    for quantity in [RigQuantity::LeverInertia, RigQuantity::LeverDamping, RigQuantity::LeverStiffness] {
        for factor in [0.8, 1.2] {
            let stated = RigConstants::stated(Some(LEVER));
            let value = factor * stated.value(quantity).unwrap();
            let lever = stated.with(quantity, value).lever.unwrap();
            let session = SyntheticSession { lever, ..quiet() }.session();
            let calibration = calibration(&[(quantity, value, 0.01 * value)]);
            let constants = RigConstants::calibrated(&calibration, session.lever).unwrap();
            let settings = PreprocessingSettings::default();
            let observations = Observations::of_rig(&session, settings, constants).unwrap();
            let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
            let together = SessionFit::new(&observations, &fit).unwrap();
            let ratio = |(own, trial): (&Vec<f64>, &TrialObservation)| {
                own[K_SRS] / truth(trial.velocity_rad_s, trial.torque_nm)[K_SRS]
            };
            let ratios = together.fit.parameters.iter().zip(&observations.trials).map(ratio);
            let bias = ratios.sum::<f64>() / observations.trials.len() as f64 - 1.0;
            assert!(bias.abs() < 0.02, "{quantity:?} times {factor}: k_srs is off by {bias}");
        }
    }
}

#[test]
fn correlated_constants_have_the_variance_of_their_sum() {
    let gains = [(RigQuantity::TorqueGain, 1.0, 0.02), (RigQuantity::AngleGain, 1.0, 0.02)];
    let mut together = calibration(&gains);
    let observations = quiet().observations();
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    let variance = |calibration: &RigCalibration| {
        of_trials(&observations, &fit, calibration).log_covariance(K_SRS, 0, 0)
    };
    let apart = variance(&together);
    let part = [0, 1].map(|own| variance(&calibration(&gains[own..=own])));
    assert!((apart - part[0] - part[1]).abs() < 1e-9);
    together.covariance[0][1] = 0.02 * 0.02;
    together.covariance[1][0] = 0.02 * 0.02;
    let effects = of_trials(&observations, &fit, &together);
    let sum = effects.per_se[0][0][K_SRS] + effects.per_se[1][0][K_SRS];
    assert!((effects.log_covariance(K_SRS, 0, 0) - sum * sum).abs() < 1e-9);
    let matrix = DMatrix::from_fn(6, 6, |i, j| effects.log_covariance(K_SRS, i, j));
    assert!(matrix.symmetric_eigenvalues().min() > -1e-12, "a covariance");
}

#[test]
fn a_calibration_of_another_rig_or_in_other_units_is_refused_with_what_is_wrong() {
    let refusal = |calibration: &RigCalibration, lever: Option<Lever>| {
        RigConstants::calibrated(calibration, lever).unwrap_err().to_string()
    };
    let inertia = calibration(&[(RigQuantity::LeverInertia, 0.0016, 1e-5)]);
    assert!(refusal(&inertia, None).contains("the session states a rigid one"));
    let mut rigid = calibration(&[(RigQuantity::TorqueGain, 1.01, 0.001)]);
    assert!(RigConstants::calibrated(&rigid, Some(LEVER)).is_ok(), "the lever is stated, and not told");
    rigid.quantities.iter_mut().for_each(|own| own.stated = None);
    assert!(refusal(&rigid, Some(LEVER)).contains("of a rigid lever"));
    assert!(RigConstants::calibrated(&rigid, None).is_ok());
    let in_g_cm2 = calibration(&[(RigQuantity::LeverInertia, 16_000.0, 100.0)]);
    let message = refusal(&in_g_cm2, Some(LEVER));
    assert!(
        message.contains("lever_inertia_kg_m2 is 16000") && message.contains("mistake of units"),
        "{message}"
    );
    let in_ms = calibration(&[(RigQuantity::TorqueDelay, 0.8, 0.01)]);
    assert!(refusal(&in_ms, Some(LEVER)).contains("expected -0.01 to 0.01"));
    let in_percent = calibration(&[(RigQuantity::TorqueGain, 101.0, 0.1)]);
    assert!(refusal(&in_percent, Some(LEVER)).contains("101.000 times the 1"));
    let mut contradictory = inertia;
    contradictory.warnings = vec!["the bar of 0.004 kg m2 looks like 0.006".into()];
    let message = refusal(&contradictory, Some(LEVER));
    assert!(message.contains("looks like 0.006") && message.contains("--calibration none"), "{message}");
}

#[test]
fn a_nonlinearity_that_was_not_measured_up_to_the_torques_of_a_session_is_refused() {
    let constants = RigConstants { torque_nonlinearity_per_nm2: -0.2, ..RigConstants::stated(Some(LEVER)) };
    let settings = PreprocessingSettings::default();
    let error = Observations::of_rig(&quiet().session(), settings, constants).unwrap_err().to_string();
    assert!(error.contains("calibrate with a larger weight"), "{error}");
}
