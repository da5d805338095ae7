//! The door of the protocol, tried with every field replaced by every kind of value.

use ramphold::protocol::{Protocol, ProtocolError, schema_text};
use ramphold::schedule;
use serde_json::{Value, json};

const PAPER: &str = include_str!("../../protocols/de-vlugt-2011.json");

/// JSON pointers to every value in a document.
fn pointers(value: &Value, pointer: String) -> Vec<String> {
    let children: Vec<(String, &Value)> = match value {
        Value::Object(members) => members.iter().map(|(key, value)| (key.clone(), value)).collect(),
        Value::Array(items) => {
            items.iter().enumerate().map(|(index, item)| (index.to_string(), item)).collect()
        }
        _ => Vec::new(),
    };
    let below = children.into_iter().flat_map(|(key, child)| pointers(child, format!("{pointer}/{key}")));
    below.chain([pointer.clone()]).collect()
}

fn replacements() -> Vec<Value> {
    let numbers = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, -1e-300, 1e300, -1e300, 0.02, 2.0, 19.9, 1e5];
    let mut values: Vec<Value> = numbers.iter().map(|number| json!(number)).collect();
    values.extend([json!(0), json!(3), json!(-3), json!(u64::MAX), json!(i64::MIN), json!(999)]);
    values.extend([json!(null), json!(true), json!(""), json!("1.3"), json!("kind"), json!("\u{1F4A1}")]);
    values.extend([json!([]), json!([0.9]), json!([0.9, 0.9]), json!([[1]]), json!({})]);
    values.extend([
        json!({ "kind": 3 }),
        json!({ "kind": "williams" }),
        json!({ "kind": "constrained", "max_run": 1 }),
    ]);
    values.push(json!({ "kind": "fixed", "trials": [{ "velocity_rad_s": 1.3, "torque_nm": 0.9 }] }));
    values
}

#[test]
fn whatever_stands_in_a_field_the_door_decides_and_what_it_lets_in_can_be_run() {
    let paper: Value = serde_json::from_str(PAPER).unwrap();
    let schema = serde_json::from_str(&schema_text()).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let (mut let_in, mut refused) = (0, 0);
    for pointer in pointers(&paper, String::new()) {
        for replacement in replacements() {
            let mut changed = paper.clone();
            *changed.pointer_mut(&pointer).unwrap() = replacement.clone();
            match Protocol::parse(&changed.to_string(), "p.json") {
                Ok(protocol) => {
                    let_in += 1;
                    assert!(validator.is_valid(&changed), "{pointer} = {replacement}: not by the schema");
                    for velocity in &protocol.velocities_rad_s {
                        let movement = protocol.ramp_and_hold(*velocity).unwrap();
                        assert!(movement.ramp().end_of_constant_speed_s() >= protocol.window_s);
                        assert!(movement.duration_s().is_finite());
                    }
                    assert!(protocol.duration().longest_s.is_finite());
                    let order = schedule::draw(&protocol, 1, Some(1)).unwrap();
                    assert_eq!(order.len(), protocol.trial_count());
                }
                Err(ProtocolError::Invalid { problems, .. }) => {
                    refused += 1;
                    for problem in &problems {
                        // The walk must know all that the types know; the types are asked last.
                        assert!(
                            !problem.advice.contains("compare with"),
                            "{pointer} = {replacement}: {problem}"
                        );
                        assert!(!problem.expected.is_empty() && !problem.advice.is_empty(), "{problem}");
                    }
                }
                Err(other) => panic!("{pointer} = {replacement}: {other}"),
            }
        }
    }
    assert!(let_in > 100 && refused > 1000, "let in {let_in}, refused {refused}");
}

#[test]
fn every_field_is_missed_unless_it_may_be_left_out() {
    let paper: Value = serde_json::from_str(PAPER).unwrap();
    let optional = [
        "/$schema",
        "/before",
        "/before/offset_s",
        "/before/mvc",
        "/before/familiarisation_trials",
        "/gate/delay_s",
        "/gate/antagonist_limit_mvc",
        "/signal/filter/zero_phase",
    ];
    for pointer in pointers(&paper, String::new()) {
        let Some((parent, key)) = pointer.rsplit_once('/') else { continue };
        let mut changed = paper.clone();
        let Some(members) = changed.pointer_mut(parent).unwrap().as_object_mut() else { continue };
        members.shift_remove(key);
        let parsed = Protocol::parse(&changed.to_string(), "p.json");
        if optional.contains(&pointer.as_str()) {
            assert!(parsed.is_ok(), "without {pointer}: {}", parsed.unwrap_err());
        } else {
            let error = parsed.expect_err(&pointer).to_string();
            let path = pointer[1..].replace('/', ".");
            assert!(error.contains(&format!("{path} is missing")), "without {pointer}: {error}");
        }
    }
}
