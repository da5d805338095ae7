//! Everything that the session format calls bad input, given to `ramphold fit`: exit code 2, and a message that names file,
//! line, column and what was expected. Nothing is written, and no input file is changed.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::workspace::{Workspace, files};

const SESSION: &str = r#"{
  "format": "ramphold-session/1",
  "subject": { "id": "S01" },
  "sample_rate_hz": 1000,
  "rig": { "lever": null },
  "recorded_filter": null
}
"#;

const TRIALS: &str = "\
trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status
1,trials/trial-001.csv,1.3,0.9,1,0.3,ok
2,trials/trial-002.csv,2.6,0.9,1,0.3,ok
";

/// 0.3 s of hold, a ramp of 0.1 s against a spring, 0.1 s after it.
fn record(velocity_rad_s: f64) -> String {
    let mut text = "t_s,theta_m_rad,torque_l_nm\n".to_owned();
    for sample in 0..500 {
        let angle_rad = 1e-3 * velocity_rad_s * f64::from((sample - 300).clamp(0, 100));
        let torque_nm = 0.9 + 15.0 * angle_rad + 0.001 * f64::from((sample * 7919) % 13);
        text += &format!("{:.3},{angle_rad:.6},{torque_nm:.6}\n", f64::from(sample) / 1000.0);
    }
    text
}

/// A sound session under `session`, beside it whatever else is there.
pub fn sound() -> Workspace {
    let workspace = Workspace::new();
    fs::create_dir_all(workspace.path("session/trials")).unwrap();
    let session = workspace.path("session");
    fs::write(session.join("session.json"), SESSION).unwrap();
    fs::write(session.join("trials.csv"), TRIALS).unwrap();
    for (number, velocity_rad_s) in [(1, 1.3), (2, 2.6)] {
        fs::write(session.join(format!("trials/trial-00{number}.csv")), record(velocity_rad_s)).unwrap();
    }
    workspace
}

fn fit(workspace: &Workspace, more: &[&str]) -> Output {
    workspace.ramphold(&["fit", "session"]).args(more).output().unwrap()
}

/// The session after `spoil` is refused with code 2 in words that contain `parts`, and is left as it was.
#[track_caller]
fn assert_refused(spoil: impl FnOnce(&Path), parts: &[&str]) {
    let workspace = sound();
    spoil(&workspace.path("session"));
    let before = files(workspace.folder());
    let output = fit(&workspace, &[]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
    assert!(files(workspace.folder()) == before, "a file was written or changed");
}

/// Replaces the first `from` in a file.
fn replace<'a>(file: &'a str, from: &'a str, to: &'a str) -> impl FnOnce(&Path) + 'a {
    move |session| {
        let text = fs::read_to_string(session.join(file)).unwrap();
        assert!(text.contains(from), "{file} has no {from:?}");
        fs::write(session.join(file), text.replacen(from, to, 1)).unwrap();
    }
}

