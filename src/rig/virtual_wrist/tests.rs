//! The virtual wrist as a protocol meets it.

use std::path::Path;

use super::*;
use crate::protocol::Protocol;
use crate::rig::Upcoming;

const RATE: f64 = 2500.0;

fn limits() -> Limits {
    let text = include_str!("../../../protocols/quick.json");
    Protocol::parse(text, "quick.json").unwrap().limits.clone()
}

fn armed(person: Person, setup: Setup, seed: u64) -> ArmedVirtualWrist {
    let Ok(armed) = VirtualWrist::new(person, setup, seed, RATE).arm(ArmingConsent::given(), &limits())
    else {
        panic!("the virtual wrist is always ready")
    };
    armed
}

fn upcoming(velocity_rad_s: f64, position: u32) -> Upcoming {
    let key = TrialKey { practice: false, position, rejections: 0 };
    Upcoming { key, velocity_rad_s, progress: 0.0, rest_s: 5.0 }
}

/// Shows the target until the subject has settled, then ramps; the samples of both.
fn trial(wrist: &mut ArmedVirtualWrist, target_nm: f64, trial: Upcoming) -> (Vec<Sample>, Vec<Sample>) {
    let mut shown_nm = 0.0;
    let mut hold = Vec::new();
    for _ in 0..10_000 {
        let cue = Cue::Target { target_nm, shown_nm, trial };
        let sample = wrist.exchange(&Command { motor: Motor::Follow { angle_rad: 0.0 }, cue }).unwrap();
        shown_nm += 0.12 * (sample.torque_l_nm - Setup::default().gauge_offset_nm - shown_nm);
        hold.push(sample);
    }
    let sweep = crate::protocol::Sweep::new(0.14, trial.velocity_rad_s, 0.020).unwrap();
    let ramp = (1..=500)
        .map(|n| {
            let motor = Motor::Follow { angle_rad: sweep.at(f64::from(n) / RATE).angle_rad };
            wrist.exchange(&Command { motor, cue: Cue::Moving }).unwrap()
        })
        .collect();
    (hold, ramp)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

fn quiet() -> (Person, Setup) {
    let mut person = Person::default();
    person.voluntary =
        person::VoluntaryParameters { wander: 0.0, tremor: 0.0, first_error: 0.0, ..person.voluntary };
    person.spread = person::Spread {
        short_range_stiffness: 0.0,
        stiffness_decrement: 0.0,
        elastic_limit: 0.0,
        flexor_emg: 0.0,
        cocontraction: 0.0,
    };
    let setup = Setup { gauge_noise_nm: 0.0, gauge_step_nm: 0.0, ..Setup::default() };
    (person, setup)
}

#[test]
fn the_person_finds_the_target_and_holds_it_as_unsteadily_as_people_do() {
    let mut wrist = armed(Person::default(), Setup { gauge_noise_nm: 0.0, ..Setup::default() }, 1);
    let (hold, _) = trial(&mut wrist, 1.5, upcoming(1.3, 1));
    let torque =
        |samples: &[Sample]| samples.iter().map(|sample| sample.torque_l_nm - 0.03).collect::<Vec<_>>();
    let reaction = torque(&hold[..400]);
    assert!(reaction.iter().all(|torque| torque.abs() < 0.01), "nobody reacts within 160 ms");
    let settled = torque(&hold[5000..]);
    let average = mean(settled.iter().copied());
    let deviation = mean(settled.iter().map(|torque| (torque - average) * (torque - average))).sqrt();
    assert!((average / 1.5 - 1.0).abs() < 0.01, "mean {average}");
    assert!(deviation / 1.5 > 0.003 && deviation / 1.5 < 0.015, "deviation {deviation}");
}

#[test]
fn parameters_follow_figure_5_of_the_paper() {
    let person = Person::default();
    let close =
        |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 0.03, "{value}, not {expected}");
    for velocity in [1.3, 3.25] {
        close(person.short_range_stiffness_nm_per_rad.at(velocity, 0.9), 15.0);
        close(person.short_range_stiffness_nm_per_rad.at(velocity, 2.1), 23.0);
    }
    for torque in [0.9, 1.5, 2.1] {
        close(person.elastic_limit_rad.at(1.3, torque), 0.025);
        close(person.elastic_limit_rad.at(3.25, torque), 0.065);
        for velocity in [1.3, 1.95, 2.6, 3.25] {
            let k_dec = person.stiffness_decrement_nm_per_rad.at(velocity, torque);
            assert!(k_dec > 0.0 && k_dec < person.short_range_stiffness_nm_per_rad.at(velocity, torque));
        }
    }
    let (k_dec, x_e) = (person.stiffness_decrement_nm_per_rad, person.elastic_limit_rad);
    assert!(k_dec.per_nm > 0.0 && k_dec.per_rad_s > 0.0 && x_e.per_nm < 0.0);
    assert!(person.interface_stiffness_nm_per_rad.per_rad_s < 0.0);
    assert_eq!(person.elastic_limit_rad.at(-2.0, -1.0), person.elastic_limit_rad.at(2.0, 1.0));
}

