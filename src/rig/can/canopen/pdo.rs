//! Process data objects: which objects travel in which frame, written to the device in the order CiA 301 demands.

use super::error::CanopenError;
use super::link::Link;
use super::object::{Object, Value};

/// Bit 31 of the identifier: the PDO does not exist.
const OFF: u32 = 0x8000_0000;
/// Transmission type: with every SYNC.
const EVERY_SYNC: u8 = 1;

/// PDOs of each direction that have an identifier of their own in the pre-defined connection set.
pub const MAX_PDOS: u8 = 4;

/// Which way a PDO goes, as the device sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PdoDirection {
    /// To the device (RPDO).
    Receive,
    /// From the device (TPDO).
    Transmit,
}

/// A PDO as it is to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pdo {
    /// Which way.
    pub direction: PdoDirection,
    /// Its number, from 1.
    pub number: u8,
    /// The identifier it gets.
    pub id: u16,
    /// The objects in it with their lengths in bytes, in order.
    pub mapped: Vec<(Object, usize)>,
    /// An RPDO that stays away for so long is an error to the device, ms; 0 for never.
    pub deadline_ms: u16,
}

impl Pdo {
    /// Its payload, bytes.
    pub fn bytes(&self) -> usize {
        self.mapped.iter().map(|(_, bytes)| bytes).sum()
    }

    fn communication(&self) -> u16 {
        let base = match self.direction {
            PdoDirection::Receive => 0x1400,
            PdoDirection::Transmit => 0x1800,
        };
        base + u16::from(self.number) - 1
    }

    fn mapping(&self) -> u16 {
        self.communication() + 0x200
    }
}

impl Link {
    /// Makes a PDO what it is to be: off, mapping emptied, filled, confirmed, on.
    ///
    /// # Errors
    /// Whatever the device refuses.
    pub fn configure_pdo(&mut self, node: u8, pdo: &Pdo) -> Result<(), CanopenError> {
        let (communication, mapping) = (pdo.communication(), pdo.mapping());
        let at = Object::entry;
        self.write(node, at(communication, 1), OFF | u32::from(pdo.id))?;
        self.write_and_confirm(node, at(communication, 2), EVERY_SYNC)?;
        if pdo.direction == PdoDirection::Receive && pdo.deadline_ms > 0 {
            self.write_and_confirm(node, at(communication, 5), pdo.deadline_ms)?;
        }
        self.write_and_confirm(node, at(mapping, 0), 0u8)?;
        for ((object, bytes), sub) in pdo.mapped.iter().zip(1..) {
            let word = u32::from(object.index) << 16 | u32::from(object.sub) << 8 | (8 * *bytes as u32);
            self.write_and_confirm(node, at(mapping, sub), word)?;
        }
        self.write_and_confirm(node, at(mapping, 0), pdo.mapped.len() as u8)?;
        self.write_and_confirm(node, at(communication, 1), u32::from(pdo.id))
    }

    /// Switches a PDO off; one that the device does not have is off already.
    ///
    /// # Errors
    /// Whatever the device refuses but for the PDO not being there.
    pub fn switch_off_pdo(
        &mut self,
        node: u8,
        direction: PdoDirection,
        number: u8,
    ) -> Result<(), CanopenError> {
        let pdo = Pdo { direction, number, id: 0, mapped: Vec::new(), deadline_ms: 0 };
        let object = Object::entry(pdo.communication(), 1);
        match self.read(node, object) {
            Ok(id) if id.number() & OFF == 0 => {
                self.write_and_confirm(node, object, Value::from(id.number() | OFF))
            }
            Ok(_) | Err(CanopenError::SdoAborted { .. }) => Ok(()),
            Err(fault) => Err(fault),
        }
    }
}
