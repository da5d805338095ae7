//! Output to a terminal, which obeys control characters: those of a stranger's texts are written as numbers.

use std::io::{self, Write};
use std::str;

use crate::files::without_controls;

/// Writes text without control characters. Every write is a whole number of characters, as those of `write!` are.
#[derive(Debug)]
pub struct SafeOutput<W>(pub W);

impl<W: Write> Write for SafeOutput<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match str::from_utf8(bytes) {
            Ok(text) => self.0.write_all(without_controls(text).as_bytes())?,
            Err(_) => self.0.write_all(without_controls(&String::from_utf8_lossy(bytes)).as_bytes())?,
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_of_the_terminal_is_not_set_by_a_name() {
        let mut written = Vec::new();
        let subject = "S\u{1b}]0;x\u{7}";
        writeln!(SafeOutput(&mut written), "subject {subject}").unwrap();
        assert_eq!(written, b"subject S\\u001b]0;x\\u0007\n");
    }
}
