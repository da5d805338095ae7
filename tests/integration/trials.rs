//! Judgements on trials after the session, and what a session says of when, who and what.

use std::fs;

use ramphold::dataset;
use serde_json::Value;

use crate::fit_input::sound;
use crate::workspace::{QUICK, Workspace, files};

#[test]
fn a_trial_rejected_after_looking_is_analysed_no_more_and_the_raw_data_stay() {
    let workspace = sound();
    let before = files(&workspace.path("session"));
    workspace.call(0, &["fit", "session"]);
    let (listed, told) = workspace
        .call(0, &["trials", "session", "--reject", "2", "--because", "hand slipped", "--by", "A. B."]);
    assert!(listed.contains("rejected by A. B.") && listed.contains("hand slipped"), "{listed}");
    assert!(told.contains("ramphold fit session"), "the results are of before: {told}");
    for (file, bytes) in &before {
        assert!(fs::read(workspace.path("session").join(file)).unwrap() == *bytes, "{file} was changed");
    }
    let (_, told) = workspace.call(0, &["report", "session"]);
    assert!(told.contains("before the session was changed"), "{told}");
    workspace.call(0, &["fit", "session"]);
    let table = fs::read_to_string(workspace.path("session/results/fit.csv")).unwrap();
    assert_eq!(table.lines().count(), 2, "only trial 1 has estimates: {table}");
    let report = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(report.contains("hand slipped (A. B.)"));

    workspace.call(0, &["trials", "session", "--accept", "2", "--because", "it did not"]);
    workspace.call(0, &["fit", "session"]);
    let table = fs::read_to_string(workspace.path("session/results/fit.csv")).unwrap();
    assert_eq!(table.lines().count(), 3, "{table}");
    let kept: Value =
        serde_json::from_slice(&fs::read(workspace.path("session/amendments.json")).unwrap()).unwrap();
    assert_eq!(kept["amendments"].as_array().unwrap().len(), 2, "nothing is deleted: {kept}");
    assert!(kept["amendments"][0]["at_utc"].as_str().unwrap().ends_with('Z'));
}

#[test]
fn a_judgement_on_no_trial_or_without_a_reason_is_refused() {
    let workspace = sound();
    let (_, told) = workspace.call(2, &["trials", "session", "--reject", "9", "--because", "x"]);
    assert!(told.contains("has no trial 9") && told.contains("1 to 2"), "{told}");
    workspace.call(2, &["trials", "session", "--reject", "1"]);
    let (_, told) = workspace.call(2, &["trials", "session", "--reject", "1", "--because", " "]);
    assert!(told.contains("--because is empty"), "{told}");
    let both = ["trials", "session", "--reject", "1", "--accept", "1", "--because", "x"];
    let (_, told) = workspace.call(2, &both);
    assert!(told.contains("trial 1 is given with --reject and with --accept"), "{told}");
    assert!(!workspace.path("session/amendments.json").exists());
    fs::write(
        workspace.path("session/amendments.json"),
        r#"{"format":"ramphold-amendments/1","amendments":[{"trial":9,"status":"ok","because":"","by":"","at_utc":""}]}"#,
    )
    .unwrap();
    let (_, told) = workspace.call(2, &["fit", "session"]);
    assert!(told.contains("amendments.json, field amendments[0].trial"), "{told}");
}

#[test]
fn judgements_of_another_session_are_refused() {
    let (judged, other) = (sound(), Workspace::new());
    judged.call(0, &["trials", "session", "--reject", "1", "--because", "sneezed"]);
    other.call(0, &["run", QUICK, "--seed", "1", "--out", "s"]);
    fs::copy(judged.path("session/amendments.json"), other.path("s/amendments.json")).unwrap();
    let (_, told) = other.call(2, &["fit", "s"]);
    assert!(told.contains("amendments.json, field amendments[0].record_sha256"), "{told}");
    assert!(told.contains("trials/") && told.contains("of another session"), "{told}");
}

#[test]
fn verify_lists_judgements_and_does_not_call_them_changes() {
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "1", "--out", "s"]);
    workspace.call(0, &["trials", "s", "--reject", "3", "--because", "sneezed"]);
    let (told, _) = workspace.call(0, &["verify", "s"]);
    assert!(told.contains("trial 3 rejected by") && told.contains("sneezed"), "{told}");
    let file = workspace.path("s/amendments.json");
    fs::write(&file, fs::read_to_string(&file).unwrap().replace("sneezed", "coughed")).unwrap();
    let (told, _) = workspace.call(1, &["verify", "s"]);
    assert!(told.contains("changed  amendments.json"), "{told}");
}

