//! A motor in MIT mode: an impedance on a shaft, numbers of 16 and 12 bits over the ranges of its firmware.

use std::time::{Duration, Instant};

use super::shaft::Shaft;
use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;

const MIT_ID: u16 = 1;
const MIT_REPLY_ID: u16 = 17;
const MIT_STEP: Duration = Duration::from_millis(1);

/// What differs from one firmware to another.
#[derive(Debug, Clone, Copy)]
pub struct MitFirmware {
    /// Half-widths of position, speed and torque; highest kp and kd.
    pub position_rad: f64,
    pub speed_rad_s: f64,
    pub torque_nm: f64,
    pub kp_nm_per_rad: f64,
    pub kd_nm_s_per_rad: f64,
    /// The motor lets go after so long without a command.
    pub watchdog: Option<Duration>,
    /// In motor mode it goes on with the last command, even one of before it was left.
    pub keeps_last_command: bool,
    /// Dry friction of the gear, N m.
    pub friction_nm: f64,
    /// Where the shaft is at first, rad.
    pub angle_rad: f64,
}

impl Default for MitFirmware {
    fn default() -> Self {
        Self {
            position_rad: 12.5,
            speed_rad_s: 50.0,
            torque_nm: 18.0,
            kp_nm_per_rad: 500.0,
            kd_nm_s_per_rad: 5.0,
            watchdog: Some(Duration::from_millis(1000)),
            keeps_last_command: false,
            friction_nm: 0.0,
            angle_rad: 0.05,
        }
    }
}

/// An impedance command, at the motor.
#[derive(Debug, Clone, Copy, Default)]
struct Impedance {
    position_rad: f64,
    speed_rad_s: f64,
    kp: f64,
    kd: f64,
    torque_nm: f64,
}

#[derive(Debug)]
pub struct EmulatedMitMotor {
    firmware: MitFirmware,
    shaft: Shaft,
    /// What the encoder says is zero, rad.
    origin_rad: f64,
    in_motor_mode: bool,
    command: Impedance,
    /// How far the servo has run away, rad.
    drift_rad: f64,
    error: u8,
    fed: Instant,
    updated: Instant,
    is_dead: bool,
    /// Commands that made torque after its watchdog had let go.
    woken: u32,
    let_go: bool,
}

impl EmulatedMitMotor {
    pub fn new(firmware: MitFirmware, now: Instant) -> Self {
        let mut shaft = Shaft::new(firmware.angle_rad, now);
        shaft.friction_nm = firmware.friction_nm;
        Self {
            firmware,
            shaft,
            origin_rad: 0.0,
            in_motor_mode: false,
            command: Impedance {
                // A command of an earlier program, at the other end of the world.
                position_rad: if firmware.keeps_last_command { 1.0 } else { 0.0 },
                kp: if firmware.keeps_last_command { 400.0 } else { 0.0 },
                ..Impedance::default()
            },
            drift_rad: 0.0,
            error: 0,
            fed: now,
            updated: now,
            is_dead: false,
            woken: 0,
            let_go: false,
        }
    }

    fn is_acting(&self) -> bool {
        self.in_motor_mode && (self.command.kp > 0.0 || self.command.kd > 0.0)
    }

    fn decoded(&self, data: [u8; 8]) -> Impedance {
        let word = u64::from_be_bytes(data);
        let symmetric = |number: u64, reach: f64, bits: u32| {
            number as f64 * 2.0 * reach / f64::from((1u32 << bits) - 1) - reach
        };
        let firmware = &self.firmware;
        Impedance {
            position_rad: symmetric(word >> 48, firmware.position_rad, 16),
            speed_rad_s: symmetric(word >> 36 & 0xFFF, firmware.speed_rad_s, 12),
            kp: (word >> 24 & 0xFFF) as f64 * firmware.kp_nm_per_rad / 4095.0,
            kd: (word >> 12 & 0xFFF) as f64 * firmware.kd_nm_s_per_rad / 4095.0,
            torque_nm: symmetric(word & 0xFFF, firmware.torque_nm, 12),
        }
    }

