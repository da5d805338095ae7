//! Tables as HTML, which can also be copied into a spreadsheet.

use std::fmt::Write;

use super::scale::{escape, significant, with_spread};

/// Largest number of columns that fit on a sheet of A4 at the size of other tables.
const WIDE: usize = 8;

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text.
    Text(String),
    /// A number as it is shown.
    Number(String),
    /// Mean and standard deviation: one cell here, two when copied.
    Spread(Option<f64>, Option<f64>),
}

/// A table.
#[derive(Debug, Clone)]
pub struct HtmlTable {
    /// Its caption.
    pub caption: String,
    /// Headings.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<Cell>>,
    /// What stands below it.
    pub note: Option<String>,
}

impl Cell {
    /// A text.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number with a number of significant digits; a dash if there is no number.
    pub fn number(value: Option<f64>, digits: i32) -> Self {
        Self::Number(value.map_or("–".into(), |value| significant(value, digits)))
    }

    /// As a cell of the table; `head` stands before it on a narrow screen, where each row is a list.
    fn html(&self, head: &str) -> String {
        let head = format!(" data-head=\"{}\"", escape(head));
        match self {
            Self::Text(text) => format!("<td class=\"words\"{head}>{}</td>", escape(text)),
            Self::Number(text) => format!("<td{head}>{}</td>", escape(text)),
            Self::Spread(None, _) => format!("<td{head} data-tsv=\"\t\">–</td>"),
            Self::Spread(Some(mean), None) => {
                format!("<td{head} data-tsv=\"{mean}\t\">{}</td>", significant(*mean, 3))
            }
            Self::Spread(Some(mean), Some(sd)) => {
                let (shown, spread) = with_spread(*mean, *sd);
                format!("<td{head} data-tsv=\"{mean}\t{sd}\">{shown}&nbsp;±&nbsp;{spread}</td>")
            }
        }
    }
}

impl HtmlTable {
    /// As a part of the page, with a button that copies it.
    pub fn html(&self) -> String {
        let spread =
            |column: usize| self.rows.iter().any(|row| matches!(row.get(column), Some(Cell::Spread(..))));
        let mut html = format!(
            "<div class=\"table\"><div class=\"bar\"><span>{}</span><button type=\"button\" class=\"copy\">copy</button></div>\
             <div class=\"scroll\" tabindex=\"0\"><table{}><thead><tr>",
            escape(&self.caption),
            if self.head.len() > WIDE { " class=\"wide\"" } else { "" }
        );
        for (column, name) in self.head.iter().enumerate() {
            let name = escape(name);
            let copied =
                if spread(column) { format!(" data-tsv=\"{name}\t± {name}\"") } else { String::new() };
            let words = |row: &Vec<Cell>| matches!(row.get(column), Some(Cell::Text(_)));
            let class = if self.rows.iter().any(words) { " class=\"words\"" } else { "" };
            let _ = write!(html, "<th{class}{copied}>{name}</th>");
        }
        html += "</tr></thead><tbody>";
        for row in &self.rows {
            html += "<tr>";
            for (cell, head) in row.iter().zip(&self.head) {
                html += &cell.html(head);
            }
            html += "</tr>";
        }
        html += "</tbody></table></div>";
        if let Some(note) = &self.note {
            let _ = write!(html, "<p class=\"note\">{}</p>", escape(note));
        }
        html + "</div>"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_one_cell_to_read_and_two_to_copy() {
        let table = HtmlTable {
            caption: "<values>".into(),
            head: vec!["condition".into(), "x_e (mrad)".into()],
            rows: vec![vec![Cell::text("a\tb"), Cell::Spread(Some(15.512), Some(0.98))]],
            note: Some("† biased".into()),
        };
        let html = table.html();
        assert!(html.contains("data-tsv=\"15.512\t0.98\">15.51&nbsp;±&nbsp;0.98"), "{html}");
        assert!(html.contains("data-tsv=\"x_e (mrad)\t± x_e (mrad)\"") && html.contains("&lt;values&gt;"));
        assert!(html.contains("data-head=\"x_e (mrad)\"") && html.contains("<p class=\"note\">† biased</p>"));
    }
}
