//! Recordings with several ramps.

use super::*;

#[test]
fn a_ramp_too_near_to_the_ends_of_a_long_record_is_left_out_and_told() {
    let long = columns(1.3).into_iter().zip(columns(2.6)).map(|(first, second)| [first, second].concat());
    let mut long = table("long", long.collect::<Vec<_>>().try_into().unwrap());
    long.columns[0].1 = (0..2 * SAMPLES).map(|i| i as f64).collect();
    long.columns[1].1[SAMPLES..].iter_mut().for_each(|angle| *angle -= 0.14_f64.to_degrees());
    let long_record = LongRecord { ramp_column: None, threshold: 0.5, before_s: 0.6, after_s: 0.25 };
    let imported = import(vec![long], &Mapping { long_record: Some(long_record), ..mapping() }).unwrap();
    assert_eq!(imported.sources.len(), 1);
    assert!(
        imported.left_out[0].contains("expected long_record.before_s (0.6 s)"),
        "{:?}",
        imported.left_out
    );
}

/// A long record of ramps of these speeds, each of which the motor leaves again in 0.5 s.
fn long_record(speeds_rad_s: &[f64]) -> SourceTable {
    let mut long = [const { Vec::new() }; 3];
    for speed_rad_s in speeds_rad_s {
        let [_, angle, torque] = columns(*speed_rad_s);
        let (first, last) = (angle[0], angle[SAMPLES - 1]);
        let samples = (0.5 * RATE_HZ) as usize;
        let back = (0..2 * samples).map(|i| last + (first - last) * (i as f64 / samples as f64).min(1.0));
        long[1].extend(angle.iter().copied().chain(back));
        long[2].extend(torque.iter().copied().chain((0..2 * samples).map(|_| torque[0])));
    }
    long[0] = (0..long[1].len()).map(|i| 1e3 * i as f64 / RATE_HZ).collect();
    table("long", long)
}

fn cut(long: SourceTable) -> ImportedSession {
    let long_record = LongRecord { ramp_column: None, threshold: 0.5, before_s: 0.4, after_s: 0.25 };
    import(vec![long], &Mapping { long_record: Some(long_record), ..mapping() }).unwrap()
}

#[test]
fn a_sample_that_is_off_hides_no_ramp_of_a_long_record() {
    let mut long = long_record(&[1.3, 2.6, 1.3]);
    let sound = cut(long.clone());
    assert!(sound.sources.len() == 3 && sound.left_out.is_empty(), "{:?}", sound.left_out);
    long.columns[1].1[SAMPLES + 700] = 90.0;
    let spike = cut(long);
    assert_eq!(spike.sources, sound.sources);
    assert_eq!(spike.session.trials[1].record, sound.session.trials[1].record);
}

#[test]
fn a_ramp_too_slow_beside_the_others_is_told() {
    let cut = cut(long_record(&[4.0, 0.5, 4.0]));
    assert_eq!(cut.sources.len(), 2);
    let told = &cut.left_out[..];
    assert!(told.len() == 1 && told[0].contains("slower than 0.3 times the fastest"), "{told:?}");
}

#[test]
fn a_second_ramp_of_a_recording_is_told_with_what_cuts_it() {
    let [time, angle, torque] = columns(1.3);
    let at_rest: Vec<f64> = angle.iter().rev().copied().collect();
    let twice = [
        (0..3 * SAMPLES).map(|i| time[1] * i as f64).collect(),
        [angle.clone(), at_rest, angle].concat(),
        [torque.clone(), torque.clone(), torque].concat(),
    ];
    let imported = import(vec![table("t1.csv", twice), table("t2.csv", columns(1.3))], &mapping()).unwrap();
    assert_eq!(imported.sources, ["t1.csv", "t2.csv"]);
    let told = &imported.left_out[..];
    assert!(told.len() == 1 && told[0].starts_with("t1.csv: another ramp begins "), "{told:?}");
    assert!(told[0].ends_with("cut the recording with long_record or trial_column"), "{told:?}");
}
