//! Texts of strangers in messages: short, and without characters that a terminal obeys.

use std::borrow::Cow;
use std::fmt::Write;

use super::limits::QUOTED_CHARACTERS;

/// The beginning of a text, for a message that quotes it; `...` stands for the rest.
pub fn excerpt(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(QUOTED_CHARACTERS) {
        None => Cow::Borrowed(text),
        Some((end, _)) => Cow::Owned(format!("{}...", &text[..end])),
    }
}

/// A text in which every control character but the line break and the tabulator is written as its number, such as
/// `\u001b`, and so are the characters that reverse the direction of writing.
pub fn without_controls(text: &str) -> Cow<'_, str> {
    if !text.contains(is_control) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if is_control(character) {
            // Four digits, so that it is an escape of JSON as well. Writing into memory does not fail.
            let _ = write!(safe, "\\u{:04x}", u32::from(character));
        } else {
            safe.push(character);
        }
    }
    Cow::Owned(safe)
}

fn is_control(character: char) -> bool {
    let reverses = matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (character.is_control() && !matches!(character, '\n' | '\t')) || reverses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_finds_nothing_to_obey() {
        let text = "S\u{1b}]0;owned\u{7} \u{9b}2J\r \u{202e}\n\t\u{e4}";
        assert_eq!(without_controls(text), "S\\u001b]0;owned\\u0007 \\u009b2J\\u000d \\u202e\n\t\u{e4}");
        assert!(matches!(without_controls("plain \u{e4}"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_long_text_is_quoted_by_its_beginning() {
        assert_eq!(excerpt("short"), "short");
        assert_eq!(excerpt(&"\u{e4}".repeat(10_000)).chars().count(), QUOTED_CHARACTERS + 3);
    }
}
