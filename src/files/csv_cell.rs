//! Texts as cells of a CSV table that people open in a spreadsheet.

use std::borrow::Cow;

/// What a spreadsheet takes for the beginning of a formula.
const FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// A text as a cell of a CSV table, in quotes where necessary. A text that a spreadsheet would compute gets an apostrophe before
/// it, which shows it as it is; a number does not.
pub fn csv_cell(text: &str) -> String {
    let computes = text.starts_with(FORMULA) && text.parse::<f64>().is_err();
    let text: Cow<str> = if computes { format!("'{text}").into() } else { text.into() };
    if text.contains([',', '"', '\n', '\r', '#', ';']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.into()
    }
}

/// The text of a cell that [`csv_cell`] wrote.
pub fn text_of_cell(cell: &str) -> &str {
    cell.strip_prefix('\'').filter(|text| text.starts_with(FORMULA)).unwrap_or(cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_is_a_formula() {
        for formula in ["=cmd|' /C calc'!A0", "+SUM(A1)", "-x", "@now", "\t=1"] {
            let cell = csv_cell(formula);
            assert!(cell.trim_matches('"').starts_with('\''), "{cell}");
            assert_eq!(text_of_cell(cell.trim_matches('"')), formula);
        }
        for text in ["slow", "-1.5", "+3", "'quoted'"] {
            assert_eq!((csv_cell(text).as_str(), text_of_cell(text)), (text, text));
        }
        assert_eq!(csv_cell("=a,\"b\""), "\"'=a,\"\"b\"\"\"");
    }
}
