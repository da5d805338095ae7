//! A recorded session is played in the pages.

use std::fs;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::program::Program;

/// Samples in 160 h.
const DAYS: u64 = 160 * 3600 * 2500;

/// Makes the pause of a recorded session, and what came after it, 160 h later.
fn with_a_pause_of_days(program: &Program) {
    let path = program.session.join("journal.log");
    let (mut longer, mut resumed, mut began) = (String::new(), false, false);
    for line in fs::read_to_string(&path).unwrap().lines() {
        let mut record: Value = serde_json::from_str(&line[26..]).unwrap();
        resumed |= record["event"] == "resume";
        if resumed && let Some(sample) = record["sample"].as_u64() {
            record["sample"] = (sample + DAYS).into();
        }
        // The next trial has rested as long.
        if resumed
            && !began
            && let Some(rest) = record["detail"]["began"]["rest_samples"].as_u64()
        {
            record["detail"]["began"]["rest_samples"] = (rest + DAYS).into();
            began = true;
        }
        let json = record.to_string();
        let sum: String =
            Sha256::digest(json.as_bytes())[..8].iter().map(|byte| format!("{byte:02x}")).collect();
        longer += &format!("{:08x} {sum} {json}\n", json.len());
    }
    assert!(resumed, "the session was not paused");
    fs::write(path, longer).unwrap();
}

/// Every sample of a pause was stepped through and played: for 160 h nothing was to be seen.
#[test]
fn of_a_pause_of_days_only_the_beginning_is_played() {
    let mut program = Program::run(&["--speed", "20"]);
    let mut operator = program.operator.live();
    operator.pause_after_the_first_trial();
    operator.word("resume");
    operator.phase("finished");
    drop(operator);
    assert_eq!(program.ends(), Some(0));
    with_a_pause_of_days(&program);

    let program = program.again("watch", &[]);
    let mut page = program.operator.live();
    let hello = page.until("the first message", |message| message["kind"] == "hello");
    let length_s = hello["tape"]["length_s"].as_f64().unwrap();
    assert!((10.0..1000.0).contains(&length_s), "{length_s} s would be played");
    page.send(&json!({ "play": { "speed": 1000.0, "plays": true } }));
    let told =
        page.until("how long the pause was", |message| message.to_string().contains("the pause lasted"));
    assert!(told.to_string().contains("the pause lasted 160 h"), "{told}");
    // The time of the session is the real one, the place in the recording is that of what is played.
    let end = page.phase("finished");
    assert!(end["t_s"].as_f64().unwrap() > 160.0 * 3600.0, "{end}");
    assert!(end["tape"]["position_s"].as_f64().unwrap() <= length_s, "{end}");
    page.send(&json!({ "seek": { "t_s": 1.0 } }));
    page.until("the beginning", |message| message["kind"] == "now" && message["t_s"].as_f64() < Some(60.0));
}
