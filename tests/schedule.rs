//! `ramphold schedule`, and the frame of the command line that all verbs share.

use std::process::Command as Process;

use assert_cmd::Command;

fn ramphold(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ramphold"));
    command.args(arguments);
    command
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn schedule_prints_the_order_as_csv() {
    let run = || ramphold(&["schedule", "protocols/quick.json", "--seed", "1"]).assert().code(0).stderr("");
    let printed = words(&run().get_output().stdout);
    insta::assert_snapshot!(printed);
    run().stdout(printed);
}

#[test]
fn schedule_asks_for_a_seed() {
    let output = ramphold(&["schedule", "protocols/quick.json"]).assert().code(2).stdout("");
    assert!(words(&output.get_output().stderr).contains("--seed <N>"));
}

#[test]
fn a_williams_square_asks_for_the_subject_s_number_and_takes_its_row() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("williams.json");
    let text = include_str!("../protocols/quick.json").replace("shuffled", "williams");
    std::fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();

    let output = ramphold(&["schedule", file, "--seed", "1"]).assert().code(2).stdout("");
    assert!(words(&output.get_output().stderr).contains("--subject-number"));
    let row = |number| {
        let output =
            ramphold(&["schedule", file, "--seed", "1", "--subject-number", number]).assert().code(0);
        words(&output.get_output().stdout)
    };
    assert_ne!(row("1"), row("2"));
    assert_eq!(row("1"), row("5"), "a square of 4 conditions has 4 rows");
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Process::new(env!("CARGO_BIN_EXE_ramphold"))
        .args(["schedule", "protocols/de-vlugt-2011.json", "--seed", "1"])
        .stdout(writer)
        .output()
        .unwrap();
    assert_eq!(words(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_written_are_a_failure() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = Process::new(env!("CARGO_BIN_EXE_ramphold"))
        .args(["schedule", "protocols/quick.json", "--seed", "1"])
        .stdout(full)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output.stderr).contains("standard output cannot be written"), "{}", words(&output.stderr));
}

#[test]
fn without_a_verb_the_help_is_printed() {
    let output = ramphold(&[]).assert().code(2);
    let help = words(&output.get_output().stderr);
    assert!(
        help.contains("Usage: ramphold") && help.contains("schedule") && help.contains("Exit codes"),
        "{help}"
    );
    ramphold(&["--help"]).assert().code(0).stderr("");
    ramphold(&["no-such-verb"]).assert().code(2).stdout("");
}

#[test]
fn schema_prints_the_committed_schema() {
    ramphold(&["schema"]).assert().code(0).stdout(include_str!("../protocols/protocol.schema.json"));
}

/// The examples are read out of the help itself. Those of verbs that write are run in a folder of their own.
#[test]
fn the_examples_in_the_help_of_the_reading_verbs_work() {
    for verb in ["check", "schedule", "schema"] {
        let help = words(&ramphold(&[verb, "--help"]).assert().code(0).get_output().stdout);
        let example = help.lines().find_map(|line| line.strip_prefix("  ramphold ")).expect("an example");
        let command = example.split(" > ").next().unwrap();
        ramphold(&command.split(' ').collect::<Vec<_>>()).assert().code(0);
    }
}
