//! A session folder from a stranger: links, pipes, sizes, forged files and texts. Each of these did harm once.

#![cfg(unix)]

use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use rustix::fs::{CWD, FileType, Mode, mknodat};
use serde_json::{Value, json};

use crate::workspace::{PROGRAM, QUICK, Workspace, files, output_of};

impl Workspace {
    /// `call` with at most a minute of processor time, however busy the machine is: before, these commands took more, or never ended.
    #[track_caller]
    fn call_limited(&self, code: i32, arguments: &[&str]) -> (String, String) {
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -t 60; exec \"$@\"", "sh", PROGRAM]).args(arguments);
        output_of(command.current_dir(self.folder()), code)
    }

    /// The session `s`, run to its end, and a folder `outside` with files that are none of its business.
    fn with_stranger(&self) -> PathBuf {
        self.call(0, &["run", QUICK, "--seed", "7", "--out", "s"]);
        fs::create_dir(self.path("outside")).unwrap();
        for name in ["id_ed25519", "manifest.json", "fit.csv", "notes.json.new"] {
            fs::write(self.path("outside").join(name), "precious").unwrap();
        }
        self.path("s")
    }

    /// Replaces a file or folder of the session by a link.
    fn link(&self, target: &str, name: &str) {
        let link = self.path("s").join(name);
        match fs::symlink_metadata(&link) {
            Ok(about) if about.is_dir() => fs::rename(&link, self.path("taken-away")).unwrap(),
            Ok(_) => fs::remove_file(&link).unwrap(),
            Err(_) => {}
        }
        symlink(target, link).unwrap();
    }

    #[track_caller]
    fn assert_untouched(&self) {
        for (name, bytes) in files(&self.path("outside")) {
            assert_eq!(String::from_utf8_lossy(&bytes), "precious", "{name}");
        }
        assert_eq!(files(&self.path("outside")).len(), 4);
    }
}

fn fifo(path: &Path) {
    let _ = fs::remove_file(path);
    mknodat(CWD, path, FileType::Fifo, Mode::from_raw_mode(0o666), 0).unwrap();
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{} has no {from:?}", path.display());
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_link_in_place_of_the_results_leads_nobody_out_of_the_session() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    workspace.link("../outside", "results");
    for verb in ["fit", "report"] {
        let (_, said) = workspace.call(2, &[verb, "s"]);
        assert!(said.contains("s/results") && said.contains("symbolic link"), "{said}");
    }
    fs::remove_file(session.join("manifest.json")).unwrap();
    workspace.call(2, &["resume", "s", "--yes"]);
    workspace.call(0, &["export", "s", "--bids", "bids"]);
    let exported = files(&workspace.path("bids"));
    assert!(exported.keys().any(|file| file.contains("sourcedata")), "{:?}", exported.keys());
    assert!(!exported.keys().any(|file| file.contains("id_ed25519")), "{:?}", exported.keys());
    workspace.assert_untouched();
}

#[test]
fn a_link_under_the_name_of_a_temporary_file_is_not_written_through() {
    let workspace = Workspace::new();
    workspace.with_stranger();
    for name in [
        "results/fit.csv.new",
        "results/fit.csv",
        "results/report.html",
        "manifest.json.new",
        "trials/trial-001.csv.new",
    ] {
        workspace.link(&format!("{}/id_ed25519", workspace.path("outside").display()), name);
    }
    workspace.call(0, &["fit", "s"]);
    workspace.call(0, &["report", "s"]);
    workspace.assert_untouched();
    assert!(fs::symlink_metadata(workspace.path("s/results/fit.csv")).unwrap().is_file());
}

#[test]
fn the_journal_of_another_session_is_not_cut_and_not_appended_to() {
    let workspace = Workspace::with_short_protocol();
    workspace.killed_session();
    fs::rename(workspace.path("s"), workspace.path("other")).unwrap();
    let other = files(&workspace.path("other"));
    fs::create_dir(workspace.path("s")).unwrap();
    for name in ["session.json", "protocol.json", "schedule.csv", "rig.json", "trials.csv"] {
        fs::copy(workspace.path("other").join(name), workspace.path("s").join(name)).unwrap();
    }
    workspace.link("../other/journal.log", "journal.log");
    let (_, said) = workspace.call(2, &["resume", "s", "--yes"]);
    assert!(said.contains("s/journal.log") && said.contains("symbolic link"), "{said}");
    fs::remove_file(workspace.path("s/journal.log")).unwrap();
    fs::hard_link(workspace.path("other/journal.log"), workspace.path("s/journal.log")).unwrap();
    let (_, said) = workspace.call(2, &["resume", "s", "--yes"]);
    assert!(said.contains("hard link"), "{said}");
    assert!(files(&workspace.path("other")) == other);
}

