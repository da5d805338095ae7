//! Random streams with numbers in their names, made without allocation.

use std::io::Write;

use crate::random::Stream;

/// The stream `prefix/number/number...` of `seed`.
pub fn stream(seed: u64, prefix: &str, numbers: &[u64]) -> Stream {
    let mut buffer = [0u8; 128];
    let length = buffer.len();
    let mut rest = &mut buffer[..];
    // 128 bytes hold the longest prefix and four numbers; a longer name is truncated.
    let _ = rest.write_all(prefix.as_bytes());
    for number in numbers {
        let _ = write!(rest, "/{number}");
    }
    let used = length - rest.len();
    Stream::new(seed, std::str::from_utf8(&buffer[..used]).unwrap_or(prefix))
}
