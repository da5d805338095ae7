//! Parameters of an axis, by the numbers of its firmware. A number of another firmware is another parameter, so nothing
//! is written before the numbers are proved: Set_Limits, which needs no number, must change what two of them read, and all
//! others must read what their parameters can be.

use std::f64::consts::TAU;
use std::time::Duration;

use super::axis::{AXIS_REPLY_TIMEOUT, CONFIRMATION_TIMEOUT, Cansimple};
use super::frame::{command, float, pair};
use crate::rig::can::canopen::{CanopenError, Link};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::HandleLimits;

/// Part by which the torque constants may differ: what is written with three digits.
const TORQUE_CONSTANT_TOLERANCE: f64 = 0.02;

/// Highest speed and current of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    pub turns_s: f64,
    pub current_a: f64,
}

impl AxisLimits {
    /// Those of the handle, behind the gear. A current has no sign: it bounds the torque on both sides.
    pub fn of(axis: &Cansimple, limits: &HandleLimits) -> Self {
        let ratio = axis.motor.gear_ratio.abs();
        Self {
            turns_s: limits.speed_rad_s * ratio / TAU,
            current_a: limits.motor_torque_nm / ratio / axis.motor.torque_constant_nm_per_a,
        }
    }

    /// With this part of speed and current.
    pub fn part(self, part: f64) -> Self {
        Self { turns_s: self.turns_s * part, current_a: self.current_a * part }
    }
}

impl Cansimple {
    /// The version of firmware and hardware must be those of the rig file, where it gives them.
    pub(super) fn check_version(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.version = None;
        self.send_command(link, command::GET_VERSION, &[])?;
        let version = self.until(link, AXIS_REPLY_TIMEOUT, |axis| axis.version)?;
        let given = [
            ("hardware", self.motor.hardware.as_deref(), 0),
            ("firmware", self.motor.firmware.as_deref(), 3),
        ];
        for (what, text, at) in given {
            let Some(text) = text else { continue };
            let version = version.ok_or(CanFault::VersionUnknown)?;
            let read = [version[at], version[at + 1], version[at + 2]];
            let mut parts = text.split('.').map(|part| part.parse().unwrap_or(u8::MAX));
            let expected = [0; 3].map(|_: u8| parts.next().unwrap_or(u8::MAX));
            if read != expected {
                return Err(CanFault::WrongVersion { what, read, expected });
            }
        }
        Ok(())
    }

    /// The axis, its firmware, and what its watchdog was proved with; `None` where the rig file does not say how to ask for
    /// the serial number.
    pub(super) fn identity(&mut self, link: &mut Link) -> Result<Option<String>, CanFault> {
        let Some(endpoint) = self.motor.endpoints.serial_number else { return Ok(None) };
        let serial_number = u32::from_le_bytes(self.read(link, endpoint)?);
        let version = self.version.map_or_else(
            || "version unknown".to_owned(),
            |[a, b, c, d, e, f]| format!("hardware {a}.{b}.{c}, firmware {d}.{e}.{f}"),
        );
        let waits_ms = self.motor_waits.as_millis();
        Ok(Some(format!("odrive {serial_number:08X}h, {version}, watchdog {waits_ms} ms")))
    }

    /// Sets speed and current limit without endpoints.
    pub(super) fn set_limits(&mut self, link: &mut Link, limits: AxisLimits) -> Result<(), CanFault> {
        self.send_command(link, command::SET_LIMITS, &pair(float(limits.turns_s), float(limits.current_a)))
    }

    /// The endpoints of speed and current limit read what Set_Limits wrote.
    pub(super) fn limits_read(&mut self, link: &mut Link, limits: AxisLimits) -> Result<(), CanFault> {
        let endpoints = self.motor.endpoints;
        for (endpoint, name, expected) in [
            (endpoints.vel_limit, "vel_limit", limits.turns_s as f32),
            (endpoints.current_soft_max, "current_soft_max", limits.current_a as f32),
        ] {
            let read = f32::from_le_bytes(self.read(link, endpoint)?);
            if read != expected {
                return Err(CanFault::WrongEndpoint { endpoint, name, read, expected });
            }
        }
        Ok(())
    }

    /// Every endpoint is the parameter that the rig file means, as far as can be told without writing to it.
    pub(super) fn prove_endpoints(&mut self, link: &mut Link, limits: AxisLimits) -> Result<(), CanFault> {
        for part in [0.5, 1.0] {
            self.set_limits(link, limits.part(part))?;
            self.limits_read(link, limits.part(part))?;
        }
        let endpoints = self.motor.endpoints;
        let float_ok = |low: f32| move |bytes| f32::from_le_bytes(bytes) >= low;
        let whole_ok = |most: u32| move |bytes| u32::from_le_bytes(bytes) <= most;
        self.plausible(link, endpoints.enable_watchdog, "enable_watchdog", 0.0, whole_ok(1))?;
        self.plausible(link, endpoints.watchdog_timeout, "watchdog_timeout", 0.0, float_ok(0.0))?;
        self.plausible(
            link,
            endpoints.heartbeat_msg_rate_ms,
            "heartbeat_msg_rate_ms",
            0.0,
            whole_ok(65_535),
        )?;
        self.plausible(link, endpoints.encoder_msg_rate_ms, "encoder_msg_rate_ms", 0.0, whole_ok(65_535))?;
        self.plausible(link, endpoints.torque_soft_max, "torque_soft_max", 0.0, float_ok(0.0))?;
        if let Some(endpoint) = endpoints.torque_soft_min {
            self.plausible(link, endpoint, "torque_soft_min", 0.0, |bytes| f32::from_le_bytes(bytes) <= 0.0)?;
        }
        let endpoint = endpoints.torque_constant.ok_or(CanFault::TorqueConstantUnknown)?;
        let read = f64::from(f32::from_le_bytes(self.read(link, endpoint)?));
        let expected = self.motor.torque_constant_nm_per_a;
        if (read / expected - 1.0).abs() <= TORQUE_CONSTANT_TOLERANCE {
            return Ok(());
        }
        Err(CanFault::WrongTorqueConstant { read, expected })
    }

