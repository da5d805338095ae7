//! `ramphold check`: what is right is said to be, what is wrong is said all at once.

use std::fs;

use ramphold::protocol::{Problem, Protocol, ProtocolError, schema_text};
use serde_json::{Value, json};

use crate::workspace::{output_of, ramphold};

const PAPER: &str = include_str!("../../protocols/de-vlugt-2011.json");
const QUICK: &str = include_str!("../../protocols/quick.json");

fn changed(change: impl FnOnce(&mut Value)) -> String {
    let mut protocol: Value = serde_json::from_str(PAPER).unwrap();
    change(&mut protocol);
    format!("{protocol:#}")
}

fn problems(text: &str) -> Vec<Problem> {
    match Protocol::parse(text, "p.json") {
        Err(ProtocolError::Invalid { problems, .. }) => problems,
        other => panic!("expected a list of problems, got {other:?}"),
    }
}

/// The only problem of the paper's protocol after a change, as "path is value | expected | to do".
fn problem_after(change: impl FnOnce(&mut Value)) -> String {
    let problems = problems(&changed(change));
    let [Problem { path, value, expected, advice, .. }] = &problems[..] else {
        panic!("expected one problem, got {problems:#?}")
    };
    format!("{path} is {} | {expected} | {advice}", value.as_deref().unwrap_or("missing"))
}

fn assert_problem(change: impl FnOnce(&mut Value), parts: &[&str]) {
    let problem = problem_after(change);
    for part in parts {
        assert!(problem.contains(part), "no {part:?} in:\n{problem}");
    }
}

#[test]
fn the_protocols_of_the_repository_are_valid_by_the_program_and_by_the_schema() {
    let schema: Value = serde_json::from_str(&schema_text()).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    for text in [PAPER, QUICK] {
        let protocol = Protocol::parse(text, "p.json").unwrap();
        assert_eq!(protocol.text(), text);
        let errors: Vec<String> = validator
            .iter_errors(&serde_json::from_str(text).unwrap())
            .map(|error| error.to_string())
            .collect();
        assert!(errors.is_empty(), "{errors:?}");
    }
    let wrong = serde_json::from_str(&changed(|p| p["velocities_rad_s"][2] = json!(130))).unwrap();
    assert!(!validator.is_valid(&wrong), "the schema knows the ranges");
}

#[test]
fn the_schema_file_is_what_the_types_say() {
    assert_eq!(
        include_str!("../../protocols/protocol.schema.json"),
        schema_text(),
        "run: ramphold schema > protocols/protocol.schema.json"
    );
}

#[test]
fn the_paper_s_protocol_has_the_paper_s_numbers() {
    let protocol = Protocol::parse(PAPER, "p.json").unwrap();
    assert_eq!(protocol.velocities_rad_s, [1.3, 1.95, 2.6, 3.25]);
    assert_eq!(protocol.torques_nm, [0.9, 1.5, 2.1]);
    assert_eq!((protocol.repetitions, protocol.trial_count()), (3, 36));
    assert_eq!((protocol.gate.band_fraction, protocol.gate.duration_s, protocol.rest_s), (0.025, 0.5, 5.0));
    assert_eq!((protocol.signal.sample_rate_hz, protocol.window_s), (2500.0, 0.040));
}

#[test]
fn a_protocol_made_by_a_program_is_checked_like_a_file() {
    let protocol = Protocol::parse(PAPER, "p.json").unwrap();
    let again = (*protocol).clone().validate().unwrap();
    assert_eq!(*again, *protocol);
    let mut wrong = (*protocol).clone();
    wrong.rest_s = f64::NAN;
    assert!(wrong.validate().unwrap_err().to_string().contains("rest_s is null"));
}

#[test]
fn everything_wrong_is_said_at_once_with_its_line() {
    let problems = problems(include_str!("../../fixtures/everything-wrong.json"));
    let places: Vec<String> =
        problems.iter().map(|problem| format!("{}: {}", problem.line, problem.path)).collect();
    insta::assert_snapshot!(places.join("\n"));
    let error =
        Protocol::parse(include_str!("../../fixtures/everything-wrong.json"), "wrong.json").unwrap_err();
    insta::assert_snapshot!(error.to_string());
}

