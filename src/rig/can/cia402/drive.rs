//! A CiA 402 drive as the motor of a rig: cyclic synchronous position between SYNCs.

use std::time::Duration;

use super::configure::write_profiles;
use super::{Controlword, Mode, State, Statusword, towards_enabled};
use crate::rig::can::bus::Frame;
use crate::rig::can::canopen::{Kind, Link, NmtCommand, Object, Producer, Strictness, cob, identify};
use crate::rig::can::drive::{Drive, Power, Wish};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::{Cia402Motor, Display, RigFile};
use crate::rig::can::limits::{Confirmed, HandleLimits};
use crate::rig::can::lookout::Lookout;
use crate::rig::can::readings::Readings;
use crate::rig::can::sensors::{Sensors, start_nodes};
use crate::rig::can::units::{BusPeriod, Counts, Gearing, JointAngle};

/// Speed at which the cycle goes what the drive's own positioning has left over, rad/s.
const CREEP_RAD_S: f64 = 0.02;

/// A CiA 402 drive.
#[derive(Debug)]
pub struct Cia402 {
    pub(super) motor: Cia402Motor,
    pub(super) gearing: Gearing,
    /// 60C2h.
    pub(super) interpolation: (u8, i8),
    sensors: Sensors,
    display: Option<Display>,
    /// The start position was found.
    pub(super) homed: bool,
    /// The limits of the last arming, which a drive that was not restarted still has.
    written: Option<HandleLimits>,
    remembers: bool,
    /// The state that the latest frames told.
    seen: State,
}

impl Cia402 {
    /// The drive of a rig file; nothing is sent yet.
    pub fn new(motor: &Cia402Motor, file: &RigFile) -> Self {
        let period = BusPeriod::from_us(file.period_us).and_then(BusPeriod::interpolation);
        Self {
            gearing: Gearing::new(motor.counts_per_revolution, motor.gear_ratio, motor.rated_torque_nm),
            motor: motor.clone(),
            // The rig file was checked for a period that can be written so.
            interpolation: period.unwrap_or((0, 0)),
            sensors: Sensors::new(file),
            display: file.display,
            homed: false,
            written: None,
            remembers: false,
            seen: State::NotReady,
        }
    }

    pub(super) fn target_id(&self) -> u16 {
        0x200 + u16::from(self.motor.node)
    }

    /// The controlword that goes with a target, if one goes out.
    fn word(&self, wish: Wish) -> Option<Controlword> {
        Some(match wish {
            Wish::Nothing => return None,
            Wish::Enable => towards_enabled(self.seen).unwrap_or(Controlword::SHUTDOWN),
            Wish::Follow => Controlword::ENABLE,
            Wish::QuickStop => Controlword::QUICK_STOP,
            Wish::NoPower => Controlword::DISABLE_VOLTAGE,
        })
    }
}

impl Drive for Cia402 {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &RigFile,
        limits: &HandleLimits,
    ) -> Result<Confirmed, CanFault> {
        let node = self.motor.node;
        for producer in self.producers() {
            link.nmt(NmtCommand::EnterPreOperational, producer.node)?;
        }
        identify(link, node, &self.motor.identity)?;
        if file.bench.is_some() {
            check_emulated(link, node)?;
        }
        self.check_scale(link)?;
        self.remembers = match self.written {
            Some(written) => self.remembers(link, &written)?,
            None => false,
        };
        self.reset_fault(link)?;
        self.confirm_no_power(link)?;
        self.written = None;
        self.write_watchdogs(link, file)?;
        self.write_limits(link, limits)?;
        write_profiles(link, &self.motor, self)?;
        self.write_frames(link, file)?;
        self.sensors.prepare(link, file)?;
        self.written = Some(*limits);
        Ok(Confirmed::by_reading_back())
    }

    fn producers(&self) -> Vec<Producer> {
        let patience = Duration::from_millis(u64::from(self.motor.heartbeat_wait_ms));
        std::iter::once(Producer { node: self.motor.node, patience })
            .chain(self.sensors.producers())
            .collect()
    }

    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        lookout: &mut Lookout<'_>,
    ) -> Result<(), CanFault> {
        start_nodes(link, &self.producers())?;
        link.set_strictness(Strictness::Watching);
        self.home(link, self.remembers, lookout)?;
        self.confirm_limits(link, limits)?;
        self.go_to_start(link, lookout)?;
        self.set_mode(link, Mode::CyclicSynchronousPosition)?;
        self.seen = self.ask_status(link)?.state();
        Ok(())
    }

    fn send_target(
        &mut self,
        link: &mut Link,
        target: JointAngle,
        shown_nm: f64,
        wish: Wish,
    ) -> Result<(), CanFault> {
        let Some(word) = self.word(wish) else { return Ok(()) };
        let Counts(counts) = self.gearing.to_drive(target);
        let mut data = [0u8; 8];
        data[..2].copy_from_slice(&word.0.to_le_bytes());
        Kind::I32.write(f64::from(counts), &mut data[2..]);
        let mut length = 6;
        if let Some(display) = self.display {
            display.kind.write(shown_nm / display.nm_per_count, &mut data[6..]);
            length += display.kind.bytes();
        }
        link.send(&Frame::new(self.target_id(), &data[..length.min(8)]))
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        link.send(&Frame::new(cob::SYNC, &[]))
    }

    fn take(&mut self, _frame: &Frame) -> Result<bool, CanFault> {
        Ok(false)
    }

    fn answered(&self) -> bool {
        true
    }

    fn angle(&self, readings: &Readings, sample: usize) -> JointAngle {
        let JointAngle(at_sync) = self.gearing.from_drive(Counts(readings.position));
        let JointAngle(one) = self.gearing.from_drive(Counts(1));
        JointAngle(at_sync + readings.steps[sample] * one)
    }

    fn check(&self, readings: &Readings) -> Result<(), CanFault> {
        let status = Statusword(readings.statusword);
        let (state, statusword) = (status.state(), status.0);
        if state != State::OperationEnabled {
            return Err(CanFault::NotEnabled { state, statusword });
        }
        if status.internal_limit() || !status.mode_bit_12() || status.mode_bit_13() {
            return Err(CanFault::DriveLimit { statusword });
        }
        Ok(())
    }

    fn power(&self, readings: &Readings) -> Power {
        match Statusword(readings.statusword).state() {
            State::OperationEnabled => Power::Following,
            state if state.has_power() => Power::Changing,
            _ => Power::Off,
        }
    }

    /// To the next SYNC, and through the drive's interpolation.
    fn periods_to_target(&self) -> usize {
        2
    }

    fn creep_rad_s(&self) -> f64 {
        CREEP_RAD_S
    }

    fn saw(&mut self, readings: &Readings) {
        self.seen = Statusword(readings.statusword).state();
    }

    fn power_off(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.confirm_no_power(link)?;
        // From here on it need not mind us, and sends nothing but heartbeats.
        for producer in self.producers() {
            link.nmt(NmtCommand::EnterPreOperational, producer.node)?;
        }
        link.write(self.motor.node, Object::entry(0x1016, 1), 0u32)
    }
}

/// A stretched cycle would make a real motor jerk from target to target.
fn check_emulated(link: &mut Link, node: u8) -> Result<(), CanFault> {
    let name = link.read_bytes(node, Object::plain(0x1008))?;
    if name.starts_with(b"canbench") { Ok(()) } else { Err(CanFault::NotTheBench { node }) }
}
