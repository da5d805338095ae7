//! Reads the numeric arrays of a .mat file of version 5, which MATLAB writes up to `-v7`.
//!
//! "MAT-File Format", The MathWorks: a header of 128 bytes, then elements with a tag of type and length; a matrix is an element with
//! the elements flags, dimensions, name and values.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::error::ImportError;
use super::mat_array::MatArray;
use crate::files::limits;

const FILE_HEADER: usize = 128;
const MATRIX: u32 = 14;
const STRUCT_CLASS: u8 = 2;
const COMPRESSED: u32 = 15;
/// Classes of numeric arrays: double, single, and integers of 8 to 64 bits.
const NUMERIC_CLASSES: std::ops::RangeInclusive<u8> = 6..=15;

/// Reads the real numeric arrays in `bytes`, and those in the fields of structs; `path` is for messages. Cells are passed over.
pub fn read(bytes: &[u8], path: &Path) -> Result<Vec<MatArray>, ImportError> {
    let broken = |found: &str| ImportError::Source {
        path: path.into(),
        found: found.to_owned(),
        expected: "a .mat file of version 5 or 7.3; write it again with: save('file.mat', '-v7')",
    };
    if bytes.len() < FILE_HEADER || !bytes.starts_with(b"MATLAB 5.0") {
        return Err(broken("no .mat file of version 5"));
    }
    if &bytes[126..128] != b"IM" {
        return Err(broken("a .mat file with the bytes in the other order"));
    }
    let mut arrays = Vec::new();
    let mut left = limits::UNPACKED_BYTES;
    let mut rest = &bytes[FILE_HEADER..];
    while !rest.is_empty() {
        let at = bytes.len() - rest.len();
        let damaged =
            || broken(&format!("an element at byte {at} that is damaged or of no kind that is known"));
        let (kind, data, after) = element(rest).ok_or_else(|| {
            broken(&format!(
                "the file ends early, at byte {}: the element that begins at byte {at} is not whole",
                bytes.len()
            ))
        })?;
        if kind == COMPRESSED {
            let mut unpacked = Vec::new();
            let read = ZlibDecoder::new(data).take(left + 1).read_to_end(&mut unpacked);
            read.map_err(|_| broken("a damaged compressed element"))?;
            left = left.checked_sub(unpacked.len() as u64).ok_or_else(|| {
                broken(&format!("variables that unpack to more than {} GiB", limits::UNPACKED_BYTES >> 30))
            })?;
            let (kind, matrix, _) = element(&unpacked).ok_or_else(damaged)?;
            if kind == MATRIX {
                arrays.extend(numeric_arrays(matrix).ok_or_else(damaged)?);
            }
        } else if kind == MATRIX {
            arrays.extend(numeric_arrays(data).ok_or_else(damaged)?);
        }
        rest = after;
    }
    Ok(arrays)
}

/// Type and data of the first element, and what follows it; `None` at the end or if the element is cut off.
fn element(bytes: &[u8]) -> Option<(u32, &[u8], &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let first = word(0)?;
    if first >> 16 != 0 {
        // A short element has its length in the upper half of the type, and four bytes of data.
        let length = (first >> 16) as usize;
        let data = bytes.get(4..8)?.get(..length)?;
        return Some((first & 0xffff, data, bytes.get(8..)?));
    }
    let length = word(4)? as usize;
    let data = bytes.get(8..8usize.checked_add(length)?)?;
    // Elements begin at multiples of eight bytes; a compressed one is not padded.
    let padded = if first == COMPRESSED { length } else { length.next_multiple_of(8) };
    Some((first, data, bytes.get(8 + padded..).unwrap_or_default()))
}

/// The array of a matrix element, or those in the fields of a struct; empty if it is neither real and numeric nor a struct, `None` if it
/// is not as its own sizes say.
fn numeric_arrays(matrix: &[u8]) -> Option<Vec<MatArray>> {
    if matrix.is_empty() {
        // A field without a value.
        return Some(Vec::new());
    }
    let (_, flags, rest) = element(matrix)?;
    let (class, is_complex) = (*flags.first()?, flags.get(1)? & 0x08 != 0);
    // Elements of other classes have other parts.
    if class != STRUCT_CLASS && (!NUMERIC_CLASSES.contains(&class) || is_complex) {
        return Some(Vec::new());
    }
    let (_, dimensions, rest) = element(rest)?;
    let (_, name, rest) = element(rest)?;
    let name = String::from_utf8_lossy(name).into_owned();
    if class == STRUCT_CLASS {
        return fields(&name, rest);
    }
    let sizes = dimensions
        .chunks_exact(4)
        .map(|size| u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize);
    let count = sizes.clone().try_fold(1usize, |count, size| count.checked_mul(size))?;
    let values = if rest.is_empty() && count == 0 {
        Vec::new()
    } else {
        let (kind, data, _) = element(rest)?;
        numbers(kind, data)?
    };
    let rows = sizes.clone().next()?;
    (values.len() == count).then(|| vec![MatArray { name, rows, values }])
}

/// The numeric arrays among the fields of a struct; those of structs in it are passed over.
fn fields(of: &str, rest: &[u8]) -> Option<Vec<MatArray>> {
    let (_, length, rest) = element(rest)?;
    let length = u32::from_le_bytes(length.get(..4)?.try_into().ok()?) as usize;
    let (_, names, mut rest) = element(rest)?;
    let mut arrays = Vec::new();
    for name in names.chunks(length.max(1)) {
        let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
        let (_, matrix, after) = element(rest)?;
        rest = after;
        // The elements of fields have no name of their own.
        let is_struct = element(matrix).is_some_and(|(_, flags, _)| flags.first() == Some(&STRUCT_CLASS));
        let own = if is_struct { Vec::new() } else { numeric_arrays(matrix)? };
        arrays.extend(own.into_iter().map(|array| MatArray {
            name: format!("{of}.{}", String::from_utf8_lossy(&name[..end])),
            ..array
        }));
    }
    Some(arrays)
}

/// Values of an element of a numeric type; whole doubles are often stored as integers.
fn numbers(kind: u32, data: &[u8]) -> Option<Vec<f64>> {
    macro_rules! read {
        ($number:ty) => {{
            const SIZE: usize = size_of::<$number>();
            data.chunks_exact(SIZE)
                .map(|bytes| {
                    bytes.try_into().map_or(f64::NAN, |bytes| <$number>::from_le_bytes(bytes) as f64)
                })
                .collect()
        }};
    }
    Some(match kind {
        1 => read!(i8),
        2 => read!(u8),
        3 => read!(i16),
        4 => read!(u16),
        5 => read!(i32),
        6 => read!(u32),
        7 => read!(f32),
        9 => read!(f64),
        12 => read!(i64),
        13 => read!(u64),
        _ => return None,
    })
}
