//! The CAN motor as a rig. It is armed only with limits read back, a dry run without objections, and the operator's consent.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::canopen::{CanopenError, ErrorPolicy};
use super::connection::Connection;
use super::cycle::{Cycle, PeriodCommand};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, PowerState};
use super::dry_run::DryRun;
use super::fault::CanFault;
use super::file::SafeState;
use super::homing_monitor::HomingMonitor;
use super::limits::{HandleLimits, LimitsConfirmed};
use super::motion_proof::MotionProof;
use super::motor_state::{MotorState, OnFault};
use super::pdo_decoder::MAX_SAMPLES;
use super::realtime::{Privileges, RealTimeThread};
use super::safe_state;
use super::summary::Summary;
use super::target_motion::{Profile, TargetMotion};
use crate::protocol::Limits;
use crate::rig::{
    Armed, ArmingConsent, Command, Cue, Direction, Fault, Motor, Origin, Punctuality, RecordedSignals, Rig,
    Sample, Vitals,
};
use crate::signal::FilterSpec;
use crate::wrist::Lever;

/// How long a drive may take from SHUTDOWN to following its target.
const ENABLE_S: f64 = 3.0;
/// Periods in which the program only looks before there is power: enough to take the speed of the handle.
const LOOK_PERIODS: u32 = 8;
/// Periods for which the motor must report that it follows before its target moves.
const SETTLED_PERIODS: u32 = 3;

