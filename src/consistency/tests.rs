//! Mistakes that a session can have and still parse, each made in a sound session.

use super::{SignalCheck, check_with_gains, contradictions};
use crate::dataset::{Record, Session, Status, Subject, Trial};
use crate::wrist::Lever;

const RATE_HZ: f64 = 2000.0;
const ONSET_S: f64 = 0.6;

/// Three torques, two speeds, two repetitions; ramps that rise in 16 ms, a wrist of inertia, damping and stiffness.
fn sound() -> Session {
    let mut trials = Vec::new();
    for (velocity_rad_s, torque_nm) in [1.3, 3.0].into_iter().flat_map(|v| [0.9, 1.5, 2.1].map(|t| (v, t))) {
        for repetition in [1, 2] {
            let number = trials.len() as u32 + 1;
            trials.push(Trial {
                number,
                file: format!("trials/trial-{number:03}.csv"),
                velocity_rad_s,
                torque_nm,
                repetition,
                condition: None,
                onset_s: Some(ONSET_S),
                status: Status::Ok,
                extra: Default::default(),
                record: record(velocity_rad_s, torque_nm, f64::from(number)),
            });
        }
    }
    Session {
        subject: Subject { id: "S01".into() },
        sample_rate_hz: RATE_HZ,
        lever: Some(Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 }),
        recorded_filter: None,
        channel_ranges: Default::default(),
        trials,
    }
}

fn record(velocity_rad_s: f64, torque_nm: f64, phase: f64) -> Record {
    let samples = 1600;
    let time = |i: usize| i as f64 / RATE_HZ - ONSET_S;
    let smooth = |t: f64| {
        if t < 0.0 {
            0.0
        } else if t < 0.016 {
            t * t / 0.032
        } else {
            t - 0.008
        }
    };
    let angle = |t: f64| velocity_rad_s * (smooth(t) - smooth(t - 0.12 / velocity_rad_s));
    let step = 1.0 / RATE_HZ;
    let speed = |t: f64| (angle(t + step) - angle(t - step)) / (2.0 * step);
    let tremor = |i: usize| 0.004 * libm::sin(0.03 * i as f64 + phase);
    let torque =
        |i: usize| torque_nm * (1.0 + tremor(i)) + 0.3 + 15.0 * angle(time(i)) + 0.5 * speed(time(i));
    // Rectified noise of a muscle.
    let active = |i: usize, level: f64| level * libm::sin(1.7 * i as f64 + phase).abs();
    Record {
        start_s: 0.0,
        theta_m_rad: (0..samples).map(|i| -0.07 + angle(time(i)) + 1e-5 * libm::sin(i as f64)).collect(),
        torque_l_nm: (0..samples).map(torque).collect(),
        emg_fcr_mvc: Some((0..samples).map(|i| active(i, 0.2)).collect()),
        emg_ecr_mvc: Some((0..samples).map(|i| active(i, 0.05)).collect()),
        ..Record::default()
    }
}

/// The checks that fail after `spoil`.
fn failed(spoil: impl Fn(&mut Session)) -> Vec<SignalCheck> {
    let mut session = sound();
    spoil(&mut session);
    contradictions(&session).iter().map(|one| one.check).collect()
}

fn each(spoil: impl Fn(&mut Trial)) -> impl Fn(&mut Session) {
    move |session| session.trials.iter_mut().for_each(&spoil)
}

/// The likely mistake that is named after `spoil`.
#[track_caller]
fn assert_named(spoil: impl Fn(&mut Session), check: SignalCheck, words: &str) {
    let mut session = sound();
    spoil(&mut session);
    let found = contradictions(&session);
    let one = found.iter().find(|one| one.check == check).unwrap_or_else(|| panic!("{check}: {found:?}"));
    assert!(one.to_string().contains(words), "{words:?} is not in: {one}");
}

fn scale(values: &mut [f64], factor: f64) {
    values.iter_mut().for_each(|value| *value *= factor);
}

