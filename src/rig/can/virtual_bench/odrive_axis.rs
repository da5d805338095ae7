//! An ODrive axis that speaks CANSimple: position loop, speed loop with its limit, torque and current limits, on a shaft.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::shaft::Shaft;
use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;

const AXIS_IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;
const WATCHDOG_EXPIRED: u32 = 0x0100_0000;
const AXIS_STEP: Duration = Duration::from_millis(1);
const POSITION_GAIN: f64 = 100.0;
/// N m for each rad/s, and for each rad.
const SPEED_GAIN: f64 = 3.0;
const SPEED_INTEGRATOR: f64 = 100.0;

/// Parameters by the numbers of `fixtures/can/rigs/odrive.json`.
mod endpoint {
    pub const SERIAL_NUMBER: u16 = 4;
    pub const WATCHDOG_TIMEOUT: u16 = 195;
    pub const ENABLE_WATCHDOG: u16 = 196;
    pub const CURRENT_SOFT_MAX: u16 = 230;
    pub const TORQUE_SOFT_MAX: u16 = 231;
    pub const TORQUE_SOFT_MIN: u16 = 232;
    pub const TORQUE_CONSTANT: u16 = 233;
    pub const HEARTBEAT_MS: u16 = 270;
    pub const ENCODER_MS: u16 = 271;
    pub const VEL_LIMIT: u16 = 400;
    /// Those of one byte.
    pub const BOOLS: [u16; 1] = [ENABLE_WATCHDOG];
}

/// What differs from one firmware, or one motor, to another.
#[derive(Debug, Clone, Copy)]
pub struct OdriveFirmware {
    pub serial_number: u32,
    pub version: [u8; 3],
    /// Get_Version is answered.
    pub tells_version: bool,
    /// Numbers of the endpoints are so much higher.
    pub shift: u16,
    /// A write is confirmed by a TX_SDO with the value that was sent.
    pub confirms_writes: bool,
    pub torque_constant_nm_per_a: f64,
    /// The watchdog does nothing, whatever is written.
    pub has_no_watchdog: bool,
    /// Time from one estimate to the next, whatever is written; `None` for what is written.
    pub encoder_period: Option<Duration>,
    /// Where the shaft is at first, rad.
    pub angle_rad: f64,
    /// What was written outlives a restart.
    pub saves_settings: bool,
    /// Set_Absolute_Position changes nothing.
    pub takes_no_position: bool,
}

impl Default for OdriveFirmware {
    fn default() -> Self {
        Self {
            serial_number: 51_966,
            version: [0, 6, 10],
            tells_version: true,
            shift: 0,
            confirms_writes: false,
            torque_constant_nm_per_a: 1.0,
            has_no_watchdog: false,
            encoder_period: None,
            angle_rad: 0.125,
            saves_settings: false,
            takes_no_position: false,
        }
    }
}

#[derive(Debug)]
pub struct EmulatedOdriveAxis {
    firmware: OdriveFirmware,
    shaft: Shaft,
    endpoints: HashMap<u16, [u8; 4]>,
    state: u8,
    errors: u32,
    origin_rad: f64,
    input_rad: f64,
    integrator_nm: f64,
    /// How far the servo has run away, rad.
    drift_rad: f64,
    next_heartbeat: Option<Instant>,
    next_estimate: Instant,
    fed: Instant,
    updated: Instant,
    is_dead: bool,
    /// Endpoints that were written.
    writes: u32,
}

impl EmulatedOdriveAxis {
    pub fn new(firmware: OdriveFirmware, now: Instant) -> Self {
        let float = |value: f64| (value as f32).to_le_bytes();
        let endpoints = [
            (endpoint::SERIAL_NUMBER, firmware.serial_number.to_le_bytes()),
            (endpoint::WATCHDOG_TIMEOUT, float(0.0)),
            (endpoint::ENABLE_WATCHDOG, [0; 4]),
            (endpoint::CURRENT_SOFT_MAX, float(80.0)),
            (endpoint::TORQUE_SOFT_MAX, float(f64::INFINITY)),
            (endpoint::TORQUE_SOFT_MIN, float(f64::NEG_INFINITY)),
            (endpoint::TORQUE_CONSTANT, float(firmware.torque_constant_nm_per_a)),
            (endpoint::HEARTBEAT_MS, 100u32.to_le_bytes()),
            (endpoint::ENCODER_MS, 10u32.to_le_bytes()),
            (endpoint::VEL_LIMIT, float(20.0)),
        ];
        Self {
            firmware,
            shaft: Shaft::new(firmware.angle_rad, now),
            endpoints: endpoints.into_iter().map(|(id, value)| (id + firmware.shift, value)).collect(),
            state: AXIS_IDLE,
            errors: 0,
            origin_rad: 0.0,
            input_rad: 0.0,
            integrator_nm: 0.0,
            drift_rad: 0.0,
            next_heartbeat: Some(now),
            // Not on the program's clock.
            next_estimate: now + Duration::from_micros(370),
            fed: now,
            updated: now,
            is_dead: false,
            writes: 0,
        }
    }

