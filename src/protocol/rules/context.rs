//! What every rule needs: the document, and where problems go.

use std::collections::HashSet;

use crate::protocol::Problem;
use crate::protocol::source::{JsonContent, JsonNode};

/// The document that is checked, and the problems found so far.
pub(super) struct Rules<'a> {
    pub(super) document: &'a JsonNode,
    /// Paths whose value is already known to be wrong.
    pub(super) known: HashSet<String>,
    pub(super) problems: &'a mut Vec<Problem>,
}

impl Rules<'_> {
    /// The number at `path`; none if it is missing or already known to be wrong.
    pub(super) fn number(&self, path: &str) -> Option<f64> {
        self.document.at(path).filter(|_| !self.known.contains(path))?.number()
    }

    /// The numbers of a list that are usable, each with its path.
    pub(super) fn numbers(&self, list: &str) -> Vec<(String, f64)> {
        let paths = (0..self.length(list)).map(|index| format!("{list}[{index}]"));
        paths.filter_map(|path| self.number(&path).map(|number| (path, number))).collect()
    }

    /// The length of a list; 0 if it is missing.
    pub(super) fn length(&self, list: &str) -> usize {
        match self.document.at(list).map(|node| &node.content) {
            Some(JsonContent::Array(items)) => items.len(),
            _ => 0,
        }
    }

    /// Adds a problem with the value at `path`; a value that is missing is left to the schema.
    pub(super) fn add(&mut self, path: &str, expected: String, advice: String) {
        let Some(node) = self.document.at(path) else { return };
        let value = Some(node.to_string());
        self.problems.push(Problem { path: path.to_owned(), line: node.line, value, expected, advice });
    }
}
