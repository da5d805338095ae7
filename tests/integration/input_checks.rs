//! Sessions that parse and contradict themselves: refused before any fit, unless the operator says that they are right.

use std::fs;

use serde_json::{Value, json};

use crate::fit_input::sound;
use crate::workspace::Workspace;

/// The sound session with its angles in degrees.
fn in_degrees() -> Workspace {
    let workspace = sound();
    for number in [1, 2] {
        let path = workspace.path(&format!("session/trials/trial-00{number}.csv"));
        let text = fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        let mut turned = lines.next().unwrap().to_owned() + "\n";
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let angle: f64 = cells[1].parse().unwrap();
            turned += &format!("{},{:.6},{}\n", cells[0], angle.to_degrees(), cells[2]);
        }
        fs::write(path, turned).unwrap();
    }
    workspace
}

fn json_of(workspace: &Workspace, file: &str) -> Value {
    serde_json::from_slice(&fs::read(workspace.path(file)).unwrap()).unwrap()
}

#[test]
fn a_session_in_degrees_is_refused_by_fit_and_diagnose_with_the_likely_mistake() {
    let workspace = in_degrees();
    for verb in ["fit", "diagnose"] {
        let (stdout, stderr) = workspace.call(2, &[verb, "session"]);
        assert!(stdout.is_empty(), "{stdout}");
        for part in
            ["ramp-speed", "velocity_rad_s", "times as fast as stated", "in degrees?", "--accept ramp-speed"]
        {
            assert!(stderr.contains(part), "{part:?} is not in: {stderr}");
        }
        assert!(!workspace.path("session/results").exists(), "nothing is analysed");
    }
}

#[test]
fn what_was_accepted_is_kept_in_the_results() {
    let workspace = in_degrees();
    workspace.call(0, &["fit", "session", "--accept", "ramp-speed"]);
    let fit = json_of(&workspace, "session/results/fit.json");
    assert_eq!(fit["accepted"][0]["check"], "ramp-speed");
    let report = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(report.contains("times as fast as stated"), "the report tells of it");
    let (_, stderr) = workspace.call(2, &["fit", "session", "--accept", "ramp-sped"]);
    assert!(stderr.contains("ramp-direction"), "the checks are listed: {stderr}");
}

#[test]
fn a_fit_that_describes_nothing_says_so_first() {
    let workspace = sound();
    for number in [1, 2] {
        // A torque that has nothing to do with the motion.
        let path = workspace.path(&format!("session/trials/trial-00{number}.csv"));
        let mut text = "t_s,theta_m_rad,torque_l_nm\n".to_owned();
        for sample in 0..500 {
            let angle_rad = 0.0013 * f64::from(number) * f64::from((sample - 300).clamp(0, 100));
            let torque_nm = 0.9 + 0.5 * f64::from(sample).mul_add(0.4, 0.0).sin();
            text += &format!("{:.3},{angle_rad:.6},{torque_nm:.6}\n", f64::from(sample) / 1000.0);
        }
        fs::write(path, text).unwrap();
    }
    let (stdout, _) = workspace.call(0, &["fit", "session", "--accept", "resistance"]);
    assert!(stdout.starts_with("THE MODEL DOES NOT DESCRIBE THESE DATA"), "{stdout}");
    let report = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(report.contains("does not describe these data"));
}

#[test]
fn a_session_that_contradicts_itself_is_left_out_of_a_study() {
    let workspace = in_degrees();
    let study = |accept: Value| {
        json!({
            "format": "ramphold-study/1", "name": "s",
            "persons": { "kind": "measured", "folders": ["session"], "accept": accept },
        })
    };
    workspace.write("study.json", &study(json!([])));
    let (_, stderr) = workspace.call(1, &["cohort", "study.json", "--out", "refused"]);
    assert!(stderr.contains("in degrees?"), "{stderr}");
    workspace.write("study.json", &study(json!(["ramp-speed"])));
    let output = workspace.ramphold(&["cohort", "study.json", "--out", "accepted"]).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!stderr.contains("in degrees?"), "{stderr}");
}