/// Speed of the small motion that shows the scale when the handle is at the start position already, rad/s.
const PROOF_SPEED_RAD_S: f64 = 0.05;
/// Periods at rest after which a motor has come to where its target is.
const PROOF_REST_PERIODS: u32 = 10;

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
    /// It could not be confirmed that the motor has no power, when it was released last.
    power_may_be_on: bool,
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
            power_may_be_on: false,
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
        Summary::new(file, &self.stats, link, privileges, drive.proved(), &self.faults)
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
        self.power_may_be_on = released.is_err();
        // The fits and whatever else this thread does next need no real time.
        self.real_time = None;
        match released {
            Ok(disobedience) => {
                if let Some(fault) = disobedience {
                    tracing::error!("{fault}");
                    self.record_fault(fault);
                }
                true
            }
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

    fn power_may_be_on(&self) -> bool {
        self.power_may_be_on
    }

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

/// The motor, able to move. Dropped without being disarmed, as after a panic, it makes the motor safe as well.
#[derive(Debug)]
pub struct ArmedCanMotor {
    /// `None` once it was disarmed.
    motor: Option<CanMotor>,
    cycle: Cycle,
    /// Samples of the latest period that were not given out yet.
    ready: VecDeque<Sample>,
    /// The command for the next period.
    target_rad: f64,
    shown_nm: f64,
    /// After a gap in a movement, in which the motor stood: how its target catches up with the session's.
    catching_up: Option<TargetMotion>,
    /// The motor was made safe and must be armed again before it moves.
    latched: bool,
}

impl ArmedCanMotor {
    /// Requires the proofs that arming depends on: limits read back, and the operator's consent. `motor` holds the dry run.
    fn new(motor: CanMotor, cycle: Cycle, _confirmed: LimitsConfirmed, _consent: ArmingConsent) -> Self {
        Self {
            motor: Some(motor),
            cycle,
            ready: VecDeque::with_capacity(MAX_SAMPLES),
            target_rad: 0.0,
            shown_nm: 0.0,
            catching_up: None,
            latched: false,
        }
    }

    fn period(&mut self, request: DriveRequest, state: MotorState) -> Result<(), CanFault> {
        let command = PeriodCommand { target_rad: self.target_rad, shown_nm: self.shown_nm, request };
        let Some(CanMotor { connection: Connection { link, drive, .. }, stats, .. }) = &mut self.motor else {
            return Err(CanFault::Latched);
        };
        self.cycle.run(link, drive.as_mut(), stats, command, state)
    }

    fn drive(&self) -> Result<&dyn Drive, CanFault> {
        self.motor.as_ref().map(|motor| motor.connection.drive.as_ref()).ok_or(CanFault::Latched)
    }

    fn measured_rad(&self) -> Result<f64, CanFault> {
        Ok(self.drive()?.angle(self.cycle.readings(), self.cycle.samples() - 1).0)
    }

    /// From no power to following, with the target where the handle is; then slowly to the start position.
    fn enable_operation(&mut self) -> Result<(), CanFault> {
        // Where the handle is, that it stands still, and what the torque is, before there is any power.
        let mut looked = 0;
        while looked < LOOK_PERIODS {
            self.period(DriveRequest::None, MotorState::Looking)?;
            looked += u32::from(self.cycle.has_new_readings());
        }
        self.target_rad = self.measured_rad()?;
        self.cycle.stand_at(self.target_rad);
        let most = (ENABLE_S / self.cycle.period_s()).ceil() as u64;
        let mut following = 0;
        for _ in 0..most {
            self.period(DriveRequest::Enable, MotorState::Enabling)?;
            match self.drive()?.power(self.cycle.readings()) {
                PowerState::Following => following += 1,
                PowerState::Off => self.target_rad = self.measured_rad()?,
                PowerState::Changing => {}
            }
            if following == SETTLED_PERIODS {
                return self.approach_start();
            }
        }
        let now = self.motor.as_ref().map(|motor| motor.connection.clock.now());
        now.map_or(Ok(()), |now| self.drive()?.check(self.cycle.readings(), now))?;
        Err(CanFault::NotAtStart { off_rad: self.measured_rad()? })
    }

    /// Slowly to the start position. On the way, or by a small motion there and back, the motor must move as far and as fast
    /// as it is told, before anything faster is asked of it.
    fn approach_start(&mut self) -> Result<(), CanFault> {
        let wanted = self.drive()?.approach();
        let limits = *self.cycle.limits();
        let profile = Profile {
            speed_rad_s: wanted.speed_rad_s.min(limits.speed_rad_s),
            acceleration_rad_s2: wanted.acceleration_rad_s2.min(limits.acceleration_rad_s2),
        };
        let [low_rad, high_rad] = limits.angle_rad;
        let mut proof = self.motion_proof(profile)?;
        self.creep_to(0.0, profile, &mut proof)?;
        if !proof.is_long_enough() {
            let slow = Profile { speed_rad_s: profile.speed_rad_s.min(PROOF_SPEED_RAD_S), ..profile };
            let there_rad =
                if high_rad >= -low_rad { MotionProof::LENGTH_RAD } else { -MotionProof::LENGTH_RAD };
            proof = self.motion_proof(slow)?;
            self.creep_to(there_rad, slow, &mut proof)?;
            self.creep_to(0.0, slow, &mut proof)?;
        }
        proof.finish()
    }

    fn motion_proof(&self, profile: Profile) -> Result<MotionProof, CanFault> {
        let motor = self.motor.as_ref().ok_or(CanFault::Latched)?;
        let stretch = motor.connection.file.bench.map_or(1.0, |bench| bench.time_stretch);
        let resolution_rad = motor.connection.drive.angle_resolution_rad();
        Ok(MotionProof::new(profile.speed_rad_s, resolution_rad, stretch))
    }

    /// Moves the target to an angle, and waits until the motor stands there.
    fn creep_to(&mut self, end_rad: f64, profile: Profile, proof: &mut MotionProof) -> Result<(), CanFault> {
        let mut motion = TargetMotion::at_rest(self.target_rad);
        let mut settled = 0;
        while settled < PROOF_REST_PERIODS {
            // The first period of a motion is at its start.
            self.period(DriveRequest::Follow, MotorState::Following)?;
            let now =
                self.motor.as_ref().map(|motor| motor.connection.clock.now()).ok_or(CanFault::Latched)?;
            if self.cycle.has_new_readings() {
                proof.observe(self.target_rad, self.measured_rad()?, now)?;
            }
            if self.cycle.take_standstill() {
                motion = self.cycle.target_motion();
                self.target_rad = motion.angle_rad;
            }
            settled = if self.target_rad == end_rad && !self.cycle.is_moving() { settled + 1 } else { 0 };
            if self.target_rad != end_rad {
                self.target_rad = motion.approach(end_rad, profile, self.cycle.period_s());
            }
        }
        Ok(())
    }

    /// Brings the motor to the safe state that the rig file gives for the fault. It ends without power, and only arming
    /// again leaves it. Returns whether it was confirmed that there is no power.
    fn make_safe(&mut self, fault: CanFault) -> bool {
        if self.latched {
            return true;
        }
        let Some(motor) = &mut self.motor else { return true };
        let chosen = safe_state::state_for(&fault, &motor.connection.file.safe_state);
        motor.record_fault(fault);
        let is_in_dispute = matches!(fault, CanFault::Canopen(CanopenError::OtherMaster { .. }));
        let state = match self.cycle.state().rule().on_fault {
            _ if fault.bus_is_dead() => None,
            _ if fault == CanFault::Canopen(CanopenError::Interrupted) => Some(SafeState::QuickStop),
            OnFault::StaysOff => None,
            OnFault::Stop if chosen == SafeState::Hold => Some(SafeState::QuickStop),
            // The targets of a hold would be in dispute with the other program's.
            OnFault::SafeState if is_in_dispute && chosen == SafeState::Hold => Some(SafeState::QuickStop),
            OnFault::Stop | OnFault::SafeState => Some(chosen),
            OnFault::QuickStop => Some(SafeState::QuickStop),
            OnFault::PowerOff => Some(SafeState::TorqueOff),
        };
        self.cycle.excuse(&fault);
        self.stop(state);
        let Some(CanMotor { connection: Connection { link, drive, .. }, .. }) = &mut self.motor else {
            return true;
        };
        // So that the fault can say whether the power is off; `disarm` asks once more.
        let outcome = safe_state::power_off(link, drive.as_mut());
        let met = outcome.unwrap_or_else(Some);
        self.motor.iter_mut().for_each(|motor| met.into_iter().for_each(|fault| motor.record_fault(fault)));
        outcome.is_ok()
    }

    fn set_interruptible(&mut self, is_interruptible: bool) {
        self.motor.iter_mut().for_each(|motor| motor.connection.link.set_interruptible(is_interruptible));
    }

    /// Stops the motor, unless the bus is dead, and keeps it stopped.
    fn stop(&mut self, state: Option<SafeState>) {
        self.set_interruptible(false);
        self.latched = true;
        self.ready.clear();
        let Some(motor) = &mut self.motor else { return };
        let Connection { link, drive, .. } = &mut motor.connection;
        link.set_error_policy(ErrorPolicy::Count);
        let Some(state) = state else { return };
        let met = safe_state::reach(state, link, drive.as_mut(), &mut self.cycle, &mut motor.stats);
        met.into_iter().for_each(|fault| motor.record_fault(fault));
    }

    /// Makes the motor safe; the fault for the layers above, which says whether the power is known to be off.
    fn fault(&mut self, fault: CanFault) -> Fault {
        if self.make_safe(fault) { fault.into() } else { Fault::from(fault).with_power_not_confirmed() }
    }

    /// A motor that stood while the program was kept from running accelerates anew, within the limits.
    fn catch_up(&mut self) {
        let Some(motion) = &mut self.catching_up else { return };
        let HandleLimits { speed_rad_s, acceleration_rad_s2, .. } = *self.cycle.limits();
        let goal_rad = self.target_rad;
        let profile = Profile { speed_rad_s, acceleration_rad_s2 };
        self.target_rad = motion.approach(goal_rad, profile, self.cycle.period_s());
        if motion.has_arrived(goal_rad) {
            self.catching_up = None;
        }
    }

    fn collect_samples(&mut self) {
        let Some(motor) = &self.motor else { return };
        let readings = self.cycle.readings();
        for at in 0..self.cycle.samples() {
            self.ready.push_back(Sample {
                theta_m_rad: motor.connection.drive.angle(readings, at).0,
                torque_l_nm: readings.torque_nm[at],
                emg_fcr_mvc: readings.emg_mvc[0].map(|emg| emg[at] / motor.emg_scale[0]),
                emg_ecr_mvc: readings.emg_mvc[1].map(|emg| emg[at] / motor.emg_scale[1]),
                ..Sample::default()
            });
        }
    }

    fn show(&mut self, cue: &Cue) {
        let display = self.motor.as_ref().and_then(|motor| motor.connection.file.display);
        let effort_nm = display.map_or(0.0, |display| display.effort_nm);
        match cue {
            Cue::Target { target_nm, .. } => self.shown_nm = *target_nm,
            Cue::Effort(Direction::Flexion) => self.shown_nm = effort_nm,
            Cue::Effort(Direction::Extension) => self.shown_nm = -effort_nm,
            Cue::Rest | Cue::Relax | Cue::RigTrial(_) => self.shown_nm = 0.0,
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
            // Checked when it is sent.
            Motor::Follow { angle_rad } => self.target_rad = angle_rad,
            Motor::Safe if self.cycle.is_moving() => {
                // The session ends in the middle of a movement: stop on the ramp, and stay stopped.
                self.stop(Some(SafeState::QuickStop));
                self.collect_samples();
            }
            Motor::Safe => {}
        }
        if self.ready.is_empty() {
            self.catch_up();
            if let Err(fault) = self.period(DriveRequest::Follow, MotorState::Following) {
                return Err(self.fault(fault));
            }
            if self.cycle.take_standstill() {
                self.catching_up = Some(self.cycle.target_motion());
            }
            self.collect_samples();
        }
        self.ready.pop_front().ok_or(Fault::NoSample)
    }

    fn take_punctuality(&mut self) -> Option<Punctuality> {
        self.motor.as_mut().map(|motor| motor.stats.take_punctuality())
    }

    fn origin(&self) -> Option<Origin> {
        self.motor.as_ref().map(|motor| motor.connection.drive.origin())
    }

    fn vitals(&self) -> Option<Vitals> {
        self.motor.as_ref().map(CanMotor::vitals)
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        for (scale, factor) in self.motor.iter_mut().flat_map(|motor| &mut motor.emg_scale).zip(factors) {
            *scale *= factor;
        }
        for sample in &mut self.ready {
            sample.emg_fcr_mvc = sample.emg_fcr_mvc.map(|emg| emg / factors[0]);
            sample.emg_ecr_mvc = sample.emg_ecr_mvc.map(|emg| emg / factors[1]);
        }
    }

    #[allow(clippy::expect_used, reason = "only this takes the motor out, and it takes all of self")]
    fn disarm(mut self) -> CanMotor {
        let mut motor = self.motor.take().expect("a motor that is armed is there");
        motor.release();
        motor
    }
}

impl Drop for ArmedCanMotor {
    fn drop(&mut self) {
        if self.motor.is_some() && !self.latched {
            self.stop(Some(SafeState::QuickStop));
        }
        self.motor.iter_mut().for_each(|motor| {
            motor.release();
        });
    }
}
