//! Names that can be part of a path and lead nowhere else.

/// Whether a text is a name of letters, digits, -, _ and . such as `S03`, so that it can stand in a path, a table and a message.
pub fn is_plain_name(text: &str) -> bool {
    !text.trim_matches('.').is_empty() && text.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c))
}
