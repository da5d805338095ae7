//! `ramphold run`: a session from its protocol to its folder, and what becomes of it when something goes wrong.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use ramphold::dataset::{self, Status};
use serde_json::{Value, json};

use crate::workspace::{PAPER, PROGRAM, Workspace, files, output_of, ramphold, wait_for};

impl Workspace {
    /// Writes the quick protocol after a change.
    fn protocol(&self, change: impl FnOnce(&mut Value)) -> PathBuf {
        let mut protocol: Value = serde_json::from_str(include_str!("../../protocols/quick.json")).unwrap();
        change(&mut protocol);
        self.write("protocol.json", &protocol);
        self.path("protocol.json")
    }

    fn quick(&self) -> PathBuf {
        self.protocol(|_| {})
    }

    /// `ramphold run` with a protocol, a folder to write and further options; its standard error.
    #[track_caller]
    fn run(&self, code: i32, protocol: &Path, out: &str, more: &[&str]) -> String {
        output_of(self.ramphold(&["run", "--out", out]).arg(protocol).args(more), code).1
    }
}

#[test]
fn a_session_is_run_and_kept_as_the_format_says() {
    let workspace = Workspace::new();
    let protocol = workspace.protocol(|protocol| protocol["before"]["familiarisation_trials"] = json!(1));
    workspace.run(0, &protocol, "s", &["--seed", "3", "--subject", "S01"]);

    let session = dataset::load(&workspace.path("s")).unwrap();
    assert_eq!((session.subject.id.as_str(), session.sample_rate_hz), ("S01", 2500.0));
    assert_eq!(session.lever.unwrap().inertia_kg_m2, 0.0016);
    let ok: Vec<_> = session.trials.iter().filter(|trial| trial.status == Status::Ok).collect();
    let mut conditions: Vec<_> =
        ok.iter().map(|trial| (trial.velocity_rad_s, trial.torque_nm, trial.repetition)).collect();
    conditions.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let all: Vec<_> = [1.3, 3.25]
        .into_iter()
        .flat_map(|velocity| [0.9, 2.1].map(|torque| (velocity, torque)))
        .flat_map(|(velocity, torque)| [1, 2].map(|repetition| (velocity, torque, repetition)))
        .collect();
    assert_eq!(conditions, all);
    for trial in ok {
        let onset = (trial.onset_s.unwrap() * 2500.0).round() as usize;
        assert!(onset > 1500, "0.6 s of hold before the onset of trial {}", trial.number);
        assert_eq!(trial.record.start_s, 0.0);
        let angle = &trial.record.theta_m_rad;
        assert!((angle[onset] - angle[onset - 500]).abs() < 1e-3, "the motor moves before the onset");
        assert!(angle[onset + 100] - angle[onset] > 0.02, "the motor does not move after the onset");
        assert!(trial.record.emg_fcr_mvc.is_some() && trial.record.emg_ecr_mvc.is_some());
    }

    let kept = files(&workspace.path("s"));
    assert_eq!(kept["protocol.json"], fs::read(&protocol).unwrap(), "the protocol is kept byte for byte");
    let schedule = String::from_utf8(kept["schedule.csv"].clone()).unwrap();
    assert!(
        schedule.starts_with("position,velocity_rad_s,torque_nm,repetition\n")
            && schedule.lines().count() == 9
    );
    for file in ["before/offset.csv", "before/effort-1.csv", "before/effort-2.csv", "journal.log", "rig.json"]
    {
        assert!(kept.contains_key(file), "{file} is missing");
    }
    assert!(kept.contains_key("familiarisation/trial-001.csv") && kept.contains_key("familiarisation.csv"));
    assert!(!kept.keys().any(|file| file.ends_with(".part") || file.ends_with(".new")), "{:?}", kept.keys());
    let text = kept.values().map(|bytes| String::from_utf8_lossy(bytes)).collect::<String>();
    assert!(!text.contains(workspace.folder().to_str().unwrap()), "a path of this machine is in the session");
}

#[test]
fn the_same_protocol_seed_and_subject_give_the_same_bytes() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    workspace.run(0, &quick, "a", &["--seed", "7"]);
    workspace.run(0, &quick, "b", &["--seed", "7"]);
    workspace.run(0, &quick, "other-seed", &["--seed", "8"]);
    workspace.run(0, &quick, "other-subject", &["--seed", "7", "--subject", "S02"]);
    assert!(files(&workspace.path("a")) == files(&workspace.path("b")));
    for other in ["other-seed", "other-subject"] {
        assert_ne!(
            files(&workspace.path("a"))["trials/trial-001.csv"],
            files(&workspace.path(other))["trials/trial-001.csv"]
        );
    }
}

#[test]
fn a_folder_is_never_overwritten() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    workspace.run(0, &quick, "s", &["--seed", "7"]);
    let before = files(&workspace.path("s"));
    let again = workspace.run(2, &quick, "s", &["--seed", "8"]);
    assert!(again.contains("s: is there already"), "{}", again);
    assert!(files(&workspace.path("s")) == before);
    fs::create_dir(workspace.path("empty")).unwrap();
    workspace.run(2, &quick, "empty", &[]);
}

