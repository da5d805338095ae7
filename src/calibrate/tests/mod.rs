//! Tests of the calibration with a rig that is simulated in another way.

mod coverage;
mod mistakes;
mod simulator;

use std::path::Path;

use self::simulator::{ALL_LOADS, Loads, TrueRig, rig_trials, truth};
use super::prepared_rig::PreparedRig;
use super::{CalibrateError, CalibrationOutcome, calibrate, compare};
use crate::dataset::{RigCalibration, RigQuantity, RigTrialMotion, RigTrials};
use crate::protocol::RigLoad;
use crate::wrist::Lever;

const NO_LOADS: Loads = Loads { weight: false, inertia: false, clamp: false, spring: false };

fn calibrated(trials: &RigTrials) -> CalibrationOutcome {
    calibrate(trials, "ramphold", "rig").unwrap()
}

/// Differences from the truth in standard errors, of the quantities that have a value.
fn deviations(outcome: &CalibrationOutcome, rig: &TrueRig) -> Vec<(RigQuantity, f64)> {
    let quantities = &outcome.calibration.quantities;
    let of = |(own, truth): (&crate::dataset::CalibratedQuantity, f64)| {
        Some((own.name, (own.value? - truth) / own.se?))
    };
    quantities.iter().zip(truth(rig)).filter_map(of).collect()
}

/// What a right calibration of `rig`, whose loads are right, says.
fn assert_right(outcome: &CalibrationOutcome, rig: &TrueRig) {
    for (name, z) in deviations(outcome, rig) {
        assert!(z.abs() < 4.0, "seed {}: {} is {z:.1} standard errors off", rig.seed, name.name());
    }
    assert!(outcome.calibration.warnings.is_empty(), "seed {}: {:?}", rig.seed, outcome.calibration.warnings);
}

#[test]
fn every_constant_is_found_within_its_error_with_coarse_and_fine_encoders() {
    for (seed, bits, rate_hz) in [(1, 17, 2000.0), (2, 13, 1000.0)] {
        let rig = TrueRig { encoder_bits: bits, sample_rate_hz: rate_hz, ..TrueRig::usual(seed) };
        let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
        let found = deviations(&outcome, &rig);
        assert!(found.len() >= 10, "{found:?}");
        for (name, z) in &found {
            assert!(z.abs() < 4.0, "{bits} bits: {} is {z:.1} standard errors off", name.name());
        }
        let mean_square = found.iter().map(|(_, z)| z * z).sum::<f64>() / found.len() as f64;
        assert!(mean_square < 3.0, "{bits} bits: {found:?}");
        assert!(outcome.misfit.p_value > 0.001, "{:?}", outcome.misfit);
        assert!(outcome.calibration.warnings.is_empty(), "{:?}", outcome.calibration.warnings);
    }
}

/// A rig like the virtual wrist's: a fine encoder, and a motor that yields to the lever as much as the lever itself.
fn yielding_rig(seed: u64) -> TrueRig {
    TrueRig {
        lever: Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 },
        torque_gain: 1.0,
        torque_offset_nm: 0.03,
        torque_nonlinearity_per_nm2: 0.0,
        angle_gain: 1.0,
        servo_hz: 80.0,
        servo_compliance_rad_per_nm: 0.001,
        servo_speed_command: 1.0,
        encoder_bits: 20,
        noise_nm: 0.003,
        slow_noise_nm: 0.0,
        drift_nm: 0.0,
        jitter_rad: 0.0,
        ..TrueRig::usual(seed)
    }
}

