//! Names that can be part of a path and lead nowhere else.

/// Whether a text can be the name of one file: not empty, without separators and control characters, and more than dots.
pub fn is_single_name(text: &str) -> bool {
    !text.trim_matches(['.', ' ']).is_empty() && !text.chars().any(|c| c.is_control() || "/\\:".contains(c))
}

/// Whether a text is a name of letters, digits, -, _ and . such as `S03`, so that it can stand in a path, a table and a message.
pub fn is_plain_name(text: &str) -> bool {
    !text.trim_matches('.').is_empty() && text.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_spaces_is_one_and_a_path_is_none() {
        for name in ["S03", "average of the eight", "Zoë", "a..b", ".hidden"] {
            assert!(is_single_name(name), "{name:?}");
        }
        for path in ["", ".", "..", " ", ". .", "../../evil", "/tmp/evil", "a/b", "a\\b", "C:evil", "a\u{7}b"]
        {
            assert!(!is_single_name(path), "{path:?}");
        }
    }
}
