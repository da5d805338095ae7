//! The documentation shows the table that the machine uses.

use crate::session::table;

#[test]
fn the_documented_table_and_diagram_are_those_of_the_machine() {
    let docs = include_str!("../../../docs/states.md");
    for (kind, text) in [("text", table::text()), ("mermaid", table::mermaid())] {
        let block = format!("```{kind}\n{text}```\n");
        assert!(docs.contains(&block), "docs/states.md must contain:\n{block}");
    }
}
