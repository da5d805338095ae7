//! What the README tells a newcomer to type works.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::workspace::PROGRAM;

const README: &str = include_str!("../../README.md");

/// The lines of the README's shell example, in order, in a folder with the repository's protocols.
fn run_the_example(folder: &Path) {
    let protocols = folder.join("protocols");
    fs::create_dir(&protocols).unwrap();
    let quick = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/quick.json");
    fs::copy(quick, protocols.join("quick.json")).unwrap();
    let lines: Vec<&str> = README.lines().filter_map(|line| line.strip_prefix("    ramphold ")).collect();
    let lines: Vec<&str> = lines.into_iter().filter(|line| !line.starts_with("VERB")).collect();
    assert!(lines.len() >= 5, "{lines:?}");
    for line in lines {
        let line = line.split('#').next().unwrap_or_default();
        let output =
            Command::new(PROGRAM).args(line.split_whitespace()).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "ramphold {line}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(!output.stdout.is_empty(), "ramphold {line} prints nothing");
    }
}

#[test]
fn the_commands_and_the_python_example_of_the_readme_work() {
    let folder = tempfile::tempdir().unwrap();
    run_the_example(folder.path());
    let python = README.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let interpreter = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
    let output = Command::new(&interpreter)
        .args(["-c", python])
        .env("MPLBACKEND", "Agg")
        .current_dir(folder.path())
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}; scripts/test sets it up", interpreter.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let picture = fs::read(folder.path().join("k_srs.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG") && picture.len() > 5000, "{} bytes", picture.len());
}

#[test]
fn the_files_that_the_readme_and_the_decisions_link_to_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let decisions = fs::read_to_string(root.join("docs/explanation/decisions/README.md")).unwrap();
    for (text, folder) in [(README, root.to_owned()), (&decisions, root.join("docs/explanation/decisions"))] {
        let links: Vec<&str> = text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
        assert!(links.len() >= 5, "{links:?}");
        for link in links {
            assert!(folder.join(link).exists(), "{link} is not there");
        }
    }
}

#[test]
fn the_persons_rigs_and_models_in_the_docs_can_be_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("docs/how-to/virtual-wrist.md")).unwrap();
    let blocks: Vec<&str> =
        text.split("```json\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    let [person, rig, model] = blocks[..] else { panic!("{blocks:?}") };
    let folder = tempfile::tempdir().unwrap();
    for (file, json) in [("person.json", person), ("rig.json", rig), ("model.json", model)] {
        fs::write(folder.path().join(file), json).unwrap();
    }
    let output = Command::new(PROGRAM)
        .arg("run")
        .arg(root.join("protocols/quick.json"))
        .args(["--subject", "person.json", "--rig", "rig.json", "--model", "model.json", "--out", "s"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