#[test]
fn an_unfinished_session_that_was_changed_is_not_resumed() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    let before = files(&session);
    let text = |name: &str| String::from_utf8(before[name].clone()).unwrap();
    let order = text("schedule.csv");
    let mut rows: Vec<&str> = order.lines().collect();
    rows.swap(1, 2);
    let inertia = text("rig.json").replacen("\"inertia_kg_m2\": 0.0016", "\"inertia_kg_m2\": 0.0048", 1);
    for (name, altered) in [
        ("rig.json", inertia),
        ("schedule.csv", rows.join("\n") + "\n"),
        ("session.json", text("session.json").replacen("V00", "V01", 1)),
        ("trials/trial-001.csv", text("trials/trial-001.csv").replacen(",2.", ",3.", 1)),
    ] {
        let text = text(name);
        assert_ne!(altered, text, "{name}");
        fs::write(session.join(name), &altered).unwrap();
        let (_, said) = workspace.call(2, &["resume", "s", "--yes"]);
        assert!(said.contains(name) && said.contains("not as the session left it"), "{said}");
        let (told, _) = workspace.call(1, &["replay", "s"]);
        assert!(told.contains(&format!("{name} changed")), "{told}");
        fs::write(session.join(name), &text).unwrap();
    }
    assert!(files(&session) == before);
    workspace.call(0, &["resume", "s", "--yes"]);
    workspace.call(0, &["verify", "s"]);
    workspace.call(0, &["replay", "s"]);
}

/// Sessions of versions that noted no sums can be resumed still, with a word about it, and have the sums from then on.
#[test]
fn an_unfinished_session_of_an_older_version_is_resumed_and_gets_its_sums() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    without_sums(&session.join("journal.log"));
    let (_, said) = workspace.call(0, &["resume", "s", "--yes"]);
    assert!(said.contains("older version"), "{said}");
    let journal = fs::read_to_string(session.join("journal.log")).unwrap();
    assert!(journal.contains("\"record\":\"resumed\"") && journal.contains("\"rig.json\":"), "{journal}");
    workspace.call(0, &["replay", "s"]);
}

/// Takes the sums out of a journal.
fn without_sums(journal: &Path) {
    use sha2::{Digest, Sha256};
    let mut older = String::new();
    for line in fs::read_to_string(journal).unwrap().lines() {
        let mut record: Value = serde_json::from_str(&line[26..]).unwrap();
        if record["record"] == "recorded" {
            continue;
        }
        record.as_object_mut().unwrap().remove("files_sha256");
        let json = record.to_string();
        let sum: String =
            Sha256::digest(json.as_bytes())[..8].iter().map(|byte| format!("{byte:02x}")).collect();
        older += &format!("{:08x} {sum} {json}\n", json.len());
    }
    fs::write(journal, older).unwrap();
}

#[test]
fn a_replay_tells_of_garbage_behind_the_journal_and_behind_a_record() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    for (name, garbage) in [("journal.log", "\0\0\0 not a record"), ("trials/trial-001.csv", "1.5,0.")] {
        let before = fs::read(session.join(name)).unwrap();
        fs::OpenOptions::new()
            .append(true)
            .open(session.join(name))
            .unwrap()
            .write_all(garbage.as_bytes())
            .unwrap();
        let (told, _) = workspace.call(1, &["replay", "s"]);
        let bytes = format!("{name}: {} bytes behind its end", garbage.len());
        assert!(told.contains(&bytes) && told.contains("no difference"), "{told}");
        fs::write(session.join(name), before).unwrap();
    }
    workspace.call(0, &["replay", "s"]);
}

