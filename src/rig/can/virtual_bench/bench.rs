//! Arms a motor on the virtual bus, lets a fault strike, and says what became of the motor.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::mit_motor::{EmulatedMitMotor, MitFirmware};
use super::odrive_axis::{EmulatedOdriveAxis, OdriveFirmware};
use super::servo_drive::EmulatedServoDrive;
use super::transducer::EmulatedTransducer;
use super::world::{BenchFault, Device, VirtualBus, World};
use crate::protocol::ValidProtocol;
use crate::rig::can::file::{CanRigFileError, ValidRigFile};
use crate::rig::can::{ArmedCanMotor, CanMotor, Connection, DryRun};
use crate::rig::{Armed, ArmingConsent, Command, Cue, Fault, Motor, Rig};
use crate::timing::{Clock, VirtualClock};

/// Protocols of 500 Hz with a ramp of 2.6 rad/s, and of 100 Hz with 1.3 rad/s.
const QUICK_TRIAL: &str = include_str!("../../../../fixtures/can/rigs/one-trial.json");
const SLOW_TRIAL: &str = include_str!("../../../../fixtures/can/rigs/slow-trial.json");

/// The kinds of motors that the bench has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorKind {
    Cia402,
    Cansimple,
    Mit,
}

/// A motor on the virtual bus.
pub struct Bench {
    pub clock: VirtualClock,
    pub bus: VirtualBus,
    pub protocol: ValidProtocol,
    file: ValidRigFile,
}

/// What became of a motor that a fault struck.
pub struct Outcome {
    /// What the rig reported.
    pub fault: Fault,
    /// Time from the strike to the loss of power; `None` if the motor had none by then.
    pub power_off_after: Option<Duration>,
    /// The power came back after it was lost.
    pub power_came_back: bool,
    /// The motor has power at the end.
    pub has_power: bool,
    /// Lowest and highest angle of the handle, rad.
    pub angles_rad: [f64; 2],
    /// The faults of the summary.
    pub recorded: Vec<String>,
}

impl Bench {
    /// A bench with the rig file of the kind, as for a person: without stretched time, and nothing is tolerated.
    pub fn new(kind: MotorKind) -> Self {
        Self::with(kind, |_| {})
    }

    /// A bench with some fields of the rig file changed.
    pub fn with(kind: MotorKind, change: impl FnOnce(&mut Value)) -> Self {
        Self::of(kind, if kind == MotorKind::Cia402 { QUICK_TRIAL } else { SLOW_TRIAL }, change)
    }

    /// A bench for the protocol, with some fields of the rig file changed.
    fn of(kind: MotorKind, protocol: &str, change: impl FnOnce(&mut Value)) -> Self {
        let rig = match kind {
            MotorKind::Cia402 => include_str!("../../../../fixtures/can/rigs/plain.json"),
            MotorKind::Cansimple => include_str!("../../../../fixtures/can/rigs/odrive.json"),
            MotorKind::Mit => include_str!("../../../../fixtures/can/rigs/mit.json"),
        };
        let mut rig: Value = serde_json::from_str(rig).unwrap();
        rig.as_object_mut().unwrap().remove("bench");
        if kind != MotorKind::Cia402 {
            rig["motor"].as_object_mut().unwrap().remove("proved_with_free_handle");
        }
        rig["tolerate"]["missed_cycles_in_a_row"] = json!(0);
        if kind == MotorKind::Cia402 {
            rig["master"]["motor_waits_ms"] = json!(100);
            rig["motor"]["heartbeat_wait_ms"] = json!(100);
            rig["motor"]["target_wait_ms"] = json!(0);
        }
        change(&mut rig);
        // A torque may stand still for as long as the motor waits, whatever the period.
        let waits_us = 1000 * rig["master"]["motor_waits_ms"].as_u64().unwrap();
        let most = waits_us / rig["period_us"].as_u64().unwrap();
        let unchanged = &mut rig["tolerate"]["unchanged_torque_periods"];
        *unchanged = json!(unchanged.as_u64().unwrap().min(most));
        let file = ValidRigFile::parse(&rig.to_string(), "rig.json").unwrap();
        let clock = VirtualClock::default();
        let now = clock.now();
        let motor: Box<dyn Device> = match kind {
            MotorKind::Cia402 => Box::new(EmulatedServoDrive::new(now, 0.3)),
            MotorKind::Cansimple => Box::new(EmulatedOdriveAxis::new(OdriveFirmware::default(), now)),
            MotorKind::Mit => Box::new(EmulatedMitMotor::new(MitFirmware::default(), now)),
        };
        let mut devices = vec![motor];
        if kind != MotorKind::Cia402 {
            devices.push(Box::new(EmulatedTransducer::new()));
        }
        let world = World::new(clock.clone(), devices);
        Self {
            bus: VirtualBus(Arc::new(Mutex::new(world))),
            protocol: ValidProtocol::parse(protocol, "protocol.json").unwrap(),
            clock,
            file,
        }
    }

    /// A bench with an ODrive axis of another firmware.
    pub fn odrive(firmware: OdriveFirmware, change: impl FnOnce(&mut Value)) -> Self {
        let bench = Self::with(MotorKind::Cansimple, change);
        bench.bus.world().devices[0] = Box::new(EmulatedOdriveAxis::new(firmware, bench.clock.now()));
        bench
    }

    /// A bench with a motor in MIT mode of another firmware.
    pub fn mit(firmware: MitFirmware, change: impl FnOnce(&mut Value)) -> Self {
        let bench = Self::with(MotorKind::Mit, change);
        bench.bus.world().devices[0] = Box::new(EmulatedMitMotor::new(firmware, bench.clock.now()));
        bench
    }