#[test]
fn without_out_every_session_gets_a_new_folder() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    for _ in 0..2 {
        workspace.call(0, &["run", quick.to_str().unwrap(), "--seed", "7"]);
    }
    let mut names: Vec<_> =
        fs::read_dir(workspace.path("sessions")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["protocol-V00-7", "protocol-V00-7-2"]);
}

#[test]
fn a_folder_that_cannot_be_written_is_an_error_that_names_it() {
    let workspace = Workspace::new();
    fs::write(workspace.path("file"), "").unwrap();
    for out in ["file/session", "/proc/session"] {
        let message = workspace.run(1, &workspace.quick(), out, &["--seed", "7"]);
        assert!(message.contains("cannot be written"), "{}", message);
    }
}

#[test]
fn bad_input_is_refused_with_code_2_and_no_folder_is_made() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    fs::write(workspace.path("person.json"), "{}").unwrap();
    fs::write(workspace.path("rig.json"), r#"{"kind": "virtual", "lever": 3}"#).unwrap();
    fs::write(workspace.path("bad.json"), "not JSON").unwrap();
    let williams = {
        let path = workspace.path("williams.json");
        let text = fs::read_to_string(&quick).unwrap().replace("\"shuffled\"", "\"williams\"");
        fs::write(&path, text).unwrap();
        path
    };
    for (protocol, more, part) in [
        (workspace.path("bad.json"), vec![], "bad.json"),
        (workspace.path("none.json"), vec![], "none.json"),
        (quick.clone(), vec!["--subject", "person.json"], "person.json"),
        (quick.clone(), vec!["--subject", "missing.json"], "missing.json"),
        (quick.clone(), vec!["--subject="], "--subject"),
        (quick.clone(), vec!["--subject", "people/ada"], "people/ada"),
        (quick.clone(), vec!["--rig", "rig.json"], "rig.json"),
        (quick.clone(), vec!["--seed", "one"], "--seed"),
        (williams, vec!["--subject", "nobody"], "williams"),
    ] {
        let message = workspace.run(2, &protocol, "s", &more);
        assert!(message.contains(part), "{part:?} is not in: {}", message);
        assert!(!workspace.path("s").exists());
    }
}

#[test]
fn a_person_and_a_rig_can_be_given_as_files() {
    let workspace = Workspace::new();
    fs::write(workspace.path("person.json"), r#"{"format": "ramphold-person/1", "id": "Ada"}"#).unwrap();
    fs::write(workspace.path("rig.json"), r#"{"kind": "virtual", "lever": null, "gauge_noise_nm": 0.0}"#)
        .unwrap();
    workspace.run(
        0,
        &workspace.quick(),
        "s",
        &["--seed", "1", "--subject", "person.json", "--rig", "rig.json"],
    );
    let session = dataset::load(&workspace.path("s")).unwrap();
    assert_eq!((session.subject.id.as_str(), session.lever), ("Ada", None));
}

#[test]
fn quiet_says_nothing() {
    let workspace = Workspace::new();
    let message = workspace.run(0, &workspace.quick(), "s", &["--quiet"]);
    assert_eq!(message, "");
}

/// Short trials at true speed: there is time to interrupt them.
fn slow(workspace: &Workspace) -> PathBuf {
    workspace.protocol(|protocol| {
        protocol["before"] = json!({});
        protocol["rest_s"] = json!(0.1);
    })
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_session_cleanly_with_all_trials_so_far() {
    for signal in ["INT", "TERM"] {
        let workspace = Workspace::new();
        let mut child = Command::new(PROGRAM)
            .args(["run", "--real-time", "--seed", "7", "--out"])
            .arg(workspace.path("s"))
            .arg(slow(&workspace))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let second = workspace.path("s/trials/trial-002.csv.part");
        wait_for(&mut child, "the second trial", || second.exists());
        let kill = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
        assert!(kill.unwrap().success());
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("trials left to do"), "{message}");
        let session = dataset::load(&workspace.path("s")).unwrap();
        let statuses: Vec<Status> = session.trials.iter().map(|trial| trial.status).collect();
        assert_eq!(statuses, [Status::Ok, Status::Aborted]);
        assert!(!second.exists(), "the interrupted trial is kept under its name");
        let (table, _) = workspace.call(0, &["fit", "s"]);
        assert!(table.starts_with("V00: 1 trials, 1 conditions"), "{table}");
    }
}

#[cfg(unix)]
#[test]
fn a_killed_session_is_loadable_up_to_the_last_finished_trial() {
    let workspace = Workspace::new();
    let mut child = Command::new(PROGRAM)
        .args(["run", "--real-time", "--quiet", "--seed", "7", "--out"])
        .arg(workspace.path("s"))
        .arg(slow(&workspace))
        .spawn()
        .unwrap();
    let second = workspace.path("s/trials/trial-002.csv.part");
    wait_for(&mut child, "the second trial", || second.exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let session = dataset::load(&workspace.path("s")).unwrap();
    assert_eq!(session.trials.iter().map(|trial| trial.status).collect::<Vec<_>>(), [Status::Ok]);
}

/// `script` of util-linux gives the program a terminal of its own.
#[cfg(target_os = "linux")]
#[test]
fn progress_is_shown_on_a_terminal_and_only_there() {
    let workspace = Workspace::new();
    let command =
        |out: &str| format!("'{PROGRAM}' run '{PAPER}' --seed 7 --out '{}'", workspace.path(out).display());
    let on = Command::new("script")
        .args(["-qec", &command("a"), "/dev/null"])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let on = String::from_utf8_lossy(&on.stdout).into_owned();
    assert!(on.contains("trial 0 of 38") && on.contains("left"), "{on}");
    let off = Command::new("sh").args(["-c", &command("b")]).output().unwrap();
    let off = String::from_utf8_lossy(&off.stderr).into_owned();
    assert!(!off.contains("of 38") && !off.contains("left"), "{off}");
}

#[test]
fn the_mechanisms_of_a_model_file_are_at_work_in_the_virtual_wrist() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    let model = r#"{"format": "ramphold-model/1", "mechanisms": [
        {"mechanism": "torque_gain", "parameters": {"factor": 1.5}}]}"#;
    fs::write(workspace.path("model.json"), model).unwrap();
    workspace.run(0, &quick, "plain", &["--seed", "7"]);
    workspace.run(0, &quick, "gain", &["--seed", "7", "--model", "model.json"]);
    let rig: Value = serde_json::from_slice(&files(&workspace.path("gain"))["rig.json"]).unwrap();
    assert_eq!(
        rig["rig"]["mechanisms"],
        json!([{"mechanism": "torque_gain", "parameters": {"factor": 1.5}}]),
        "the session says what was at work"
    );
    let rise_nm = |session: &str| {
        let session = dataset::load(&workspace.path(session)).unwrap();
        let trial = &session.trials[0];
        let onset = (trial.onset_s.unwrap() * session.sample_rate_hz).round() as usize;
        let torque_nm = &trial.record.torque_l_nm[onset..onset + 60];
        torque_nm.iter().copied().fold(f64::MIN, f64::max) - torque_nm[0]
    };
    let ratio = rise_nm("gain") / rise_nm("plain");
    assert!((1.4..1.6).contains(&ratio), "a gain of 1.5 makes the torque rise {ratio} times as high");
}