#[test]
fn a_pipe_or_a_device_in_place_of_a_file_holds_nobody_up() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    for (name, verbs) in [
        ("bus.json", &["report"][..]),
        ("results/diagnosis.json", &["report"]),
        ("results/fit.json", &["report"]),
        ("protocol.json", &["replay", "fit"]),
        ("journal.log", &["replay", "resume", "report"]),
        ("trials/trial-001.csv", &["fit", "report"]),
        ("trials.csv", &["fit"]),
    ] {
        let kept = fs::read(session.join(name)).ok();
        fifo(&session.join(name));
        for verb in verbs {
            let (_, said) = workspace.call(2, &[verb, "s"]);
            assert!(said.contains(name) && said.contains("FIFO"), "{verb}: {said}");
        }
        fs::remove_file(session.join(name)).unwrap();
        if let Some(kept) = kept {
            fs::write(session.join(name), kept).unwrap();
        }
    }
    let (listed, _) = workspace.call(0, &["verify", "s"]);
    assert!(listed.contains("unchanged"), "{listed}");
    fifo(&workspace.path("protocol"));
    workspace.call(2, &["check", "protocol"]);
    workspace.call(2, &["check", "/dev/zero"]);
}

#[test]
fn a_stray_file_of_any_size_is_not_read_by_verify() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    fs::File::create(session.join("stray")).unwrap().set_len(1 << 40).unwrap();
    fs::File::options()
        .write(true)
        .open(session.join("trials/trial-001.csv"))
        .unwrap()
        .set_len(1 << 40)
        .unwrap();
    let (listed, _) = workspace.call_limited(1, &["verify", "s"]);
    assert!(
        listed.contains("added    stray") && listed.contains("changed  trials/trial-001.csv"),
        "{listed}"
    );
    let (_, said) = workspace.call_limited(2, &["fit", "s"]);
    assert!(said.contains("trial-001.csv") && said.contains("bytes; expected at most"), "{said}");
}

#[test]
fn many_trials_with_one_record_are_refused_before_it_is_read() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    let table = fs::read_to_string(session.join("trials.csv")).unwrap();
    let (header, first) = (table.lines().next().unwrap(), table.lines().nth(1).unwrap());
    let rest = first.split_once(',').unwrap().1;
    let rows: String = (1..=15_000).map(|trial| format!("{trial},{rest}\n")).collect();
    fs::write(session.join("trials.csv"), format!("{header}\n{rows}")).unwrap();
    let (_, said) = workspace.call_limited(2, &["fit", "s"]);
    assert!(said.contains("is the record of line 2 already"), "{said}");
    let rows: String =
        (1..=30_000).map(|trial| format!("{trial},{}\n", rest.replace("001", &trial.to_string()))).collect();
    fs::write(session.join("trials.csv"), format!("{header}\n{rows}")).unwrap();
    let (_, said) = workspace.call_limited(2, &["fit", "s"]);
    assert!(said.contains("more than 20000 trials"), "{said}");
    // A column's name was repeated in the message, whatever its length.
    fs::write(session.join("trials.csv"), format!("{}\n", "x".repeat(10_000_000))).unwrap();
    let (_, said) = workspace.call_limited(2, &["fit", "s"]);
    assert!(said.contains("column trial is missing") && said.len() < 1000, "{} bytes", said.len());
}

#[test]
fn a_protocol_of_eighty_thousand_velocities_is_refused_within_a_minute_of_processor_time() {
    let workspace = Workspace::new();
    let mut protocol: Value = serde_json::from_str(include_str!("../../protocols/quick.json")).unwrap();
    protocol["velocities_rad_s"] = (1..=80_000).map(|n| json!(f64::from(n) * 1e-4)).collect();
    workspace.write("protocol.json", &protocol);
    let (_, said) = workspace.call_limited(2, &["check", "protocol.json"]);
    assert!(said.contains("velocities_rad_s") && said.contains("at most 100"), "{said}");
    let terms: Vec<&str> = vec!["one"; 1000];
    let model = json!({ "format": "ramphold-model/1", "parameters": { "x_e_rad": { "scope": "session", "law": terms } } });
    workspace.write("model.json", &model);
    let (_, said) = workspace.call_limited(2, &["run", QUICK, "--model", "model.json", "--out", "s"]);
    assert!(said.contains("parameters.x_e_rad") && said.contains("twice"), "{said}");
}

