//! The lines of Lawicel's ASCII protocol.
//!
//! A frame is `tIIIL` and two hexadecimal digits a byte, closed by a carriage return. `z` acknowledges one of ours.

use super::can_bus::{Arrival, ControllerError, Received};
use super::frame::Frame;

const HEX: &[u8; 16] = b"0123456789ABCDEF";

/// Writes a frame as Lawicel's ASCII; its length.
pub fn encode(frame: &Frame, text: &mut [u8; 32]) -> usize {
    let digit = |value: u16| HEX[usize::from(value & 0xF)];
    text[..5].copy_from_slice(&[
        b't',
        digit(frame.id >> 8),
        digit(frame.id >> 4),
        digit(frame.id),
        digit(frame.data().len() as u16),
    ]);
    let mut at = 5;
    for byte in frame.data() {
        text[at] = digit(u16::from(*byte) >> 4);
        text[at + 1] = digit(u16::from(*byte));
        at += 2;
    }
    text[at] = b'\r';
    at + 1
}

/// What a line says; nothing for acknowledgements and answers.
pub fn received(line: &[u8], arrival: Arrival) -> Option<Received> {
    let line = match line {
        [b'z' | b'Z', rest @ ..] => rest,
        whole => whole,
    };
    match line.first() {
        None | Some(b'V' | b'N') => None,
        Some(b'F') => flags(&line[1..]),
        Some(b'T' | b'r' | b'R') => Some(Received::Foreign),
        Some(b't') => {
            Some(decode(&line[1..]).map_or(Received::Garbled, |frame| Received::Frame(frame, arrival)))
        }
        Some(_) => Some(Received::Garbled),
    }
}

/// The answer to `F`: bit 2 warning, 3 overrun, 5 passive, 7 bus error.
fn flags(digits: &[u8]) -> Option<Received> {
    let [high, low] = digits else { return Some(Received::Garbled) };
    let flags = nibble(*high)? << 4 | nibble(*low)?;
    // The worst of what it tells: an error-passive controller also tells the bus errors that made it so.
    let trouble = match flags {
        0 => return None,
        _ if flags & 0x20 != 0 => ControllerError::Passive,
        _ if flags & 0x08 != 0 => ControllerError::Overrun,
        _ if flags & 0x80 != 0 => ControllerError::BusError,
        _ => ControllerError::Warning,
    };
    Some(Received::ControllerError(trouble))
}

fn nibble(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

fn decode(text: &[u8]) -> Option<Frame> {
    let (head, data) = text.split_at_checked(4)?;
    let mut id = 0u16;
    for digit in &head[..3] {
        id = id << 4 | u16::from(nibble(*digit)?);
    }
    let length = usize::from(nibble(head[3])?);
    // Adapters with time stamps switched on add four digits.
    if id > 0x7FF || length > 8 || !(data.len() == 2 * length || data.len() == 2 * length + 4) {
        return None;
    }
    let mut bytes = [0u8; 8];
    for (byte, pair) in bytes.iter_mut().zip(data[..2 * length].chunks_exact(2)) {
        *byte = nibble(pair[0])? << 4 | nibble(pair[1])?;
    }
    Some(Frame::new(id, &bytes[..length]))
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use proptest::prelude::*;

    use super::*;

    fn heard(text: &[u8]) -> Option<Received> {
        received(text, Arrival::at(Instant::now()))
    }

    #[test]
    fn lines_that_are_frames_answers_or_neither_are_told_apart() {
        assert!(
            matches!(heard(b"t1232AABB"), Some(Received::Frame(f, _)) if f == Frame::new(0x123, &[0xAA, 0xBB]))
        );
        assert!(matches!(heard(b"zt0800"), Some(Received::Frame(f, _)) if f == Frame::new(0x80, &[])));
        assert!(matches!(heard(b"t1231AA1234"), Some(Received::Frame(..))), "a time stamp behind it");
        for answer in [b"".as_slice(), b"z", b"Z", b"V1013", b"NCB01", b"F00"] {
            assert_eq!(heard(answer), None);
        }
        for garbled in [b"t12".as_slice(), b"t12?2AABB", b"t1232AAB", b"t9991AA", b"t1239", b"x"] {
            assert_eq!(heard(garbled), Some(Received::Garbled), "{}", String::from_utf8_lossy(garbled));
        }
        assert_eq!(heard(b"T000001230"), Some(Received::Foreign));
        assert_eq!(heard(b"F80"), Some(Received::ControllerError(ControllerError::BusError)));
        assert_eq!(heard(b"F04"), Some(Received::ControllerError(ControllerError::Warning)));
    }

    #[test]
    fn what_is_never_tolerated_is_told_before_bus_errors_that_may_be() {
        for (line, trouble) in [
            (b"FA0", ControllerError::Passive),
            (b"FA4", ControllerError::Passive),
            (b"F28", ControllerError::Passive),
            (b"F88", ControllerError::Overrun),
            (b"F84", ControllerError::BusError),
        ] {
            assert_eq!(heard(line), Some(Received::ControllerError(trouble)));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_frame_survives_the_way_through_ascii(id in 0u16..0x800, data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let frame = Frame::new(id, &data);
            let mut text = [0; 32];
            let length = encode(&frame, &mut text);
            prop_assert_eq!(text[length - 1], b'\r');
            prop_assert_eq!(decode(&text[1..length - 1]), Some(frame));
        }

        #[test]
        fn no_line_makes_the_reader_stumble(text in prop::collection::vec(any::<u8>(), 0..40)) {
            let _ = heard(&text);
        }
    }
}
