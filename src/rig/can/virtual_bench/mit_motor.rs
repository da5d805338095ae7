//! An AK80-9 in MIT mode that is where it is sent.

use std::time::{Duration, Instant};

use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;

const MIT_ID: u16 = 1;
const MIT_REPLY_ID: u16 = 17;
const REACH_RAD: f64 = 12.5;
/// The watchdog that is set with the manufacturer's tool.
const MIT_WATCHDOG: Duration = Duration::from_millis(1000);
const MIT_STEP: Duration = Duration::from_millis(1);

#[derive(Debug)]
pub struct EmulatedMitMotor {
    in_motor_mode: bool,
    /// It holds a position: it got a command in motor mode.
    is_commanded: bool,
    angle_rad: f64,
    /// How far the servo has run away, rad.
    drift_rad: f64,
    error: u8,
    fed: Instant,
    updated: Instant,
    is_dead: bool,
}

impl EmulatedMitMotor {
    pub fn new(now: Instant) -> Self {
        Self {
            in_motor_mode: false,
            is_commanded: false,
            angle_rad: 0.05,
            drift_rad: 0.0,
            error: 0,
            fed: now,
            updated: now,
            is_dead: false,
        }
    }

    fn reply(&self, now: Instant, wire: &mut Wire) {
        let bits =
            ((self.angle_rad + self.drift_rad + REACH_RAD) / (2.0 * REACH_RAD) * 65535.0).round() as u16;
        let [high, low] = bits.to_be_bytes();
        wire.send(now, MIT_REPLY_ID, &[MIT_ID as u8, high, low, 0x7F, 0xF7, 0xFF, 25, self.error]);
    }
}

impl Device for EmulatedMitMotor {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        if frame.id != MIT_ID || self.is_dead {
            return;
        }
        self.fed = now;
        match frame.data() {
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC] => self.in_motor_mode = true,
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD] => {
                (self.in_motor_mode, self.is_commanded) = (false, false);
            }
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE] => self.angle_rad = 0.0,
            [high, low, ..] if self.in_motor_mode && self.error == 0 => {
                self.is_commanded = true;
                let bits = f64::from(u16::from_be_bytes([*high, *low]));
                if !wire.faults.iter().any(|fault| matches!(fault, BenchFault::Jam { .. })) {
                    self.angle_rad = bits / 65535.0 * 2.0 * REACH_RAD - REACH_RAD;
                }
            }
            _ => {}
        }
        self.reply(now, wire);
    }

    fn advance(&mut self, now: Instant, wire: &mut Wire) {
        let dt = now.saturating_duration_since(self.updated).as_secs_f64();
        self.updated = now;
        for fault in &wire.faults {
            if let (BenchFault::Runaway(rad_s), true) = (fault, self.is_commanded) {
                self.drift_rad += rad_s * dt;
            }
        }
        if self.is_commanded && now.saturating_duration_since(self.fed) > MIT_WATCHDOG {
            self.is_commanded = false;
        }
    }

    fn next_event(&self) -> Option<Instant> {
        self.is_commanded.then(|| self.updated + MIT_STEP)
    }

    fn strike(&mut self, fault: BenchFault, _now: Instant, _wire: &mut Wire) {
        match fault {
            BenchFault::Error { code, .. } => (self.error, self.is_commanded) = (code as u8, false),
            BenchFault::PowerLoss => (self.is_commanded, self.is_dead) = (false, true),
            _ => {}
        }
    }

    fn motor(&self) -> Option<(bool, f64)> {
        Some((self.is_commanded, self.angle_rad + self.drift_rad))
    }
}