#[test]
fn a_sound_session_is_not_refused() {
    assert_eq!(failed(|_| ()), []);
}

#[test]
fn a_left_hand_recorded_as_such_is_not_refused() {
    let mirrored = each(|trial| {
        scale(&mut trial.record.theta_m_rad, -1.0);
        scale(&mut trial.record.torque_l_nm, -1.0);
        (trial.velocity_rad_s, trial.torque_nm) = (-trial.velocity_rad_s, -trial.torque_nm);
    });
    assert_eq!(failed(mirrored), []);
}

#[test]
fn an_offset_of_the_gauge_is_not_refused() {
    assert_eq!(failed(each(|trial| trial.record.torque_l_nm.iter_mut().for_each(|x| *x -= 3.0))), []);
}

#[test]
fn units_of_the_angle() {
    assert_named(
        each(|t| scale(&mut t.record.theta_m_rad, 57.2958)),
        SignalCheck::RampSpeed,
        "57.34 times as fast as stated",
    );
    assert_named(each(|t| scale(&mut t.record.theta_m_rad, 57.2958)), SignalCheck::RampSpeed, "in degrees?");
    assert_named(each(|t| scale(&mut t.record.theta_m_rad, 1000.0)), SignalCheck::RampSpeed, "milliradians");
    assert_named(each(|t| t.velocity_rad_s *= 57.2958), SignalCheck::RampSpeed, "degrees a second");
}

#[test]
fn units_of_the_time() {
    let milliseconds = |session: &mut Session| {
        session.sample_rate_hz /= 1000.0;
        for trial in &mut session.trials {
            trial.onset_s = trial.onset_s.map(|onset| onset * 1000.0);
        }
    };
    assert_named(milliseconds, SignalCheck::RampSpeed, "t_s in milliseconds");
}

#[test]
fn units_of_the_torque() {
    assert_named(each(|t| scale(&mut t.record.torque_l_nm, 100.0)), SignalCheck::SteadyTorque, "N cm");
    assert_named(each(|t| scale(&mut t.record.torque_l_nm, 1000.0)), SignalCheck::SteadyTorque, "mN m");
    assert_named(each(|t| t.torque_nm *= 100.0), SignalCheck::SteadyTorque, "torque_nm in N cm");
}

#[test]
fn signs() {
    let torque = each(|t| scale(&mut t.record.torque_l_nm, -1.0));
    assert_eq!(failed(torque), [SignalCheck::SteadyTorque, SignalCheck::Resistance]);
    let angle = each(|t| scale(&mut t.record.theta_m_rad, -1.0));
    assert_eq!(failed(angle), [SignalCheck::RampDirection, SignalCheck::Resistance]);
    let left = each(|t| {
        scale(&mut t.record.theta_m_rad, -1.0);
        scale(&mut t.record.torque_l_nm, -1.0);
    });
    assert_eq!(failed(&left), [SignalCheck::RampDirection, SignalCheck::SteadyTorque]);
    assert_named(left, SignalCheck::RampDirection, "left hand");
}

#[test]
fn onsets() {
    for (shift_s, words) in [(0.1, "ms late"), (0.02, "ms late"), (-0.02, "ms early"), (-0.1, "ms early")] {
        let shifted = each(move |t| t.onset_s = t.onset_s.map(|onset| onset + shift_s));
        assert_eq!(failed(&shifted), [SignalCheck::Onset], "{shift_s}");
        assert_named(shifted, SignalCheck::Onset, words);
    }
    // One trial is enough: its numbers would be nonsense.
    assert_eq!(failed(|session| session.trials[4].onset_s = Some(ONSET_S + 0.02)), [SignalCheck::Onset]);
}

