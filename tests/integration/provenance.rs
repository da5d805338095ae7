//! Results know what they were made from, and are neither replaced by others nor shown beside them.

use std::fs;

use serde_json::{Value, json};

use crate::fit_input::sound;
use crate::workspace::{QUICK, Workspace, copy_folder, files};

fn page(workspace: &Workspace, folder: &str) -> String {
    fs::read_to_string(workspace.path(folder).join("report.html")).unwrap()
}

/// The sound session with its fit.
fn fitted() -> Workspace {
    let workspace = sound();
    workspace.call(0, &["fit", "session"]);
    workspace
}

/// A diagnosis of the fit beside it, as far as the report reads it.
fn write_diagnosis(workspace: &Workspace, window_s: f64) {
    let fit: Value =
        serde_json::from_slice(&fs::read(workspace.path("session/results/fit.json")).unwrap()).unwrap();
    let diagnosis = json!({
        "format": "ramphold-diagnosis/1", "verdict": "adequate", "misfit": { "statistic": 1.0, "p_value": 0.5 }, "causes": [],
        "left_over": { "p_value": 0.5 }, "settings": { "window_s": window_s }, "model": fit["model"], "made_from": fit["made_from"],
    });
    workspace.write("session/results/diagnosis.json", &diagnosis);
}

#[test]
fn a_fit_with_another_window_does_not_replace_the_first() {
    let workspace = fitted();
    let first = fs::read(workspace.path("session/results/fit.csv")).unwrap();
    let (_, told) = workspace.call(0, &["fit", "session", "--window", "0.05"]);
    assert!(told.contains("session/results/window-50ms"), "{told}");
    assert_eq!(fs::read(workspace.path("session/results/fit.csv")).unwrap(), first);
    assert!(workspace.path("session/results/window-50ms/report.html").is_file());
    // The same settings again replace what they made.
    workspace.call(0, &["fit", "session", "--window", "0.05"]);
    assert!(!workspace.path("session/results/window-50ms-2").exists());

    workspace.call(0, &["report", "session", "--beside", "window-50ms", "--out", "both"]);
    let both = page(&workspace, "both");
    assert!(both.contains("Two fits beside each other") && both.contains("window-50ms"));
    let (_, told) = workspace.call(2, &["report", "session", "--beside", "nowhere"]);
    assert!(told.contains("nowhere") && told.contains("fit.json"), "{told}");
}

#[test]
fn a_diagnosis_of_another_window_is_not_shown_beside_the_fit() {
    let workspace = fitted();
    write_diagnosis(&workspace, 0.04);
    workspace.call(0, &["report", "session"]);
    assert!(page(&workspace, "session/results").contains("The model is adequate."));
    write_diagnosis(&workspace, 0.3);
    let (_, told) = workspace.call(0, &["report", "session"]);
    assert!(told.contains("ramphold diagnose session --window 0.04"), "the command can be typed: {told}");
    let page = page(&workspace, "session/results");
    assert!(page.contains("do not belong together"));
    assert!(!page.contains("The model is adequate."));
}

#[test]
fn results_of_a_session_that_was_changed_since_are_not_shown() {
    let workspace = fitted();
    write_diagnosis(&workspace, 0.04);
    let table = workspace.path("session/trials.csv");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, text.replace("2.6,0.9,1,0.3,ok", "2.6,0.9,1,0.3,rejected")).unwrap();
    let (_, told) = workspace.call(0, &["report", "session"]);
    assert!(told.contains("The fit was made before the session was changed"), "{told}");
    assert!(told.contains("The diagnosis was made before the session was changed"), "{told}");
    assert!(!page(&workspace, "session/results").contains("k_srs (N m/rad)"), "no number of the old fit");
    let (_, told) = workspace.call(0, &["export", "session", "--bids", "bids"]);
    assert!(told.contains("The fit was made before the session was changed"), "{told}");
    let exported = files(&workspace.path("bids"));
    let is_result =
        |file: &&String| ["fit.csv", "fit.json", "diagnosis.json"].iter().any(|end| file.ends_with(end));
    assert_eq!(exported.keys().find(is_result), None, "no number of before the change");
}

