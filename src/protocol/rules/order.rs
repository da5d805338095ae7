//! Rules on the order: it must contain the trials that the protocol has.

use super::context::Rules;
use crate::protocol::source::{JsonContent, JsonNode};

/// Largest number of trials of a protocol, more than a subject can do in a day. Assumed.
pub(super) const MAX_PROTOCOL_TRIALS: f64 = 10_000.0;

pub(super) fn check(rules: &mut Rules) {
    let (velocities, torques) = (rules.numbers("velocities_rad_s"), rules.numbers("torques_nm"));
    let complete =
        velocities.len() == rules.length("velocities_rad_s") && torques.len() == rules.length("torques_nm");
    let Some(repetitions) = rules.number("repetitions").filter(|_| complete) else { return };
    let trials = (velocities.len() * torques.len()) as f64 * repetitions;
    if trials > MAX_PROTOCOL_TRIALS {
        let expected = format!("at most {MAX_PROTOCOL_TRIALS} trials in all; these are {trials}");
        return rules.add("repetitions", expected, "lower it".to_owned());
    }
    let kind = rules.document.at("order.kind").map(JsonNode::value);
    match kind.as_ref().and_then(|kind| kind.as_str()) {
        Some("constrained") => {
            runs_can_be_broken(rules, "torque", torques.len(), trials);
            runs_can_be_broken(rules, "velocity", velocities.len(), trials);
        }
        Some("fixed") => {
            each_condition_is_listed(rules, &values(&velocities), &values(&torques), repetitions)
        }
        _ => {}
    }
}

/// With one level only, all trials are one run.
fn runs_can_be_broken(rules: &mut Rules, what: &str, levels: usize, trials: f64) {
    if levels == 1 && rules.number("order.max_run").is_some_and(|max_run| max_run < trials) {
        let expected =
            format!("{trials}, the number of trials: there is one {what} only, so all are one run");
        rules.add("order.max_run", expected, format!("use \"shuffled\", or more than one {what}"));
    }
}

fn each_condition_is_listed(rules: &mut Rules, velocities: &[f64], torques: &[f64], repetitions: f64) {
    let Some(JsonContent::Array(trials)) = rules.document.at("order.trials").map(|node| node.content.clone())
    else {
        return;
    };
    let mut listed = Vec::new();
    for index in 0..trials.len() {
        let trial = format!("order.trials[{index}]");
        let velocity = one_of(rules, &format!("{trial}.velocity_rad_s"), "velocities_rad_s", velocities);
        let torque = one_of(rules, &format!("{trial}.torque_nm"), "torques_nm", torques);
        listed.extend(velocity.zip(torque));
    }
    if listed.len() < trials.len() {
        return;
    }
    for velocity in velocities {
        for torque in torques {
            let times = listed.iter().filter(|trial| **trial == (*velocity, *torque)).count();
            if times as f64 != repetitions {
                let expected = format!(
                    "{velocity} rad/s at {torque} N m {repetitions} times (\"repetitions\"); it is there {times} times"
                );
                rules.add("order.trials", expected, "add or take away trials of this condition".to_owned());
            }
        }
    }
}

fn one_of(rules: &mut Rules, path: &str, list: &str, values: &[f64]) -> Option<f64> {
    let number = rules.number(path)?;
    if values.contains(&number) {
        return Some(number);
    }
    let expected = format!("one of {list}: {values:?}");
    rules.add(path, expected, format!("add it to {list}, or choose one of them"));
    None
}

fn values(numbers: &[(String, f64)]) -> Vec<f64> {
    numbers.iter().map(|(_, number)| *number).collect()
}
