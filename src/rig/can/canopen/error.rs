//! What goes wrong on a CANopen bus: the bus, its nodes, and transfers to and from their objects.

use serde::Serialize;

use super::nmt::NmtState;
use super::object::Object;
use super::{emergency, sdo_abort};
use crate::rig::can::bus::ControllerError;

/// Why the bus or a node on it cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum CanopenError {
    /// The adapter, the interface or the server does not answer to the operating system any more.
    #[error("the CAN adapter is gone or takes no frames; check its cable, then arm again")]
    BusGone,
    /// The operator stopped the program while the motor was being armed.
    #[error("the operator stopped the program while the motor was being armed")]
    Interrupted,
    /// The controller left the bus.
    #[error(
        "the CAN controller went bus-off; check termination, bit rate and cable, and bring the bus up again"
    )]
    BusOff,
    /// The controller reports trouble on the bus.
    #[error(
        "the CAN bus is in trouble ({trouble:?}, seen {count} times); check termination, bit rate and cable"
    )]
    #[serde(rename = "bus_trouble")]
    ControllerError {
        /// What it reports.
        trouble: ControllerError,
        /// How often.
        count: u64,
    },
    /// Bytes arrived that are no frame.
    #[error("{count} frames arrived garbled from the adapter, {tolerated} are tolerated; check its cable")]
    Garbled {
        /// How many.
        count: u64,
        /// How many the rig file tolerates.
        tolerated: u64,
    },
    /// Another program commands the nodes of this bus.
    #[error(
        "another program commands this bus: it sent {id:03X}h, which only this program may send. End it, then arm the motor again"
    )]
    OtherMaster {
        /// Of the frame that was heard.
        id: u16,
    },
    /// Too many frames of others.
    #[error(
        "{per_s} foreign frames a second on the bus, {tolerated} are tolerated; take other devices off this bus"
    )]
    Flood {
        /// Foreign frames in the last second.
        per_s: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
    },
    /// A node's heartbeat stayed away.
    #[error("no heartbeat of node {node} for {after_ms} ms; check its power and cable")]
    HeartbeatLost {
        /// Which node.
        node: u8,
        /// Since when.
        after_ms: u64,
    },
    /// A node is not in OPERATIONAL.
    #[error("node {node} went to {state}; see its error memory, then arm again")]
    NotOperational {
        /// Which node.
        node: u8,
        /// Where it is.
        state: NmtState,
    },
    /// A node started anew by itself.
    #[error("node {node} restarted by itself; check its supply, bring the motor home and arm again")]
    Rebooted {
        /// Which node.
        node: u8,
    },
    /// A node sent an emergency.
    #[error("node {node} reports emergency {code:04X}h: {} (error register {register:02X}h)", emergency::description(*code))]
    Emergency {
        /// Which node.
        node: u8,
        /// Error code.
        code: u16,
        /// Error register.
        register: u8,
    },
    /// An SDO was aborted by the device.
    #[error("node {node} aborts access to object {index:04X}h:{sub:02X} with {code:08X}h: {}", sdo_abort::description(*code))]
    SdoAborted {
        /// Which node.
        node: u8,
        /// The object.
        index: u16,
        /// Its entry.
        sub: u8,
        /// The abort code.
        code: u32,
    },
    /// An SDO was not answered.
    #[error(
        "node {node} does not answer for object {index:04X}h:{sub:02X}; check its power, node id and bit rate"
    )]
    SdoSilent {
        /// Which node.
        node: u8,
        /// The object.
        index: u16,
        /// Its entry.
        sub: u8,
    },
    /// A device reads back another value than was written.
    #[error(
        "node {node} says that object {index:04X}h:{sub:02X} is {read:08X}h after {written:08X}h was written: it does \
         not take this limit or setting; correct the rig file or the drive's configuration"
    )]
    #[serde(rename = "not_taken")]
    ValueNotAccepted {
        /// Which node.
        node: u8,
        /// The object.
        index: u16,
        /// Its entry.
        sub: u8,
        /// What was written.
        written: u32,
        /// What it reads.
        read: u32,
    },
    /// The device is another one than the rig file says.
    #[error(
        "node {node} says {index:04X}h:{sub:02X} is {read:08X}h, the rig file expects {expected:08X}h: another device?"
    )]
    WrongDevice {
        /// Which node.
        node: u8,
        /// The object that tells.
        index: u16,
        /// Its entry.
        sub: u8,
        /// What it says.
        read: u32,
        /// What the rig file says.
        expected: u32,
    },
}

impl CanopenError {
    /// The node did not answer an SDO request for an object.
    pub fn no_answer(node: u8, object: Object) -> Self {
        Self::SdoSilent { node, index: object.index, sub: object.sub }
    }
}
