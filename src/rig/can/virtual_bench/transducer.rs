//! A CANopen sensor of handle torque and EMG, for motors that are no CANopen devices.

use std::time::Instant;

use super::canopen_node::{CanopenNode, OPERATIONAL};
use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;

#[derive(Debug)]
pub struct EmulatedTransducer {
    node: CanopenNode,
    periods: u16,
    last_torque_nm: f32,
}

impl EmulatedTransducer {
    pub fn new() -> Self {
        Self { node: CanopenNode::new(32, 1028), periods: 0, last_torque_nm: 0.0 }
    }

    fn on_sync(&mut self, now: Instant, wire: &mut Wire) {
        if self.node.nmt != OPERATIONAL {
            return;
        }
        if !wire.faults.iter().any(|f| matches!(f, BenchFault::CounterStale | BenchFault::TorqueStale)) {
            self.periods = self.periods.wrapping_add(1);
        }
        let mut torque_nm = 1.0 + f32::from(self.periods % 7) * 0.001;
        for fault in &wire.faults {
            match fault {
                BenchFault::TorqueInvalid => torque_nm = f32::NAN,
                BenchFault::TorqueStale => torque_nm = self.last_torque_nm,
                BenchFault::Push(nm) => torque_nm = *nm as f32,
                _ => {}
            }
        }
        self.last_torque_nm = torque_nm;
        let [a, b, c, d] = torque_nm.to_le_bytes();
        let [low, high] = self.periods.to_le_bytes();
        let flexor = 100 + (self.periods % 5) as u8;
        let extensor = if wire.has(BenchFault::EmgFrozen) { 100 } else { flexor };
        wire.send(now, 0x180 + self.node.id, &[a, b, c, d, low, high]);
        wire.send(now, 0x280 + self.node.id, &[flexor, 0, extensor, 0]);
    }
}

impl Device for EmulatedTransducer {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        if frame.id == 0x080 {
            self.on_sync(now, wire);
        } else {
            self.node.receive(frame, now, wire);
        }
    }

    fn advance(&mut self, now: Instant, wire: &mut Wire) {
        self.node.advance(now, wire);
    }

    fn next_event(&self) -> Option<Instant> {
        self.node.next_event()
    }
}