#[test]
fn the_ramp_reaches_its_velocity_and_the_muscle_resists_it() {
    let (person, setup) = quiet();
    let mut wrist = armed(person, setup, 1);
    let (hold, ramp) = trial(&mut wrist, 2.1, upcoming(3.25, 1));
    let start = hold[hold.len() - 1];
    let speed = (ramp[74].theta_m_rad - ramp[61].theta_m_rad) * RATE / 13.0;
    assert!((speed - 3.25).abs() < 0.3, "speed {speed}");
    // At 40 ms the muscle has yielded: between k_after and k_srs times the angle, less what the lags cost.
    let torque = ramp[99].torque_l_nm - start.torque_l_nm;
    assert!(torque > 1.0 && torque < 23.0 * 0.0975, "torque {torque}");
}

#[test]
fn the_mirrored_ramp_gives_the_mirrored_torque() {
    let (person, setup) = quiet();
    let rise = |velocity: f64, target: f64| {
        let setup = Setup { gauge_offset_nm: 0.0, ..setup.clone() };
        let mut wrist = armed(person.clone(), setup, 1);
        let (hold, ramp) = trial(&mut wrist, target, upcoming(velocity, 1));
        let start = hold[hold.len() - 1];
        ramp.iter().map(|sample| sample.torque_l_nm - start.torque_l_nm).collect::<Vec<_>>()
    };
    for (positive, negative) in rise(2.6, 1.5).into_iter().zip(rise(-2.6, -1.5)).take(100) {
        assert!((positive + negative).abs() < 0.01, "{positive} and {negative}");
    }
}

#[test]
fn the_reflex_comes_after_the_window_in_torque_and_shortly_before_its_end_in_emg() {
    let (person, setup) = quiet();
    let mut without = person.clone();
    without.reflex.gain_s_per_rad = 0.0;
    let ramp = |person: Person| trial(&mut armed(person, setup.clone(), 1), 1.5, upcoming(2.6, 1)).1;
    let (with, without) = (ramp(person), ramp(without));
    let difference = |n: usize| {
        (with[n].torque_l_nm - without[n].torque_l_nm).abs()
            + (with[n].theta_m_rad - without[n].theta_m_rad).abs()
    };
    assert!((0..100).all(|n| difference(n) == 0.0), "the window of 40 ms is free of reflexes");
    assert!(difference(200) > 0.3, "reflex torque at 80 ms: {}", difference(200));
    let level = |samples: &[Sample]| mean(samples.iter().map(|sample| sample.emg_fcr_mvc.unwrap().abs()));
    assert!(level(&with[120..200]) > 1.5 * level(&with[0..80]));
}