#[test]
fn a_motor_that_yields_to_the_lever_is_not_taken_for_a_slow_one() {
    let softer = Lever { stiffness_nm_per_rad: 600.0, ..yielding_rig(7).lever };
    for rig in [
        yielding_rig(5),
        TrueRig { lever: softer, ..yielding_rig(7) },
        TrueRig { torque_gain: 1.04, ..yielding_rig(11) },
    ] {
        let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
        let found = deviations(&outcome, &rig);
        for name in [
            RigQuantity::LeverInertia,
            RigQuantity::LeverStiffness,
            RigQuantity::LeverDamping,
            RigQuantity::TorqueGain,
            RigQuantity::AngleGain,
            RigQuantity::ServoBandwidth,
        ] {
            let (_, z) = found.iter().find(|(own, _)| *own == name).unwrap();
            assert!(z.abs() < 4.0, "seed {}: {} is {z:.1} standard errors off", rig.seed, name.name());
        }
        let bandwidth_hz = outcome.calibration.value(RigQuantity::ServoBandwidth).unwrap();
        assert!((bandwidth_hz / rig.servo_hz - 1.0).abs() < 0.05, "seed {}: {bandwidth_hz} Hz", rig.seed);
    }
}

#[test]
fn a_friction_that_a_search_finds_at_no_speed_is_searched_again() {
    let rig = TrueRig::usual(5);
    let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
    let found = deviations(&outcome, &rig);
    let (_, z) = found.iter().find(|(name, _)| *name == RigQuantity::BearingFriction).unwrap();
    assert!(z.abs() < 4.0, "{z:.1} standard errors off: {found:?}");
    let friction_nm = outcome.calibration.value(RigQuantity::BearingFriction).unwrap();
    assert!((friction_nm / rig.bearing_friction_nm - 1.0).abs() < 0.1, "{friction_nm} N m");
}

#[test]
fn a_motion_of_a_few_steps_of_the_encoder_accuses_no_load() {
    // Clamped, the motor that yields turns by five steps.
    let rig = TrueRig { encoder_bits: 13, sample_rate_hz: 1250.0, ..yielding_rig(21) };
    let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
    assert_right(&outcome, &rig);
}

#[test]
fn the_errors_are_small_enough_to_be_of_use() {
    let rig = TrueRig::usual(3);
    let calibration = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0)).calibration;
    for (name, largest) in [
        (RigQuantity::LeverInertia, 0.03),
        (RigQuantity::LeverStiffness, 0.03),
        (RigQuantity::LeverDamping, 0.05),
        (RigQuantity::TorqueGain, 0.01),
        (RigQuantity::AngleGain, 0.03),
        (RigQuantity::TorqueDelay, 0.2),
        // Whether the drive brakes the motor or its error is not known, and costs a hundredth more.
        (RigQuantity::ServoBandwidth, 0.06),
    ] {
        let part = calibration.se(name).unwrap() / calibration.value(name).unwrap();
        assert!(part < largest, "{}: {part}", name.name());
    }
}

#[test]
fn a_calibration_passes_the_checks_of_its_file() {
    let rig = TrueRig::usual(4);
    let calibration = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0)).calibration;
    let text = serde_json::to_string(&calibration).unwrap();
    assert_eq!(RigCalibration::parse(&text, Path::new("c.json")).unwrap(), calibration);
    // Inertia and gain of the angle follow from each other through the bar: their errors are not independent.
    let together = calibration.covariance_between(RigQuantity::LeverInertia, RigQuantity::AngleGain).unwrap();
    let alone =
        calibration.se(RigQuantity::LeverInertia).unwrap() * calibration.se(RigQuantity::AngleGain).unwrap();
    assert!(together.abs() > 0.5 * alone, "{}", together / alone);
}

#[test]
fn an_empty_handle_tells_no_gain_and_no_lever_but_says_what_would() {
    let rig = TrueRig::usual(5);
    let outcome = calibrated(&rig_trials(&rig, NO_LOADS, |_| 1.0));
    let quantity =
        |name: RigQuantity| outcome.calibration.quantities.iter().find(|own| own.name == name).unwrap();
    for (name, load) in [
        (RigQuantity::LeverInertia, "known_inertia"),
        (RigQuantity::LeverStiffness, "clamped_handle"),
        (RigQuantity::TorqueGain, "known_weight"),
        (RigQuantity::AngleGain, "known_inertia"),
    ] {
        let own = quantity(name);
        assert_eq!((own.value, own.se), (None, None), "{name:?}");
        let reason = own.reason.as_deref().unwrap();
        assert!(reason.contains(load) && reason.contains("known only together with"), "{reason}");
    }
    for name in [RigQuantity::TorqueOffset, RigQuantity::TorqueDelay, RigQuantity::ServoBandwidth] {
        assert!(quantity(name).value.is_some(), "{name:?}: {:?}", quantity(name).reason);
    }
}

