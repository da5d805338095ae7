//! Tables as HTML, which can also be copied into a spreadsheet.

use std::fmt::Write;

use super::scale::{escape, significant, with_spread};

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

    fn html(&self) -> String {
        match self {
            Self::Text(text) => format!("<td class=\"words\">{}</td>", escape(text)),
            Self::Number(text) => format!("<td>{}</td>", escape(text)),
            Self::Spread(None, _) => "<td data-tsv=\"\t\">–</td>".into(),
            Self::Spread(Some(mean), None) => {
                format!("<td data-tsv=\"{mean}\t\">{}</td>", significant(*mean, 3))
            }
            Self::Spread(Some(mean), Some(sd)) => {
                let (shown, spread) = with_spread(*mean, *sd);
                format!("<td data-tsv=\"{mean}\t{sd}\">{shown}&nbsp;±&nbsp;{spread}</td>")
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
             <div class=\"scroll\" tabindex=\"0\"><table><thead><tr>",
            escape(&self.caption)
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
            for cell in row {
                html += &cell.html();
            }
            html += "</tr>";
        }
        html + "</tbody></table></div></div>"
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
        };
        let html = table.html();
        assert!(html.contains("data-tsv=\"15.512\t0.98\">15.51&nbsp;±&nbsp;0.98"), "{html}");
        assert!(html.contains("data-tsv=\"x_e (mrad)\t± x_e (mrad)\"") && html.contains("&lt;values&gt;"));
    }
}