#[test]
fn emg_is_a_fraction_of_the_greatest_effort() {
    let mut wrist = armed(Person::default(), Setup::default(), 1);
    let mut effort = |direction| {
        let command = Command { motor: Motor::Follow { angle_rad: 0.0 }, cue: Cue::Effort(direction) };
        let samples: Vec<Sample> = (0..5000).map(|_| wrist.exchange(&command).unwrap()).collect();
        let late = &samples[2500..];
        [
            mean(late.iter().map(|sample| sample.torque_l_nm)),
            mean(late.iter().map(|sample| sample.emg_fcr_mvc.unwrap().abs())),
            mean(late.iter().map(|sample| sample.emg_ecr_mvc.unwrap().abs())),
        ]
    };
    let [torque, fcr, ecr] = effort(crate::rig::Direction::Flexion);
    assert!((torque - 12.0).abs() < 0.3 && (fcr - 1.0).abs() < 0.1 && ecr < 0.25, "{torque} {fcr} {ecr}");
    let [torque, fcr, ecr] = effort(crate::rig::Direction::Extension);
    assert!((torque + 8.0).abs() < 0.3 && fcr < 0.25 && (ecr - 1.0).abs() < 0.1, "{torque} {fcr} {ecr}");
    wrist.rescale_emg([2.0, 4.0]);
    let again = wrist.exchange(&Command { motor: Motor::Safe, cue: Cue::Rest }).unwrap();
    assert!(again.emg_ecr_mvc.unwrap().abs() < 1.0);
    assert_eq!(wrist.disarm().emg_scale, [2.0, 4.0]);
}

#[test]
fn a_trial_is_the_same_whatever_came_before_it() {
    let second = |before: &[u32]| {
        let mut wrist = armed(Person::default(), Setup::default(), 5);
        for position in before {
            trial(&mut wrist, 0.9, upcoming(1.3, *position));
            let rest = Command { motor: Motor::Follow { angle_rad: 0.0 }, cue: Cue::Rest };
            for _ in 0..12_500 {
                wrist.exchange(&rest).unwrap();
            }
        }
        trial(&mut wrist, 2.1, upcoming(2.6, 9))
    };
    let alone = second(&[]);
    assert!(alone == second(&[1]) && alone == second(&[2, 3]));
}

#[test]
fn trials_and_seeds_differ() {
    let of = |seed, position| {
        trial(&mut armed(Person::default(), Setup::default(), seed), 2.1, upcoming(2.6, position))
    };
    assert!(of(5, 1) != of(5, 2));
    assert!(of(5, 1) != of(6, 1));
}

#[test]
fn after_a_trial_the_limb_comes_to_rest() {
    let mut wrist = armed(Person::default(), Setup { gauge_noise_nm: 0.0, ..Setup::default() }, 1);
    trial(&mut wrist, 2.1, upcoming(3.25, 1));
    let rest = Command { motor: Motor::Follow { angle_rad: 0.0 }, cue: Cue::Rest };
    let last = (0..5000).map(|_| wrist.exchange(&rest).unwrap()).last().unwrap();
    assert!(last.theta_m_rad.abs() < 1e-4 && (last.torque_l_nm - 0.03).abs() < 1e-3, "{last:?}");
}

