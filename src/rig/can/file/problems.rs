//! Collects what is wrong with a rig file.

use crate::protocol::Problem;
use crate::protocol::source::JsonNode;

/// Collects what is wrong, each with its line.
pub(super) struct Problems<'a> {
    source: &'a JsonNode,
    problems: Vec<Problem>,
}

impl<'a> Problems<'a> {
    /// None yet, in the file that was read as `source`.
    pub fn new(source: &'a JsonNode) -> Self {
        Self { source, problems: Vec::new() }
    }

    /// All of them.
    pub fn into_list(self) -> Vec<Problem> {
        self.problems
    }

    /// Notes what was expected at a path, and what to do.
    pub fn add(&mut self, path: &str, expected: impl Into<String>, advice: impl Into<String>) {
        let place = self.source.at(path);
        self.problems.push(Problem {
            path: path.to_owned(),
            line: place.map_or(1, |node| node.line),
            value: place.map(ToString::to_string),
            expected: expected.into(),
            advice: advice.into(),
        });
    }

    /// Notes a number outside a range, or one that is none.
    pub fn in_range(&mut self, path: &str, value: f64, low: f64, high: f64) {
        if !(low..=high).contains(&value) {
            self.add(path, format!("a number from {low} to {high}"), "");
        }
    }
}
