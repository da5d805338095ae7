//! `ramphold schedule`: the order of trials that a seed gives.

use crate::workspace::{QUICK, Workspace, output_of, ramphold};

#[test]
fn schedule_prints_the_order_as_csv() {
    let run = || output_of(&mut ramphold(&["schedule", QUICK, "--seed", "1"]), 0);
    let (printed, message) = run();
    insta::assert_snapshot!(printed);
    assert_eq!(message, "");
    assert_eq!(run().0, printed);
}

#[test]
fn schedule_asks_for_a_seed() {
    let (printed, message) = output_of(&mut ramphold(&["schedule", QUICK]), 2);
    assert_eq!(printed, "");
    assert!(message.contains("--seed <N>"), "{message}");
}

#[test]
fn a_williams_square_asks_for_the_subject_number_and_takes_its_row() {
    let workspace = Workspace::new();
    let text = include_str!("../../protocols/quick.json").replace("shuffled", "williams");
    std::fs::write(workspace.path("williams.json"), text).unwrap();
    let schedule = ["schedule", "williams.json", "--seed", "1"];
    let (printed, message) = workspace.call(2, &schedule);
    assert_eq!(printed, "");
    assert!(message.contains("--subject-number"), "{message}");
    let row = |number| output_of(workspace.ramphold(&schedule).args(["--subject-number", number]), 0).0;
    assert_ne!(row("1"), row("2"));
    assert_eq!(row("1"), row("5"), "a square of 4 conditions has 4 rows");
}
