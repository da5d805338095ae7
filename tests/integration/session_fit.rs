//! The fit of a session as a whole, from the command line: beside it the fit of each trial on its own, and why there is only that.

use std::fs;

use serde_json::Value;

use crate::workspace::Workspace;

const PROTOCOL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/quick.json");

fn session() -> Workspace {
    let workspace = Workspace::new();
    workspace.call(0, &["run", PROTOCOL, "--seed", "1", "--out", "session"]);
    workspace
}

fn fit_json(workspace: &Workspace, folder: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(workspace.path(folder).join("fit.json")).unwrap()).unwrap()
}

#[test]
fn a_session_is_fitted_as_a_whole_and_each_trial_on_its_own_stands_beside() {
    let workspace = session();
    let results = workspace.path("session/results");
    let text = |name: &str| fs::read_to_string(results.join(name)).unwrap();
    assert_ne!(text("fit.csv"), text("fit-independent.csv"));
    assert_eq!(text("fit.csv").lines().next(), text("fit-independent.csv").lines().next());
    assert!(text("conditions.csv").lines().next().unwrap().ends_with(",se_x_e_rad"));
    let json = fit_json(&workspace, "session/results");
    assert_eq!(json["session_model"]["used"], true);
    assert!(json["session_model"]["parameters"]["k_srs_nm_per_rad"]["trial_sd"].as_f64().unwrap() > 0.0);
    let of_trial = |values: &Value| values["k_srs_nm_per_rad"].as_f64().unwrap();
    for trial in json["trials"].as_array().unwrap() {
        let (together, alone) = (of_trial(&trial["values"]), of_trial(&trial["independent"]["values"]));
        assert!(together > 10.0 && alone > 10.0);
    }
    let report = text("report.html");
    assert!(report.contains("All trials were fitted together"));
}

#[test]
fn a_window_that_ends_before_the_yield_gives_the_stiffness_that_the_whole_window_gives() {
    let workspace = session();
    let stiffness = |folder: &str| -> Vec<f64> {
        let json = fit_json(&workspace, folder);
        assert_eq!(json["session_model"]["used"], true, "{folder}");
        let trials = json["trials"].as_array().unwrap().iter();
        trials.map(|trial| trial["values"]["k_srs_nm_per_rad"].as_f64().unwrap()).collect()
    };
    for window_s in ["0.035", "0.03"] {
        workspace.call(0, &["fit", "session", "--window", window_s, "--out", window_s]);
        for (short, whole) in stiffness(window_s).into_iter().zip(stiffness("session/results")) {
            assert!((short / whole - 1.0).abs() < 0.2, "{short} instead of {whole} N m/rad, {window_s} s");
        }
    }
}

#[test]
fn independent_gives_each_trial_on_its_own_alone() {
    let workspace = session();
    let (table, _) = workspace.call(0, &["fit", "session", "--independent", "--out", "alone"]);
    assert!(table.contains("each trial fitted on its own: as asked"), "{table}");
    let text = |name: &str| fs::read_to_string(workspace.path("alone").join(name)).unwrap();
    assert_eq!(text("fit.csv"), text("fit-independent.csv"));
    assert_eq!(
        text("fit.csv"),
        fs::read_to_string(workspace.path("session/results/fit-independent.csv")).unwrap()
    );
    let json = fit_json(&workspace, "alone");
    assert_eq!(json["session_model"]["used"], false);
}

#[test]
fn a_session_without_repetitions_is_fitted_trial_by_trial_and_says_so() {
    let workspace = session();
    let file = workspace.path("session/trials.csv");
    let table = fs::read_to_string(&file).unwrap();
    let repetition = table.lines().next().unwrap().split(',').position(|name| name == "repetition").unwrap();
    let first = |line: &&str| line.split(',').nth(repetition) != Some("2");
    fs::write(&file, table.lines().filter(first).map(|line| format!("{line}\n")).collect::<String>())
        .unwrap();
    let (table, _) = workspace.call(0, &["fit", "session", "--out", "once"]);
    assert!(table.contains("each trial fitted on its own: no condition was repeated"), "{table}");
    assert_eq!(fit_json(&workspace, "once")["session_model"]["reason"], "no condition was repeated");
}

#[test]
fn fits_of_one_session_at_one_time_all_succeed_and_leave_results_that_go_together() {
    let workspace = session();
    for _ in 0..3 {
        let fits: Vec<_> = (0..4)
            .map(|_| {
                let mut fit = workspace.ramphold(&["fit", "session"]);
                fit.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn().unwrap()
            })
            .collect();
        for fit in fits {
            let ended = fit.wait_with_output().unwrap();
            assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        }
        workspace.call(0, &["verify", "session"]);
    }
}
