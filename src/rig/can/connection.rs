//! The connection to a rig: its open bus, and the adapter of the motor on it. It configures the motor but cannot move it.

use std::sync::Arc;
use std::time::Duration;

use super::bus::{self, CanBus};
use super::canopen::{ErrorPolicy, Link, OwnHeartbeat};
use super::cansimple::Cansimple;
use super::cia402::Cia402;
use super::drive::Drive;
use super::fault::CanFault;
use super::file::{CanRigFile, MotorSettings, ValidRigFile};
use super::finding::ObjectFinding;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::mit::Mit;
use super::safe_state;
use crate::timing::{Clock, SystemClock};

/// A frame is always given the time that a full adapter needs for the one before.
const SHORTEST_SEND_TIMEOUT: Duration = Duration::from_micros(500);

/// Heartbeats or SYNCs of another program that would be heard before anything is sent.
const HEARD_INTERVALS: u32 = 3;

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
        let bus = bus::open(&file.bus, file.bit_rate, send_timeout(&file))
            .map_err(|source| ConnectError::Bus { bus: file.bus.to_string(), source })?;
        Ok(Self { is_real_time: true, ..Self::on(bus, Arc::new(SystemClock::default()), file) })
    }

    /// The rig on an open bus. All waiting is done on `clock`; the thread gets no real-time privileges.
    pub fn on(bus: Box<dyn CanBus>, clock: Arc<dyn Clock>, file: ValidRigFile) -> Self {
        let drive: Box<dyn Drive> = match &file.motor {
            MotorSettings::Cia402(motor) => Box::new(Cia402::new(motor, &file)),
            MotorSettings::Cansimple(motor) => Box::new(Cansimple::new(motor, &file, clock.now())),
            MotorSettings::Mit(motor) => Box::new(Mit::new(motor, &file, clock.now())),
        };
        let mut link = Link::new(bus, Arc::clone(&clock));
        let tolerate = &file.tolerate;
        link.set_own_commands(file.own_commands());
        link.tolerate(tolerate.error_frames, tolerate.garbled_frames, tolerate.foreign_frames_per_s);
        link.stretch(file.bench.map_or(1.0, |bench| bench.time_stretch));
        Self { file, clock, link, drive, is_real_time: false }
    }

    /// The rig file.
    pub fn file(&self) -> &ValidRigFile {
        &self.file
    }

    /// Whether nobody else commands this bus, as a session in another terminal would: two programs on an interface of Linux hear and
    /// command the same motor. Nothing is sent.
    ///
    /// # Errors
    /// [`CanopenError::OtherMaster`](super::canopen::CanopenError::OtherMaster)
    pub fn check_alone(&mut self) -> Result<(), CanFault> {
        let master = self.file.master;
        let stretch = self.file.bench.map_or(1.0, |bench| bench.time_stretch);
        let period = self.file.period().duration().mul_f64(stretch);
        let longest = period.max(Duration::from_millis(u64::from(master.heartbeat_ms)));
        self.link.set_error_policy(ErrorPolicy::Count);
        self.link.drain()?;
        let end = self.link.now() + HEARD_INTERVALS * longest;
        Ok(self.link.listen_for_other_master(end)?)
    }

    /// Checks the identity of the motor; writes limits, watchdogs and frames, and reads them back. The motor gets no power.
    ///
    /// # Errors
    /// What is refused, not taken, or not answered.
    pub fn prepare(&mut self, limits: &HandleLimits) -> Result<LimitsConfirmed, CanFault> {
        let master = self.file.master;
        let period = Duration::from_millis(u64::from(master.heartbeat_ms));
        self.link.set_error_policy(ErrorPolicy::Count);
        self.link.set_own_heartbeat(Some(OwnHeartbeat { node: master.node, period }));
        self.link.watch(&self.drive.monitored_nodes());
        self.link.drain()?;
        self.drive.prepare(&mut self.link, &self.file, limits)
    }

    /// Objects that were missing or refused at the last `prepare`.
    pub fn findings(&self) -> &[ObjectFinding] {
        self.drive.findings()
    }

    /// Removes the power, confirms it, and ends all monitoring. The program's heartbeat ends too, so the drive's own watchdog acts
    /// if the power could not be removed. Returns the disobedience of a motor that let go only when it was left to its watchdog.
    ///
    /// # Errors
    /// Why it could not be confirmed.
    pub fn release(&mut self) -> Result<Option<CanFault>, CanFault> {
        self.link.set_interruptible(false);
        self.link.set_error_policy(ErrorPolicy::Count);
        let outcome = safe_state::power_off(&mut self.link, self.drive.as_mut());
        self.link.set_own_heartbeat(None);
        self.link.watch(&[]);
        outcome
    }
}

/// How long a frame may wait for the adapter: not longer than a period, and a quarter of the time after which the motor
/// stops by itself, so that one frame that waits is not the end of the motion.
fn send_timeout(file: &CanRigFile) -> Duration {
    let stretch = file.bench.map_or(1.0, |bench| bench.time_stretch);
    let period = Duration::from_micros(u64::from(file.period_us)).mul_f64(stretch);
    let watchdog = Duration::from_millis(u64::from(file.master.motor_waits_ms));
    period.min(watchdog / 4).max(SHORTEST_SEND_TIMEOUT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_waits_for_the_adapter_no_longer_than_a_period_or_a_quarter_of_the_watchdog() {
        let text = include_str!("../../../fixtures/can/rigs/plain.json");
        let timeout = |period_us: u32, motor_waits_ms: u16| {
            let mut file = CanRigFile::clone(&ValidRigFile::parse(text, "plain.json").unwrap());
            (file.bench, file.period_us, file.master.motor_waits_ms) = (None, period_us, motor_waits_ms);
            send_timeout(&file)
        };
        assert_eq!(timeout(2000, 100), Duration::from_millis(2));
        assert_eq!(timeout(50_000, 100), Duration::from_millis(25));
        assert_eq!(timeout(100, 100), SHORTEST_SEND_TIMEOUT);
    }
}