#[test]
fn a_session_measured_elsewhere_is_told_why_there_is_nothing_to_verify() {
    let workspace = sound();
    let (_, told) = workspace.call(2, &["verify", "session"]);
    assert!(told.contains("measured elsewhere") && told.contains("ramphold fit"), "{told}");
}

#[test]
fn a_field_of_the_subject_that_is_given_twice_is_refused() {
    let workspace = Workspace::new();
    let twice = ["run", QUICK, "--about", "age=3", "--about", "age=4", "--out", "a"];
    let (_, told) = workspace.call(2, &twice);
    assert!(told.contains("--about gives age twice"), "{told}");
    assert!(!workspace.path("a").exists());
}

#[test]
fn who_and_what_are_kept_and_a_virtual_session_says_that_it_is_one() {
    let workspace = Workspace::new();
    let about =
        ["--operator", "A. B.", "--hand", "left", "--about", "age=31", "--about", "condition=fatigued"];
    workspace.call(0, &[&["run", QUICK, "--seed", "1", "--out", "a"][..], &about].concat());
    workspace.call(0, &[&["run", QUICK, "--seed", "1", "--out", "b"][..], &about].concat());
    let card: Value = serde_json::from_slice(&fs::read(workspace.path("a/session.json")).unwrap()).unwrap();
    assert_eq!((&card["operator"], &card["hand"]), (&"A. B.".into(), &"left".into()));
    assert_eq!((&card["subject"]["age"], &card["subject"]["condition"]), (&31.into(), &"fatigued".into()));
    assert!(card.get("started_utc").is_none(), "a virtual session has no time of day");
    assert!(
        files(&workspace.path("a")) == files(&workspace.path("b")),
        "virtual sessions are equal to the last byte"
    );
    let report = fs::read_to_string(workspace.path("a/results/report.html")).unwrap();
    assert!(report.contains("VIRTUAL WRIST, seed 1"));
    assert!(report.contains("A. B.") && report.contains("age 31, condition fatigued"));
    workspace.call(0, &["export", "a", "--bids", "bids"]);
    let people = fs::read_to_string(workspace.path("bids/participants.tsv")).unwrap();
    assert_eq!(people, "participant_id\tage\tcondition\nsub-V00\t31\tfatigued\n");
    let (_, told) = workspace.call(2, &["export", "a", "--bids", "other", "--participant", "../x"]);
    assert!(told.contains("--participant \"../x\"") && !told.contains("subject.id"), "{told}");
}

#[test]
fn each_run_of_a_bids_dataset_has_the_time_at_which_its_own_record_began() {
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "2", "--out", "s"]);
    // As a session of a motor says it.
    let path = workspace.path("s/session.json");
    let mut card: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    card["started_utc"] = "2026-12-31T23:59:30Z".into();
    fs::write(&path, card.to_string()).unwrap();
    workspace.call(0, &["export", "s", "--bids", "bids"]);

    let session = dataset::load(&workspace.path("s")).unwrap();
    let ramps = dataset::ramp_times(&workspace.path("s")).unwrap().unwrap();
    let dataset = files(&workspace.path("bids"));
    let (_, scans) = dataset.iter().find(|(name, _)| name.ends_with("_scans.tsv")).unwrap();
    let scans = String::from_utf8(scans.clone()).unwrap();
    let mut rows = 0;
    for row in scans.lines().skip(1) {
        let (file, told) = row.split_once('\t').unwrap();
        let (_, number) = file.split_once("run-").unwrap();
        let number: u32 = number[..3].parse().unwrap();
        let trial = session.trials.iter().find(|trial| trial.number == number).unwrap();
        let Some(ramp) = ramps.iter().find(|ramp| ramp.trial == Some(number)) else {
            assert_eq!(told, "n/a", "a trial without a ramp");
            continue;
        };
        let began_s = 30 - (ramp.onset_s + trial.record.start_s - trial.onset_s.unwrap()).floor() as i64;
        let expected = match -began_s {
            left @ ..0 => format!("2026-12-31T23:59:{:02}Z", 60 + left),
            after => format!("2027-01-01T00:{:02}:{:02}Z", after / 60, after % 60),
        };
        assert_eq!(told, expected, "{file}");
        rows += 1;
    }
    assert!(rows > 4, "{scans}");
}