#[test]
fn an_unknown_field_is_named_with_the_one_that_was_meant() {
    assert_problem(|p| p["rest"] = json!(5), &["rest is 5", "no field of this name", "did you mean rest_s?"]);
    assert_problem(|p| p["ramp"]["colour"] = json!("red"), &["ramp.colour is \"red\"", "| take it away"]);
    assert_problem(|p| p["order"]["max_run"] = json!(2), &["order.max_run is 2", "the fields here are kind"]);
}

#[test]
fn numbers_in_other_units_are_recognised_by_their_magnitude() {
    let cases: [(&str, Value, &str); 12] = [
        ("/velocities_rad_s/2", json!(130), "130 deg/s is 2.269 rad/s"),
        ("/torques_nm/0", json!(900), "900 mN m is 0.9 N m"),
        ("/ramp/amplitude_rad", json!(8), "8 degrees is 0.1396 rad"),
        ("/ramp/rise_time_s", json!(20), "20 ms is 0.02 s"),
        ("/ramp/return_velocity_rad_s", json!(29), "29 deg/s is 0.5061 rad/s"),
        ("/gate/band_fraction", json!(2.5), "2.5 percent is 0.025"),
        ("/gate/duration_s", json!(500), "500 ms is 0.5 s"),
        ("/rest_s", json!(5000), "5000 ms is 5 s"),
        ("/window_s", json!(40), "40 ms is 0.04 s"),
        ("/signal/sample_rate_hz", json!(2.5), "2.5 kHz is 2500 Hz"),
        ("/limits/acceleration_rad_s2", json!(200_000), "200000 deg/s2 is 3491 rad/s2"),
        ("/limits/torque_nm", json!(20_000), "20000 mN m is 20 N m"),
    ];
    for (pointer, value, expected) in cases {
        assert_problem(|p| *p.pointer_mut(pointer).unwrap() = value, &["this looks like", expected]);
    }
}

#[test]
fn a_type_that_is_wrong_is_said_with_what_belongs_there() {
    assert_problem(
        |p| p["rest_s"] = json!("5"),
        &["rest_s is \"5\"", "a number from 0 to 600", "without quotes"],
    );
    assert_problem(|p| p["repetitions"] = json!(2.5), &["repetitions is 2.5", "a whole number from 1"]);
    assert_problem(|p| p["repetitions"] = json!(-1), &["repetitions is -1", "a whole number from 1"]);
    assert_problem(|p| p["torques_nm"] = json!(0.9), &["torques_nm is 0.9", "a list of at least one"]);
    assert_problem(|p| p["torques_nm"] = json!([]), &["torques_nm is an empty list", "at least one"]);
    assert_problem(
        |p| p["limits"]["angle_rad"] = json!([0.2]),
        &["limits.angle_rad is [0.2]", "a list of 2"],
    );
    assert_problem(|p| p["order"] = json!("shuffled"), &["order is \"shuffled\"", "\"kind\"", "williams"]);
    assert_problem(|p| p["order"]["kind"] = json!("shufled"), &["order.kind", "did you mean \"shuffled\"?"]);
    assert_problem(|p| p["before"]["mvc"] = json!(3), &["before.mvc is 3", "an object or null"]);
    assert_problem(|p| p["format"] = json!("ramphold-protocol/2"), &["reads no other"]);
    let missing = |p: &mut Value| drop(p["ramp"].as_object_mut().unwrap().remove("hold_s"));
    assert_problem(
        missing,
        &["ramp.hold_s is missing", "Time for which the end angle is held", "add \"hold_s\""],
    );
}

#[test]
fn a_condition_that_breaks_a_limit_on_its_way_is_named() {
    let limit = |name: &'static str, value: Value| move |p: &mut Value| p["limits"][name] = value;
    assert_problem(limit("speed_rad_s", json!(3)), &["velocities_rad_s[3] is 3.25", "at most 3 rad/s"]);
    // pi 3.25 / (2 0.020) = 255.3, and 3.25 250 / 255.3 = 3.183
    assert_problem(
        limit("acceleration_rad_s2", json!(250)),
        &["velocities_rad_s[3]", "takes 255.3 rad/s2", "at most 3.183 rad/s", "at least 0.02042 s"],
    );
    // 2.1 + 23 0.14 = 5.32 at the end of a ramp whose muscle never yields
    assert_problem(limit("torque_nm", json!(5)), &["torques_nm[2] is 2.1", "5 N m", "up to 5.3"]);
    let problems = problems(&changed(limit("angle_rad", json!([-0.05, 0.1]))));
    assert_eq!(problems.len(), 4, "every velocity ends beyond the angle");
    assert_problem(
        |p| p["velocities_rad_s"] = json!([1.3, -1.3]),
        &["velocities_rad_s[1] is -1.3", "within -0.05 rad", "ends at -0.14 rad"],
    );
    assert_problem(limit("angle_rad", json!([0.01, 0.2])), &["limits.angle_rad[0]", "0 or less"]);
    assert_problem(|p| p["ramp"]["return_velocity_rad_s"] = json!(4.5), &["at most 4 rad/s"]);
}

