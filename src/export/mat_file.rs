//! Writes .mat files of version 5, which MATLAB, Octave and scipy read.
//!
//! "MAT-File Format", The MathWorks: a header of 128 bytes, then elements with a tag of type and length; a matrix is an element
//! with the elements flags, dimensions, name and values. Written here rather than with a crate: those for this format either only
//! read, or declare their interface unstable, and put the time of day into the header, so that equal sessions would not have equal files.

/// Types of elements.
const INT8: u32 = 1;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;

/// Classes of matrices.
const STRUCT_CLASS: u32 = 2;
const CHAR_CLASS: u32 = 4;
const DOUBLE_CLASS: u32 = 6;

/// Bytes of a field name in a file, the end included; its readers allow no longer ones.
const NAME_BYTES: usize = 64;

/// The largest variable that readers of this version take, bytes.
pub const LARGEST_VARIABLE: usize = (1 << 31) - 1;

/// A value of MATLAB.
#[derive(Debug, Clone, PartialEq)]
pub enum MatValue {
    /// A column of numbers; a scalar if there is one, an empty matrix if there is none.
    Numbers(Vec<f64>),
    /// A line of text.
    Text(String),
    /// A struct array of one row. Every element has the same fields in the same order.
    Structs(StructArray),
}

/// A struct array of one row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StructArray {
    /// Names of the fields.
    pub fields: Vec<String>,
    /// The elements: a value for each field.
    pub elements: Vec<Vec<MatValue>>,
}

impl MatValue {
    /// A scalar; NaN where there is none.
    pub fn number(value: Option<f64>) -> Self {
        Self::Numbers(vec![value.unwrap_or(f64::NAN)])
    }

    /// A struct of one element.
    pub fn record(fields: Vec<(String, Self)>) -> Self {
        let (fields, values) = fields.into_iter().unzip();
        Self::Structs(StructArray { fields, elements: vec![values] })
    }
}

/// A name that MATLAB takes for a field: letters, digits and underscores, a letter first, at most 63 characters.
pub fn field_name(name: &str) -> String {
    let is_letter = name.starts_with(|c: char| c.is_ascii_alphabetic());
    let kept = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    let prefix = if is_letter { "" } else { "x" };
    prefix.chars().chain(kept).take(NAME_BYTES - 1).collect()
}

/// The bytes of a file with these variables; `text` is what its header says, at most 116 ASCII characters.
///
/// # Errors
/// Name and size of a variable that is too large for the format.
pub fn file(text: &str, variables: &[(&str, MatValue)]) -> Result<Vec<u8>, (String, usize)> {
    let mut bytes: Vec<u8> = format!("MATLAB 5.0 MAT-file, {text}").into_bytes();
    bytes.resize(124, b' ');
    // Version 1.0, and the order of the bytes.
    bytes.extend_from_slice(&0x0100u16.to_le_bytes());
    bytes.extend_from_slice(b"IM");
    for (name, value) in variables {
        let start = bytes.len();
        matrix(&mut bytes, name, value);
        let size = bytes.len() - start;
        if size > LARGEST_VARIABLE {
            return Err(((*name).to_owned(), size));
        }
    }
    Ok(bytes)
}

/// Adds a matrix with all that is in it.
fn matrix(bytes: &mut Vec<u8>, name: &str, value: &MatValue) {
    bytes.extend_from_slice(&MATRIX.to_le_bytes());
    // The length is known at the end.
    let length_at = bytes.len();
    bytes.extend_from_slice(&[0; 4]);
    let (class, dimensions) = match value {
        MatValue::Numbers(numbers) => (DOUBLE_CLASS, [numbers.len(), usize::from(!numbers.is_empty())]),
        MatValue::Text(text) => {
            let units = text.encode_utf16().count();
            (CHAR_CLASS, [usize::from(units > 0), units])
        }
        MatValue::Structs(array) => (STRUCT_CLASS, [1, array.elements.len()]),
    };
    element(bytes, UINT32, [class, 0].into_iter().flat_map(u32::to_le_bytes));
    element(bytes, INT32, dimensions.into_iter().flat_map(|count| (count as i32).to_le_bytes()));
    element(bytes, INT8, name.bytes());
    match value {
        MatValue::Numbers(numbers) => element(bytes, DOUBLE, numbers.iter().flat_map(|x| x.to_le_bytes())),
        MatValue::Text(text) => element(bytes, UINT16, text.encode_utf16().flat_map(u16::to_le_bytes)),
        MatValue::Structs(array) => {
            // The only short element: readers expect the length of the names in this form.
            bytes.extend_from_slice(&(4 << 16 | INT32).to_le_bytes());
            bytes.extend_from_slice(&(NAME_BYTES as i32).to_le_bytes());
            let names = array.fields.iter().flat_map(|name| {
                let name = name.as_bytes();
                let kept = &name[..name.len().min(NAME_BYTES - 1)];
                kept.iter().copied().chain(std::iter::repeat_n(0, NAME_BYTES - kept.len()))
            });
            element(bytes, INT8, names);
            for value in array.elements.iter().flatten() {
                matrix(bytes, "", value);
            }
        }
    }
    let length = bytes.len() - length_at - 4;
    // One that does not fit is refused by the caller.
    let length = u32::try_from(length).unwrap_or(u32::MAX);
    bytes[length_at..length_at + 4].copy_from_slice(&length.to_le_bytes());
}

/// Adds an element that is no matrix, filled up to a multiple of eight bytes.
fn element(bytes: &mut Vec<u8>, kind: u32, data: impl Iterator<Item = u8>) {
    bytes.extend_from_slice(&kind.to_le_bytes());
    let length_at = bytes.len();
    bytes.extend_from_slice(&[0; 4]);
    bytes.extend(data);
    let length = bytes.len() - length_at - 4;
    let length = u32::try_from(length).unwrap_or(u32::MAX);
    bytes[length_at..length_at + 4].copy_from_slice(&length.to_le_bytes());
    bytes.resize(bytes.len().next_multiple_of(8), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scalar_has_the_bytes_of_the_format() {
        let bytes = file("a test", &[("x", MatValue::number(Some(2.5)))]).unwrap();
        assert_eq!(&bytes[..26], b"MATLAB 5.0 MAT-file, a tes");
        assert_eq!(&bytes[124..128], [0x00, 0x01, b'I', b'M']);
        let words: Vec<u32> =
            bytes[128..].chunks(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        // Matrix of 64 bytes: flags, dimensions 1 x 1, name of one byte, one double.
        let name = u32::from(b'x');
        let value = 2.5f64.to_bits();
        let expected =
            [14, 64, 6, 8, 6, 0, 5, 8, 1, 1, 1, 1, name, 0, 9, 8, value as u32, (value >> 32) as u32];
        assert_eq!(words, expected);
    }

    #[test]
    fn every_element_begins_at_a_multiple_of_eight_bytes() {
        for text in ["", "a", "ab", "abcde", "Gelenk µ"] {
            let value = MatValue::record(vec![
                ("a".into(), MatValue::Text(text.into())),
                ("b".into(), MatValue::Numbers(Vec::new())),
            ]);
            assert!(file("", &[("long_name", value)]).unwrap().len().is_multiple_of(8), "{text:?}");
        }
    }

    #[test]
    fn names_are_those_of_matlab() {
        let names = ["rest_s", "2nd", "a b", "", "x".repeat(80).as_str()].map(field_name);
        assert_eq!(names, ["rest_s", "x2nd", "a_b", "x", &"x".repeat(63)]);
    }
}
