//! What the source must keep to, held against every file.

use std::fs;
use std::path::{Path, PathBuf};

/// Every Rust file under `src`, with its text.
fn sources() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).unwrap();
                found.push((path, text));
            }
        }
    }
    assert!(found.len() > 50, "the source was not found");
    found
}

/// The line with its comment and strings aside, as far as a search for a word needs it.
fn code(line: &str) -> String {
    let code = line.split("//").next().unwrap_or_default();
    code.split('"').step_by(2).collect::<Vec<_>>().join("\"\"")
}

#[test]
fn every_unsafe_says_why_it_is_sound() {
    for (path, text) in sources() {
        let lines: Vec<&str> = text.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            let code = code(line);
            let words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
            // The type of a foreign function does nothing: its calls must say why they are sound.
            if !words.clone().any(|word| word == "unsafe") || code.contains("unsafe extern") {
                continue;
            }
            let reasoned =
                lines[number.saturating_sub(6)..=number].iter().any(|line| line.contains("SAFETY:"));
            assert!(reasoned, "{}:{}: unsafe without a SAFETY comment", path.display(), number + 1);
        }
    }
}

/// The kernel stamps CAN frames with the wall clock; what is read there is the difference to the present, at once.
const KERNEL_STAMPS: [&str; 2] = ["rig/can/bus/socketcan.rs", "rig/can/bus/arrival.rs"];

/// Records of who did what when, which nothing depends on.
const RECORDS: [&str; 2] = ["app/wall_clock.rs", "timing/clock_stamp.rs"];

/// A clock that is set back cannot disturb a session that does not look at it.
#[test]
fn nothing_reads_the_wall_clock() {
    for (path, text) in sources() {
        if KERNEL_STAMPS.iter().chain(&RECORDS).any(|stamps| path.ends_with(stamps)) {
            continue;
        }
        for (number, line) in text.lines().enumerate() {
            for clock in ["SystemTime", "UNIX_EPOCH", "Utc::now", "Local::now"] {
                assert!(!code(line).contains(clock), "{}:{}: {clock}", path.display(), number + 1);
            }
        }
    }
}

#[test]
fn nothing_is_left_undone() {
    for (path, text) in sources() {
        for (number, line) in text.lines().enumerate() {
            for word in ["todo!(", "unimplemented!(", "dbg!("] {
                assert!(!code(line).contains(word), "{}:{}: {word}", path.display(), number + 1);
            }
        }
    }
}