#[test]
fn the_sound_session_is_fitted() {
    let workspace = sound();
    let output = fit(&workspace, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(workspace.path("session/results/fit.csv").is_file());
}

#[test]
fn a_missing_column_is_refused() {
    let column = replace("trials/trial-001.csv", "torque_l_nm", "torque");
    assert_refused(column, &["trial-001.csv, line 1", "torque_l_nm", "missing", "t_s,theta_m_rad,torque"]);
    let column = replace("trials.csv", "repetition,", "rep,");
    assert_refused(column, &["trials.csv, line 1", "repetition", "missing"]);
}

#[test]
fn text_where_a_number_belongs_is_refused() {
    let cell = replace("trials/trial-002.csv", "0.007,0.000000", "0.007,fast");
    assert_refused(cell, &["trial-002.csv, line 9, column theta_m_rad", "fast", "expected"]);
    let cell = replace("trials.csv", "2.6", "quick");
    assert_refused(cell, &["trials.csv, line 3, column velocity_rad_s", "quick", "expected"]);
    let field = replace("session.json", "1000", "\"fast\"");
    assert_refused(field, &["session.json", "sample_rate_hz", "expected"]);
}

#[test]
fn nan_is_refused() {
    for number in ["NaN", "nan", "inf", ""] {
        let cell = format!("0.007,{number}");
        let cell = replace("trials/trial-001.csv", "0.007,0.000000", &cell);
        assert_refused(cell, &["trial-001.csv, line 9, column theta_m_rad", "expected"]);
    }
}

#[test]
fn a_gap_in_time_is_refused() {
    let gap = |session: &Path| {
        let file = session.join("trials/trial-001.csv");
        let text = fs::read_to_string(&file).unwrap();
        let kept = text.lines().enumerate().filter(|(line, _)| !(200..205).contains(line));
        fs::write(&file, kept.map(|(_, line)| format!("{line}\n")).collect::<String>()).unwrap();
    };
    assert_refused(gap, &["trial-001.csv, line 201", "gap", "0.198", "0.204"]);
}

#[test]
fn a_step_back_in_time_is_refused() {
    let step = replace("trials/trial-001.csv", "\n0.100,", "\n0.098,");
    assert_refused(step, &["trial-001.csv, line 102", "time goes from 0.099 s to 0.098 s"]);
}

#[test]
fn a_rate_that_disagrees_is_refused() {
    let rate = replace("session.json", "1000", "2500");
    assert_refused(rate, &["trial-001.csv", "sample_rate_hz", "2500"]);
}

#[test]
fn a_record_that_is_not_there_is_refused() {
    let gone = |session: &Path| fs::remove_file(session.join("trials/trial-002.csv")).unwrap();
    assert_refused(gone, &["trial-002.csv", "not found", "trials.csv"]);
}

#[test]
fn an_onset_outside_the_trace_is_refused() {
    for onset_s in ["7", "-1", "0.01", "0.495"] {
        let row = format!("0.9,1,{onset_s},ok");
        let onset = replace("trials.csv", "0.9,1,0.3,ok", &row);
        assert_refused(onset, &["trials.csv, line 2", "onset", "runs from 0 s to 0.499 s"]);
    }
}

#[test]
fn a_path_that_leaves_the_folder_is_refused() {
    for path in ["../outside.csv", "/etc/passwd", "trials/../../outside.csv"] {
        let spoil = |session: &Path| {
            fs::write(session.parent().unwrap().join("outside.csv"), record(1.3)).unwrap();
            replace("trials.csv", "trials/trial-001.csv", path)(session);
        };
        assert_refused(spoil, &["trials.csv, line 2", path, "inside"]);
    }
}

#[test]
fn a_format_version_that_is_not_known_is_refused() {
    let version = replace("session.json", "ramphold-session/1", "ramphold-session/2");
    assert_refused(version, &["session.json", "format", "ramphold-session/2", "ramphold-session/1"]);
}

#[test]
fn a_status_that_is_not_known_is_refused() {
    assert_refused(
        replace("trials.csv", "0.3,ok", "0.3,fine"),
        &["trials.csv, line 2, column status", "fine", "rejected"],
    );
}

#[test]
fn a_session_without_a_trial_to_analyse_is_refused() {
    let spoil =
        |session: &Path| fs::write(session.join("trials.csv"), TRIALS.replace(",ok", ",aborted")).unwrap();
    assert_refused(spoil, &["session", "trial"]);
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let workspace = sound();
    fs::write(
        workspace.path("model.json"),
        r#"{"format": "ramphold-model/1", "mechanisms": [{"mechanism": "ghost"}]}"#,
    )
    .unwrap();
    fs::write(workspace.path("broken.json"), "{").unwrap();
    for (arguments, part) in [
        (&["--window", "0"][..], "--window 0"),
        (&["--window=-0.04"], "--window"),
        (&["--window", "nan"], "--window"),
        (&["--window", "5"], "window"),
        (&["--window", "long"], "--window"),
        (&["--model", "model.json"], "model.json: mechanisms[0].mechanism: \"ghost\""),
        (&["--model", "broken.json"], "broken.json"),
        (&["--model", "none.json"], "none.json"),
        (&["nowhere"], "nowhere"),
        (&["--fast"], "--fast"),
    ] {
        let output = fit(&workspace, arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        let code = if arguments == ["nowhere"] { 1 } else { 2 };
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn results_of_an_earlier_fit_in_out_are_not_overwritten() {
    let workspace = sound();
    assert_eq!(fit(&workspace, &["--out", "results"]).status.code(), Some(0));
    let before = files(&workspace.path("results"));
    let output = fit(&workspace, &["--out", "results"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("results") && message.contains("--out"), "{message}");
    assert!(files(&workspace.path("results")) == before);
}

#[test]
fn two_sessions_of_the_same_name_do_not_share_a_result_folder() {
    let workspace = sound();
    fs::create_dir_all(workspace.path("other/session/trials")).unwrap();
    for file in ["session.json", "trials.csv", "trials/trial-001.csv", "trials/trial-002.csv"] {
        fs::copy(workspace.path("session").join(file), workspace.path("other/session").join(file)).unwrap();
    }
    let output = fit(&workspace, &["other/session", "--out", "results"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("session") && !workspace.path("results").exists(), "{message}");
}

#[test]
fn json_prints_the_result_file_and_of_many_a_list() {
    let workspace = sound();
    let output = fit(&workspace, &["--json"]);
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let kept = fs::read(workspace.path("session/results/fit.json")).unwrap();
    assert_eq!(output.stdout, kept);
    assert_eq!(printed["format"], "ramphold-fit/1");

    fs::create_dir_all(workspace.path("two/trials")).unwrap();
    for file in ["session.json", "trials.csv", "trials/trial-001.csv", "trials/trial-002.csv"] {
        fs::copy(workspace.path("session").join(file), workspace.path("two").join(file)).unwrap();
    }
    let output = fit(&workspace, &["two", "--json"]);
    let many: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(many.as_array().map(Vec::len), Some(2));
    assert_eq!(many[0], printed);
}

#[test]
fn one_bad_session_of_a_folder_is_told_of_and_the_rest_is_fitted() {
    let workspace = Workspace::new();
    for name in ["a", "b", "c"] {
        let one = sound();
        fs::create_dir_all(workspace.path("all").join(name).join("trials")).unwrap();
        for (file, text) in files(&one.path("session")) {
            fs::write(workspace.path("all").join(name).join(file), text).unwrap();
        }
    }
    fs::write(workspace.path("all/b/trials/trial-002.csv"), "t_s\n").unwrap();
    let (stdout, message) = workspace.call(1, &["fit", "all"]);
    assert!(message.contains("trial-002.csv") && message.contains("theta_m_rad"), "{message}");
    assert!(stdout.contains("fitted 2 of 3 sessions"));
    for name in ["a", "c"] {
        assert!(workspace.path("all").join(name).join("results/fit.csv").is_file());
    }
    assert!(!workspace.path("all/b/results").exists());
}

#[test]
fn a_trial_of_constant_torque_is_said_to_tell_nothing_and_the_other_is_estimated() {
    let workspace = sound();
    let mut flat = "t_s,theta_m_rad,torque_l_nm\n".to_owned();
    for sample in 0..500 {
        let angle_rad = 0.0026 * f64::from((sample - 300).clamp(0, 100));
        flat += &format!("{:.3},{angle_rad:.6},0.9\n", f64::from(sample) / 1000.0);
    }
    fs::write(workspace.path("session/trials/trial-002.csv"), flat).unwrap();
    let output = fit(&workspace, &[]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "the work was only partly possible: {message}");
    assert!(message.contains("trial 2") && message.contains("torque"), "{message}");
    let table = fs::read_to_string(workspace.path("session/results/fit.csv")).unwrap();
    assert_eq!(table.lines().count(), 2, "only trial 1 has estimates: {table}");
}

/// Ends the record of trial 2 some 50 ms after its onset.
fn cut_second_trial_short(workspace: &Workspace) {
    let file = workspace.path("session/trials/trial-002.csv");
    let short: String =
        fs::read_to_string(&file).unwrap().lines().take(350).map(|line| format!("{line}\n")).collect();
    fs::write(&file, short).unwrap();
}

#[test]
fn a_window_longer_than_one_trial_leaves_that_trial_out_and_says_so() {
    let workspace = sound();
    cut_second_trial_short(&workspace);
    let output = fit(&workspace, &["--window", "0.1"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "the work was only partly possible: {message}");
    assert!(message.contains("trial 2 left out") && message.contains("window"), "{message}");
}

#[test]
fn of_several_sessions_one_with_a_trial_left_out_is_named_and_the_others_are_fitted() {
    let workspace = sound();
    cut_second_trial_short(&workspace);
    let whole = sound();
    let sessions = [workspace.path("session"), whole.path("session")];
    let output = workspace.ramphold(&["fit", "--window", "0.1"]).args(&sessions).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("trial 2 left out") && message.contains("1 only in part"), "{message}");
    for session in sessions {
        assert!(session.join("results/fit.csv").is_file(), "{message}");
    }
}

#[test]
fn a_window_in_which_a_reflex_acts_is_said_to_hold_one() {
    let workspace = sound();
    let tell = |options: &[&str]| String::from_utf8(fit(&workspace, options).stdout).unwrap();
    let told = tell(&["--window", "0.1"]);
    assert!(told.contains("the window of 100 ms is longer than the 40 ms in which no reflex acts"), "{told}");
    assert!(!tell(&[]).contains("reflex"), "the paper's window has none");
}