#[test]
fn mechanisms_of_the_catalogue_act_in_the_virtual_wrist() {
    let (person, setup) = quiet();
    let torque = |mechanisms: &str| {
        let mechanisms = serde_json::from_str(mechanisms).unwrap();
        let setup = Setup { mechanisms, ..setup.clone() };
        let (hold, ramp) = trial(&mut armed(person.clone(), setup, 1), 2.1, upcoming(2.6, 1));
        ramp.iter().map(|sample| sample.torque_l_nm - hold[hold.len() - 1].torque_l_nm).collect::<Vec<_>>()
    };
    let base = torque("[]");
    let gained = torque(r#"[{"mechanism":"torque_gain","parameters":{"factor":1.1}}]"#);
    for (gained, base) in gained.iter().zip(&base).take(100) {
        assert!((gained - 1.1 * base).abs() < 0.02);
    }
    let late = torque(r#"[{"mechanism":"channel_skew","parameters":{"delay_s":0.0008}}]"#);
    for n in 2..100 {
        assert!((late[n] - base[n - 2]).abs() < 1e-4, "sample {n}");
    }
    let damped = torque(r#"[{"mechanism":"joint_damping","parameters":{"b_j_nm_s_per_rad":0.05}}]"#);
    assert!((damped[60] - base[60]).abs() > 0.03);
    // A virtual person does not know of the ramp before it begins.
    let drifting =
        torque(r#"[{"mechanism":"torque_drift","parameters":{"slope_nm_per_s":3,"start_s":-0.01}}]"#);
    assert!((drifting[0] - base[0]).abs() < 1e-3, "no step at the onset: {} N m", drifting[0] - base[0]);
    assert!((drifting[60] - base[60]).abs() > 0.01);
}

#[test]
fn drawn_persons_are_reproducible_and_differ() {
    assert_eq!(Person::drawn("S01"), Person::drawn("S01"));
    let stiffness = |id: &str| Person::drawn(id).short_range_stiffness_nm_per_rad.at_lowest;
    let all: Vec<f64> = (1..=200).map(|number| stiffness(&format!("S{number:02}"))).collect();
    assert!((mean(all.iter().copied()) / 15.0 - 1.0).abs() < 0.03);
    assert!(all.iter().all(|value| *value > 9.0 && *value < 25.0) && stiffness("S01") != stiffness("S02"));
}

#[test]
fn a_person_survives_writing_and_reading_and_fields_left_out_get_their_defaults() {
    let person = Person::drawn("S07");
    let text = serde_json::to_string_pretty(&person).unwrap();
    assert_eq!(Person::parse(&text, Path::new("s07.json")).unwrap(), person);
    let least =
        Person::parse(r#"{"format": "ramphold-person/1", "id": "V00"}"#, Path::new("v.json")).unwrap();
    assert_eq!(least, Person::default());
}

#[test]
fn a_person_that_cannot_be_is_refused_with_file_and_field() {
    for (text, parts) in [
        ("{", vec!["p.json, line 1"]),
        (r#"{"format": "ramphold-person/2", "id": "A"}"#, vec!["field format", "ramphold-person/1"]),
        (r#"{"format": "ramphold-person/1", "id": ""}"#, vec!["field id"]),
        (r#"{"format": "ramphold-person/1", "id": "A", "wight": 70}"#, vec!["wight"]),
        (
            r#"{"format": "ramphold-person/1", "id": "A", "joint_inertia_kg_m2": -1}"#,
            vec!["field joint_inertia_kg_m2: -1", "above 0"],
        ),
        (
            r#"{"format": "ramphold-person/1", "id": "A", "voluntary": {"wander": "much"}}"#,
            vec!["field voluntary.wander", "much"],
        ),
        (
            r#"{"format": "ramphold-person/1", "id": "A", "voluntary": {"reaction_s": 3.0}}"#,
            vec!["field voluntary.reaction_s: 3", "at most 2 s"],
        ),
    ] {
        let message = Person::parse(text, Path::new("p.json")).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in: {message}");
        }
    }
}

#[test]
fn the_schema_of_subjects_beside_the_protocols_is_that_of_the_types() {
    let text = person_schema_text();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/person.schema.json");
    let hint = "write it anew with: ramphold schema person > protocols/person.schema.json";
    assert!(std::fs::read_to_string(path).unwrap_or_default() == text, "{hint}");
    assert!(text.contains("Assumed: "), "what no source gives is marked");
    let schema = serde_json::from_str(&text).unwrap();
    assert!(jsonschema::is_valid(&schema, &serde_json::to_value(Person::drawn("S01")).unwrap()));
    assert!(!jsonschema::is_valid(&schema, &serde_json::json!({ "kind": "virtual", "id": 3 })));
}

#[test]
fn a_rig_file_is_read_and_a_bad_one_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.json");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        RigFile::read(&path)
    };
    let RigFile::Virtual(setup) =
        read(r#"{"kind": "virtual", "lever": null, "gauge_noise_nm": 0.02}"#).unwrap();
    assert_eq!((setup.lever, setup.gauge_noise_nm, setup.servo_bandwidth_hz), (None, 0.02, 80.0));
    for (text, part) in [
        ("{}", "kind"),
        (r#"{"kind": "steam"}"#, "steam"),
        (r#"{"kind": "virtual", "gauge": 1}"#, "gauge"),
        (r#"{"kind": "virtual", "servo_bandwidth_hz": 0}"#, "field servo_bandwidth_hz: 0"),
    ] {
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains("rig.json") && message.contains(part), "{part:?} is not in: {message}");
    }
}

/// A rig with every sensor, without quantisation and noise that would matter.
fn with_all_sensors() -> (Person, Setup) {
    let (person, setup) = quiet();
    let setup = Setup {
        encoder_counts_per_revolution: 1e9,
        handle_encoder_counts_per_revolution: Some(1e9),
        accelerometer_noise_rad_s2: Some(0.0),
        hand_load_cell_noise_nm: Some(0.0),
        joint_encoder_counts_per_revolution: Some(1e9),
        ..setup
    };
    (person, setup)
}

#[test]
fn the_further_sensors_obey_the_equations_of_lever_and_handle() {
    for rigid in [false, true] {
        let (person, mut setup) = with_all_sensors();
        if rigid {
            setup.lever = None;
        }
        let mut wrist = armed(person, setup.clone(), 1);
        let (hold, ramp) = trial(&mut wrist, 1.5, upcoming(2.6, 1));
        let samples: Vec<Sample> = hold[9000..].iter().chain(&ramp[..100]).copied().collect();
        let further = |sample: usize, place: usize| samples[sample].further[place].unwrap();
        let torque = |sample: usize| samples[sample].torque_l_nm - setup.gauge_offset_nm;
        let mut largest: f64 = 0.0;
        for n in 2..samples.len() - 2 {
            let speed = |value: &dyn Fn(usize) -> f64| (value(n + 1) - value(n - 1)) * RATE / 2.0;
            let (motor, handle) = (|n: usize| samples[n].theta_m_rad, |n: usize| further(n, 0));
            let acceleration = (handle(n + 1) - 2.0 * handle(n) + handle(n - 1)) * RATE * RATE;
            largest = largest.max(further(n, 1).abs());
            let off = (further(n, 1) - acceleration).abs();
            assert!(off < 40.0, "rigid {rigid}, sample {n}: {} or {acceleration} rad/s2", further(n, 1));
            let Some(lever) = setup.lever else {
                assert!((handle(n) - motor(n)).abs() < 1e-9 && (further(n, 2) - torque(n)).abs() < 1e-9);
                continue;
            };
            // Eq. 5 and Eq. 3.
            let bent = lever.stiffness_nm_per_rad * (motor(n) - handle(n))
                + lever.damping_nm_s_per_rad * (speed(&motor) - speed(&handle));
            assert!((bent - torque(n)).abs() < 0.05, "sample {n}: {bent} or {} N m", torque(n));
            let inertial = lever.inertia_kg_m2 * further(n, 1);
            let left = torque(n) - further(n, 2) - inertial;
            assert!(left.abs() < 1e-6, "sample {n}: {left} N m");
            // Eq. 6, with the person's stiffness of the interface while nothing moves.
            if n < 900 {
                let stiffness = torque(n) / (handle(n) - further(n, 3));
                assert!((200.0..400.0).contains(&stiffness), "sample {n}: {stiffness} N m/rad");
            }
        }
        assert!(largest > 100.0, "the handle is accelerated: {largest} rad/s2");
    }
}