/// The second of two sessions with one name replaced the report of the first, and so did a report the operator's own file.
#[test]
fn a_report_elsewhere_replaces_nothing() {
    let workspace = fitted();
    workspace.call(0, &["report", "session", "--out", "page"]);
    let first = page(&workspace, "page");
    let (_, told) = workspace.call(2, &["report", "session", "--out", "page"]);
    assert!(told.contains("report.html") && told.contains("not overwritten"), "{told}");
    assert_eq!(page(&workspace, "page"), first);

    copy_folder(&workspace.path("session"), &workspace.path("other/session"));
    let (_, told) = workspace.call(2, &["report", "session", "other/session", "--out", "both"]);
    assert!(told.contains("the folder name session"), "{told}");
    assert!(!workspace.path("both").exists(), "nothing was written");
    for verb in [&["report"][..], &["export", "--bids", "bids"], &["fit"]] {
        let sessions = ["session", "other/../session"];
        let (_, told) = workspace.call(2, &[verb, &sessions].concat());
        assert!(told.contains("given twice"), "{verb:?}: {told}");
    }
    assert!(!workspace.path("bids").exists());
}

#[test]
fn trials_are_listed_without_the_numbers_of_a_fit_of_before() {
    let workspace = fitted();
    let (listed, _) = workspace.call(0, &["trials", "session"]);
    assert!(listed.contains("0.9") || listed.contains("1.0000"), "with its VAF: {listed}");
    let table = workspace.path("session/trials.csv");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, text.replace("2.6,0.9,1,0.3,ok", "2.6,0.9,1,0.3,rejected")).unwrap();
    let (listed, told) = workspace.call(0, &["trials", "session"]);
    assert!(told.contains("the fit was made before the session was changed"), "{told}");
    let vafs = listed.lines().skip(1).filter_map(|line| line.split_whitespace().nth(5));
    assert!(vafs.into_iter().all(|vaf| vaf == "-"), "{listed}");
}

/// A filter of 15 Hz that nobody had run made a stiffness of 63 N m/rad of 15.
#[test]
fn a_protocol_that_the_session_was_not_run_with_is_refused() {
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "1", "--out", "s"]);
    let path = workspace.path("s/protocol.json");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace("\"cutoff_hz\": 50", "\"cutoff_hz\": 15")).unwrap();
    let before = fs::read(workspace.path("s/results/fit.csv")).unwrap();
    let design = ["design", "s", "--between", "torque_lag", "lever_damping"];
    for words in [&["fit", "s"][..], &["diagnose", "s"], &design] {
        let (_, told) = workspace.call(2, words);
        assert!(told.contains("protocol.json") && told.contains("Put that one back"), "{words:?}: {told}");
    }
    assert_eq!(fs::read(workspace.path("s/results/fit.csv")).unwrap(), before);
}

#[test]
fn a_protocol_of_another_session_is_refused() {
    let workspace = sound();
    let protocol = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/quick.json")).unwrap();
    let sound: Value = serde_json::from_str(&protocol).unwrap();
    let refused = |velocities: Value, torques: Value, rate_hz: f64| {
        let mut protocol = sound.clone();
        protocol["velocities_rad_s"] = velocities;
        protocol["torques_nm"] = torques;
        protocol["signal"]["sample_rate_hz"] = json!(rate_hz);
        workspace.write("session/protocol.json", &protocol);
        workspace.call(2, &["fit", "session"]).1
    };
    let told = refused(json!([1.4, 2.6]), json!([0.9]), 1000.0);
    assert!(
        told.contains("protocol.json, field velocities_rad_s") && told.contains("as trial 1 has it"),
        "{told}"
    );
    let told = refused(json!([1.3, 2.6]), json!([1.5]), 1000.0);
    assert!(
        told.contains("protocol.json, field torques_nm") && told.contains("of another session?"),
        "{told}"
    );
    let told = refused(json!([1.3, 2.6]), json!([0.9]), 2000.0);
    assert!(told.contains("protocol.json, field signal.sample_rate_hz"), "{told}");
    assert!(!workspace.path("session/results").exists());
}