#[test]
fn results_are_input_like_any_other() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    let fit = session.join("results/fit.json");
    let kept = fs::read(&fit).unwrap();
    for window in ["1e308", "-1", "0"] {
        edit(&fit, "\"window_s\": 0.04", &format!("\"window_s\": {window}"));
        let (_, said) = workspace.call(2, &["report", "s"]);
        assert!(said.contains("fit.json") && said.contains("settings.window_s"), "{said}");
        fs::write(&fit, &kept).unwrap();
    }
    let row: Vec<f64> = vec![0.1; 500];
    for time_s in [vec![1e300; 500], vec![0.0; 500], (0..500).map(|n| 1e17 + f64::from(n)).collect()] {
        let conditions: Vec<Value> = (0..5000).map(|_| json!({ "mean_nm": row, "after_nm": null })).collect();
        for count in [3, 1000, 1200] {
            let map = json!({ "residual_map": { "time_s": time_s, "conditions": conditions[..count] } });
            fs::write(session.join("results/diagnosis.json"), map.to_string()).unwrap();
            workspace.call(0, &["report", "s"]);
        }
    }
}

#[test]
fn no_text_of_a_session_reaches_the_terminal_or_a_spreadsheet_as_a_command() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    fs::write(session.join("evil\u{1b}]0;title\u{7}.csv"), "").unwrap();
    let (listed, _) = workspace.call(1, &["verify", "s"]);
    assert!(listed.contains("evil\\u001b]0;title\\u0007.csv") && !listed.contains('\u{1b}'), "{listed:?}");
    edit(&session.join("session.json"), "V00", "\\u001b[2JV00");
    let table = fs::read_to_string(session.join("trials.csv")).unwrap();
    let labelled: String = table
        .lines()
        .enumerate()
        .map(|(n, line)| format!("{line},{}\n", if n == 0 { "condition" } else { "=1+cmd" }))
        .collect();
    fs::write(session.join("trials.csv"), labelled).unwrap();
    let (printed, said) = workspace.call(0, &["fit", "s"]);
    assert!(!printed.contains('\u{1b}') && !said.contains('\u{1b}'), "{printed}{said}");
    for table in ["fit.csv", "conditions.csv", "fit-independent.csv"] {
        let text = fs::read_to_string(session.join("results").join(table)).unwrap();
        assert!(text.contains(",'=1+cmd") && !text.contains(",=1"), "{table}: {text}");
    }
}

#[test]
fn an_output_folder_inside_the_session_at_the_root_or_with_other_results_is_refused() {
    let workspace = Workspace::new();
    let session = workspace.with_stranger();
    let before = files(&session);
    for arguments in [
        &["fit", "s", "--out", "s/more"][..],
        &["fit", "s", "--out", "s/results"],
        &["diagnose", "s", "--out", "s"],
        &["export", "s", "--bids", "s/trials/bids"],
        &["run", QUICK, "--out", "s/inner"],
        &["cohort", "study.json", "--out", "s/cohort"],
        &["fit", "s", "--out", "/"],
        &["export", "s", "--bids", "/"],
    ] {
        let (_, said) = workspace.call(2, arguments);
        let known = ["lies in the session", "root of the file system"];
        assert!(known.iter().any(|why| said.contains(why)), "{arguments:?}: {said}");
    }
    assert!(files(&session) == before);
    // Results of something else: replaced without a word when fit.json was not among them.
    fs::create_dir(workspace.path("there")).unwrap();
    fs::write(workspace.path("there/conditions.csv"), "precious").unwrap();
    let (_, said) = workspace.call(2, &["fit", "s", "--out", "there"]);
    assert!(said.contains("conditions.csv"), "{said}");
    assert_eq!(fs::read(workspace.path("there/conditions.csv")).unwrap(), b"precious");
    workspace.call(0, &["fit", "s", "--out", "elsewhere"]);
    edit(&workspace.path("elsewhere/fit.json"), "\"subject\": \"V00\"", "\"subject\": \"V99\"");
    let (_, said) = workspace.call(2, &["diagnose", "s", "--out", "elsewhere"]);
    assert!(said.contains("a fit of other trials"), "{said}");
}
