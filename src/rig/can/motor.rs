//! The CAN motor as a rig. It is armed only with limits read back, a dry run without objections, and the operator's consent.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub use self::armed::ArmedCanMotor;
use super::connection::Connection;
use super::cycle::Cycle;
use super::cycle_stats::CycleStats;
use super::dry_run::DryRun;
use super::fault::CanFault;
use super::homing_monitor::HomingMonitor;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::realtime::{Privileges, RealTimeThread};
use super::summary::Summary;
use crate::protocol::Limits;
use crate::rig::{Armed, ArmingConsent, Fault, RecordedSignals, Rig, Vitals};
use crate::signal::FilterSpec;
use crate::wrist::Lever;

mod armed;

/// The motor, unable to move.
#[derive(Debug)]
pub struct CanMotor {
    pub(super) connection: Connection,
    pub(super) dry_run: DryRun,
    stats: CycleStats,
    /// What the system granted at the latest arming.
    privileges: Option<Privileges>,
    /// Held while the motor is armed.
    real_time: Option<RealTimeThread>,
    emg_scale: [f64; 2],
    faults: Vec<CanFault>,
    /// The motor goes by the origin of an earlier process.
    pub(super) origin_is_adopted: bool,
}

impl CanMotor {
    /// The motor of a connection, for the protocol of the dry run.
    pub fn new(connection: Connection, dry_run: DryRun) -> Self {
        Self {
            connection,
            dry_run,
            stats: CycleStats::default(),
            privileges: None,
            real_time: None,
            emg_scale: [1.0; 2],
            faults: Vec::new(),
            origin_is_adopted: false,
        }
    }

    /// Ends the arming of the motor as soon as the operator sets `stop`: homing, the way to the start position, and every
    /// wait for an answer. While the motor is armed, the session listens to the operator by itself.
    pub fn stop_on(&mut self, stop: Arc<AtomicBool>) {
        self.connection.link.stop_on(stop);
    }

    /// Samples from the sample after a command to the motor being at its target.
    pub fn motion_delay_samples(&self) -> u64 {
        let samples = self.connection.file.signals.torque.samples;
        (self.connection.drive.target_delay_periods() * samples).saturating_sub(1) as u64
    }

    /// The lever between motor and handle; `None` for a rigid one.
    pub fn lever(&self) -> Option<Lever> {
        self.connection.file.lever
    }

    /// The filter that both angle and torque passed before their numbers are on the bus.
    pub fn recorded_filter(&self) -> Option<FilterSpec> {
        self.connection.file.recorded_filter
    }

    /// What is known of the recorded channels.
    pub fn recorded_signals(&self) -> RecordedSignals {
        self.connection.file.recorded_signals()
    }

    /// The rig's name.
    pub fn name(&self) -> &str {
        &self.connection.file.name
    }

    /// Counts, times and faults of the bus so far.
    pub fn summary(&self) -> Summary {
        let Connection { file, link, drive, .. } = &self.connection;
        let privileges = self.privileges.as_ref();
        Summary::new(file, &self.stats, link.counters(), privileges, drive.proved(), &self.faults)
    }

    fn vitals(&self) -> Vitals {
        let Connection { file, link, .. } = &self.connection;
        let stats = &self.stats;
        Vitals {
            periods: stats.periods,
            late_p99_us: stats.lateness.quantile_us(0.99),
            latest_us: stats.lateness.longest_us(),
            missed: stats.missed + stats.overruns,
            bus_load: Some(stats.load(f64::from(file.bit_rate.bits_per_s()))),
            bus_errors: link.counters().bus_errors,
        }
    }

    /// Lets the drive find its origin, gives the motor power at its present angle, and moves it slowly to the start position.
    #[allow(clippy::result_large_err, reason = "the rig comes back with its fault, once an arming")]
    fn enable(
        mut self,
        confirmed: LimitsConfirmed,
        consent: ArmingConsent,
    ) -> Result<ArmedCanMotor, (Self, Fault)> {
        let limits = *self.dry_run.limits();
        let Connection { file, clock, link, drive, .. } = &mut self.connection;
        let mut homing_monitor = HomingMonitor::new(file, limits, &mut self.stats, Arc::clone(clock));
        let started = drive.start(link, &limits, &mut homing_monitor);
        let cycle = Cycle::new(file, limits, 0.0, clock.now());
        let mut armed = ArmedCanMotor::new(self, cycle, confirmed, consent);
        match started.and_then(|()| armed.enable_operation()) {
            Ok(()) => {
                armed.set_interruptible(false);
                Ok(armed)
            }
            Err(fault) => {
                let fault = armed.fault(fault);
                Err((armed.disarm(), fault))
            }
        }
    }

    fn failed(mut self, fault: CanFault) -> (Self, Fault) {
        self.record_fault(fault);
        let has_no_power = self.release();
        let fault = Fault::from(fault);
        (self, if has_no_power { fault } else { fault.with_power_not_confirmed() })
    }

    fn record_fault(&mut self, fault: CanFault) {
        self.faults.push(fault);
    }

    /// Removes the power. Returns whether that was confirmed.
    fn release(&mut self) -> bool {
        let released = self.connection.release();
        // The fits and whatever else this thread does next need no real time.
        self.real_time = None;
        match released {
            Ok(()) => true,
            Err(fault) => {
                tracing::error!("{}", CanFault::PowerNotConfirmed);
                self.record_fault(fault);
                self.record_fault(CanFault::PowerNotConfirmed);
                false
            }
        }
    }
}

impl Rig for CanMotor {
    type Armed = ArmedCanMotor;

    fn arm(mut self, consent: ArmingConsent, limits: &Limits) -> Result<ArmedCanMotor, (Self, Fault)> {
        // The dry run was made with the protocol's limits; others would need another.
        let kept = self.dry_run.limits();
        let asked = HandleLimits::tighter(&self.connection.file.limits, limits);
        if *kept != asked {
            return Err(self.failed(CanFault::OtherLimits));
        }
        self.connection.link.set_interruptible(true);
        if let Err(fault) = self.connection.check_alone() {
            // Not made safe: the power is the other program's.
            self.record_fault(fault);
            return Err((self, fault.into()));
        }
        if self.connection.is_real_time {
            self.real_time = None;
            let granted = RealTimeThread::request();
            self.privileges = Some(granted.privileges().clone());
            self.real_time = Some(granted);
        }
        match self.connection.prepare(&asked) {
            Ok(confirmed) => self.enable(confirmed, consent),
            Err(fault) => Err(self.failed(fault)),
        }
    }
}
