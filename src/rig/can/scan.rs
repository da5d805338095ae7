//! Who is on the bus: heartbeats that are heard, and nodes that answer when they are asked what they are.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::bus::{CanBus, Frame, Received};
use super::canopen::{NmtState, cob};

/// A node that was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ScannedNode {
    /// Its node id.
    pub node: u8,
    /// What its heartbeat said.
    pub state: Option<NmtState>,
    /// 1000h: the device profile is in the lower half.
    pub device_type: Option<u32>,
    /// 1018h:01.
    pub vendor: Option<u32>,
    /// 1018h:02.
    pub product: Option<u32>,
    /// 1018h:03.
    pub revision: Option<u32>,
    /// 1018h:04.
    pub serial: Option<u32>,
}

impl ScannedNode {
    fn new(node: u8) -> Self {
        Self {
            node,
            state: None,
            device_type: None,
            vendor: None,
            product: None,
            revision: None,
            serial: None,
        }
    }

    /// The device profile in words.
    pub fn profile(&self) -> &'static str {
        match self.device_type.map(|device_type| device_type & 0xFFFF) {
            Some(402) => "CiA 402 drive",
            Some(404) => "CiA 404 measuring device",
            Some(401) => "CiA 401 input and output",
            Some(406) => "CiA 406 encoder",
            Some(0) => "no standard profile",
            Some(_) => "other profile",
            None => "does not answer SDOs",
        }
    }
}

/// How long answers are waited for after the last question.
const LISTEN: Duration = Duration::from_millis(400);

/// Asks every node id what it is. It only reads, and nothing moves.
///
/// # Errors
/// The bus is gone.
pub fn scan(bus: &mut dyn CanBus) -> std::io::Result<Vec<ScannedNode>> {
    let mut nodes = BTreeMap::new();
    ask(bus, 1..=127, 0x1000, 0, &mut nodes)?;
    let found: Vec<u8> = nodes
        .values()
        .filter(|node: &&ScannedNode| node.device_type.is_some())
        .map(|node| node.node)
        .collect();
    for sub in 1..=4 {
        ask(bus, found.iter().copied(), 0x1018, sub, &mut nodes)?;
    }
    Ok(nodes.into_values().collect())
}

fn ask(
    bus: &mut dyn CanBus,
    whom: impl Iterator<Item = u8>,
    index: u16,
    sub: u8,
    nodes: &mut BTreeMap<u8, ScannedNode>,
) -> std::io::Result<()> {
    let [low, high] = index.to_le_bytes();
    for node in whom {
        bus.send(&Frame::new(cob::SDO_REQUEST + u16::from(node), &[0x40, low, high, sub, 0, 0, 0, 0]))?;
        // Answers are taken in between, so that no queue runs over.
        listen(bus, Instant::now() + Duration::from_millis(2), nodes)?;
    }
    listen(bus, Instant::now() + LISTEN, nodes)
}

fn listen(
    bus: &mut dyn CanBus,
    deadline: Instant,
    nodes: &mut BTreeMap<u8, ScannedNode>,
) -> std::io::Result<()> {
    // A bus that is never silent is left after its time, too.
    while Instant::now() < deadline {
        match bus.receive(deadline)? {
            Some(Received::Frame(frame, _)) => note(&frame, nodes),
            Some(_) => {}
            None => break,
        }
    }
    Ok(())
}

fn note(frame: &Frame, nodes: &mut BTreeMap<u8, ScannedNode>) {
    let id = (frame.id & 0x7F) as u8;
    match (frame.id, frame.data()) {
        (0x701..=0x77F, [state]) => {
            nodes.entry(id).or_insert_with(|| ScannedNode::new(id)).state = Some(NmtState::from_byte(*state));
        }
        (0x581..=0x5FF, [command, low, high, sub, value @ ..])
            if *command & 0xE3 == 0x43 || *command & 0xE3 == 0x42 =>
        {
            let Ok(value) = <[u8; 4]>::try_from(value) else { return };
            let value = Some(u32::from_le_bytes(value));
            let node = nodes.entry(id).or_insert_with(|| ScannedNode::new(id));
            match (u16::from_le_bytes([*low, *high]), *sub) {
                (0x1000, 0) => node.device_type = value,
                (0x1018, 1) => node.vendor = value,
                (0x1018, 2) => node.product = value,
                (0x1018, 3) => node.revision = value,
                (0x1018, 4) => node.serial = value,
                _ => {}
            }
        }
        _ => {}
    }
}
