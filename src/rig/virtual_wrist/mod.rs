//! A wrist without a person or a motor: the paper's model inside a stiff position servo, with a virtual person who
//! tracks the target by sight, and sensors that count and hiss. It ships with the program and is what a protocol is
//! tried on before a limb is.

mod emg;
mod hidden_effect;
mod limb;
mod mechanism_list;
mod noise;
mod person;
mod seal;
mod sensors;
mod servo;
mod setup;
mod typical_effect;
mod voluntary;

pub use hidden_effect::draw_hidden_effect;
pub use mechanism_list::{MechanismList, MechanismListError};
pub use person::{FORMAT as PERSON_FORMAT, Person, PersonError, Surface};
pub use seal::{Seal, SealError};
pub use setup::{RigFile, RigFileError, Setup};
pub use typical_effect::TypicalEffect;

use emg::Emg;
use limb::Limb;
use sensors::Sensors;
use servo::Servo;
use voluntary::Voluntary;

use schemars::{JsonSchema, schema_for};

use super::{Armed, Command, Cue, Fault, Motor, OperatorsWord, Rig, Sample, TrialKey};
use crate::protocol::Limits;
use crate::random::Stream;

/// The JSON schema of the files of virtual persons, as text.
pub fn person_schema_text() -> String {
    schema_text::<Person>()
}

/// The JSON schema of rig files, as text.
pub fn rig_schema_text() -> String {
    schema_text::<RigFile>()
}

fn schema_text<T: JsonSchema>() -> String {
    format!("{:#}\n", schema_for!(T).to_value())
}

/// The virtual wrist, unable to move.
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
}

impl Rig for VirtualWrist {
    type Armed = ArmedVirtualWrist;

    fn arm(self, _word: OperatorsWord, _limits: &Limits) -> Result<Self::Armed, (Self, Fault)> {
        Ok(ArmedVirtualWrist::new(self))
    }
}

/// The virtual wrist, able to move.
pub struct ArmedVirtualWrist {
    rig: VirtualWrist,
    servo: Servo,
    limb: Limb,
    voluntary: Voluntary,
    emg: Emg,
    sensors: Sensors,
    trial: Option<TrialKey>,
    moving: bool,
    /// Samples since the rig was armed.
    sample: u64,
    lever_torque_nm: f64,
}

impl ArmedVirtualWrist {
    fn new(rig: VirtualWrist) -> Self {
        let (rate, stream) = (rig.sample_rate_hz, |name: &str| Stream::new(rig.seed, name));
        Self {
            servo: Servo::new(&rig.setup, rate),
            limb: Limb::new(&rig.person, &rig.setup, rate),
            voluntary: Voluntary::new(&rig.person, rate, stream("subject/rest")),
            emg: Emg::new(&rig.person, rate, stream("emg/rest")),
            sensors: Sensors::new(&rig.setup, &rig.person, rate, stream("noise/rest")),
            rig,
            trial: None,
            moving: false,
            sample: 0,
            lever_torque_nm: 0.0,
        }
    }

    /// Nothing random in a trial depends on what came before it: a trial run again after a crash is the same trial.
    fn begin_trial(&mut self, key: TrialKey) {
        self.trial = Some(key);
        let kind = if key.practice { "practice" } else { "trial" };
        let stream = |name: &str| {
            Stream::new(self.rig.seed, &format!("{name}/{kind}/{}/{}", key.position, key.rejections))
        };
        self.voluntary.restart(stream("subject"));
        self.emg.restart(stream("emg"));
        self.sensors.restart(stream("noise"));
        self.servo.settle();
        self.limb.stop();
        self.lever_torque_nm = 0.0;
    }

    fn follow_cue(&mut self, cue: &Cue) {
        if let Cue::Target { trial, target_nm, .. } = cue
            && self.trial != Some(trial.key)
        {
            self.begin_trial(trial.key);
            let spread = self.voluntary.draw_trial();
            let emg = self.emg.prepare(&spread, *target_nm);
            self.limb.prepare(&self.rig.person, trial, *target_nm, &spread, emg);
        }
        if matches!(cue, Cue::Moving) && !self.moving {
            self.moving = true;
            self.limb.start(self.servo.knot(), self.voluntary.torque_nm());
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
        self.follow_cue(&command.cue);
        let angle_rad = match command.motor {
            Motor::Follow { angle_rad } => angle_rad,
            // The virtual rig's safe state: stay where it is.
            Motor::Safe => self.servo.reference_rad(),
        };
        self.servo.step(angle_rad, self.lever_torque_nm);
        let voluntary_nm = self.voluntary.step(&command.cue);
        let response = self.limb.step(self.servo.knot(), matches!(command.cue, Cue::Rest));
        self.lever_torque_nm = voluntary_nm + response.lever_nm;
        let emg = self.emg.step(&self.voluntary, response.since_onset_s, response.speed_rad_s);
        self.sample += 1;
        let time_s = self.sample as f64 / self.rig.sample_rate_hz;
        Ok(self.sensors.measure(
            self.servo.knot().theta,
            voluntary_nm + response.measured_nm,
            [emg[0] / self.rig.emg_scale[0], emg[1] / self.rig.emg_scale[1]],
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
mod tests;