    /// It wakes up without power, and its encoder counts from where the shaft is.
    fn restart(&mut self, now: Instant) {
        let (shaft, endpoints) = (self.shaft.clone(), self.endpoints.clone());
        *self = Self::new(self.firmware, now);
        self.origin_rad = shaft.angle_rad;
        self.shaft = shaft;
        if self.firmware.saves_settings {
            self.endpoints = endpoints;
        }
    }

    fn id(command: u16) -> u16 {
        1 << 5 | command
    }

    fn raw(&self, endpoint: u16) -> [u8; 4] {
        self.endpoints[&(endpoint + self.firmware.shift)]
    }

    fn number(&self, endpoint: u16) -> f64 {
        f64::from(f32::from_le_bytes(self.raw(endpoint)))
    }

    fn set(&mut self, endpoint: u16, value: [u8; 4]) {
        self.endpoints.insert(endpoint + self.firmware.shift, value);
    }

    fn sdo(&mut self, data: &[u8], now: Instant, wire: &mut Wire) {
        let [opcode, low, high, _, value @ ..] = data else { return };
        let number = u16::from_le_bytes([*low, *high]);
        let mut bytes = [0; 4];
        bytes[..value.len().min(4)].copy_from_slice(&value[..value.len().min(4)]);
        let bytes_long =
            if endpoint::BOOLS.iter().any(|id| id + self.firmware.shift == number) { 1 } else { 4 };
        let answer = |value: [u8; 4]| {
            let mut answer = vec![0, *low, *high, 0];
            answer.extend(&value[..bytes_long]);
            answer
        };
        if *opcode == 1 {
            self.writes += 1;
            // Any number is that of something that can be written.
            if !wire.has(BenchFault::IgnoredWrite(number)) {
                self.endpoints.insert(number, bytes);
            }
            if self.firmware.confirms_writes {
                wire.send(now, Self::id(0x05), &answer(bytes));
            }
        } else {
            let value = self.endpoints.get(&number).copied().unwrap_or([0, 0, 0x48, 0x42]);
            wire.send(now, Self::id(0x05), &answer(value));
        }
    }

    fn enter(&mut self, state: u8) {
        self.integrator_nm = 0.0;
        self.state = if self.errors == 0 { state } else { AXIS_IDLE };
    }
}

