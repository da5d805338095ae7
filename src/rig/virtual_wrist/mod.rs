//! The virtual wrist: a rig without motor and subject, on which a protocol is tried first.
//!
//! It simulates the paper's model behind a stiff position servo, a virtual subject who tracks the displayed target, and
//! sensors with noise and finite resolution.

mod bearing;
mod emg;
mod hidden_effect;
mod loaded_handle;
mod mechanism_list;
mod noise;
mod person;
mod seal;
mod sensors;
mod servo;
mod setup;
mod typical_effect;
mod voluntary;
mod wrist_response;

pub use hidden_effect::draw_hidden_effect;
pub use mechanism_list::{MechanismList, MechanismListError};
pub use person::{PERSON_FORMAT, Person, PersonError, Surface};
pub use seal::{Seal, SealError};
pub use setup::{RigFile, RigFileError, Setup};
pub use typical_effect::TypicalEffect;

use emg::Emg;
use loaded_handle::LoadedHandle;
use sensors::VirtualSensors;
use servo::Servo;
use voluntary::VoluntaryTorque;
use wrist_response::{WristResponse, trial_parameters};

use schemars::{JsonSchema, schema_for};

use super::{
    Armed, ArmingConsent, Command, Cue, Fault, Motor, RecordedSignals, Rig, RigTrialStage, Sample, TrialKey,
    UpcomingRigTrial,
};
use crate::protocol::Limits;
use crate::random::Stream;
use crate::wrist::FurtherValues;

/// The JSON schema of the files of virtual subjects, as text.
pub fn person_schema_text() -> String {
    schema_text::<Person>()
}

/// The JSON schema of the files of virtual rigs, as text. That of all rigs is [`crate::rig::schema_text`].
pub fn rig_schema_text() -> String {
    schema_text::<RigFile>()
}

/// The JSON schema of the files of virtual rigs.
pub(super) fn rig_schema() -> serde_json::Value {
    schema_for!(RigFile).to_value()
}

fn schema_text<T: JsonSchema>() -> String {
    format!("{:#}\n", schema_for!(T).to_value())
}

/// The virtual wrist, disarmed.
#[derive(Debug, Clone)]
pub struct VirtualWrist {
    person: Person,
    setup: Setup,
    seed: u64,
    sample_rate_hz: f64,
    emg_scale: [f64; 2],
}

impl VirtualWrist {
    /// `person` at a rig of `setup`, sampled at `sample_rate_hz`.
    pub fn new(person: Person, setup: Setup, seed: u64, sample_rate_hz: f64) -> Self {
        Self { person, setup, seed, sample_rate_hz, emg_scale: [1.0; 2] }
    }

    /// The six base parameters that the wrist has in a trial of this velocity, rad/s, and target torque, N m: what a fit should find.
    pub fn trial_parameters(&self, key: TrialKey, velocity_rad_s: f64, torque_nm: f64) -> [f64; 6] {
        let mut voluntary =
            VoluntaryTorque::new(&self.person, self.sample_rate_hz, self.stream("subject", key));
        trial_parameters(&self.person, velocity_rad_s, torque_nm, &voluntary.draw_trial())
    }

    /// What is known of the recorded channels.
    pub fn recorded_signals(&self, sample_rate_hz: f64) -> RecordedSignals {
        self.setup.recorded_signals(sample_rate_hz)
    }

    /// The random numbers of a trial: a trial that is repeated after a crash is the same trial.
    fn stream(&self, name: &str, key: TrialKey) -> Stream {
        let kind = if key.practice { "practice" } else { "trial" };
        Stream::new(self.seed, &format!("{name}/{kind}/{}/{}", key.position, key.rejections))
    }
}

impl Rig for VirtualWrist {
    type Armed = ArmedVirtualWrist;

    fn arm(self, _word: ArmingConsent, _limits: &Limits) -> Result<Self::Armed, (Self, Fault)> {
        Ok(ArmedVirtualWrist::new(self))
    }
}

/// The virtual wrist, armed.
pub struct ArmedVirtualWrist {
    rig: VirtualWrist,
    servo: Servo,
    wrist: WristResponse,
    voluntary: VoluntaryTorque,
    emg: Emg,
    sensors: VirtualSensors,
    trial: Option<TrialKey>,
    rig_trial: Option<RigTrialUnderWay>,
    moving: bool,
    /// The angle of the motor at the last sample, without noise, rad.
    angle_rad: f64,
    /// What is still to come of the turn of the motor while a load is put on or taken off.
    load_change: LoadChange,
    /// Samples since the rig was armed.
    sample: u64,
    lever_torque_nm: f64,
}

