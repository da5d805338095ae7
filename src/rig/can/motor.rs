//! The CAN motor as a rig: disarmed until every limit was read back, the dry run was passed, and the operator said so.

use std::collections::VecDeque;

use super::canopen::Strictness;
use super::connection::Connection;
use super::cycle::{Cycle, Scrutiny, Tally};
use super::drive::{Power, Wish};
use super::dry_run::DryRun;
use super::fault::CanFault;
use super::file::SafeState;
use super::limits::{Confirmed, HandleLimits};
use super::lookout::Lookout;
use super::readings::MOST_SAMPLES;
use super::realtime::{self, Privileges};
use super::safe;
use super::summary::Summary;
use super::units::JointAngle;
use crate::protocol::Limits;
use crate::rig::{Armed, Command, Cue, Direction, Fault, Motor, OperatorsWord, Rig, Sample, Vitals};
use crate::wrist::Lever;

/// How long a drive may take from SHUTDOWN to following its target.
const ENABLE_S: f64 = 3.0;

/// The motor, unable to move.
#[derive(Debug)]
pub struct CanMotor {
    on_bus: Connection,
    dry_run: DryRun,
    tally: Tally,
    privileges: Option<Privileges>,
    emg_scale: [f64; 2],
    faults: Vec<CanFault>,
}

impl CanMotor {
    /// The motor behind a connection, for the protocol that was walked through.
    pub fn new(on_bus: Connection, dry_run: DryRun) -> Self {
        Self {
            on_bus,
            dry_run,
            tally: Tally::default(),
            privileges: None,
            emg_scale: [1.0; 2],
            faults: Vec::new(),
        }
    }

    /// By how many samples the motor follows a command later than at the next sample.
    pub fn motion_delay_samples(&self) -> u64 {
        let samples = self.on_bus.file.signals.torque.samples;
        (self.on_bus.drive.periods_to_target() * samples).saturating_sub(1) as u64
    }

    /// The lever between motor and handle; `None` for a rigid one.
    pub fn lever(&self) -> Option<Lever> {
        self.on_bus.file.lever
    }

    /// The rig's name.
    pub fn name(&self) -> &str {
        &self.on_bus.file.name
    }

    /// What happened on the bus so far.
    pub fn summary(&self) -> Summary {
        let Connection { file, link, .. } = &self.on_bus;
        Summary::new(file, &self.tally, link.counters(), self.privileges.as_ref(), &self.faults)
    }

    fn vitals(&self) -> Vitals {
        let Connection { file, link, .. } = &self.on_bus;
        let tally = &self.tally;
        Vitals {
            periods: tally.periods,
            late_p99_us: tally.lateness.quantile_us(0.99),
            latest_us: tally.lateness.longest_us(),
            missed: tally.missed + tally.overruns,
            bus_load: Some(tally.load(f64::from(file.bit_rate.bits_per_s()))),
            bus_errors: link.counters().bus_errors,
        }
    }

    /// Powers the motor where it stands and brings it the last stretch to the start position.
    #[allow(clippy::result_large_err, reason = "the rig comes back with its fault, once an arming")]
    fn enable(mut self, confirmed: Confirmed, word: OperatorsWord) -> Result<ArmedCanMotor, (Self, Fault)> {
        let limits = *self.dry_run.limits();
        let Connection { file, link, drive } = &mut self.on_bus;
        let mut lookout = Lookout::new(file, limits, &mut self.tally);
        if let Err(fault) = drive.start(link, &limits, &mut lookout) {
            return Err(self.failed(fault));
        }
        let file = &self.on_bus.file;
        let bits = file.budget().bits_per_period();
        let cycle = Cycle::new(file, limits, file.sample_period(), bits, 0.0);
        let mut armed = ArmedCanMotor::new(self, cycle, confirmed, word);
        match armed.take_power() {
            Ok(()) => Ok(armed),
            Err(fault) => {
                armed.make_safe(fault);
                Err((armed.disarm(), fault.into()))
            }
        }
    }

    fn failed(mut self, fault: CanFault) -> (Self, Fault) {
        self.note(fault);
        self.let_go();
        (self, fault.into())
    }

    fn note(&mut self, fault: CanFault) {
        self.faults.push(fault);
    }

    fn let_go(&mut self) {
        if let Err(fault) = self.on_bus.release() {
            tracing::error!("{}", CanFault::PowerNotConfirmed);
            self.note(fault);
            self.note(CanFault::PowerNotConfirmed);
        }
    }
}

impl Rig for CanMotor {
    type Armed = ArmedCanMotor;

