//! A recording of another rig becomes a session.

use std::fs;

use crate::workspace::{Workspace, files};

const RECORDINGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/other-rig/recordings");
const MAPPING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/other-rig/mapping.json");

#[test]
fn the_example_of_the_repository_is_imported_and_fitted() {
    let workspace = Workspace::new();
    let (listed, _) = workspace.call(0, &["import", RECORDINGS, "--mapping", MAPPING, "--dry-run"]);
    assert!(listed.contains("1.30") && listed.contains("2.60"), "{listed}");
    assert!(files(workspace.folder()).is_empty(), "a dry run writes nothing");
    workspace.call(0, &["import", RECORDINGS, "--mapping", MAPPING, "--out", "s"]);
    assert!(workspace.path("s/import.svg").is_file());
    let (table, _) = workspace.call(0, &["fit", "s"]);
    assert!(table.starts_with("S01: 2 trials, 2 conditions"), "{table}");
    let (_, told) = workspace.call(2, &["import", RECORDINGS, "--mapping", MAPPING, "--out", "s"]);
    assert!(told.contains("not overwritten"), "{told}");
    let (_, told) = workspace.call(2, &["watch", "s"]);
    assert!(told.contains("measured elsewhere") && told.contains("ramphold report"), "{told}");
}

#[test]
fn a_sign_that_is_turned_is_told_before_the_fit() {
    let workspace = Workspace::new();
    let text = fs::read_to_string(MAPPING).unwrap().replace("\"sign\": -1, ", "");
    fs::write(workspace.path("m.json"), text).unwrap();
    let (_, told) = workspace.call(0, &["import", RECORDINGS, "--mapping", "m.json", "--dry-run"]);
    assert!(told.contains("ramphold fit will refuse this: resistance"), "{told}");
}

#[test]
fn without_a_mapping_and_a_terminal_the_columns_are_named() {
    let workspace = Workspace::new();
    let (_, told) = workspace.call(2, &["import", RECORDINGS]);
    assert!(told.contains("--mapping is required") && told.contains("Time, Pos, Tq"), "{told}");
}

#[test]
fn every_missing_field_of_a_session_is_told_at_once() {
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("s")).unwrap();
    fs::write(workspace.path("s/session.json"), "{ \"format\": \"ramphold-session/1\" }").unwrap();
    let (_, told) = workspace.call(2, &["fit", "s"]);
    for field in ["subject.id", "sample_rate_hz", "rig.lever", "recorded_filter", "ramphold schema session"] {
        assert!(told.contains(field), "{field} is not in: {told}");
    }
    let (schema, _) = workspace.call(0, &["schema", "session"]);
    assert!(schema.contains("recorded_filter") && schema.contains("inertia_kg_m2"));
}
