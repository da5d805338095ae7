//! A session is steered from a page, and goes on when nobody is there.

use std::process::Command;

use serde_json::json;

use super::program::{Program, protocol};
use crate::workspace::PROGRAM;

#[test]
fn nothing_moves_before_the_operator_says_so() {
    let mut program = Program::run(&[]);
    let mut operator = program.operator.live();
    let ready = operator.phase("ready");
    assert_eq!(ready["possible"], json!(["start", "abort"]));
    // A virtual wrist has no hand to ask about.
    assert_eq!(ready["questions"], json!({ "abort": "End the session now? It can be resumed." }));
    // Not sure is not said.
    operator.send(&json!({ "word": { "word": "start", "sure": false } }));
    operator.send(&json!({ "note": { "text": "still here", "clock": null } }));
    operator.until("the note", |message| message.to_string().contains("still here"));
    operator.phase("ready");
    operator.word("abort");
    operator.phase("aborted");
    drop(operator);
    assert_eq!(program.ends(), Some(1));
    assert!(program.journal().iter().all(|record| record["event"] != "start"));
}

#[test]
fn a_session_is_paused_skipped_repeated_and_finished() {
    let mut program = Program::run(&["--speed", "20"]);
    let mut operator = program.operator.live();
    let paused = operator.pause_after_the_first_trial();
    assert_eq!(paused["possible"], json!(["resume", "skip", "repeat", "abort"]));
    let total = paused["total"].as_u64().unwrap();
    operator.word("repeat");
    operator.until("one more to do", |message| message["done"].as_u64() < paused["done"].as_u64());
    operator.word("skip");
    operator.until("one less to do", |message| message["total"].as_u64() == Some(total - 1));
    operator.word("resume");
    operator.phase("finished");
    drop(operator);
    assert_eq!(program.ends(), Some(0));
    let trials = std::fs::read_to_string(program.session.join("trials.csv")).unwrap();
    let count = |status: &str| trials.lines().filter(|line| line.contains(status)).count();
    assert_eq!((count(",ok,"), count(",rejected,repeat,"), count(",aborted,")), (7, 1, 0));
    assert!(program.session.join("results/report.html").exists());
}

#[test]
fn a_page_that_comes_later_sees_how_it_stands_at_once() {
    let program = Program::run(&["--speed", "10"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    operator.word("start");
    operator.until("the third trial", |message| message["trial"]["number"] == 3);
    let mut later = program.operator.live();
    let hello = later.next().unwrap();
    assert_eq!(hello["kind"], "hello");
    assert_eq!(
        hello["transitions"].as_array().unwrap().len(),
        ramphold::session::transitions::TRANSITIONS.len()
    );
    let (story, now) = (later.next().unwrap(), later.next().unwrap());
    let (story, now) = if story["kind"] == "story" { (story, now) } else { (now, story) };
    assert!(story["trials"].as_array().unwrap().len() >= 3, "{story}");
    // Between trials there is no trial number, so what is done is compared.
    assert!(now["done"].as_u64().unwrap() >= 2, "{now}");
    assert!(now["bins"].as_array().unwrap().len() > 100, "the charts begin empty");
}

#[test]
fn without_its_operator_the_session_pauses_after_the_trial() {
    let program = Program::run(&["--speed", "5", "--operator-timeout", "0.2"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    operator.word("start");
    operator.phase("hold");
    drop(operator);
    let mut subject = program.subject.live();
    subject.until("a pause", |message| message["cue"] == "pause");
    let mut back = program.operator.live();
    back.phase("paused");
    let journal = program.journal();
    let missed = json!({ "missed": { "after_s": 0.2 } });
    assert!(journal.iter().any(|record| record["deed"] == missed && record["desk"] == "program"));
    assert!(journal.iter().any(|record| record["event"] == "pause"));
    let trials = std::fs::read_to_string(program.session.join("trials.csv")).unwrap();
    assert!(!trials.contains("aborted"), "a trial was broken off: {trials}");
}

#[test]
fn a_session_that_nobody_touches_is_the_session_without_a_console() {
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("alone");
    let status = Command::new(PROGRAM)
        .arg("run")
        .arg(protocol(folder.path()))
        .args(["--seed", "1", "--quiet", "--out"])
        .arg(&alone)
        .output()
        .unwrap()
        .status;
    assert!(status.success());
    let mut program = Program::run(&["--yes"]);
    assert_eq!(program.ends(), Some(0));
    let read = |folder: &std::path::Path, file: &str| std::fs::read(folder.join(file)).unwrap();
    for file in [
        "trials.csv",
        "trials/trial-001.csv",
        "trials/trial-008.csv",
        "results/fit.csv",
        "results/report.html",
    ] {
        assert!(read(&alone, file) == read(&program.session, file), "{file} is another");
    }
}

#[test]
fn an_interrupted_session_is_resumed_with_what_was_done() {
    let mut program = Program::run(&["--speed", "20"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    operator.word("start");
    operator.until("two trials", |message| message["done"] == 2);
    operator.word("abort");
    operator.phase("aborted");
    drop(operator);
    assert_eq!(program.ends(), Some(1));
    let mut program = program.again("resume", &["--console", "--speed", "20"]);
    let mut operator = program.operator.live();
    let ready = operator.phase("ready");
    assert_eq!((&ready["done"], &ready["total"]), (&json!(2), &json!(8)));
    let story = operator.until("the fits of both", |message| {
        let trials = message["trials"].as_array();
        trials.is_some_and(|trials| trials.iter().filter(|trial| trial.get("fit").is_some()).count() == 2)
    });
    assert!(story["trials"][0]["fit"]["vaf"].as_f64().unwrap() > 0.98);
    operator.word("start");
    operator.phase("finished");
    drop(operator);
    assert_eq!(program.ends(), Some(0));
}