#[test]
fn a_handle_that_is_stated_as_rigid_has_a_whole_lever_or_none() {
    let lever = Lever { inertia_kg_m2: 0.0018, damping_nm_s_per_rad: 3.0, stiffness_nm_per_rad: 20_000.0 };
    let rig = TrueRig { lever, torque_cutoff_hz: 300.0, ..TrueRig::usual(7) };
    let loads = Loads { weight: true, inertia: true, ..NO_LOADS };
    let stated_as_rigid = RigTrials { lever: None, ..rig_trials(&rig, loads, |_| 1.0) };
    let outcome = calibrated(&stated_as_rigid);
    let told = outcome.calibration.quantities[..3].iter().filter(|own| own.value.is_some()).count();
    assert!(told == 0 || told == 3, "{:?}", &outcome.calibration.quantities[..3]);
}

#[test]
fn a_cut_off_too_high_to_be_seen_has_a_bound_and_no_value() {
    let rig = TrueRig { torque_cutoff_hz: 4_000.0, ..TrueRig::usual(6) };
    let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
    let cutoff = &outcome.calibration.quantities[8];
    assert_eq!((cutoff.name, cutoff.value), (RigQuantity::TorqueCutoff, None));
    assert!(
        cutoff.reason.as_deref().unwrap().contains("it is above "),
        "{:?}",
        outcome.calibration.quantities
    );
    // The loads exclude a slow one, and not the one that is there.
    let above_hz = cutoff.above.unwrap();
    assert!((500.0..4_000.0).contains(&above_hz), "{above_hz}");
    // What it delays is part of the delay, which is known well.
    let delay = &outcome.calibration.quantities[7];
    let (value, se) = (delay.value.unwrap(), delay.se.unwrap());
    let truth = rig.torque_delay_s + 1.0 / (std::f64::consts::TAU * rig.torque_cutoff_hz);
    assert!((value - truth).abs() < 4.0 * se && se < 3e-5, "{value} +- {se}, {truth}");
}

#[test]
fn a_wrong_bar_that_no_other_load_tells_is_told_by_the_rig_as_stated() {
    let one_bar = Loads { spring: false, ..ALL_LOADS };
    let warnings = calibrated(&rig_trials(&yielding_rig(9), one_bar, wrong_bar)).calibration.warnings;
    assert!(warnings.len() == 1 && warnings[0].starts_with("known_inertia"), "{warnings:?}");
    let percent = warnings[0].split_once("probably ").unwrap().1.split_once(" %").unwrap().0;
    assert!((percent.parse::<f64>().unwrap() - 16.0).abs() < 4.0, "{warnings:?}");
}

/// Weights on one arm agree with each other whatever the arm: both gains were off by its error, "by the other loads" to 0.0 %.
#[test]
fn weights_that_are_all_wrong_by_one_factor_are_told_by_the_rig_as_stated() {
    let warnings = |rig: &TrueRig, wrong| calibrated(&rig_trials(rig, ALL_LOADS, wrong)).calibration.warnings;
    let lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
    let as_stated = TrueRig { lever, torque_gain: 1.0, angle_gain: 1.0, ..TrueRig::usual(5) };
    let told = warnings(&as_stated, wrong_arm);
    assert!(told.len() == 1 && told[0].starts_with("the known weights are probably all"), "{told:?}");
    assert!(told[0].contains("from their stated torques") && told[0].contains("measure arm_m"), "{told:?}");
    // A gain that is off alone is the torque channel's.
    let other_gain = TrueRig { torque_gain: 1.2, ..as_stated };
    assert_eq!(warnings(&other_gain, |_| 1.0), Vec::<String>::new());
}

