//! An ODrive axis that speaks CANSimple and is where it is sent.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;

const AXIS_IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;
const WATCHDOG_EXPIRED: u32 = 0x0100_0000;
const AXIS_STEP: Duration = Duration::from_millis(1);
/// Endpoints of `fixtures/can/rigs/odrive.json`.
const WATCHDOG_TIMEOUT: u16 = 195;
const ENABLE_WATCHDOG: u16 = 196;

#[derive(Debug)]
pub struct EmulatedOdriveAxis {
    endpoints: HashMap<u16, [u8; 4]>,
    state: u8,
    errors: u32,
    turns: f64,
    /// How far the servo has run away, turns.
    drift: f64,
    next_heartbeat: Option<Instant>,
    next_estimate: Instant,
    fed: Instant,
    updated: Instant,
    is_dead: bool,
}

impl EmulatedOdriveAxis {
    pub fn new(now: Instant) -> Self {
        Self {
            endpoints: HashMap::new(),
            state: AXIS_IDLE,
            errors: 0,
            turns: 0.02,
            drift: 0.0,
            next_heartbeat: Some(now),
            next_estimate: now,
            fed: now,
            updated: now,
            is_dead: false,
        }
    }

    fn id(command: u16) -> u16 {
        1 << 5 | command
    }
}

impl Device for EmulatedOdriveAxis {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        let data = frame.data();
        if frame.id >> 5 != 1 || self.is_dead {
            return;
        }
        self.fed = now;
        match (frame.id & 0x1F, data) {
            (0x04, [1, low, high, _, value @ ..]) => {
                let endpoint = u16::from_le_bytes([*low, *high]);
                if !wire.has(BenchFault::IgnoredWrite(endpoint)) {
                    self.endpoints.insert(endpoint, value.try_into().unwrap());
                }
            }
            (0x04, [0, low, high, ..]) => {
                let endpoint = u16::from_le_bytes([*low, *high]);
                let [a, b, c, d] = self.endpoints.get(&endpoint).copied().unwrap_or_default();
                wire.send(now, Self::id(0x05), &[0, *low, *high, 0, a, b, c, d]);
            }
            (0x07, [state, ..]) => self.state = if self.errors == 0 { *state } else { AXIS_IDLE },
            (0x0C, [a, b, c, d, ..]) if self.state == CLOSED_LOOP => {
                let jammed = wire.faults.iter().any(|fault| matches!(fault, BenchFault::Jam { .. }));
                if !jammed {
                    self.turns = f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
                }
            }
            (0x18, _) => self.errors = 0,
            (0x19, [a, b, c, d, ..]) => self.turns = f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            _ => {}
        }
    }

    fn advance(&mut self, now: Instant, wire: &mut Wire) {
        if self.is_dead {
            return;
        }
        let dt = now.saturating_duration_since(self.updated).as_secs_f64();
        self.updated = now;
        for fault in &wire.faults {
            if let (BenchFault::Runaway(rad_s), CLOSED_LOOP) = (fault, self.state) {
                self.drift += rad_s / TAU * dt;
            }
        }
        let number = |endpoint| self.endpoints.get(&endpoint).copied().unwrap_or_default();
        let timeout = Duration::from_secs_f32(f32::from_le_bytes(number(WATCHDOG_TIMEOUT)));
        let watched = number(ENABLE_WATCHDOG)[0] == 1;
        if watched && self.state == CLOSED_LOOP && now.saturating_duration_since(self.fed) > timeout {
            (self.errors, self.state) = (WATCHDOG_EXPIRED, AXIS_IDLE);
        }
        while let Some(due) = self.next_heartbeat.filter(|due| *due <= now) {
            let [a, b, c, d] = self.errors.to_le_bytes();
            wire.send(due, Self::id(0x01), &[a, b, c, d, self.state, 0, 0, 0]);
            self.next_heartbeat = Some(due + Duration::from_millis(50));
        }
        while self.next_estimate <= now {
            let [a, b, c, d] = ((self.turns + self.drift) as f32).to_le_bytes();
            wire.send(self.next_estimate, Self::id(0x09), &[a, b, c, d, 0, 0, 0, 0]);
            self.next_estimate += Duration::from_millis(2);
        }
    }

    fn next_event(&self) -> Option<Instant> {
        let next = self.next_estimate.min(self.updated + AXIS_STEP);
        (!self.is_dead).then(|| self.next_heartbeat.map_or(next, |due| due.min(next)))
    }

    fn strike(&mut self, fault: BenchFault, _now: Instant, _wire: &mut Wire) {
        match fault {
            BenchFault::HeartbeatStop => self.next_heartbeat = None,
            BenchFault::Error { code, .. } => (self.errors, self.state) = (u32::from(code), AXIS_IDLE),
            BenchFault::PowerLoss => (self.state, self.is_dead) = (AXIS_IDLE, true),
            _ => {}
        }
    }

    fn motor(&self) -> Option<(bool, f64)> {
        Some((self.state == CLOSED_LOOP, (self.turns + self.drift) * TAU))
    }
}
