//! Files and values that are given in the wrong place.

use std::fs;

use crate::workspace::{Workspace, output_of, ramphold};

#[test]
fn a_study_a_person_or_a_rig_given_to_run_is_recognised() {
    let files = [
        ("protocols/de-vlugt-2011-study.json", "ramphold cohort protocols/de-vlugt-2011-study.json"),
        ("protocols/de-vlugt-2011-person.json", "--subject protocols/de-vlugt-2011-person.json"),
        ("protocols/de-vlugt-2011-rig.json", "--rig protocols/de-vlugt-2011-rig.json"),
    ];
    for (file, advice) in files {
        let (_, told) = output_of(&mut ramphold(&["run", file]), 2);
        assert!(told.contains("not a protocol") && told.contains(advice), "{told}");
    }
}

#[test]
fn a_negative_seed_is_told_what_a_seed_is() {
    let (_, told) = output_of(&mut ramphold(&["run", "protocols/quick.json", "--seed", "-1"]), 2);
    assert!(told.contains("a whole number from 0 to"), "{told}");
}

#[test]
fn every_missing_field_says_what_is_expected() {
    let workspace = Workspace::new();
    fs::write(workspace.path("empty.json"), "{}\n").unwrap();
    let (_, told) = workspace.call(2, &["check", "empty.json"]);
    assert!(!told.contains("expected: :"), "{told}");
    assert!(
        told.contains("\"kind\": \"williams\"") || told.contains("williams"),
        "the orders are listed: {told}"
    );
}
