//! The CAN motor as a rig. It is armed only with limits read back, a dry run without objections, and the operator's consent.

use std::collections::VecDeque;
use std::sync::Arc;

use super::canopen::ErrorPolicy;
use super::connection::Connection;
use super::cycle::{CheckLevel, Cycle};
use super::cycle_stats::CycleStats;
use super::drive::{DriveRequest, PowerState};
use super::dry_run::DryRun;
use super::fault::CanFault;
use super::file::SafeState;
use super::homing_monitor::HomingMonitor;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::pdo_decoder::MAX_SAMPLES;
use super::realtime::{self, Privileges};
use super::safe_state;
use super::summary::Summary;
use super::units::JointAngle;
use crate::protocol::Limits;
use crate::rig::{Armed, ArmingConsent, Command, Cue, Direction, Fault, Motor, Rig, Sample, Vitals};
use crate::wrist::Lever;

/// How long a drive may take from SHUTDOWN to following its target.
const ENABLE_S: f64 = 3.0;

/// The motor, unable to move.
#[derive(Debug)]
pub struct CanMotor {
    connection: Connection,
    dry_run: DryRun,
    stats: CycleStats,
    privileges: Option<Privileges>,
    emg_scale: [f64; 2],
    faults: Vec<CanFault>,
}

impl CanMotor {
    /// The motor of a connection, for the protocol of the dry run.
    pub fn new(connection: Connection, dry_run: DryRun) -> Self {
        Self {
            connection,
            dry_run,
            stats: CycleStats::default(),
            privileges: None,
            emg_scale: [1.0; 2],
            faults: Vec::new(),
        }
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

    /// The rig's name.
    pub fn name(&self) -> &str {
        &self.connection.file.name
    }

    /// Counts, times and faults of the bus so far.
    pub fn summary(&self) -> Summary {
        let Connection { file, link, .. } = &self.connection;
        Summary::new(file, &self.stats, link.counters(), self.privileges.as_ref(), &self.faults)
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

    /// Gives the motor power at its present angle, and moves it slowly to the start position.
    #[allow(clippy::result_large_err, reason = "the rig comes back with its fault, once an arming")]
    fn enable(
        mut self,
        confirmed: LimitsConfirmed,
        consent: ArmingConsent,
    ) -> Result<ArmedCanMotor, (Self, Fault)> {
        let limits = *self.dry_run.limits();
        let Connection { file, clock, link, drive, .. } = &mut self.connection;
        let mut homing_monitor = HomingMonitor::new(file, limits, &mut self.stats, Arc::clone(clock));
        if let Err(fault) = drive.start(link, &limits, &mut homing_monitor) {
            return Err(self.failed(fault));
        }
        let file = &self.connection.file;
        let bits = file.budget().bits_per_period();
        let now = self.connection.clock.now();
        let cycle = Cycle::new(file, limits, file.sample_period(), bits, 0.0, now);
        let mut armed = ArmedCanMotor::new(self, cycle, confirmed, consent);
        match armed.enable_operation() {
            Ok(()) => Ok(armed),
            Err(fault) => {
                armed.make_safe(fault);
                Err((armed.disarm(), fault.into()))
            }
        }
    }

    fn failed(mut self, fault: CanFault) -> (Self, Fault) {
        self.record_fault(fault);
        self.release();
        (self, fault.into())
    }

    fn record_fault(&mut self, fault: CanFault) {
        self.faults.push(fault);
    }

    fn release(&mut self) {
        if let Err(fault) = self.connection.release() {
            tracing::error!("{}", CanFault::PowerNotConfirmed);
            self.record_fault(fault);
            self.record_fault(CanFault::PowerNotConfirmed);
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
        if self.connection.is_real_time {
            self.privileges.get_or_insert_with(realtime::request);
        }
        match self.connection.prepare(&asked) {
            Ok(confirmed) => self.enable(confirmed, consent),
            Err(fault) => Err(self.failed(fault)),
        }
    }
}

/// The motor, able to move.
#[derive(Debug)]
pub struct ArmedCanMotor {
    motor: CanMotor,
    cycle: Cycle,
    /// Samples of the latest period that were not given out yet.
    ready: VecDeque<Sample>,
    /// The command for the next period.
    target_rad: f64,
    shown_nm: f64,
    /// The motor was made safe and must be armed again before it moves.
    latched: bool,
}

impl ArmedCanMotor {
    /// Requires the proofs that arming depends on: limits read back, and the operator's consent. `motor` holds the dry run.
    fn new(motor: CanMotor, cycle: Cycle, _confirmed: LimitsConfirmed, _consent: ArmingConsent) -> Self {
        Self {
            motor,
            cycle,
            ready: VecDeque::with_capacity(MAX_SAMPLES),
            target_rad: 0.0,
            shown_nm: 0.0,
            latched: false,
        }
    }

    fn period(&mut self, request: DriveRequest, check_level: CheckLevel) -> Result<(), CanFault> {
        let command = (JointAngle(self.target_rad), self.shown_nm, request);
        let CanMotor { connection: Connection { link, drive, .. }, stats, .. } = &mut self.motor;
        self.cycle.run(link, drive.as_mut(), stats, command, check_level)
    }

    fn measured_rad(&self) -> f64 {
        let last = self.cycle.samples() - 1;
        self.motor.connection.drive.angle(self.cycle.readings(), last).0
    }

    /// From READY TO SWITCH ON to following, with the target where the handle is; then slowly to the start position.
    fn enable_operation(&mut self) -> Result<(), CanFault> {
        let period_s = self.motor.connection.file.period().seconds();
        // The first periods only look: where the handle is, and whether frames come.
        let most = (ENABLE_S / period_s).ceil() as u64 + 10;
        let mut following = 0;
        for _ in 0..most {
            self.period(DriveRequest::Enable, CheckLevel::Enabling)?;
            match self.motor.connection.drive.power(self.cycle.readings()) {
                PowerState::Following => following += 1,
                PowerState::Off => self.target_rad = self.measured_rad(),
                PowerState::Changing => {}
            }
            if following == 3 {
                return self.approach_start(period_s);
            }
        }
        self.motor.connection.drive.check(self.cycle.readings(), self.motor.connection.clock.now())?;
        Err(CanFault::NotAtStart { off_rad: self.measured_rad() })
    }

    fn approach_start(&mut self, period_s: f64) -> Result<(), CanFault> {
        let step_rad = self.motor.connection.drive.approach_speed_rad_s() * period_s;
        while self.target_rad != 0.0 {
            self.target_rad -= self.target_rad.clamp(-step_rad, step_rad);
            self.period(DriveRequest::Follow, CheckLevel::Full)?;
        }
        // Until every target under way is the start position: it stands.
        while self.cycle.is_moving() {
            self.period(DriveRequest::Follow, CheckLevel::Full)?;
        }
        Ok(())
    }

    /// Brings the motor to the safe state that the rig file gives for the fault. It ends without power, and only arming
    /// again leaves it.
    fn make_safe(&mut self, fault: CanFault) {
        if self.latched {
            return;
        }
        self.latched = true;
        self.motor.record_fault(fault);
        self.ready.clear();
        let states = self.motor.connection.file.safe_state;
        let state = safe_state::state_for(&fault, &states);
        let CanMotor { connection: Connection { link, drive, .. }, stats, .. } = &mut self.motor;
        link.set_error_policy(ErrorPolicy::Count);
        if !fault.bus_is_dead() {
            safe_state::reach(state, link, drive.as_mut(), &mut self.cycle, stats);
        }
        // The power itself is taken off, and made sure of, by `disarm`, which always follows.
        if let Err(fault) = safe_state::power_off(link, drive.as_mut()) {
            link.set_own_heartbeat(None);
            self.motor.record_fault(fault);
        }
    }

    fn fault(&mut self, fault: CanFault) -> Fault {
        self.make_safe(fault);
        fault.into()
    }

    fn collect_samples(&mut self) {
        let readings = self.cycle.readings();
        for at in 0..self.cycle.samples() {
            self.ready.push_back(Sample {
                theta_m_rad: self.motor.connection.drive.angle(readings, at).0,
                torque_l_nm: readings.torque_nm[at],
                emg_fcr_mvc: readings.emg_mvc[0] / self.motor.emg_scale[0],
                emg_ecr_mvc: readings.emg_mvc[1] / self.motor.emg_scale[1],
            });
        }
    }

    fn show(&mut self, cue: &Cue) {
        let effort_nm = self.motor.connection.file.display.map_or(0.0, |display| display.effort_nm);
        match cue {
            Cue::Target { target_nm, .. } => self.shown_nm = *target_nm,
            Cue::Effort(Direction::Flexion) => self.shown_nm = effort_nm,
            Cue::Effort(Direction::Extension) => self.shown_nm = -effort_nm,
            Cue::Rest | Cue::Relax => self.shown_nm = 0.0,
            // Nothing on the display changes while the motor moves.
            Cue::Moving => {}
        }
    }
}

impl Armed for ArmedCanMotor {
    type Disarmed = CanMotor;

    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        if self.latched {
            return Err(CanFault::Latched.into());
        }
        self.show(&command.cue);
        match command.motor {
            Motor::Follow { angle_rad } => {
                if let Err(fault) = self.cycle.limits().check_target(angle_rad) {
                    return Err(self.fault(fault));
                }
                self.target_rad = angle_rad;
            }
            Motor::Safe if self.cycle.is_moving() => {
                // The session ends in the middle of a movement: stop on the ramp, and stay stopped.
                self.latched = true;
                let CanMotor { connection: Connection { link, drive, .. }, stats, .. } = &mut self.motor;
                link.set_error_policy(ErrorPolicy::Count);
                safe_state::reach(SafeState::QuickStop, link, drive.as_mut(), &mut self.cycle, stats);
                self.collect_samples();
            }
            Motor::Safe => {}
        }
        if self.ready.is_empty() {
            if let Err(fault) = self.period(DriveRequest::Follow, CheckLevel::Full) {
                return Err(self.fault(fault));
            }
            self.collect_samples();
        }
        self.ready.pop_front().ok_or(Fault::NoSample)
    }

    fn vitals(&self) -> Option<Vitals> {
        Some(self.motor.vitals())
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        for (scale, factor) in self.motor.emg_scale.iter_mut().zip(factors) {
            *scale *= factor;
        }
        for sample in &mut self.ready {
            sample.emg_fcr_mvc /= factors[0];
            sample.emg_ecr_mvc /= factors[1];
        }
    }

    fn disarm(mut self) -> CanMotor {
        self.motor.release();
        self.motor
    }
}
