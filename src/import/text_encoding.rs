//! The characters of a table that another program wrote.

/// The text in UTF-8, in UTF-16 with its mark, as spreadsheets save "Unicode text", or else in Latin-1, in which every byte is a character.
pub fn text_of(bytes: Vec<u8>) -> String {
    let in_utf_16 = |word: fn([u8; 2]) -> u16| {
        let words = bytes[2..].chunks_exact(2).map(|pair| word([pair[0], pair[1]]));
        char::decode_utf16(words).map(|one| one.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes.as_slice() {
        [0xFF, 0xFE, ..] => in_utf_16(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => in_utf_16(u16::from_be_bytes),
        _ => match String::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
            Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_other_programs_keeps_its_characters() {
        let text = "t;Drehmoment °\n0;1,5\n";
        let words = |bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(bytes).collect()
        };
        let latin_1 = text.chars().map(|one| u8::try_from(u32::from(one)).unwrap()).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            format!("\u{feff}{text}").into_bytes(),
            words(u16::to_le_bytes),
            words(u16::to_be_bytes),
            latin_1,
        ] {
            assert_eq!(text_of(bytes), text);
        }
    }
}