#[test]
fn columns_and_rows() {
    let swapped = each(|t| std::mem::swap(&mut t.record.theta_m_rad, &mut t.record.torque_l_nm));
    assert_named(swapped, SignalCheck::RampSpeed, "swapped");
    let of_the_table = each(|t| std::mem::swap(&mut t.velocity_rad_s, &mut t.torque_nm));
    assert!(failed(of_the_table).contains(&SignalCheck::RampSpeed));
    let rows = |session: &mut Session| {
        let velocities: Vec<f64> = session.trials.iter().map(|t| t.velocity_rad_s).collect();
        let count = velocities.len();
        for (index, trial) in session.trials.iter_mut().enumerate() {
            trial.velocity_rad_s = velocities[(index + 3) % count];
        }
    };
    assert_named(rows, SignalCheck::RampSpeed, "another order than the records");
}

#[test]
fn a_record_in_the_row_of_another_condition_is_told_by_its_number() {
    let exchange = |a: usize, b: usize| {
        move |session: &mut Session| {
            let record = session.trials[a].record.clone();
            session.trials[a].record = std::mem::replace(&mut session.trials[b].record, record);
        }
    };
    // Trials 1 and 5 have 0.9 and 2.1 N m, trials 3 and 9 have 1.3 and 3.0 rad/s.
    assert_named(
        exchange(0, 4),
        SignalCheck::SteadyTorque,
        "trials 1, 5: the torque before the ramp of trial 1",
    );
    assert_named(exchange(2, 8), SignalCheck::RampSpeed, "trials 3, 9: the ramp of trial 3");
}

#[test]
fn the_torque_of_one_trial_with_another_sign_or_unit_is_told_by_its_number() {
    let one =
        |factor: f64| move |session: &mut Session| scale(&mut session.trials[2].record.torque_l_nm, factor);
    assert_named(
        one(-1.0),
        SignalCheck::SteadyTorque,
        "trial 3: the torque before the ramp of trial 3 is -1.8 N m",
    );
    assert_named(one(-1.08), SignalCheck::SteadyTorque, "Is its sign turned?");
    assert_named(one(100.0), SignalCheck::SteadyTorque, "in another unit");
    assert_named(one(0.1), SignalCheck::SteadyTorque, "in another unit");
    let half = |session: &mut Session| {
        session.trials.iter_mut().step_by(2).for_each(|trial| scale(&mut trial.record.torque_l_nm, -1.0));
    };
    assert_named(half, SignalCheck::SteadyTorque, "trials 1, 3, 5, 7, 9, 11: the torque");
}

#[test]
fn torques_that_nobody_held_well_are_not_refused() {
    let badly_held = |session: &mut Session| {
        for (place, trial) in session.trials.iter_mut().enumerate() {
            let by = [-0.5, 0.3, 0.6, -0.25, 0.1, -0.1, 0.45][place % 7] + 0.01 * place as f64;
            trial.record.torque_l_nm.iter_mut().for_each(|x| *x += by);
        }
    };
    assert_eq!(failed(badly_held), []);
}

#[test]
fn units_that_are_wrong_in_records_and_table_alike() {
    let degrees = each(|t| {
        scale(&mut t.record.theta_m_rad, 57.2958);
        t.velocity_rad_s *= 57.2958;
    });
    assert_named(degrees, SignalCheck::RampSpeed, "degrees");
    let torque = |factor: f64| {
        each(move |t| {
            scale(&mut t.record.torque_l_nm, factor);
            t.torque_nm *= factor;
        })
    };
    assert_named(torque(1000.0), SignalCheck::SteadyTorque, "mN m");
    assert_named(torque(1e300), SignalCheck::SteadyTorque, "no joint holds more");
    assert_eq!(failed(torque(100.0)), [], "a knee");
}

#[test]
fn an_angle_that_no_wrist_has() {
    let elsewhere = each(|t| t.record.theta_m_rad.iter_mut().for_each(|x| *x += std::f64::consts::PI));
    assert_named(elsewhere, SignalCheck::AngleRange, "zeroed elsewhere");
}

