//! The tables of a source: names of columns, and their numbers.

/// A table of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceTable {
    /// Name for messages: the file, and the part of it.
    pub name: String,
    /// Columns of equal length, by name.
    pub columns: Vec<(String, Vec<f64>)>,
    /// Columns of the source that cannot be used, by name, each with its reason.
    pub unusable: Vec<(String, String)>,
}

impl SourceTable {
    /// A table all of whose columns can be used.
    pub fn new(name: String, columns: Vec<(String, Vec<f64>)>) -> Self {
        Self { name, columns, unusable: Vec::new() }
    }

    /// The column called `name`.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(own, _)| own == name).map(|(_, values)| values.as_slice())
    }

    /// Why there is no column called `name` to use, for a message.
    pub fn why_not(&self, name: &str) -> String {
        match self.unusable.iter().find(|(own, _)| own == name) {
            Some((_, reason)) => format!("cannot use column {name:?}: {reason}"),
            None => format!("has no column {name:?}"),
        }
    }

    /// The names of the columns, for a message; those that cannot be used with their reason.
    pub fn names(&self) -> String {
        let usable = self.columns.iter().map(|(name, _)| name.clone());
        let others = self.unusable.iter().map(|(name, reason)| format!("{name} (not usable: {reason})"));
        usable.chain(others).collect::<Vec<_>>().join(", ")
    }
}