#[test]
fn an_amplitude_too_short_for_the_window_is_named_with_its_velocity() {
    // 0.12 rad at 3.25 rad/s last 36.9 ms of the 40 ms; 3.25 0.040 = 0.13 rad would do.
    assert_problem(
        |p| p["ramp"]["amplitude_rad"] = json!(0.12),
        &["velocities_rad_s[3] is 3.25", "slows down after 0.03692 s", "at least 0.13", "at most 3 rad/s"],
    );
}

#[test]
fn fields_that_contradict_each_other_are_named() {
    assert_problem(
        |p| p["velocities_rad_s"][1] = json!(1.3),
        &["velocities_rad_s[1]", "velocities_rad_s[0] is the"],
    );
    assert_problem(|p| p["torques_nm"][0] = json!(0), &["torques_nm[0] is 0", "at least 0.01 N m"]);
    assert_problem(|p| p["gate"]["timeout_s"] = json!(0.5), &["gate.timeout_s", "more than gate.duration_s"]);
    assert_problem(|p| p["gate"]["delay_s"] = json!([2, 1]), &["gate.delay_s[1] is 1", "exchange the two"]);
    assert_problem(
        |p| {
            p["before"]["mvc"] = json!(null);
            p["gate"]["antagonist_limit_mvc"] = json!(0.1);
        },
        &["gate.antagonist_limit_mvc is 0.1", "add \"mvc\""],
    );
    assert_problem(
        |p| p["signal"]["filter"]["cutoff_hz"] = json!(1250),
        &["below half the sample rate, 1250 Hz"],
    );
    assert_problem(
        |p| p["signal"]["filter"]["cutoff_hz"] = json!(0.05),
        &["signal.filter.cutoff_hz is 0.05", "from 3.979 Hz up", "nothing of the 40 ms"],
    );
    assert_problem(
        |p| p["signal"]["filter"]["order"] = json!(9),
        &["signal.filter.order is 9", "from 1 to 8"],
    );
    assert_problem(
        |p| p["signal"]["filter"]["zero_phase"] = json!(true),
        &["signal.filter.zero_phase is true", "write false here"],
    );
    assert_problem(
        |p| p["signal"]["filter"]["order"] = json!(0),
        &["signal.filter.order is 0", "from 1 to 8"],
    );
    let rise_of_3_samples = |p: &mut Value| {
        p["ramp"]["rise_time_s"] = json!(0.001);
        p["limits"] = json!({
            "angle_rad": [-0.05, 0.2], "speed_rad_s": 4, "acceleration_rad_s2": 10_000, "torque_nm": 50
        });
    };
    assert_problem(rise_of_3_samples, &["ramp.rise_time_s is 0.001", "at least 5 samples: 0.002 s"]);
}

#[test]
fn an_order_that_does_not_fit_the_conditions_is_named() {
    assert_problem(|p| p["repetitions"] = json!(1000), &["at most 10000 trials in all; these are 12000"]);
    assert_problem(
        |p| {
            p["torques_nm"] = json!([0.9]);
            p["order"] = json!({ "kind": "constrained", "max_run": 2 });
        },
        &["order.max_run is 2", "there is one torque only"],
    );
    let fixed = |velocity: f64| {
        move |p: &mut Value| {
            p["velocities_rad_s"] = json!([1.3]);
            p["torques_nm"] = json!([0.9]);
            p["repetitions"] = json!(2);
            p["order"] = json!({ "kind": "fixed", "trials": [
                { "velocity_rad_s": 1.3, "torque_nm": 0.9 }, { "velocity_rad_s": velocity, "torque_nm": 0.9 }
            ] });
        }
    };
    assert!(Protocol::parse(&changed(fixed(1.3)), "p.json").is_ok());
    assert_problem(fixed(2.6), &["order.trials[1].velocity_rad_s is 2.6", "one of velocities_rad_s: [1.3]"]);
    assert_problem(
        |p| {
            fixed(1.3)(p);
            p["repetitions"] = json!(3);
        },
        &["order.trials is", "1.3 rad/s at 0.9 N m 3 times", "it is there 2 times"],
    );
}