fn wrong_arm(load: &RigLoad) -> f64 {
    if matches!(load, RigLoad::KnownWeight { .. }) { 1.2 } else { 1.0 }
}

#[test]
fn a_drive_that_reports_its_target_as_the_angle_is_told_from_a_motor_that_follows() {
    let rig = TrueRig::usual(6);
    let mut trials = rig_trials(&rig, NO_LOADS, |_| 1.0);
    let seen =
        |trials: &RigTrials| PreparedRig::new(trials, |_| true, None).unwrap().angle_against_target.unwrap();
    let angle = seen(&trials);
    assert!(!angle.is_target() && angle.largest_s > 2.0 * angle.sample_s, "{angle:?}");
    let step = std::f64::consts::TAU / f64::from(1u32 << rig.encoder_bits);
    for trial in &mut trials.trials {
        let rounded = trial.record.target_rad.iter().map(|target| libm::round((target + 0.1) / step) * step);
        trial.record.theta_m_rad = rounded.collect();
    }
    assert!(seen(&trials).is_target(), "{:?}", seen(&trials));
}

fn wrong_bar(load: &RigLoad) -> f64 {
    if matches!(load, RigLoad::KnownInertia { .. }) { 1.16 } else { 1.0 }
}

fn wrong_spring(load: &RigLoad) -> f64 {
    if matches!(load, RigLoad::KnownSpring { .. }) { 1.25 } else { 1.0 }
}

#[test]
fn a_soft_lever_that_damps_more_at_speed_accuses_neither_a_load_nor_the_torque_channel() {
    for seed in [31, 32] {
        let rig = TrueRig {
            lever: Lever { inertia_kg_m2: 0.002, damping_nm_s_per_rad: 0.25, stiffness_nm_per_rad: 450.0 },
            torque_cutoff_hz: 400.0,
            damping_growth: 0.02,
            servo_compliance_rad_per_nm: 0.0,
            encoder_bits: 18,
            noise_nm: 0.012,
            ..yielding_rig(seed)
        };
        let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
        assert_right(&outcome, &rig);
    }
}

#[test]
fn a_bearing_that_gives_before_it_slides_leaves_no_misfit_and_accuses_no_load() {
    let rig = TrueRig {
        lever: Lever { inertia_kg_m2: 0.002, damping_nm_s_per_rad: 0.25, stiffness_nm_per_rad: 450.0 },
        torque_cutoff_hz: 400.0,
        presliding_rad: 3e-4,
        bearing_friction_nm: 0.007,
        servo_compliance_rad_per_nm: 0.0,
        encoder_bits: 18,
        noise_nm: 0.012,
        ..yielding_rig(52)
    };
    let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0));
    assert_right(&outcome, &rig);
    // Without the law it is at the least that the draws can tell, 0.001.
    assert!(outcome.misfit.p_value > 0.01, "{:?}", outcome.misfit);
}

#[test]
fn a_load_with_a_wrong_value_disagrees_with_the_others() {
    let rig = TrueRig::usual(7);
    let outcome = calibrated(&rig_trials(&rig, ALL_LOADS, wrong_spring));
    let spring = outcome.loads.iter().find(|own| matches!(own.load, RigLoad::KnownSpring { .. })).unwrap();
    assert!(spring.disagrees(), "{spring:?}");
    assert!((spring.difference.unwrap() - 0.25).abs() < 0.08, "{spring:?}");
    // Only spring and bar tell the gain of the angle: either may be the wrong one, and no weight is.
    assert!(spring.or.iter().all(|load| matches!(load, RigLoad::KnownInertia { .. })), "{spring:?}");
    assert!(
        outcome.loads.iter().all(|own| !own.disagrees() || !matches!(own.load, RigLoad::KnownWeight { .. }))
    );
    assert!(outcome.calibration.warnings.iter().any(|text| text.starts_with("known_spring of 20 N m/rad")));
}

