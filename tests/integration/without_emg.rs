//! A rig that measures no EMG: nothing of the session says that it does.

use std::fs;

use serde_json::{Value, json};

use crate::workspace::{QUICK, Workspace, files};

fn json_of(workspace: &Workspace, file: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(workspace.path(file)).unwrap()).unwrap()
}

/// A workspace with the protocol `protocol.json` that needs no EMG, and the session `s` of a rig without EMG.
fn measured() -> Workspace {
    let workspace = Workspace::new();
    let mut protocol: Value = serde_json::from_str(&fs::read_to_string(QUICK).unwrap()).unwrap();
    protocol["gate"]["antagonist_limit_mvc"] = Value::Null;
    protocol["before"]["mvc"] = Value::Null;
    workspace.write("protocol.json", &protocol);
    workspace.write("rig.json", &json!({ "kind": "virtual", "emg": false }));
    workspace.call(0, &["run", "protocol.json", "--seed", "3", "--rig", "rig.json", "--out", "s"]);
    workspace
}

#[test]
fn every_record_results_and_exports_of_a_rig_without_emg_have_none() {
    let workspace = measured();
    let session = files(&workspace.path("s"));
    let records = session.iter().filter(|(name, _)| name.ends_with(".csv") && name.contains("trial-"));
    let mut count = 0;
    for (name, bytes) in records {
        let header = String::from_utf8_lossy(bytes).lines().next().unwrap().to_owned();
        assert_eq!(header, "t_s,theta_m_rad,torque_l_nm", "{name}");
        count += 1;
    }
    assert!(count > 3);
    let channels = &json_of(&workspace, "s/session.json")["channels"];
    let names: Vec<&String> = channels.as_object().unwrap().keys().collect();
    assert_eq!(names, ["theta_m_rad", "torque_l_nm"]);

    workspace.call(0, &["replay", "s"]);
    workspace.call(0, &["verify", "s"]);
    let report = fs::read_to_string(workspace.path("s/results/report.html")).unwrap();
    assert!(!report.contains("EMG and reflexes") && !report.contains("rectified EMG"));

    workspace.call(0, &["export", "s", "--bids", "bids"]);
    let exported = files(&workspace.path("bids"));
    assert!(exported.keys().any(|name| name.ends_with("_motion.tsv")));
    let of_emg = |name: &&String| name.contains("/emg/") || name.contains("_emg.");
    assert_eq!(exported.keys().find(of_emg), None);
    let events = exported.keys().filter(|name| name.ends_with("_events.tsv")).count();
    assert!(events > 3 && exported.keys().filter(|name| name.contains("/motion/")).count() == 4 * events);
}

#[test]
fn the_samples_of_a_rig_without_emg_are_those_of_the_same_rig_with_it() {
    let workspace = measured();
    workspace.call(0, &["run", "protocol.json", "--seed", "3", "--out", "with"]);
    let text = |session: &str| {
        fs::read_to_string(workspace.path(&format!("{session}/trials/trial-003.csv"))).unwrap()
    };
    for (with, without) in text("with").lines().zip(text("s").lines()).skip(1) {
        assert!(with.starts_with(&format!("{without},")), "{with} and {without}");
    }
    let fit =
        |session: &str| fs::read_to_string(workspace.path(&format!("{session}/results/fit.csv"))).unwrap();
    assert_eq!(fit("s"), fit("with"), "no fit depends on EMG");
}

#[test]
fn an_interrupted_session_without_emg_is_resumed_without_it() {
    let workspace = measured();
    let session = workspace.path("s");
    // What a computer that died in the last trial leaves: a record with its header and a torn row, and a journal without its end.
    let table = fs::read_to_string(session.join("trials.csv")).unwrap();
    let last = table.lines().last().unwrap().split(',').nth(1).unwrap().to_owned();
    let record = fs::read_to_string(session.join(&last)).unwrap();
    let torn = &record[..record.len() / 2 - 3];
    fs::remove_file(session.join(&last)).unwrap();
    fs::write(session.join(format!("{last}.part")), torn).unwrap();
    let journal = fs::read(session.join("journal.log")).unwrap();
    let text = String::from_utf8_lossy(&journal);
    let onset = text.rmatch_indices("\"event\":\"onset\"").next().unwrap().0;
    let line = onset + text[onset..].find('\n').unwrap() + 1;
    fs::write(session.join("journal.log"), &journal[..line]).unwrap();
    fs::remove_file(session.join("manifest.json")).unwrap();
    fs::remove_dir_all(session.join("results")).unwrap();

    workspace.call(0, &["resume", "s", "--yes"]);
    let kept = fs::read_to_string(session.join(&last)).unwrap();
    assert_eq!(kept.lines().next(), Some("t_s,theta_m_rad,torque_l_nm"));
    assert!(kept.lines().count() > 100 && record.starts_with(&kept));
    workspace.call(0, &["replay", "s"]);
    assert!(session.join("results/fit.csv").exists());
}

#[test]
fn a_protocol_that_needs_emg_is_refused_on_a_rig_without_it() {
    let workspace = Workspace::new();
    let mut protocol: Value = serde_json::from_str(&fs::read_to_string(QUICK).unwrap()).unwrap();
    protocol["gate"]["antagonist_limit_mvc"] = json!(0.2);
    workspace.write("protocol.json", &protocol);
    workspace.write("rig.json", &json!({ "kind": "virtual", "emg": false }));
    let (_, message) =
        workspace.call(2, &["run", "protocol.json", "--seed", "3", "--rig", "rig.json", "--out", "s"]);
    assert!(message.contains("antagonist_limit_mvc, which needs signal emg_ecr"), "{message}");
    assert!(!workspace.path("s").exists());
}

#[test]
fn emg_that_has_frozen_is_told_before_anything_is_fitted() {
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "3", "--out", "s"]);
    let path = workspace.path("s/trials/trial-002.csv");
    let text = fs::read_to_string(&path).unwrap();
    let rows: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(row, line)| match row {
            0..800 => line.to_owned(),
            _ => format!("{},0.00312", line.rsplit_once(',').unwrap().0),
        })
        .collect();
    fs::write(&path, rows.join("\n") + "\n").unwrap();
    let (_, message) = workspace.call(2, &["fit", "s"]);
    assert!(
        message.contains("emg-frozen: column emg_ecr_mvc of the records, trial 2: it stays at 0.00312"),
        "{message}"
    );
    workspace.call(0, &["fit", "s", "--accept", "emg-frozen"]);
}