#[test]
fn emg_that_has_an_offset_or_is_no_fraction() {
    let raw = |offset: f64| {
        each(move |t| {
            let signal = t.record.emg_fcr_mvc.as_mut().unwrap();
            let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            signal.iter_mut().enumerate().for_each(|(i, x)| *x = offset + *x * sign(i));
        })
    };
    assert_eq!(failed(raw(0.0)), [], "the analysis rectifies raw EMG");
    assert_named(raw(0.1), SignalCheck::Emg, "offset");
    let both = |factor: f64| {
        each(move |t| {
            scale(t.record.emg_fcr_mvc.as_mut().unwrap(), factor);
            scale(t.record.emg_ecr_mvc.as_mut().unwrap(), factor);
        })
    };
    assert_named(both(100.0), SignalCheck::Emg, "percent");
    assert_named(both(1e-3), SignalCheck::Emg, "volts");
    assert_eq!(failed(each(|t| (t.record.emg_fcr_mvc, t.record.emg_ecr_mvc) = (None, None))), []);
}

#[test]
fn units_of_the_lever() {
    let lever = |session: &mut Session| session.lever.as_mut().unwrap().inertia_kg_m2 *= 1e4;
    assert_named(lever, SignalCheck::Lever, "kg cm2");
    let damping = |session: &mut Session| session.lever.as_mut().unwrap().damping_nm_s_per_rad = 400.0;
    assert_named(damping, SignalCheck::Lever, "a damping ratio of 166.7; expected at most 10");
    let badly_known = |session: &mut Session| session.lever.as_mut().unwrap().damping_nm_s_per_rad = 8.0;
    assert_eq!(failed(badly_known), []);
}

/// Each value of a channel stands until the next of every `samples`-th.
fn hold(values: &mut [f64], samples: f64) {
    let measured = values.to_vec();
    for (at, value) in values.iter_mut().enumerate() {
        let last = libm::floor(at as f64 / samples) * samples;
        *value = measured[libm::ceil(last) as usize];
    }
}

/// Values in steps of an instrument's resolution.
fn in_steps(values: &mut [f64], step: f64) {
    values.iter_mut().for_each(|value| *value = step * libm::round(*value / step));
}

#[test]
fn a_record_that_is_there_twice_is_refused_with_its_trials() {
    let copy = |session: &mut Session| session.trials[7].record = session.trials[6].record.clone();
    assert_eq!(failed(copy), [SignalCheck::RepeatedRecord]);
    assert_named(copy, SignalCheck::RepeatedRecord, "trials 7, 8: their angle and torque are equal");
    let rejected = |session: &mut Session| {
        copy(session);
        session.trials[7].status = Status::Rejected;
    };
    assert_eq!(failed(rejected), []);
    // Cut elsewhere, or with another offset, it passed for a repetition.
    let cut = |session: &mut Session| {
        copy(session);
        let record = &mut session.trials[7].record;
        for signal in [&mut record.theta_m_rad, &mut record.torque_l_nm]
            .into_iter()
            .chain(record.emg_fcr_mvc.as_mut())
            .chain(record.emg_ecr_mvc.as_mut())
        {
            signal.drain(..7);
        }
        record.start_s += 7.0 / RATE_HZ;
    };
    assert_eq!(failed(cut), [SignalCheck::RepeatedRecord]);
    let shifted = |session: &mut Session| {
        copy(session);
        session.trials[7].record.torque_l_nm.iter_mut().for_each(|torque| *torque += 1e-4);
    };
    assert_named(
        shifted,
        SignalCheck::RepeatedRecord,
        "trials 7, 8: their angles and torques differ by constants",
    );
    let computed = |session: &mut Session| {
        copy(session);
        for trial in &mut session.trials[6..8] {
            trial.record.torque_l_nm[..100].fill(2.1);
        }
    };
    assert!(!failed(computed).contains(&SignalCheck::RepeatedRecord), "a torque without noise is computed");
}