    fn arm(mut self, word: OperatorsWord, limits: &Limits) -> Result<ArmedCanMotor, (Self, Fault)> {
        // The dry run was made with the protocol's limits; others would need another.
        let kept = self.dry_run.limits();
        let asked = HandleLimits::tighter(&self.on_bus.file.limits, limits);
        if *kept != asked {
            return Err(self.failed(CanFault::OtherLimits));
        }
        self.privileges.get_or_insert_with(realtime::ask);
        match self.on_bus.prepare(&asked) {
            Ok(confirmed) => self.enable(confirmed, word),
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
    /// It was made safe; nothing moves it again.
    latched: bool,
}

impl ArmedCanMotor {
    /// Takes what makes arming lawful: the limits read back, and the operator's word. The dry run is the motor's own.
    fn new(motor: CanMotor, cycle: Cycle, _confirmed: Confirmed, _word: OperatorsWord) -> Self {
        Self {
            motor,
            cycle,
            ready: VecDeque::with_capacity(MOST_SAMPLES),
            target_rad: 0.0,
            shown_nm: 0.0,
            latched: false,
        }
    }

    fn period(&mut self, wish: Wish, scrutiny: Scrutiny) -> Result<(), CanFault> {
        let command = (JointAngle(self.target_rad), self.shown_nm, wish);
        let CanMotor { on_bus: Connection { link, drive, .. }, tally, .. } = &mut self.motor;
        self.cycle.run(link, drive.as_mut(), tally, command, scrutiny)
    }

    fn measured_rad(&self) -> f64 {
        let last = self.cycle.samples() - 1;
        self.motor.on_bus.drive.angle(self.cycle.readings(), last).0
    }

    /// From READY TO SWITCH ON to following, with the target where the handle is; then slowly to the start position.
    fn take_power(&mut self) -> Result<(), CanFault> {
        let period_s = self.motor.on_bus.file.period().seconds();
        // The first periods only look: where the handle is, and whether frames come.
        let most = (ENABLE_S / period_s).ceil() as u64 + 10;
        let mut following = 0;
        for _ in 0..most {
            self.period(Wish::Enable, Scrutiny::Enabling)?;
            match self.motor.on_bus.drive.power(self.cycle.readings()) {
                Power::Following => following += 1,
                Power::Off => self.target_rad = self.measured_rad(),
                Power::Changing => {}
            }
            if following == 3 {
                return self.creep_to_start(period_s);
            }
        }
        self.motor.on_bus.drive.check(self.cycle.readings())?;
        Err(CanFault::NotAtStart { off_rad: self.measured_rad() })
    }

    fn creep_to_start(&mut self, period_s: f64) -> Result<(), CanFault> {
        let step_rad = self.motor.on_bus.drive.creep_rad_s() * period_s;
        while self.target_rad != 0.0 {
            self.target_rad -= self.target_rad.clamp(-step_rad, step_rad);
            self.period(Wish::Follow, Scrutiny::Full)?;
        }
        // Until every target under way is the start position: it stands.
        while self.cycle.is_moving() {
            self.period(Wish::Follow, Scrutiny::Full)?;
        }
        Ok(())
    }

    /// The safe state that the rig file has for a fault; it ends without power and is never left but by arming.
    fn make_safe(&mut self, fault: CanFault) {
        if self.latched {
            return;
        }
        self.latched = true;
        self.motor.note(fault);
        self.ready.clear();
        let states = self.motor.on_bus.file.safe_state;
        let state = safe::state_for(&fault, &states);
        let CanMotor { on_bus: Connection { link, drive, .. }, tally, .. } = &mut self.motor;
        link.set_strictness(Strictness::Noting);
        if !fault.bus_is_dead() {
            safe::reach(state, link, drive.as_mut(), &mut self.cycle, tally);
        }
        // The power itself is taken off, and made sure of, by `disarm`, which always follows.
        if let Err(fault) = safe::power_off(link, drive.as_mut()) {
            link.set_beat(None);
            self.motor.note(fault);
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
                theta_m_rad: self.motor.on_bus.drive.angle(readings, at).0,
                torque_l_nm: readings.torque_nm[at],
                emg_fcr_mvc: readings.emg_mvc[0] / self.motor.emg_scale[0],
                emg_ecr_mvc: readings.emg_mvc[1] / self.motor.emg_scale[1],
            });
        }
    }

    fn show(&mut self, cue: &Cue) {
        let effort_nm = self.motor.on_bus.file.display.map_or(0.0, |display| display.effort_nm);
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
                if let Err(fault) = self.cycle.limits().let_pass(angle_rad) {
                    return Err(self.fault(fault));
                }
                self.target_rad = angle_rad;
            }
            Motor::Safe if self.cycle.is_moving() => {
                // The session ends in the middle of a movement: stop on the ramp, and stay stopped.
                self.latched = true;
                let CanMotor { on_bus: Connection { link, drive, .. }, tally, .. } = &mut self.motor;
                link.set_strictness(Strictness::Noting);
                safe::reach(SafeState::QuickStop, link, drive.as_mut(), &mut self.cycle, tally);
                self.collect_samples();
            }
            Motor::Safe => {}
        }
        if self.ready.is_empty() {
            if let Err(fault) = self.period(Wish::Follow, Scrutiny::Full) {
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
        self.motor.let_go();
        self.motor
    }
}