#[test]
fn a_model_that_a_virtual_wrist_cannot_have_is_refused() {
    let workspace = Workspace::new();
    let quick = workspace.quick();
    let rig =
        r#"{"kind": "virtual", "mechanisms": [{"mechanism": "fatigue", "parameters": {"fraction": 0.1}}]}"#;
    fs::write(workspace.path("rig.json"), rig).unwrap();
    for (model, part) in [
        (r#"{"format": "ramphold-model/2"}"#, "ramphold-model/1"),
        (r#"{"format": "ramphold-model/1", "mechanisms": [{"mechanism": "ghost"}]}"#, "ghost"),
        (
            r#"{"format": "ramphold-model/1", "mechanisms": [{"mechanism": "fatigue", "parameters": {"fraction": 0.2}}]}"#,
            "already in the subject file",
        ),
        (
            r#"{"format": "ramphold-model/1", "mechanisms": [{"mechanism": "torque_gain", "parameters":
                {"factor": {"scope": "session", "law": ["one", "velocity"]}}}]}"#,
            "mechanisms[0].parameters.factor",
        ),
        (
            r#"{"format": "ramphold-model/1", "parameters": {"x_e_rad": {"scope": "fixed", "value": 0.04}}}"#,
            "parameters.x_e_rad",
        ),
    ] {
        fs::write(workspace.path("model.json"), model).unwrap();
        let message = workspace.run(2, &quick, "s", &["--rig", "rig.json", "--model", "model.json"]);
        assert!(message.contains("model.json") && message.contains(part), "{part:?} is not in: {message}");
        assert!(!workspace.path("s").exists());
    }
}

#[test]
fn states_prints_the_table_as_text_and_as_graphs() {
    let states = |more: &[&str]| output_of(ramphold(&["states"]).args(more), 0).0;
    assert_eq!(states(&[]), ramphold::session::transitions::text());
    assert!(states(&["--dot"]).starts_with("digraph session {"));
    assert!(states(&["--mermaid"]).starts_with("stateDiagram-v2\n"));
}

#[test]
fn a_subject_whose_id_is_a_path_is_refused_and_becomes_no_path() {
    let workspace = Workspace::new();
    for id in ["../../evil", "/tmp/evil", "a/b", "..", "", "a\u{7}b"] {
        workspace.write("person.json", &json!({ "format": "ramphold-person/1", "id": id }));
        let person = workspace.path("person.json");
        let told = workspace.run(2, &workspace.quick(), "s", &["--subject", person.to_str().unwrap()]);
        let expected = "field id: ";
        assert!(told.contains(expected) && told.contains("expected a name such as S03"), "{id:?}: {told}");
        assert!(!workspace.path("s").exists(), "{id:?}");
        let found = files(&workspace.path("."));
        assert!(found.keys().all(|file| !file.contains("evil")), "{id:?}");
    }
}
