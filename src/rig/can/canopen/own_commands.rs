//! Frames that only this program may send: heard from the bus, they are those of another program that commands the same motor.

use super::cob;
use crate::rig::can::bus::Frame;

/// The commands of one program.
#[derive(Debug, Clone, Default)]
pub struct OwnCommands {
    ids: Vec<u16>,
    /// CANopen nodes that mind network management.
    nodes: Vec<u8>,
}

impl OwnCommands {
    /// Those with the identifiers `ids`, SDO requests to the CANopen `nodes`, network management of these, and SYNC.
    pub fn new(ids: impl IntoIterator<Item = u16>, nodes: Vec<u8>) -> Self {
        let requests = nodes.iter().map(|node| cob::SDO_REQUEST + u16::from(*node));
        Self { ids: requests.chain(ids).chain([cob::SYNC]).collect(), nodes }
    }

    /// Whether a frame from the bus is one of them.
    pub fn contains(&self, frame: &Frame) -> bool {
        let manages = |addressed: u8| self.nodes.iter().any(|node| addressed == 0 || addressed == *node);
        match frame.data() {
            [_, addressed] if frame.id == cob::NMT => manages(*addressed),
            _ => self.ids.contains(&frame.id),
        }
    }
}