#[test]
fn a_slower_channel_whose_values_were_repeated_is_refused() {
    for samples in [2.0, 2.5, 4.0, 5.0, 8.0] {
        let torque = each(|trial| hold(&mut trial.record.torque_l_nm, samples));
        assert_eq!(failed(torque), [SignalCheck::HeldSamples], "torque, {samples}");
    }
    assert_named(
        each(|trial| hold(&mut trial.record.torque_l_nm, 5.0)),
        SignalCheck::HeldSamples,
        "each value stands for 5 samples, as if it were measured at 400 Hz",
    );
    assert_named(
        each(|trial| hold(&mut trial.record.theta_m_rad, 4.0)),
        SignalCheck::HeldSamples,
        "column theta_m_rad of the records",
    );
}

#[test]
fn a_single_trial_whose_values_were_repeated_is_named() {
    assert_named(
        |session| hold(&mut session.trials[4].record.torque_l_nm, 4.0),
        SignalCheck::HeldSamples,
        "trial 5: during the ramps",
    );
}

#[test]
fn coarse_steps_of_an_instrument_are_no_repeated_values() {
    for (angle_rad, torque_nm) in [(3.8e-4, 1e-3), (1.5e-3, 0.01), (1.0e-4, 0.1), (3.0e-3, 0.05)] {
        let coarse = each(|trial| {
            in_steps(&mut trial.record.theta_m_rad, angle_rad);
            in_steps(&mut trial.record.torque_l_nm, torque_nm);
        });
        assert!(!failed(coarse).contains(&SignalCheck::HeldSamples), "{angle_rad} rad, {torque_nm} N m");
    }
}

#[test]
fn a_ramp_that_takes_seconds_after_a_hold_that_settled_is_not_taken_for_a_late_one() {
    let slow = each(|trial| {
        let speed_rad_s = 0.05;
        let time_s = |i: usize| i as f64 / RATE_HZ - ONSET_S;
        trial.velocity_rad_s = speed_rad_s;
        trial.record.theta_m_rad = (0..8000)
            .map(|i| {
                let settling = if time_s(i) < -0.25 { -0.001 } else { 0.0 };
                -0.07 + settling + speed_rad_s * (time_s(i) - 0.008).clamp(0.0, 2.4)
            })
            .collect();
        trial.record.torque_l_nm = (0..8000).map(|i| trial.torque_nm + 0.3 + 1e-4 * (i % 7) as f64).collect();
        (trial.record.emg_fcr_mvc, trial.record.emg_ecr_mvc) = (None, None);
    });
    assert!(!failed(slow).contains(&SignalCheck::Onset));
}

/// The names of the checks that a session with one wrong value, at the time `at_s` after the onset of trial 3, fails.
fn with_wrong_sample(at_s: f64, width: usize, spoil: impl Fn(&mut Record, usize)) -> Vec<SignalCheck> {
    failed(|session| {
        let sample = ((ONSET_S + at_s) * RATE_HZ) as usize;
        (sample..sample + width).for_each(|at| spoil(&mut session.trials[2].record, at));
    })
}

#[test]
fn wrong_samples_of_the_torque_before_a_ramp_are_found() {
    for at_s in [-0.55, -0.3, -0.1, -0.05] {
        for width in [1, 2, 16] {
            let found = with_wrong_sample(at_s, width, |record, at| record.torque_l_nm[at] += 8.0);
            assert!(found.contains(&SignalCheck::Spike), "{at_s} s, {width}: {found:?}");
        }
    }
    assert_named(
        |session| session.trials[2].record.torque_l_nm[900] = 50.0,
        SignalCheck::Spike,
        "before the ramp, the sample at 0.45 s of trial 3 (trials/trial-003.csv, line 902) is 50 N m",
    );
}

#[test]
fn single_wrong_samples_of_a_ramp_are_found_in_either_channel() {
    for at_s in [-0.02, 0.0, 0.005, 0.016, 0.03, 0.08] {
        for width in [1, 2] {
            for nm in [8.0, -8.0, 1.0] {
                let found = with_wrong_sample(at_s, width, |record, at| record.torque_l_nm[at] += nm);
                assert!(found.contains(&SignalCheck::Spike), "{nm} N m at {at_s} s, {width}: {found:?}");
            }
            let found = with_wrong_sample(at_s, width, |record, at| record.theta_m_rad[at] -= 0.05);
            assert!(found.contains(&SignalCheck::Spike), "angle at {at_s} s, {width}: {found:?}");
        }
    }
    assert_named(
        |session| session.trials[2].record.torque_l_nm[1210] += 8.0,
        SignalCheck::Spike,
        "the sample at 0.605 s of trial 3 (trials/trial-003.csv, line 1212) is",
    );
}