    fn plausible(
        &mut self,
        link: &mut Link,
        endpoint: u16,
        name: &'static str,
        expected: f32,
        is_possible: impl Fn([u8; 4]) -> bool,
    ) -> Result<(), CanFault> {
        let bytes = self.read(link, endpoint)?;
        if is_possible(bytes) {
            return Ok(());
        }
        Err(CanFault::WrongEndpoint { endpoint, name, read: f32::from_le_bytes(bytes), expected })
    }

    /// Writes limits, watchdog and message rates, and reads them all back: each at once, and all in the end.
    pub(super) fn write_settings(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<(), CanFault> {
        let axis = AxisLimits::of(self, limits);
        let motion = [
            Some((self.motor.endpoints.vel_limit, float(axis.turns_s))),
            Some((self.motor.endpoints.current_soft_max, float(axis.current_a))),
        ];
        let lasting = self.lasting_settings(file, limits);
        let writes = || motion.into_iter().chain(lasting).flatten();
        for (endpoint, value) in writes() {
            self.write(link, endpoint, value)?;
        }
        // What was still on its way is over: these are answers to reading, and to nothing else.
        self.until(link, CONFIRMATION_TIMEOUT, |_| None::<()>)?;
        for (endpoint, value) in writes() {
            self.confirm(link, endpoint, value)?;
        }
        Ok(())
    }

    /// What an axis that was armed has until it is restarted, whatever became of it.
    fn lasting_settings(&self, file: &CanRigFile, limits: &HandleLimits) -> [Option<(u16, [u8; 4])>; 6] {
        let endpoints = self.motor.endpoints;
        let torque_nm = limits.motor_torque_nm / self.motor.gear_ratio.abs();
        let whole = |value: u16| u32::from(value).to_le_bytes();
        [
            Some((endpoints.torque_soft_max, float(torque_nm))),
            endpoints.torque_soft_min.map(|endpoint| (endpoint, float(-torque_nm))),
            Some((endpoints.watchdog_timeout, float(f64::from(file.master.motor_waits_ms) * 1e-3))),
            Some((endpoints.heartbeat_msg_rate_ms, whole(self.motor.heartbeat_ms))),
            Some((endpoints.encoder_msg_rate_ms, whole(self.motor.encoder_ms))),
            // The watchdog last: every frame to the axis feeds it.
            Some((endpoints.enable_watchdog, [1, 0, 0, 0])),
        ]
    }

    /// Whether an axis that was armed still has its settings: one that was restarted has those that are saved in it, which may be
    /// others.
    pub(super) fn keeps_settings(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<bool, CanFault> {
        for (endpoint, value) in self.lasting_settings(file, limits).into_iter().flatten() {
            if self.read(link, endpoint)? != value {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Writes an endpoint and reads it back. Firmware from 0.6.11 confirms a write, which says nothing about what is kept.
    fn write(&mut self, link: &mut Link, endpoint: u16, value: [u8; 4]) -> Result<(), CanFault> {
        let [low, high] = endpoint.to_le_bytes();
        let [a, b, c, d] = value;
        self.endpoint = None;
        self.send_command(link, command::RX_SDO, &[1, low, high, 0, a, b, c, d])?;
        let time = match self.confirms_writes {
            Some(true) => AXIS_REPLY_TIMEOUT,
            // Only the first write tells whether there is a confirmation.
            None => CONFIRMATION_TIMEOUT,
            Some(false) => Duration::ZERO,
        };
        let confirmed =
            self.until(link, time, |axis| axis.endpoint.filter(|(number, _)| *number == endpoint))?.is_some();
        if self.confirms_writes == Some(true) && !confirmed {
            return Err(CanopenError::SdoSilent { node: self.motor.node, index: endpoint, sub: 0 }.into());
        }
        self.confirms_writes.get_or_insert(confirmed);
        self.confirm(link, endpoint, value)
    }

    fn confirm(&mut self, link: &mut Link, endpoint: u16, value: [u8; 4]) -> Result<(), CanFault> {
        let read = self.read(link, endpoint)?;
        if read == value {
            return Ok(());
        }
        let (node, index) = (self.motor.node, endpoint);
        let [written, read] = [value, read].map(u32::from_le_bytes);
        Err(CanopenError::ValueNotAccepted { node, index, sub: 0, written, read }.into())
    }

    /// What an endpoint reads.
    fn read(&mut self, link: &mut Link, endpoint: u16) -> Result<[u8; 4], CanFault> {
        let [low, high] = endpoint.to_le_bytes();
        self.endpoint = None;
        self.send_command(link, command::RX_SDO, &[0, low, high, 0])?;
        let (node, index) = (self.motor.node, endpoint);
        let answer = self.until(link, AXIS_REPLY_TIMEOUT, |axis| {
            axis.endpoint.filter(|(number, _)| *number == endpoint)
        })?;
        Ok(answer.ok_or(CanopenError::SdoSilent { node, index, sub: 0 })?.1)
    }
}