#[test]
fn what_is_not_json_is_said_with_line_column_and_what_to_do() {
    let cases = [
        ("", "line 1, column 0", "The file is empty"),
        ("{\n  \"rest_s\": 1e999\n}", "line 2, column", "number out of range"),
        ("{\n  \"rest_s\": NaN\n}", "line 2, column", "no NaN"),
        ("{\n  \"rest_s\": 5,\n}", "line 3, column 1", "Remove the comma"),
        ("{\n  \"rest_s\": 5\n", "line 3, column 0", "ends too early"),
        ("\u{feff}{}", "line 1, column 1", "byte order mark"),
        ("{ // comment\n}", "line 1, column", "JSON knows no comments"),
        ("{} {}", "line 1, column 4", "trailing characters"),
    ];
    for (text, place, words) in cases {
        let error = Protocol::parse(text, "p.json").unwrap_err().to_string();
        assert!(error.starts_with("p.json: line"), "{error}");
        assert!(error.contains(place) && error.contains(words), "{text:?}: {error}");
    }
    let deep = "[".repeat(100_000);
    assert!(Protocol::parse(&deep, "p.json").unwrap_err().to_string().contains("recursion limit"));
}

#[test]
fn json_that_is_no_object_is_no_protocol() {
    for text in ["3", "null", "[1]", "\"x\""] {
        assert!(problems(text)[0].expected.starts_with("an object"), "{text}");
    }
}

#[test]
fn check_prints_trials_and_duration() {
    // A movement takes 0.069 s at full speed on average, 0.02 s of stopping, 0.5 s of hold and 0.3 s of return. So
    // 38 trials of 2 + 0.5 s of gate, 0.889 s of movement and 5 s of rest, after 2 s of offset and 132 s of MVC.
    let expected = "protocols/de-vlugt-2011.json: de Vlugt et al. 2011, can be run
  trials: 36 (4 velocities x 3 torques x 3 repetitions, shuffled); before them 2 familiarisation trials
  expected duration: 7 min 33 s (6 min 17 s if every gate opens at once, 24 min 58 s if each takes its timeout)
";
    let printed = output_of(&mut ramphold(&["check", "protocols/de-vlugt-2011.json"]), 0);
    assert_eq!(printed, (expected.to_owned(), String::new()));
}

#[test]
fn check_ends_with_2_and_says_why_on_standard_error() {
    let (stdout, stderr) = output_of(&mut ramphold(&["check", "fixtures/everything-wrong.json"]), 2);
    assert_eq!(stdout, "");
    assert!(stderr.starts_with("error: fixtures/everything-wrong.json: "), "{stderr}");

    let (_, stderr) = output_of(&mut ramphold(&["check", "no/such.json"]), 2);
    assert!(stderr.contains("no/such.json: cannot be read"), "{stderr}");

    let folder = tempfile::tempdir().unwrap();
    let latin = folder.path().join("latin.json");
    fs::write(&latin, b"{\n \"name\": \"K\xf6ln\" }").unwrap();
    let (_, stderr) = output_of(&mut ramphold(&["check", latin.to_str().unwrap()]), 2);
    assert!(stderr.contains("line 2: not UTF-8 text"), "{stderr}");
}

#[test]
fn check_finds_a_constraint_that_no_order_keeps() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.json");
    let text = changed(|p| {
        p["velocities_rad_s"] = json!([1.3, 2.6]);
        p["torques_nm"] = json!([0.9, 2.1]);
        p["repetitions"] = json!(1);
        p["order"] = json!({ "kind": "constrained", "max_run": 1 });
    });
    fs::write(&file, text).unwrap();
    let (_, stderr) = output_of(&mut ramphold(&["check", file.to_str().unwrap()]), 2);
    assert!(stderr.contains("order.max_run is 1") && stderr.contains("Raise order.max_run"), "{stderr}");
}
