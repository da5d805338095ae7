//! The documentation shows the table that the machine uses.

use crate::session::rules::{CHANGES, RULES};
use crate::session::transitions;

#[test]
fn the_documented_table_and_diagram_are_those_of_the_machine() {
    let docs = include_str!("../../../docs/reference/states.md");
    for (kind, text) in [("text", transitions::text()), ("mermaid", transitions::mermaid())] {
        let block = format!("```{kind}\n{text}```\n");
        assert!(docs.contains(&block), "docs/reference/states.md must contain:\n{block}");
    }
}

#[test]
fn every_change_of_the_rules_is_documented() {
    let docs =
        include_str!("../../../docs/reference/states.md").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(docs.contains(&format!("In force: rules {RULES}.")));
    for change in CHANGES {
        let line = format!("- Rules {}: {}.", change.rules, change.text);
        assert!(docs.contains(&line), "docs/reference/states.md must contain: {line}");
    }
}
