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
    /// What the source itself says of its columns.
    pub stated: StatedColumns,
}

/// What a source says of its columns, beside their names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StatedColumns {
    /// Whether the column of time is of samples that the format itself says to be even.
    pub is_even: bool,
    /// Units as the source spells them, by column.
    pub units: Vec<(String, String)>,
}

impl SourceTable {
    /// A table all of whose columns can be used.
    pub fn new(name: String, columns: Vec<(String, Vec<f64>)>) -> Self {
        Self { name, columns, unusable: Vec::new(), stated: StatedColumns::default() }
    }

    /// The column called `name`, if it is the only one.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let mut called = self.columns.iter().filter(|(own, _)| own == name);
        match (called.next(), called.next()) {
            (Some((_, values)), None) => Some(values),
            _ => None,
        }
    }

    /// The unit that the source gives the column called `name`, as it spells it.
    pub fn stated_unit(&self, name: &str) -> Option<&str> {
        self.stated.units.iter().find(|(own, _)| own == name).map(|(_, unit)| unit.as_str())
    }

    /// Why there is no column called `name` to use, for a message.
    pub fn why_not(&self, name: &str) -> String {
        match self.unusable.iter().find(|(own, _)| own == name) {
            Some((_, reason)) => format!("cannot use column {name:?}: {reason}"),
            None if self.columns.iter().any(|(own, _)| own == name) => {
                format!("has several columns {name:?} (rename all but one)")
            }
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