impl Device for EmulatedOdriveAxis {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        let data = frame.data();
        if frame.id >> 5 != 1 || self.is_dead {
            return;
        }
        self.advance(now, wire);
        self.fed = now;
        let float = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
        match (frame.id & 0x1F, data) {
            (0x00, []) if self.firmware.tells_version => {
                let [major, minor, revision] = self.firmware.version;
                wire.send(now, Self::id(0x00), &[2, 4, 4, 58, major, minor, revision, 0]);
            }
            (0x04, data) => self.sdo(data, now, wire),
            (0x07, [state, ..]) => self.enter(*state),
            (0x0C, data) if data.len() == 8 => self.input_rad = float(data) * TAU,
            (0x0F, data) if data.len() == 8 => {
                self.set(endpoint::VEL_LIMIT, (float(data) as f32).to_le_bytes());
                self.set(endpoint::CURRENT_SOFT_MAX, (float(&data[4..]) as f32).to_le_bytes());
            }
            (0x18, _) => self.errors = 0,
            (0x19, data) if data.len() >= 4 && !self.firmware.takes_no_position => {
                let moved_rad = self.shaft.angle_rad - float(data) * TAU - self.origin_rad;
                self.origin_rad += moved_rad;
                self.input_rad -= moved_rad;
            }
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
            match fault {
                BenchFault::Runaway(rad_s) if self.state == CLOSED_LOOP => self.drift_rad += rad_s * dt,
                BenchFault::Jam { .. } => self.shaft.is_jammed = true,
                _ => {}
            }
        }
        let timeout = Duration::from_secs_f64(self.number(endpoint::WATCHDOG_TIMEOUT).clamp(0.0, 100.0));
        let watched = self.raw(endpoint::ENABLE_WATCHDOG)[0] == 1 && !self.firmware.has_no_watchdog;
        if watched && self.state == CLOSED_LOOP && now.saturating_duration_since(self.fed) > timeout {
            (self.errors, self.state) = (WATCHDOG_EXPIRED, AXIS_IDLE);
        }
        let goal_rad = self.input_rad + self.origin_rad + self.drift_rad;
        let most_rad_s = self.number(endpoint::VEL_LIMIT) * TAU;
        let constant = self.firmware.torque_constant_nm_per_a;
        let current_nm = self.number(endpoint::CURRENT_SOFT_MAX) * constant;
        let low_nm = self.number(endpoint::TORQUE_SOFT_MIN).max(-current_nm);
        let high_nm = self.number(endpoint::TORQUE_SOFT_MAX).min(current_nm);
        let acts = self.state == CLOSED_LOOP;
        let integrator_nm = &mut self.integrator_nm;
        self.shaft.advance(now, |angle_rad, speed_rad_s, dt_s| {
            if !acts {
                return 0.0;
            }
            let wanted_rad_s = (POSITION_GAIN * (goal_rad - angle_rad)).clamp(-most_rad_s, most_rad_s);
            let off_rad_s = wanted_rad_s - speed_rad_s;
            let asked_nm = SPEED_GAIN * off_rad_s + *integrator_nm;
            if asked_nm > low_nm && asked_nm < high_nm {
                *integrator_nm += SPEED_INTEGRATOR * off_rad_s * dt_s;
            }
            asked_nm.max(low_nm).min(high_nm)
        });
        while let Some(due) = self.next_heartbeat.filter(|due| *due <= now) {
            let [a, b, c, d] = self.errors.to_le_bytes();
            wire.send(due, Self::id(0x01), &[a, b, c, d, self.state, 0, 0, 0]);
            let every_ms = u32::from_le_bytes(self.raw(endpoint::HEARTBEAT_MS)).max(1);
            self.next_heartbeat = Some(due + Duration::from_millis(u64::from(every_ms)));
        }
        while self.next_estimate <= now {
            let mut turns = (self.shaft.angle_rad - self.origin_rad) / TAU;
            if let Some(misread_rad) = wire.misread() {
                turns = misread_rad / TAU;
            }
            let [a, b, c, d] = (turns as f32).to_le_bytes();
            let [e, f, g, h] = ((self.shaft.speed_rad_s / TAU) as f32).to_le_bytes();
            wire.send(self.next_estimate, Self::id(0x09), &[a, b, c, d, e, f, g, h]);
            let written = u32::from_le_bytes(self.raw(endpoint::ENCODER_MS)).max(1);
            let written = Duration::from_millis(u64::from(written));
            self.next_estimate += self.firmware.encoder_period.unwrap_or(written);
        }
    }

    fn next_event(&self) -> Option<Instant> {
        let next = self.next_estimate.min(self.updated + AXIS_STEP);
        (!self.is_dead).then(|| self.next_heartbeat.map_or(next, |due| due.min(next)))
    }

    fn strike(&mut self, fault: BenchFault, now: Instant, _wire: &mut Wire) {
        match fault {
            BenchFault::HeartbeatStop => self.next_heartbeat = None,
            BenchFault::Error { code, .. } => (self.errors, self.state) = (u32::from(code), AXIS_IDLE),
            BenchFault::PowerLoss => (self.state, self.is_dead) = (AXIS_IDLE, true),
            BenchFault::Reboot => self.restart(now),
            _ => {}
        }
    }

    fn motor(&self) -> Option<(bool, f64)> {
        Some((self.state == CLOSED_LOOP, self.shaft.angle_rad - self.origin_rad))
    }

    fn shaft(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.shaft)
    }

    fn times_written(&self) -> u32 {
        self.writes
    }
}
