//! What the book tells a newcomer to type works, and the files that it names are there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::workspace::PROGRAM;

const FIRST_SESSION: &str = include_str!("../../docs/getting-started/first-session.md");
const OWN_DATA: &str = include_str!("../../docs/how-to/own-data.md");

/// Runs the commands of the short session, in order, in a folder with the repository's quick protocol.
fn run_the_example(folder: &Path) {
    let protocols = folder.join("protocols");
    fs::create_dir(&protocols).unwrap();
    let quick = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/quick.json");
    fs::copy(quick, protocols.join("quick.json")).unwrap();
    let (_, section) = FIRST_SESSION.split_once("## A short session").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let lines: Vec<&str> = section.lines().filter_map(|line| line.strip_prefix("    ramphold ")).collect();
    assert!(lines.len() >= 5, "{lines:?}");
    for line in lines {
        let output =
            Command::new(PROGRAM).args(line.split_whitespace()).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "ramphold {line}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(!output.stdout.is_empty(), "ramphold {line} prints nothing");
    }
}

#[test]
fn the_commands_and_the_python_example_of_the_book_work() {
    let folder = tempfile::tempdir().unwrap();
    run_the_example(folder.path());
    let python = OWN_DATA.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
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

/// The pages of the book and the README.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("docs")];
    let mut pages = vec![root.join("README.md")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages
}

/// The paths in backquotes that begin with a folder of the repository, without their arguments.
fn named_paths(text: &str) -> impl Iterator<Item = &str> {
    const FOLDERS: [&str; 8] =
        ["src/", "tests/", "scripts/", "fixtures/", "benches/", "examples/", "fuzz/", "docs/"];
    let words = text.split('`').skip(1).step_by(2).filter_map(|code| code.split_whitespace().next());
    words.filter(|word| FOLDERS.iter().any(|folder| word.starts_with(folder)) && !word.contains(['*', '<']))
}

#[test]
fn every_file_of_the_repository_that_a_page_names_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        // Blocks of code would shift the pairs of backquotes.
        let prose: String = text.split("```").step_by(2).collect();
        for path in named_paths(&prose) {
            assert!(root.join(path).exists(), "{}: {path} is not there", page.display());
            count += 1;
        }
    }
    assert!(count > 30, "{count} paths found");
}

#[test]
fn the_subjects_rigs_and_models_of_the_book_can_be_run() {
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

/// The constants of `src/files/limits.rs` that are one number, and their values.
fn limits() -> Vec<(String, f64)> {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/src/files/limits.rs")).unwrap();
    let value = |text: &str| match text.split_once(" << ") {
        Some((number, bits)) => {
            number.parse::<f64>().unwrap() * f64::from(1u32 << bits.parse::<u32>().unwrap())
        }
        None => text.replace('_', "").parse().unwrap(),
    };
    let constant = |line: &'static str| line.strip_prefix("pub const ")?.strip_suffix(';')?.split_once(" = ");
    let constants = text.leak().lines().filter_map(constant).filter(|(_, value)| !value.starts_with('['));
    constants.map(|(name, number)| (name.split(':').next().unwrap().to_owned(), value(number))).collect()
}

#[test]
fn the_page_on_security_has_every_limit_with_its_value() {
    let page =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/explanation/security.md")).unwrap();
    assert!(limits().len() > 15);
    for (name, value) in limits() {
        let row = page.lines().find(|line| line.ends_with(&format!("| `{name}` |")));
        let row = row.unwrap_or_else(|| panic!("{name} is not in the table"));
        let shown = row.split('|').nth(2).unwrap().trim().split(' ').next().unwrap();
        assert_eq!(shown.parse::<f64>().unwrap(), value, "{name}");
    }
}
