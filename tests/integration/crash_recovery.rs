//! The program is killed at seeded moments, resumed until it is done, and the end is compared with that of a session
//! that nobody disturbed. `scripts/kill-test N` runs more of it than the tests do.

#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ramphold::dataset::{self, Status};
use ramphold::random::Stream;
use serde_json::{Value, json};

use crate::workspace::PROGRAM;

/// Kills when nobody asks for more.
const KILLS: u64 = 12;

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).map_or(otherwise, |text| text.parse().expect(variable))
}

/// The program under test.
fn ramphold() -> PathBuf {
    std::env::var_os("RAMPHOLD_PROGRAM").map_or_else(|| PROGRAM.into(), PathBuf::from)
}

/// A session with a bit of everything that is over in no time.
fn protocol(folder: &Path) -> PathBuf {
    let mut protocol: Value = serde_json::from_str(include_str!("../../protocols/quick.json")).unwrap();
    protocol["velocities_rad_s"] = json!([3.25]);
    protocol["rest_s"] = json!(0.2);
    protocol["gate"]["delay_s"] = json!([0, 0.3]);
    protocol["signal"]["sample_rate_hz"] = json!(1000);
    protocol["before"] = json!({
        "offset_s": 0.2, "mvc": { "efforts": 1, "duration_s": 0.5, "rest_s": 0.2 }, "familiarisation_trials": 1
    });
    let path = folder.join("protocol.json");
    fs::write(&path, protocol.to_string()).unwrap();
    path
}

/// What must be the same however the session came to its end.
#[derive(Debug, PartialEq)]
struct End {
    fit: String,
    conditions: String,
    ok: BTreeMap<String, Vec<[f64; 2]>>,
}

fn end(session: &Path) -> End {
    let text = |file: &str| fs::read_to_string(session.join("results").join(file)).unwrap();
    let loaded = dataset::load(session).unwrap();
    let ok = loaded.trials.iter().filter(|trial| trial.status == Status::Ok).map(|trial| {
        let record = &trial.record;
        // The first sample was measured before the person was told of the trial; it depends on what came before.
        let signals =
            record.theta_m_rad.iter().zip(&record.torque_l_nm).skip(1).map(|(a, t)| [*a, *t]).collect();
        (trial.extra["position"].clone(), signals)
    });
    End { fit: without_numbers(&text("fit.csv")), conditions: text("conditions.csv"), ok: ok.collect() }
}

/// `fit.csv` without the trials' numbers, which go on counting after an aborted trial.
fn without_numbers(text: &str) -> String {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let numbers = header.iter().position(|name| name == "trial").unwrap();
    let row = |row: &csv::StringRecord| -> String {
        let cells = row.iter().enumerate().filter(|(column, _)| *column != numbers);
        cells.map(|(_, cell)| format!("{cell},")).collect()
    };
    let rows: Vec<String> = reader.records().map(|record| row(&record.unwrap())).collect();
    rows.join("\n")
}

/// How far the program had come when it was killed.
fn stage(session: &Path) -> &'static str {
    let has = |file: &str| session.join(file).exists();
    if !session.exists() {
        return "before the folder";
    }
    if has("manifest.json") {
        return "after the end";
    }
    if has("results") {
        return "writing results";
    }
    let journal = fs::read_to_string(session.join("journal.log")).unwrap_or_default();
    if journal.contains("\"to\":\"finished\"") {
        return "in the fit";
    }
    let any_half = |folder: &str, ending: &str| {
        let entries = fs::read_dir(session.join(folder)).into_iter().flatten();
        entries.flatten().any(|entry| entry.file_name().to_string_lossy().ends_with(ending))
    };
    match () {
        () if any_half("", ".new") => "writing a table",
        () if any_half("trials", ".part") => "in a trial",
        () if any_half("before", ".part") || any_half("familiarisation", ".part") => "before the trials",
        () => "between records",
    }
}

fn call(arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(ramphold());
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn must_succeed(arguments: &[&str], folder: &Path, told: &str) {
    let output = call(arguments, folder).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}: ramphold {}: {message}", arguments.join(" "));
}

#[test]
fn a_session_that_is_killed_at_any_moment_ends_as_if_it_had_not_been() {
    let kills = number("RAMPHOLD_KILLS", KILLS);
    let first = number("RAMPHOLD_KILL_SEED", 1);
    let workspace = tempfile::tempdir().unwrap();
    let protocol = protocol(workspace.path());
    let protocol = protocol.to_str().unwrap();
    let seeds = 4u64.min(kills);
    let mut whole_s: f64 = 0.0;
    let undisturbed: Vec<End> = (0..seeds)
        .map(|seed| {
            let (seed, start) = (seed.to_string(), Instant::now());
            must_succeed(
                &["run", protocol, "--seed", &seed, "--out", &seed],
                workspace.path(),
                "undisturbed",
            );
            whole_s = whole_s.max(start.elapsed().as_secs_f64());
            end(&workspace.path().join(&seed))
        })
        .collect();

    let mut stages: BTreeMap<&str, u64> = BTreeMap::new();
    let mut killed = 0;
    for session in 0.. {
        if killed >= kills {
            break;
        }
        let mut stream = Stream::new(first, &format!("kill/{session}"));
        let seed = (session % seeds).to_string();
        let path = workspace.path().join("killed");
        let told = format!("seed {first}, session {session}");
        // Up to four kills in a row, each somewhere in the time that is left; then it may end.
        let in_a_row = 1 + stream.below(4);
        for _ in 0..in_a_row {
            let begun = path.exists();
            let run = ["run", protocol, "--seed", &seed, "--out", "killed", "--quiet"];
            let resume = ["resume", "killed", "--yes", "--quiet"];
            let mut child = call(if begun { &resume } else { &run }, workspace.path()).spawn().unwrap();
            sleep(Duration::from_secs_f64(whole_s * 1.05 * stream.uniform()));
            let over = child.try_wait().unwrap();
            child.kill().unwrap();
            let output = child.wait_with_output().unwrap();
            if let Some(over) = over {
                let message = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(over.success(), "{told}: {message}");
                break;
            }
            killed += 1;
            *stages.entry(stage(&path)).or_default() += 1;
        }
        if path.exists() {
            must_succeed(&["resume", "killed", "--yes"], workspace.path(), &told);
        } else {
            must_succeed(&["run", protocol, "--seed", &seed, "--out", "killed"], workspace.path(), &told);
        }
        must_succeed(&["verify", "killed"], workspace.path(), &told);
        must_succeed(&["replay", "killed"], workspace.path(), &told);
        assert!(end(&path) == undisturbed[(session % seeds) as usize], "{told}: it ends otherwise");
        fs::remove_dir_all(&path).unwrap();
    }
    println!("killed {killed} times, seed {first}: {stages:?}");
}