    /// A bench with a motor in MIT mode in periods of 2 ms, soft enough for a torque limit of 8 N m, which is less than half of what
    /// the motor has. The encoder's own zero is the start position.
    pub fn gentle_mit(change: impl FnOnce(&mut Value)) -> Self {
        let bench = Self::of(MotorKind::Mit, QUICK_TRIAL, |rig| {
            rig["period_us"] = json!(2000);
            rig["master"]["motor_waits_ms"] = json!(100);
            rig["limits"]["motor_torque_nm"] = json!(8);
            rig["motor"]["kp_nm_per_rad"] = json!(180);
            rig["motor"]["kd_nm_s_per_rad"] = json!(1);
            rig["motor"]["zero_here"] = json!(false);
            change(rig);
        });
        let firmware = MitFirmware {
            watchdog: Some(Duration::from_millis(100)),
            angle_rad: 0.03,
            ..MitFirmware::default()
        };
        bench.bus.world().devices[0] = Box::new(EmulatedMitMotor::new(firmware, bench.clock.now()));
        bench
    }

    /// The line of the rig file that names the motor, which arming proves.
    pub fn prove(&self) -> String {
        let motor = self.arm().unwrap().disarm();
        motor.summary().proved.unwrap()
    }

    pub fn dry_run(&self) -> Result<DryRun, CanRigFileError> {
        DryRun::of(&self.protocol, &self.file)
    }

    pub fn motor(&self) -> CanMotor {
        let dry_run = self.dry_run().unwrap();
        CanMotor::new(self.connection(), dry_run)
    }

    pub fn connection(&self) -> Connection {
        let clock = Arc::new(self.clock.clone());
        Connection::on(Box::new(self.bus.clone()), clock, self.file.clone())
    }

    /// Arms, and keeps the angles on the way.
    pub fn arm_and_watch(&self) -> Result<ArmedCanMotor, Fault> {
        self.motor().arm(ArmingConsent::given(), &self.protocol.limits).map_err(|(_, fault)| fault)
    }

    pub fn arm(&self) -> Result<ArmedCanMotor, Fault> {
        let armed = self.arm_and_watch();
        // Before the home was found, angles had no meaning.
        self.bus.world().angles_rad = [0.0; 2];
        armed
    }

    pub fn strike(&self, fault: BenchFault) {
        self.bus.world().strike(fault);
    }

    /// Angles of the first ramp of the protocol, one for each sample.
    pub fn ramp(&self) -> impl Iterator<Item = f64> + use<> {
        let movement = self.protocol.ramp_and_hold(self.protocol.velocities_rad_s[0]).unwrap();
        let rate_hz = self.protocol.signal.sample_rate_hz;
        let samples = (movement.duration_s() * rate_hz) as u32;
        (0..samples).map(move |sample| movement.at(f64::from(sample) / rate_hz).angle_rad)
    }

    /// The fault strikes while the motor holds still at the start position.
    pub fn strike_while_held(&self, fault: BenchFault) -> Outcome {
        let still = std::iter::repeat_n(0.0, 200);
        self.run(still, 100, |bench| bench.strike(fault))
    }

    /// The fault strikes in the middle of the ramp.
    pub fn strike_in_ramp(&self, fault: BenchFault) -> Outcome {
        let steepest = self.ramp().position(|angle_rad| angle_rad > 0.03).unwrap();
        self.run(self.ramp().chain(std::iter::repeat_n(0.0, 200)), steepest, |bench| bench.strike(fault))
    }

    /// Sends the motor along `angles_rad`, and does something before one of the samples. Three seconds of holding still
    /// follow, for faults that take their time.
    pub fn run(
        &self,
        angles_rad: impl Iterator<Item = f64>,
        at: usize,
        disturb: impl FnOnce(&Self),
    ) -> Outcome {
        let mut armed = self.arm().expect("nothing is wrong yet");
        let mut disturb = Some(disturb);
        let mut struck = self.clock.now();
        let mut last_rad = 0.0;
        let more = (3.0 * self.protocol.signal.sample_rate_hz) as usize;
        let angles = angles_rad.map(Some).chain(std::iter::repeat_n(None, more));
        let mut found = None;
        for (sample, angle_rad) in angles.enumerate() {
            if sample == at {
                struck = self.clock.now();
                (disturb.take().expect("once"))(self);
            }
            last_rad = angle_rad.unwrap_or(last_rad);
            if let Err(fault) = armed.exchange(&follow(last_rad)) {
                found = Some(fault);
                break;
            }
        }
        let fault = found.expect("the fault is noticed");
        assert!(armed.exchange(&follow(0.0)).is_err(), "a fault is latched");
        let motor = armed.disarm();
        // A motor that was left alone stops by its own watchdog.
        let quiet = self.clock.now() + Duration::from_secs(2);
        self.bus.world().run_until(quiet);
        self.outcome(fault, struck, motor.summary().faults)
    }

    fn outcome(&self, fault: Fault, struck: Instant, recorded: Vec<String>) -> Outcome {
        let world = self.bus.world();
        let after: Vec<_> = world.power.iter().filter(|(time, _)| *time >= struck).collect();
        let off = after.iter().find(|(_, powered)| !powered).map(|(time, _)| *time);
        Outcome {
            fault,
            power_off_after: off.map(|time| time - struck),
            power_came_back: after.iter().any(|(_, powered)| *powered),
            has_power: world.power.last().is_some_and(|(_, powered)| *powered),
            angles_rad: world.angles_rad,
            recorded,
        }
    }
}

/// The command to be at an angle at the next sample.
pub fn follow(angle_rad: f64) -> Command {
    Command { motor: Motor::Follow { angle_rad }, cue: Cue::Moving }
}