#[test]
fn a_wrong_value_of_the_only_load_of_its_kind_cannot_be_seen() {
    let rig = TrueRig::usual(8);
    let outcome =
        calibrated(&rig_trials(&rig, Loads { weight: false, clamp: true, ..ALL_LOADS }, wrong_spring));
    let mut trials = rig_trials(&rig, Loads { spring: false, weight: false, ..ALL_LOADS }, |_| 1.0);
    trials.trials.retain(|trial| !matches!(trial.load, RigLoad::ClampedHandle));
    let alone = calibrated(&trials);
    assert_eq!(alone.loads.len(), 1);
    assert_eq!((alone.loads[0].difference, alone.loads[0].disagrees()), (None, false));
    // Bar and spring without a weight tell the same quotient of both gains, and so each other.
    assert!(outcome.loads.iter().any(super::LoadCheck::disagrees), "{:?}", outcome.loads);
}

fn of_the_day(rig: &TrueRig) -> RigTrials {
    let mut trials = rig_trials(rig, NO_LOADS, |_| 1.0);
    trials.trials.retain(|trial| {
        trial.repetition == 1
            && matches!(trial.motion, RigTrialMotion::Ramp { velocity_rad_s } if velocity_rad_s != -1.3)
    });
    assert_eq!(trials.trials.len(), 3);
    trials
}

#[test]
fn three_ramps_of_another_day_agree_with_a_calibration_or_name_what_changed() {
    let rig = TrueRig::usual(9);
    let calibration = calibrated(&rig_trials(&rig, ALL_LOADS, |_| 1.0)).calibration;
    let another_day = TrueRig { seed: 10, ..rig.clone() };
    let unchanged = compare(&of_the_day(&another_day), &calibration).unwrap();
    assert_eq!(unchanged.changed, [], "{unchanged:?}");

    let changed = |change: fn(&mut TrueRig)| {
        let mut rig = another_day.clone();
        change(&mut rig);
        compare(&of_the_day(&rig), &calibration).unwrap()
    };
    let offset = changed(|rig| rig.torque_offset_nm += 0.1);
    assert_eq!(offset.changed, [RigQuantity::TorqueOffset], "{offset:?}");
    assert!((offset.quantities[0].difference - 0.1).abs() < 3.0 * offset.quantities[0].se);
    let delay = changed(|rig| rig.torque_delay_s += 0.001);
    assert!(delay.changed.contains(&RigQuantity::TorqueDelay), "{delay:?}");
    assert!(!delay.changed.contains(&RigQuantity::TorqueGain), "{delay:?}");
    let heavier = changed(|rig| {
        rig.lever = Lever { inertia_kg_m2: 1.3 * rig.lever.inertia_kg_m2, ..rig.lever };
    });
    assert!(heavier.changed.contains(&RigQuantity::LeverInertia), "{heavier:?}");
    assert!(heavier.p_value < 0.001);
}

#[test]
fn what_cannot_be_analysed_is_refused_with_the_reason() {
    let rig = TrueRig::usual(11);
    let mut trials = of_the_day(&rig);
    let record = &mut trials.trials[0].record;
    let kept = record.theta_m_rad.len() / 2;
    for channel in [&mut record.target_rad, &mut record.theta_m_rad, &mut record.torque_l_nm] {
        channel.truncate(kept);
    }
    let error = calibrate(&trials, "ramphold", "rig").unwrap_err();
    assert!(
        matches!(&error, CalibrateError::NoReturn { file, .. } if file == "rig-trials/rig-trial-001.csv"),
        "{error}"
    );
    trials.trials.clear();
    assert_eq!(calibrate(&trials, "ramphold", "rig").unwrap_err(), CalibrateError::NoMotion);
    let mut silent = of_the_day(&rig);
    for trial in &mut silent.trials {
        trial.record.torque_l_nm.fill(0.1);
    }
    assert_eq!(calibrate(&silent, "ramphold", "rig").unwrap_err(), CalibrateError::NoNoise);
}
