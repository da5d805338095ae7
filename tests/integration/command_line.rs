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

/// The names of the verbs in the help of the program.
fn verbs() -> Vec<String> {
    let (help, _) = output_of(&mut ramphold(&["--help"]), 0);
    let (_, list) = help.split_once("Commands:\n").unwrap();
    let lines = list.lines().take_while(|line| !line.is_empty());
    let names: Vec<String> =
        lines.filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect();
    assert!(names.len() > 25, "{names:?}");
    names
}

#[test]
fn completions_have_every_verb_and_their_shell_can_read_them() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let (script, _) = output_of(&mut ramphold(&["completions", shell]), 0);
        for verb in verbs() {
            assert!(script.contains(&verb), "the completions of {shell} lack {verb}");
        }
        let file = folder.path().join(shell);
        std::fs::write(&file, script).unwrap();
        // The first three say with -n whether they could read a script. Not every machine has each of them.
        if ["bash", "zsh", "fish"].contains(&shell)
            && let Ok(output) = std::process::Command::new(shell).arg("-n").arg(&file).output()
        {
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success() && message.is_empty(), "{shell}: {message}");
        }
    }
    output_of(&mut ramphold(&["completions", "no-such-shell"]), 2);
}

#[cfg(unix)]
#[test]
fn bash_completes_verbs_options_and_values() {
    let (script, _) = output_of(&mut ramphold(&["completions", "bash"]), 0);
    let completed = |words: &str, last: &str| {
        let ask = format!(
            "{script}\nCOMP_WORDS=({words} {last}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))\n\
             _ramphold ramphold {last} \"${{COMP_WORDS[COMP_CWORD - 1]}}\"; echo \"${{COMPREPLY[@]}}\""
        );
        output_of(std::process::Command::new("bash").args(["--norc", "-c", &ask]), 0).0
    };
    assert_eq!(completed("ramphold", "diag"), "diagnose\n");
    assert_eq!(completed("ramphold fit", "--win"), "--window\n");
    assert_eq!(completed("ramphold schema", "per"), "person\n");
}
