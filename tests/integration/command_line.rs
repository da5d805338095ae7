//! What all verbs share: help, exit codes, and an output that cannot be written.

use crate::workspace::{PAPER, QUICK, output_of, ramphold};

#[test]
fn a_reader_that_closes_the_pipe_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = ramphold(&["schedule", PAPER, "--seed", "1"]).stdout(writer).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_written_are_a_failure() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = ramphold(&["schedule", QUICK, "--seed", "1"]).stdout(full).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("standard output cannot be written"), "{message}");
}

#[test]
fn without_a_verb_the_help_is_printed() {
    let (_, help) = output_of(&mut ramphold(&[]), 2);
    for part in ["Usage: ramphold", "schedule", "Exit codes"] {
        assert!(help.contains(part), "{help}");
    }
    assert_eq!(output_of(&mut ramphold(&["--help"]), 0).1, "");
    assert_eq!(output_of(&mut ramphold(&["no-such-verb"]), 2).0, "");
}

#[test]
fn schema_prints_the_committed_schema() {
    let (printed, _) = output_of(&mut ramphold(&["schema"]), 0);
    assert_eq!(printed, include_str!("../../protocols/protocol.schema.json"));
}

/// The examples are taken from the help itself. Those of verbs that write need a folder of their own and are run elsewhere.
#[test]
fn the_examples_in_the_help_of_the_reading_verbs_work() {
    for verb in ["check", "schedule", "schema"] {
        let (help, _) = output_of(&mut ramphold(&[verb, "--help"]), 0);
        let example = help.lines().find_map(|line| line.strip_prefix("  ramphold ")).expect("an example");
        let command = example.split(" > ").next().unwrap();
        output_of(&mut ramphold(&command.split(' ').collect::<Vec<_>>()), 0);
    }
}