    fn reply(&self, now: Instant, wire: &mut Wire) {
        let mut position_rad = self.shaft.angle_rad - self.origin_rad;
        if let Some(misread_rad) = wire.misread() {
            position_rad = misread_rad;
        }
        // Firmwares cut off what is below a step.
        let bits = |value: f64, reach: f64, bits: u32| {
            let most = f64::from((1u32 << bits) - 1);
            ((value.clamp(-reach, reach) + reach) / (2.0 * reach) * most) as u64
        };
        let firmware = &self.firmware;
        let mut word = bits(position_rad, firmware.position_rad, 16);
        word = word << 12 | bits(self.shaft.speed_rad_s, firmware.speed_rad_s, 12);
        word = word << 12 | bits(self.shaft.torque_nm, firmware.torque_nm, 12);
        let [.., a, b, c, d, e] = word.to_be_bytes();
        wire.send(now, MIT_REPLY_ID, &[MIT_ID as u8, a, b, c, d, e, 25, self.error]);
    }
}

impl Device for EmulatedMitMotor {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        if frame.id != MIT_ID || self.is_dead {
            return;
        }
        self.advance(now, wire);
        // The reply is packed before the command acts.
        self.reply(now, wire);
        let Ok(data) = <[u8; 8]>::try_from(frame.data()) else { return };
        match data {
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC] => {
                if !self.firmware.keeps_last_command {
                    self.command = Impedance::default();
                }
                (self.in_motor_mode, self.fed) = (self.error == 0, now);
            }
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD] => self.in_motor_mode = false,
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE] => self.origin_rad = self.shaft.angle_rad,
            data if self.in_motor_mode || self.firmware.keeps_last_command => {
                (self.command, self.fed) = (self.decoded(data), now);
                if self.let_go && self.is_acting() {
                    self.woken += 1;
                }
                self.let_go = false;
            }
            _ => {}
        }
    }

    fn advance(&mut self, now: Instant, wire: &mut Wire) {
        let dt_s = now.saturating_duration_since(self.updated).as_secs_f64();
        self.updated = now;
        for fault in &wire.faults {
            match fault {
                BenchFault::Runaway(rad_s) if self.is_acting() => self.drift_rad += rad_s * dt_s,
                BenchFault::Jam { .. } => self.shaft.is_jammed = true,
                _ => {}
            }
        }
        let silent = now.saturating_duration_since(self.fed);
        if self.is_acting() && self.firmware.watchdog.is_some_and(|watchdog| silent > watchdog) {
            (self.command, self.let_go) = (Impedance::default(), true);
        }
        let (command, origin_rad, drift_rad) = (self.command, self.origin_rad, self.drift_rad);
        let (acts, most_nm) = (self.in_motor_mode && !self.is_dead, self.firmware.torque_nm);
        self.shaft.advance(now, |angle_rad, speed_rad_s, _| {
            let off_rad = command.position_rad + origin_rad + drift_rad - angle_rad;
            let asked_nm =
                command.kp * off_rad + command.kd * (command.speed_rad_s - speed_rad_s) + command.torque_nm;
            if acts { asked_nm.clamp(-most_nm, most_nm) } else { 0.0 }
        });
    }

    fn next_event(&self) -> Option<Instant> {
        Some(self.updated + MIT_STEP)
    }

    fn strike(&mut self, fault: BenchFault, _now: Instant, _wire: &mut Wire) {
        match fault {
            BenchFault::Error { code, .. } => (self.error, self.in_motor_mode) = (code as u8, false),
            BenchFault::PowerLoss => (self.in_motor_mode, self.is_dead) = (false, true),
            // Its encoder counts from where the shaft is.
            BenchFault::Reboot => (self.in_motor_mode, self.origin_rad) = (false, self.shaft.angle_rad),
            _ => {}
        }
    }

    fn motor(&self) -> Option<(bool, f64)> {
        Some((self.is_acting(), self.shaft.angle_rad - self.origin_rad))
    }

    fn shaft(&mut self) -> Option<&mut Shaft> {
        Some(&mut self.shaft)
    }

    fn times_woken(&self) -> u32 {
        self.woken
    }
}
