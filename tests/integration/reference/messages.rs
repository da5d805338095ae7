//! The messages that the book quotes are those of the program.

use std::fs;
use std::path::{Path, PathBuf};

const PAGE: &str = include_str!("../../../docs/how-to/what-to-do-when.md");

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Source text with every string literal on one line and without escapes.
fn joined(source: &str) -> String {
    let mut text = String::new();
    for line in source.lines() {
        match text.strip_suffix('\\') {
            Some(begun) => text = format!("{begun}{}", line.trim_start()),
            None => {
                text.push('\n');
                text.push_str(line);
            }
        }
    }
    text.replace("\\\"", "\"")
}

#[test]
fn every_message_that_the_book_quotes_is_one_of_the_program() {
    let mut files = Vec::new();
    sources(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")), &mut files);
    let code: Vec<String> = files.iter().map(|file| joined(&fs::read_to_string(file).unwrap())).collect();
    let blocks = PAGE.split("```text\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut count = 0;
    for message in blocks.flat_map(str::lines) {
        // What changes from case to case is written as an ellipsis.
        for part in message.split('…').map(str::trim).filter(|part| part.len() > 3) {
            let known = code.iter().any(|text| text.contains(part));
            assert!(
                known,
                "docs/how-to/what-to-do-when.md quotes {part:?}, which the program does not print"
            );
            count += 1;
        }
    }
    assert!(count > 20, "{count} parts of messages found");
}
