//! The connection to a rig: its open bus, and the adapter of the motor on it. It configures the motor but cannot move it.

use std::sync::Arc;
use std::time::Duration;

use super::bus::{self, CanBus};
use super::canopen::{ErrorPolicy, Link, OwnHeartbeat};
use super::cansimple::Cansimple;
use super::cia402::Cia402;
use super::drive::Drive;
use super::fault::CanFault;
use super::file::{MotorSettings, ValidRigFile};
use super::limits::{HandleLimits, LimitsConfirmed};
use super::mit::Mit;
use super::safe_state;
use crate::timing::{Clock, SystemClock};

/// An open bus and the motor on it.
#[derive(Debug)]
pub struct Connection {
    pub(super) file: ValidRigFile,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) link: Link,
    pub(super) drive: Box<dyn Drive>,
    /// Arming asks the operating system for real-time privileges.
    pub(super) is_real_time: bool,
}

/// Why a rig cannot be connected to.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// The bus cannot be opened.
    #[error(
        "{bus}: cannot be opened ({source}). Check that the adapter is plugged in, that no other program uses it and \
         that you may use it"
    )]
    Bus {
        /// The bus.
        bus: String,
        /// What the system or the adapter said.
        source: std::io::Error,
    },
}

impl Connection {
    /// Opens the bus of a rig. Nothing is sent yet.
    ///
    /// # Errors
    /// When the bus cannot be opened.
    pub fn open(file: ValidRigFile) -> Result<Self, ConnectError> {
        let bus = bus::open(&file.bus, file.bit_rate)
            .map_err(|source| ConnectError::Bus { bus: file.bus.to_string(), source })?;
        Ok(Self { is_real_time: true, ..Self::on(bus, Arc::new(SystemClock::default()), file) })
    }

    /// The rig on an open bus. All waiting is done on `clock`; the thread gets no real-time privileges.
    pub fn on(bus: Box<dyn CanBus>, clock: Arc<dyn Clock>, file: ValidRigFile) -> Self {
        let drive: Box<dyn Drive> = match &file.motor {
            MotorSettings::Cia402(motor) => Box::new(Cia402::new(motor, &file)),
            MotorSettings::Cansimple(motor) => Box::new(Cansimple::new(motor, &file)),
            MotorSettings::Mit(motor) => Box::new(Mit::new(motor, &file)),
        };
        let mut link = Link::new(bus, Arc::clone(&clock));
        let tolerate = &file.tolerate;
        link.tolerate(tolerate.error_frames, tolerate.garbled_frames, tolerate.foreign_frames_per_s);
        link.stretch(file.bench.map_or(1.0, |bench| bench.time_stretch));
        Self { file, clock, link, drive, is_real_time: false }
    }

    /// The rig file.
    pub fn file(&self) -> &ValidRigFile {
        &self.file
    }

    /// Checks the identity of the motor; writes limits, watchdogs and frames, and reads them back. The motor gets no power.
    ///
    /// # Errors
    /// What is refused, not taken, or not has_replied.
    pub fn prepare(&mut self, limits: &HandleLimits) -> Result<LimitsConfirmed, CanFault> {
        let master = self.file.master;
        let period = Duration::from_millis(u64::from(master.heartbeat_ms));
        self.link.set_error_policy(ErrorPolicy::Count);
        self.link.set_own_heartbeat(Some(OwnHeartbeat { node: master.node, period }));
        self.link.watch(&self.drive.monitored_nodes());
        self.link.drain()?;
        self.drive.prepare(&mut self.link, &self.file, limits)
    }

    /// Removes the power, confirms it, and ends all monitoring. The program's heartbeat ends too, so the drive's own watchdog acts
    /// if the power could not be removed.
    ///
    /// # Errors
    /// Why it could not be confirmed.
    pub fn release(&mut self) -> Result<(), CanFault> {
        self.link.set_error_policy(ErrorPolicy::Count);
        let outcome = safe_state::power_off(&mut self.link, self.drive.as_mut());
        self.link.set_own_heartbeat(None);
        self.link.watch(&[]);
        outcome
    }
}
