//! Objects of a dictionary: their address, their type, their value.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};

/// The address of an object, such as 607Dh:02.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
}

impl Object {
    /// An object with sub-index 0.
    pub const fn plain(index: u16) -> Self {
        Self { index, sub: 0 }
    }

    /// An entry of a record.
    pub const fn entry(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

impl fmt::Display for Object {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:04X}h:{:02X}", self.index, self.sub)
    }
}

impl FromStr for Object {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let error = || format!("{text:?} is no object; write index and sub-index as in \"2E00h:01\"");
        let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
        let index = index.strip_suffix(['h', 'H']).ok_or_else(error)?;
        Ok(Self {
            index: u16::from_str_radix(index, 16).map_err(|_| error())?,
            sub: u8::from_str_radix(sub, 16).map_err(|_| error())?,
        })
    }
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for Object {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Object".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "format": "can-object",
            "pattern": "^[0-9A-Fa-f]{1,4}[hH](:[0-9A-Fa-f]{1,2})?$"
        })
    }
}

/// How a number is laid out in a payload, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DataType {
    /// UNSIGNED8.
    U8,
    /// INTEGER8.
    I8,
    /// UNSIGNED16.
    U16,
    /// INTEGER16.
    I16,
    /// UNSIGNED32.
    U32,
    /// INTEGER32.
    I32,
    /// REAL32.
    F32,
}

impl DataType {
    /// Its length, bytes.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
        }
    }

    /// Reads a number from the start of `data`.
    pub fn read(self, data: &[u8]) -> Option<f64> {
        let data = data.get(..self.bytes())?;
        let mut word = [0u8; 4];
        word[..data.len()].copy_from_slice(data);
        let word = u32::from_le_bytes(word);
        Some(match self {
            Self::U8 | Self::U16 | Self::U32 => f64::from(word),
            Self::I8 => f64::from(word as u8 as i8),
            Self::I16 => f64::from(word as u16 as i16),
            Self::I32 => f64::from(word as i32),
            Self::F32 => f64::from(f32::from_bits(word)),
        })
    }

    /// Writes a number to the start of `data`; beyond the type's range it becomes the nearest there is.
    pub fn write(self, value: f64, data: &mut [u8]) {
        let word = match self {
            Self::U8 => u32::from(value.round() as u8),
            Self::I8 => u32::from(value.round() as i8 as u8),
            Self::U16 => u32::from(value.round() as u16),
            Self::I16 => u32::from(value.round() as i16 as u16),
            Self::U32 => value.round() as u32,
            Self::I32 => value.round() as i32 as u32,
            Self::F32 => (value as f32).to_bits(),
        };
        let bytes = self.bytes().min(data.len());
        data[..bytes].copy_from_slice(&word.to_le_bytes()[..bytes]);
    }
}

/// A value for an object, with its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Value {
    bytes: [u8; 4],
    length: u8,
}

impl Value {
    /// The bytes on the wire.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// As a number without sign.
    pub fn number(&self) -> u32 {
        u32::from_le_bytes(self.bytes)
    }

    /// Bytes of an answer; `None` when there are more than four.
    pub fn from_bytes(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 4];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { bytes, length: data.len() as u8 })
    }
}

macro_rules! from_integer {
    ($($kind:ty),*) => {
        $(impl From<$kind> for Value {
            fn from(value: $kind) -> Self {
                let mut bytes = [0; 4];
                let own = value.to_le_bytes();
                bytes[..own.len()].copy_from_slice(&own);
                Self { bytes, length: own.len() as u8 }
            }
        })*
    };
}

from_integer!(u8, i8, u16, i16, u32, i32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_written_as_standards_write_them() {
        let object: Object = "2E00h:01".parse().unwrap();
        assert_eq!((object.index, object.sub), (0x2E00, 1));
        assert_eq!(object.to_string(), "2E00h:01");
        assert_eq!("6041h".parse::<Object>().unwrap(), Object::plain(0x6041));
        for wrong in ["", "2E00", "2E00h:", "xyzh:1", "2E00h:100", "12E00h"] {
            assert!(wrong.parse::<Object>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_come_back_as_they_were_written() {
        let mut data = [0u8; 4];
        for (kind, value) in [
            (DataType::I16, -32768.0),
            (DataType::U16, 65535.0),
            (DataType::I32, -5.0),
            (DataType::I8, -3.0),
            (DataType::F32, 1.5),
        ] {
            kind.write(value, &mut data);
            assert_eq!(kind.read(&data), Some(value));
        }
        DataType::F32.write(f64::NAN, &mut data);
        assert!(DataType::F32.read(&data).unwrap().is_nan());
        DataType::I16.write(1e9, &mut data);
        assert_eq!(DataType::I16.read(&data), Some(32767.0), "never beyond its range");
        assert_eq!(DataType::I32.read(&data[..3]), None);
    }
}