/// Time in which the motor turns as its load is put on or taken off, s: an operator's hands take longer.
pub const LOAD_CHANGE_S: f64 = 0.2;

/// The turn of the motor while its load changes. Its drive shows it without a jump, which would be a speed beyond any limit.
#[derive(Debug, Clone, Copy, Default)]
struct LoadChange {
    /// Angle before less angle after, rad.
    turn_rad: f64,
    /// Samples that are left, and their number.
    left: u32,
    samples: u32,
}

impl LoadChange {
    /// What is to come at the next sample, rad.
    fn next_rad(&mut self) -> f64 {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 { 0.0 } else { self.turn_rad * f64::from(self.left) / f64::from(self.samples) }
    }
}

/// The handle with the load of a rig trial.
struct RigTrialUnderWay {
    /// Place of the rig trial in the protocol, and how often it was rejected before.
    key: [u32; 2],
    /// Whether it has begun, and draws its own random numbers.
    has_begun: bool,
    handle: LoadedHandle,
}

impl ArmedVirtualWrist {
    fn new(rig: VirtualWrist) -> Self {
        let (rate, stream) = (rig.sample_rate_hz, |name: &str| Stream::new(rig.seed, name));
        Self {
            servo: Servo::new(&rig.setup, rate),
            wrist: WristResponse::new(&rig.person, &rig.setup, rate),
            voluntary: VoluntaryTorque::new(&rig.person, rate, stream("subject/rest")),
            emg: Emg::new(&rig.person, rate, stream("emg/rest")),
            sensors: VirtualSensors::new(
                &rig.setup,
                &rig.person,
                rate,
                [stream("noise/rest"), stream("noise/further/rest")],
            ),
            rig,
            trial: None,
            rig_trial: None,
            moving: false,
            angle_rad: 0.0,
            load_change: LoadChange::default(),
            sample: 0,
            lever_torque_nm: 0.0,
        }
    }

    /// Draws the random numbers of a trial from streams of its own.
    fn begin_trial(&mut self, key: TrialKey) {
        self.trial = Some(key);
        self.voluntary.restart(self.rig.stream("subject", key));
        self.emg.restart(self.rig.stream("emg", key));
        self.sensors.restart([self.rig.stream("noise", key), self.rig.stream("noise/further", key)]);
        self.servo.settle();
        self.wrist.stop();
        self.lever_torque_nm = 0.0;
    }

    /// Puts a load on the handle, and lets it come to rest.
    fn mount(&mut self, upcoming: &UpcomingRigTrial) {
        let UpcomingRigTrial { position, rejections, load, .. } = *upcoming;
        let handle = LoadedHandle::new(&self.rig.person, &self.rig.setup, load, self.rig.sample_rate_hz);
        self.servo = Servo::new(&handle.servo_setup(&self.rig.setup), self.rig.sample_rate_hz);
        self.lever_torque_nm = 0.0;
        let samples = handle.mounted_samples();
        self.rig_trial = Some(RigTrialUnderWay { key: [position, rejections], has_begun: false, handle });
        let mut at_rest_rad = 0.0;
        for _ in 0..samples {
            (at_rest_rad, _, _) = self.turn_loaded_handle(0.0, false);
        }
        self.change_load(at_rest_rad);
    }

    /// The load changed, with which the motor comes to rest at `at_rest_rad`.
    fn change_load(&mut self, at_rest_rad: f64) {
        let samples = (LOAD_CHANGE_S * self.rig.sample_rate_hz).ceil() as u32;
        self.load_change = LoadChange { turn_rad: self.angle_rad - at_rest_rad, left: samples, samples };
    }

    /// One period of a rig trial: motor angle, torque and further channels that the sensors show. 0 without a rig trial.
    fn turn_loaded_handle(&mut self, command_rad: f64, is_moving: bool) -> (f64, f64, FurtherValues<f64>) {
        let Some(RigTrialUnderWay { handle, .. }) = &mut self.rig_trial else {
            return (0.0, 0.0, FurtherValues::at_rest());
        };
        let before = self.servo.motion();
        self.servo.step(command_rad, self.lever_torque_nm);
        let motor = self.servo.motion();
        let own = handle.step(motor, command_rad, is_moving);
        self.lever_torque_nm = handle.on_motor_nm(own.lever_nm, before, motor);
        (handle.motor(motor).theta, own.measured_nm, own.further)
    }

