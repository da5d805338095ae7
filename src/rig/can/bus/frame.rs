//! A CAN data frame.

use std::fmt;

/// A classic CAN data frame with an 11-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Identifier, 0 to 7FFh. A lower one wins the bus.
    pub id: u16,
    length: u8,
    bytes: [u8; 8],
}

impl Frame {
    /// A frame with up to 8 bytes; what is beyond is cut off.
    pub fn new(id: u16, data: &[u8]) -> Self {
        let length = data.len().min(8);
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&data[..length]);
        Self { id: id & 0x7FF, length: length as u8, bytes }
    }

    /// The payload.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }
}

impl fmt::Display for Frame {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:03X}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(formatter, "{byte:02X}"))
    }
}