#[test]
fn a_torque_at_the_end_of_its_converter() {
    let cut = each(|trial| {
        let most = trial.torque_nm + 1.6;
        trial.record.torque_l_nm.iter_mut().for_each(|torque| *torque = torque.min(most));
    });
    assert_named(cut, SignalCheck::Clipped, "to the last digit, the farthest of the record");
}

#[test]
fn a_channel_at_the_end_of_the_range_that_the_session_gives() {
    let with_range = |high: f64| {
        move |session: &mut Session| {
            session.channel_ranges.insert("torque_l_nm".into(), [-20.0, high]);
        }
    };
    assert_eq!(failed(with_range(20.0)), []);
    assert_named(with_range(3.0), SignalCheck::Clipped, "field channels.torque_l_nm.range");
    assert_named(with_range(3.0), SignalCheck::Clipped, "values between -20 and 3");
}

#[test]
fn a_torque_that_is_stated_as_0() {
    let words = "0 N m, which says that the wrist is relaxed";
    assert_named(each(|trial| trial.torque_nm = 0.0), SignalCheck::SteadyTorque, words);
    assert_named(|session| session.trials[0].torque_nm = 0.0, SignalCheck::SteadyTorque, words);
    // Relaxed trials among others, with a gauge that has an offset of 0.3 N m.
    let relaxed = |session: &mut Session| {
        for trial in session.trials.iter_mut().filter(|trial| trial.torque_nm < 1.0) {
            trial.record.torque_l_nm.iter_mut().for_each(|torque| *torque -= 0.9);
            trial.torque_nm = 0.0;
        }
    };
    assert_eq!(failed(relaxed), []);
}

/// Weights on half the arm that was stated made both gains two, and the fit's numbers wrong by a factor of two.
#[test]
fn a_calibration_that_makes_a_sound_session_contradict_its_table_is_refused_with_what_may_be_wrong() {
    let session = sound();
    assert_eq!(check_with_gains(&session, [1.0, 1.0], &[]), Ok(()));
    assert_eq!(check_with_gains(&session, [1.2, 0.8], &[]), Ok(()), "such a rig may be");
    for (gains, check) in [
        ([2.0, 1.0], SignalCheck::RampSpeed),
        ([0.5, 1.0], SignalCheck::RampSpeed),
        ([1.0, 2.0], SignalCheck::SteadyTorque),
    ] {
        let found = check_with_gains(&session, gains, &[]).unwrap_err();
        assert_eq!(found.0.iter().map(|one| one.check).collect::<Vec<_>>(), [check], "{gains:?}");
        let told = found.to_string();
        assert!(
            told.contains("corrected by the calibration") && told.contains("--calibration none"),
            "{told}"
        );
        assert_eq!(check_with_gains(&session, gains, &[check]), Ok(()));
    }
}

#[test]
fn an_angle_that_starts_anew_at_a_full_turn_is_told_as_that() {
    let restarted = |angle: &f64| angle.rem_euclid(std::f64::consts::TAU);
    let restart = |trial: &mut Trial| {
        trial.record.theta_m_rad = trial.record.theta_m_rad.iter().map(restarted).collect();
    };
    for some in [1, 4] {
        let mut session = sound();
        session.trials.iter_mut().step_by(some).for_each(restart);
        let found = contradictions(&session);
        let speed = found.iter().find(|one| one.check == SignalCheck::RampSpeed).unwrap();
        let mistake = speed.likely_mistake.as_deref().unwrap_or_default();
        assert!(mistake.contains("start anew at a full turn"), "every {some}: {speed:?}");
    }
}
