//! A CANopen device: SDO server, NMT state, heartbeat.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use super::world::{BenchFault, Wire};
use crate::rig::can::bus::Frame;

pub const PRE_OPERATIONAL: u8 = 127;
pub const OPERATIONAL: u8 = 5;

#[derive(Debug)]
pub struct CanopenNode {
    pub id: u16,
    pub objects: HashMap<(u16, u8), Vec<u8>>,
    pub nmt: u8,
    next_heartbeat: Option<Instant>,
}

impl CanopenNode {
    pub fn new(id: u16, product: u32) -> Self {
        let mut node = Self { id, objects: HashMap::new(), nmt: PRE_OPERATIONAL, next_heartbeat: None };
        node.set(0x1018, 1, 51_966u32.to_le_bytes());
        node.set(0x1018, 2, product.to_le_bytes());
        for pdo in 0..4 {
            node.set(0x1400 + pdo, 1, 0x8000_0000u32.to_le_bytes());
            node.set(0x1800 + pdo, 1, 0x8000_0000u32.to_le_bytes());
        }
        node
    }

    pub fn set<const N: usize>(&mut self, index: u16, sub: u8, value: [u8; N]) {
        self.objects.insert((index, sub), value.to_vec());
    }

    /// A stored object as a signed number; 0 if it was never written.
    pub fn number(&self, index: u16, sub: u8) -> i32 {
        let mut bytes = [0; 4];
        if let Some(value) = self.objects.get(&(index, sub)) {
            bytes[..value.len()].copy_from_slice(value);
        }
        i32::from_le_bytes(bytes)
    }

    pub fn next_event(&self) -> Option<Instant> {
        self.next_heartbeat
    }

    pub fn advance(&mut self, now: Instant, wire: &mut Wire) {
        let period_ms = self.number(0x1017, 0) as u64;
        if period_ms == 0 {
            self.next_heartbeat = None;
            return;
        }
        let mut due = *self.next_heartbeat.get_or_insert(now);
        while due <= now {
            wire.send(due, 0x700 + self.id, &[self.nmt]);
            due += Duration::from_millis(period_ms);
        }
        self.next_heartbeat = Some(due);
    }

    pub fn stop_heartbeat(&mut self) {
        self.set(0x1017, 0, [0, 0]);
        self.next_heartbeat = None;
    }

    /// Handles NMT and SDO frames. Returns the object that was written.
    pub fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) -> Option<(u16, u8)> {
        let data = frame.data();
        match (frame.id, data) {
            (0x000, [command, node]) if u16::from(*node) == self.id => {
                self.nmt = match command {
                    1 => OPERATIONAL,
                    2 => 4,
                    _ => PRE_OPERATIONAL,
                };
                None
            }
            (id, [command, low, high, sub, value @ ..]) if id == 0x600 + self.id => {
                self.sdo(*command, (u16::from_le_bytes([*low, *high]), *sub), value, now, wire)
            }
            _ => None,
        }
    }

    fn sdo(
        &mut self,
        command: u8,
        (index, sub): (u16, u8),
        value: &[u8],
        now: Instant,
        wire: &mut Wire,
    ) -> Option<(u16, u8)> {
        let [low, high] = index.to_le_bytes();
        let mut answer = [0, low, high, sub, 0, 0, 0, 0];
        let mut written = None;
        let abort = wire.faults.iter().find_map(|fault| match fault {
            BenchFault::Aborted(hit, code) if *hit == index => Some(*code),
            _ => None,
        });
        if wire.faults.iter().any(|fault| matches!(fault, BenchFault::Unanswered(hit) if *hit == index)) {
            return None;
        }
        if let Some(code) = abort {
            answer[0] = 0x80;
            answer[4..].copy_from_slice(&code.to_le_bytes());
        } else if command & 0xE0 == 0x20 {
            let length = 4 - usize::from(command >> 2 & 3);
            answer[0] = 0x60;
            let ignored =
                wire.faults.iter().any(|f| matches!(f, BenchFault::IgnoredWrite(hit) if *hit == index));
            if !ignored {
                self.objects.insert((index, sub), value[..length].to_vec());
                written = Some((index, sub));
            } else {
                self.objects.entry((index, sub)).or_insert_with(|| vec![0; length]);
            }
        } else if command == 0x40 {
            let wrong = wire.faults.iter().find_map(|fault| match fault {
                BenchFault::WrongReading(hit, entry, value) if (*hit, *entry) == (index, sub) => Some(*value),
                _ => None,
            });
            match (wrong, self.objects.get(&(index, sub))) {
                (Some(value), _) => {
                    answer[0] = 0x43;
                    answer[4..].copy_from_slice(&value.to_le_bytes());
                }
                (None, Some(value)) => {
                    answer[0] = 0x43 | ((4 - value.len() as u8) << 2);
                    answer[4..4 + value.len()].copy_from_slice(value);
                }
                (None, None) => {
                    answer[0] = 0x80;
                    answer[4..].copy_from_slice(&0x0602_0000u32.to_le_bytes());
                }
            }
        } else {
            return None;
        }
        wire.send(now, 0x580 + self.id, &answer);
        written
    }
}
