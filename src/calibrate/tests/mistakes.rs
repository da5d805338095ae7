//! Mistakes of people who hang weights and clamp handles, and rigs that are odd and right.

use super::simulator::{ALL_LOADS, TrueRig, rig_trials};
use super::{of_the_day, yielding_rig};
use crate::calibrate::input_check::contradictions;
use crate::calibrate::prepared_rig::PreparedRig;
use crate::calibrate::{CalibrateError, calibrate, compare};
use crate::dataset::{RigTrial, RigTrials};
use crate::protocol::RigLoad;
use crate::wrist::Lever;

/// What is said of the trials of a usual rig after a mistake.
fn said(mistake: impl Fn(&mut Vec<RigTrial>)) -> String {
    let mut trials = rig_trials(&TrueRig::usual(12), ALL_LOADS, |_| 1.0);
    mistake(&mut trials.trials);
    match calibrate(&trials, "ramphold", "rig") {
        Err(error @ CalibrateError::Contradicts(_)) => error.to_string(),
        other => panic!("{other:?}"),
    }
}

fn each_weight(trials: &mut [RigTrial], change: impl Fn(&mut f64, &mut f64, &mut i8)) {
    for trial in trials {
        if let RigLoad::KnownWeight { mass_kg, arm_m, sign, .. } = &mut trial.load {
            change(mass_kg, arm_m, sign);
        }
    }
}

fn is_weight(trial: &RigTrial) -> bool {
    matches!(trial.load, RigLoad::KnownWeight { .. })
}

#[test]
fn units_sides_and_masses_of_weights_that_cannot_be_right_are_refused() {
    let grams = said(|trials| each_weight(trials, |mass, _, _| *mass *= 1000.0));
    assert!(
        grams.contains("Is mass_kg in grams") && grams.contains("(known_weight of 1000 kg at 0.1 m)"),
        "{grams}"
    );
    let centimetres = said(|trials| each_weight(trials, |_, arm, _| *arm *= 100.0));
    assert!(centimetres.contains("Is arm_m in centimetres?"), "{centimetres}");
    let newtons = said(|trials| each_weight(trials, |mass, _, _| *mass *= 9.81));
    assert!(newtons.contains("Is mass_kg the weight in newtons?"), "{newtons}");
    let exchanged =
        said(|trials| each_weight(trials, |mass, _, _| *mass = if *mass > 2.0 { 1.0 } else { 2.5 }));
    assert!(exchanged.contains("Were the weights exchanged"), "{exchanged}");
    let other_side = said(|trials| each_weight(trials, |_, _, sign| *sign = -*sign));
    assert!(other_side.contains("do all weights hang on the other side"), "{other_side}");
    let one_pair = said(|trials| {
        let pair: Vec<usize> = (0..trials.len()).filter(|at| is_weight(&trials[*at])).collect();
        let [first, other] = [pair[0], pair[2]];
        let load = trials[first].load;
        trials[first].load = trials[other].load;
        trials[other].load = load;
    });
    assert!(one_pair.contains("Did it hang on the other side than its sign says?"), "{one_pair}");
    assert_eq!(one_pair.lines().count(), 4, "two trials and no other: {one_pair}");
}

#[test]
fn units_and_signs_of_the_channels_that_cannot_be_right_are_refused() {
    let scaled = |angle: f64, torque: f64| {
        said(|trials| {
            for trial in trials {
                trial.record.theta_m_rad.iter_mut().for_each(|value| *value *= angle);
                trial.record.torque_l_nm.iter_mut().for_each(|value| *value *= torque);
            }
        })
    };
    for (angle, torque, mistake) in [
        (57.3, 1.0, "Is theta_m_rad in degrees?"),
        (1000.0, 1.0, "Is theta_m_rad in milliradians?"),
        (-1.0, 1.0, "Has theta_m_rad the other sign than target_rad?"),
        (0.0, 1.0, "Did the motor move"),
        (1.0, 1000.0, "Is torque_l_nm in mN m?"),
        (1.0, -1.0, "Has torque_l_nm the sign of the torque that turns the handle"),
    ] {
        let said = scaled(angle, torque);
        assert!(said.contains(mistake), "{angle} and {torque}: {said}");
    }
}