    fn exchange_in_rig_trial(&mut self, upcoming: &UpcomingRigTrial, command_rad: f64) -> Sample {
        let key = [upcoming.position, upcoming.rejections];
        if self.rig_trial.as_ref().is_none_or(|trial| trial.key != key) {
            self.mount(upcoming);
        }
        if let Some(trial) = &mut self.rig_trial
            && upcoming.stage != RigTrialStage::Mounting
            && !std::mem::replace(&mut trial.has_begun, true)
        {
            // Random numbers of its own, whenever it begins.
            let own = format!("rig-trial/{}/{}", upcoming.position, upcoming.rejections);
            let stream = |name: &str| Stream::new(self.rig.seed, &format!("{name}/{own}"));
            self.sensors.restart([stream("noise"), stream("noise/further")]);
        }
        if upcoming.stage != RigTrialStage::Mounting {
            self.load_change = LoadChange::default();
        }
        let is_moving = upcoming.stage == RigTrialStage::Moving;
        let (angle_rad, torque_nm, mut further) = self.turn_loaded_handle(command_rad, is_moving);
        let change_rad = self.load_change.next_rad();
        self.angle_rad = angle_rad + change_rad;
        further.theta_l += change_rad;
        self.sample += 1;
        let time_s = self.sample as f64 / self.rig.sample_rate_hz;
        self.sensors.measure(self.angle_rad, torque_nm, [0.0; 2], &further, time_s)
    }

    /// Takes the load off, between the commands of which only those of a rig trial have one.
    fn end_rig_trial(&mut self) {
        if self.rig_trial.take().is_some() {
            self.servo = Servo::new(&self.rig.setup, self.rig.sample_rate_hz);
            self.lever_torque_nm = 0.0;
            self.change_load(0.0);
        }
    }

    fn follow_cue(&mut self, cue: &Cue) {
        if let Cue::Target { trial, target_nm, .. } = cue
            && self.trial != Some(trial.key)
        {
            self.begin_trial(trial.key);
            let spread = self.voluntary.draw_trial();
            let emg = self.emg.prepare(&spread, *target_nm);
            self.wrist.prepare(&self.rig.person, trial, *target_nm, &spread, emg);
        }
        if matches!(cue, Cue::Moving) && !self.moving {
            self.moving = true;
            self.wrist.start(self.servo.motion(), self.voluntary.torque_nm());
        }
        if matches!(cue, Cue::Rest) {
            self.trial = None;
            self.moving = false;
        }
    }
}

impl Armed for ArmedVirtualWrist {
    type Disarmed = VirtualWrist;

    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        let angle_rad = match command.motor {
            Motor::Follow { angle_rad } => angle_rad,
            // The safe state of the virtual rig: hold the last command.
            Motor::Safe => self.servo.command_rad(),
        };
        if let Cue::RigTrial(upcoming) = &command.cue {
            return Ok(self.exchange_in_rig_trial(upcoming, angle_rad));
        }
        self.end_rig_trial();
        self.follow_cue(&command.cue);
        let before = self.servo.motion();
        self.servo.step(angle_rad, self.lever_torque_nm);
        let voluntary_nm = self.voluntary.step(&command.cue);
        let response = self.wrist.step(self.servo.motion(), matches!(command.cue, Cue::Rest));
        self.lever_torque_nm = voluntary_nm + response.lever_nm;
        let emg = self.emg.step(&self.voluntary, response.since_onset_s, response.speed_rad_s);
        self.sample += 1;
        let time_s = self.sample as f64 / self.rig.sample_rate_hz;
        self.angle_rad = self.servo.motion().theta + self.load_change.next_rad();
        Ok(self.sensors.measure(
            self.angle_rad,
            voluntary_nm + response.measured_nm,
            [emg[0] / self.rig.emg_scale[0], emg[1] / self.rig.emg_scale[1]],
            &self.wrist.further(&response, [before, self.servo.motion()], voluntary_nm),
            time_s,
        ))
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        for (scale, factor) in self.rig.emg_scale.iter_mut().zip(factors) {
            *scale *= factor;
        }
    }

    fn disarm(self) -> VirtualWrist {
        self.rig
    }
}

#[cfg(test)]
mod rig_trial_tests;
#[cfg(test)]
mod tests;
