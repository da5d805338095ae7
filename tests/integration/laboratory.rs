//! `ramphold new` and `ramphold sessions`: from an empty folder to a list of sessions in every state.

use std::fs;

use serde_json::Value;

use crate::workspace::{PAPER, Workspace, files};

fn states(workspace: &Workspace, folder: &str) -> Vec<(String, String)> {
    let (text, _) = workspace.call(0, &["sessions", folder, "--json"]);
    let list: Value = serde_json::from_str(&text).unwrap();
    list.as_array()
        .unwrap()
        .iter()
        .map(|own| {
            let path = own["session"].as_str().unwrap().replace('\\', "/");
            (path.rsplit('/').next().unwrap().to_owned(), own["state"].as_str().unwrap().to_owned())
        })
        .collect()
}

#[test]
fn a_laboratory_made_without_questions_runs_a_session_at_once() {
    let workspace = Workspace::new();
    let arguments = ["new", "lab", "--protocol", "quick", "--emg", "no", "--subjects", "S01,S02", "--yes"];
    workspace.call(0, &arguments);
    let made: Vec<String> = files(&workspace.path("lab")).into_keys().collect();
    assert_eq!(made, ["README.md", "protocol.json", "rig.json", "subjects.csv"]);
    assert!(workspace.path("lab/sessions").is_dir() && workspace.path("lab/calibrations").is_dir());
    let subjects = fs::read_to_string(workspace.path("lab/subjects.csv")).unwrap();
    assert_eq!(subjects, "subject,hand,notes\nS01,,\nS02,,\n");
    workspace.call(0, &["check", "lab/protocol.json"]);
    let run = ["run", "lab/protocol.json", "--rig", "lab/rig.json", "--subject", "S01", "--seed", "3"];
    workspace.call(0, &[&run[..], &["--out", "lab/sessions/first"]].concat());
    assert_eq!(states(&workspace, "lab/sessions"), [("first".to_owned(), "fitted".to_owned())]);

    // A folder with something in it is left alone.
    let before = files(&workspace.path("lab"));
    let (_, message) = workspace.call(2, &arguments);
    assert!(message.contains("is not empty"), "{message}");
    assert_eq!(files(&workspace.path("lab")), before);
}

#[test]
fn a_laboratory_takes_the_papers_protocol_and_refuses_what_does_not_go_together() {
    let workspace = Workspace::new();
    workspace.call(0, &["new", "lab", "--protocol", "paper", "--yes"]);
    assert_eq!(fs::read(workspace.path("lab/protocol.json")).unwrap(), fs::read(PAPER).unwrap());
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/can/rigs/plain.json");
    let (_, message) = workspace.call(2, &["new", "other", "--protocol", "paper", "--rig", rig, "--yes"]);
    assert!(message.contains("the protocol samples at 2500 Hz"), "{message}");
    let (_, message) = workspace.call(2, &["new", "other", "--subjects", "S 1", "--yes"]);
    assert!(message.contains("subject \"S 1\""), "{message}");
    let (_, message) = workspace.call(2, &["new", "other", "--subjects", "S01,s01", "--yes"]);
    assert!(message.contains("\"s01\": given twice"), "{message}");
    assert!(!workspace.path("other").exists());
}

#[test]
fn every_state_of_a_session_is_told() {
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("all")).unwrap();
    let protocol = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/quick.json");
    workspace.call(0, &["run", protocol, "--seed", "3", "--subject", "S07", "--out", "all/s1-fitted"]);
    let copy = |to: &str| {
        for (name, bytes) in files(&workspace.path("all/s1-fitted")) {
            let path = workspace.path(&format!("all/{to}/{name}"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    };
    for name in
        ["s2-measured", "s3-unfinished", "s4-contradictory", "s5-other-data", "s6-broken", "s7-undescribed"]
    {
        copy(name);
    }
    fs::remove_dir_all(workspace.path("all/s2-measured/results")).unwrap();
    fs::remove_file(workspace.path("all/s3-unfinished/manifest.json")).unwrap();
    let edit = |file: &str, of: &dyn Fn(String) -> String| {
        let path = workspace.path(file);
        fs::write(&path, of(fs::read_to_string(&path).unwrap())).unwrap();
    };
    edit("all/s4-contradictory/trials.csv", &|text| {
        text.replace("csv,1.3,", "csv,-1.3,").replace("csv,3.25,", "csv,-3.25,")
    });
    fs::remove_dir_all(workspace.path("all/s4-contradictory/results")).unwrap();
    edit("all/s5-other-data/session.json", &|text| text.replace("S07", "S08"));
    fs::remove_file(workspace.path("all/s6-broken/trials/trial-001.csv")).unwrap();

    edit("all/s7-undescribed/results/fit.json", &|text| {
        let mut fit: serde_json::Value = serde_json::from_str(&text).unwrap();
        for trial in fit["trials"].as_array_mut().unwrap() {
            trial["values"]["vaf"] = 0.4.into();
        }
        fit.to_string()
    });

    let found = states(&workspace, "all");
    let expected = [
        ("s1-fitted", "fitted"),
        ("s2-measured", "measured"),
        ("s3-unfinished", "unfinished"),
        ("s4-contradictory", "doubtful"),
        ("s5-other-data", "doubtful"),
        ("s6-broken", "doubtful"),
        ("s7-undescribed", "doubtful"),
    ];
    assert_eq!(found, expected.map(|(name, state)| (name.to_owned(), state.to_owned())));
    let (table, told) = workspace.call(0, &["sessions", "all"]);
    assert!(table.lines().nth(1).unwrap().contains("S07"), "{table}");
    for words in ["ramp-direction", "trial-001.csv", "the best VAF of any trial is 0.40"] {
        assert!(told.contains(words), "{words} is not in {told}");
    }
}

#[test]
fn a_place_without_sessions_has_none_and_a_place_that_is_not_there_is_refused() {
    let workspace = Workspace::new();
    workspace.call(0, &["new", "lab", "--yes"]);
    let (table, told) = workspace.call(0, &["sessions", "lab/sessions"]);
    assert_eq!(table.lines().count(), 1, "{table}");
    assert!(told.contains("lab/sessions: no session in it"), "{told}");
    for folder in ["nowhere", "lab/protocol.json"] {
        let (_, told) = workspace.call(2, &["sessions", folder]);
        assert!(told.contains(folder) && told.contains("a folder of sessions"), "{told}");
    }
}