#[test]
fn units_of_springs_and_bars_that_cannot_be_right_are_named() {
    let springs = |factor: f64| {
        said(|trials| {
            for trial in trials {
                if let RigLoad::KnownSpring { stiffness_nm_per_rad, .. } = &mut trial.load {
                    *stiffness_nm_per_rad *= factor;
                }
            }
        })
    };
    let bars = |factor: f64| {
        said(|trials| {
            for trial in trials {
                if let RigLoad::KnownInertia { inertia_kg_m2, .. } = &mut trial.load {
                    *inertia_kg_m2 *= factor;
                }
            }
        })
    };
    for (said, mistake) in [
        (springs(std::f64::consts::PI / 180.0), "Is stiffness_nm_per_rad in N m/deg?"),
        (springs(1e3), "Is stiffness_nm_per_rad in N mm/rad?"),
        (bars(1e4), "Is inertia_kg_m2 in kg cm2?"),
        (bars(1e7), "Is inertia_kg_m2 in g cm2?"),
    ] {
        assert!(said.contains(mistake) && !said.contains("Has torque_l_nm the sign"), "{said}");
    }
}

#[test]
fn a_handle_that_was_not_as_stated_is_refused() {
    let records = |trials: &[RigTrial], of: fn(&RigTrial) -> bool| -> Vec<_> {
        trials.iter().filter(|trial| of(trial)).map(|trial| trial.record.clone()).collect()
    };
    let is_clamped = |trial: &RigTrial| trial.load == RigLoad::ClampedHandle;
    let not_clamped = said(|trials| {
        let free = records(trials, |trial| {
            trial.load == RigLoad::EmptyHandle && trial.motion == crate::dataset::RigTrialMotion::Multisine
        });
        let clamped = trials.iter_mut().filter(|trial| is_clamped(trial));
        clamped.zip(free).for_each(|(trial, record)| trial.record = record);
    });
    assert!(not_clamped.contains("Was the handle clamped?"), "{not_clamped}");
    let clamped_still = said(|trials| {
        let stopped = records(trials, is_clamped);
        let empty = trials.iter_mut().filter(|trial| {
            trial.load == RigLoad::EmptyHandle && trial.motion == crate::dataset::RigTrialMotion::Multisine
        });
        empty.zip(stopped).for_each(|(trial, record)| trial.record = record);
    });
    assert!(clamped_still.contains("Was the handle empty and free?"), "{clamped_still}");
}

#[test]
fn odd_rigs_that_are_right_contradict_nothing() {
    let soft = Lever { inertia_kg_m2: 0.002, damping_nm_s_per_rad: 0.25, stiffness_nm_per_rad: 350.0 };
    let usual = || TrueRig::usual(13);
    for rig in [
        usual(),
        yielding_rig(14),
        TrueRig { torque_gain: 2.2, angle_gain: 0.5, ..usual() },
        TrueRig { torque_gain: 0.5, angle_gain: 1.8, ..usual() },
        TrueRig { encoder_bits: 13, sample_rate_hz: 1000.0, ..usual() },
        TrueRig { servo_hz: 8.0, torque_cutoff_hz: 15.0, ..usual() },
        TrueRig { torque_delay_s: 0.008, ..usual() },
        TrueRig { lever: soft, bearing_friction_nm: 0.1, drift_nm: 0.05, ..usual() },
        // An offset that drifts by half of what the smaller weight makes.
        TrueRig { drift_nm: 0.5, ..usual() },
    ] {
        let trials: RigTrials = rig_trials(&rig, ALL_LOADS, |_| 1.0);
        let prepared = PreparedRig::new(&trials, |_| true, None).unwrap();
        let found = contradictions(&prepared, trials.lever);
        assert!(found.is_empty(), "{rig:?}: {}", found[0]);
    }
}

#[test]
fn ramps_of_another_day_that_cannot_be_right_are_not_compared_with_the_calibration() {
    let rig = TrueRig::usual(12);
    let calibration =
        calibrate(&rig_trials(&rig, ALL_LOADS, |_| 1.0), "ramphold", "rig").unwrap().calibration;
    for (angle, torque, mistake) in [
        (57.3, 1.0, "Is theta_m_rad in degrees?"),
        (1.0, 1000.0, "Is torque_l_nm in mN m?"),
        (1.0, -1.0, "Has torque_l_nm the sign"),
        (1.0, 20.0, "Was the handle empty and free?"),
    ] {
        let mut trials = of_the_day(&TrueRig { seed: 13, ..rig.clone() });
        for trial in &mut trials.trials {
            trial.record.theta_m_rad.iter_mut().for_each(|value| *value *= angle);
            trial.record.torque_l_nm.iter_mut().for_each(|value| *value *= torque);
        }
        // The calibration knows the lever, whether the session of today says what it is or not.
        trials.lever = None;
        let error = compare(&trials, &calibration).unwrap_err().to_string();
        assert!(error.contains(mistake), "{error}");
    }
}
