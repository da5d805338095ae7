//! The columns of tables of text, such as `trials.csv` and `fit.csv`: what a file calls them, and which hold numbers.

use std::collections::{BTreeMap, BTreeSet};

use super::mat_file::field_name;

/// A column of a table of text.
#[derive(Debug, Clone, PartialEq)]
pub struct TextColumn {
    /// Name in the table.
    pub name: String,
    /// Name in the exported file: letters, digits and underscores, a letter first, at most 63 of them.
    pub field: String,
    /// Whether every cell that is not empty is a number.
    pub is_number: bool,
}

impl TextColumn {
    /// The number of a row; `None` for an empty cell, or a row without the column.
    pub fn number(&self, row: &BTreeMap<String, String>) -> Option<f64> {
        self.text(row).parse().ok()
    }

    /// The text of a row; empty for a row without the column.
    pub fn text<'a>(&self, row: &'a BTreeMap<String, String>) -> &'a str {
        row.get(&self.name).map_or("", String::as_str)
    }
}

/// The columns of all `rows`, in alphabetical order. None gets a name in `taken`.
pub fn text_columns<'a>(
    rows: impl Iterator<Item = &'a BTreeMap<String, String>> + Clone,
    taken: &[&str],
) -> Vec<TextColumn> {
    let names: BTreeSet<&String> = rows.clone().flat_map(BTreeMap::keys).collect();
    let is_number = |name: &String| {
        let cells = rows.clone().filter_map(|row| row.get(name)).filter(|cell| !cell.is_empty());
        cells.clone().count() > 0 && cells.clone().all(|cell| cell.parse::<f64>().is_ok())
    };
    let mut taken: BTreeSet<String> = taken.iter().map(|name| (*name).to_owned()).collect();
    let mut columns = Vec::new();
    for name in names {
        let stem = field_name(name);
        // Names that only differ in characters that are not allowed get a number.
        let numbered = (2..).map(|number| {
            let ending = format!("_{number}");
            format!("{}{ending}", &stem[..stem.len().min(63 - ending.len())])
        });
        let free = std::iter::once(stem.clone()).chain(numbered).find(|own| !taken.contains(own));
        let Some(field) = free else { continue };
        taken.insert(field.clone());
        columns.push(TextColumn { name: name.clone(), field, is_number: is_number(name) });
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_numbers_where_all_cells_are_and_get_names_of_their_own() {
        let row = |cells: &[(&str, &str)]| -> BTreeMap<String, String> {
            cells.iter().map(|(name, cell)| ((*name).to_owned(), (*cell).to_owned())).collect()
        };
        let rows = [row(&[("a b", "1"), ("a-b", "x"), ("id", "")]), row(&[("a b", ""), ("a-b", "2")])];
        let columns = text_columns(rows.iter(), &["id"]);
        let found: Vec<(&str, &str, bool)> =
            columns.iter().map(|own| (own.name.as_str(), own.field.as_str(), own.is_number)).collect();
        assert_eq!(found, [("a b", "a_b", true), ("a-b", "a_b_2", false), ("id", "id_2", false)]);
        assert_eq!((columns[0].number(&rows[0]), columns[0].number(&rows[1])), (Some(1.0), None));
        assert_eq!((columns[1].text(&rows[1]), columns[2].text(&rows[1])), ("2", ""));
    }
}
