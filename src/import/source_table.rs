//! The tables of a source: names of columns, and their numbers.

/// A table of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceTable {
    /// Name for messages: the file, and the part of it.
    pub name: String,
    /// Columns of equal length, by name.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl SourceTable {
    /// The column called `name`.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(own, _)| own == name).map(|(_, values)| values.as_slice())
    }

    /// The names of the columns, for a message.
    pub fn names(&self) -> String {
        self.columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
    }
}
