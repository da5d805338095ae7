//! The state machine on a bench: a motor that follows at once, and a torque that the test decides.

mod control_loop;
mod docs;
mod faults;
mod gate;
mod motion;
mod operator;
mod properties;
mod rig_trials;
mod transitions;

use std::sync::Arc;

use super::*;
use crate::protocol::{Multisine, Mvc, PlannedRigTrial, Protocol, RigLoad, RigMotion};
use crate::rig::{Command, Cue, Direction, Motor, Punctuality, Sample};
use crate::schedule;

/// The quick protocol with short times: 2 velocities x 2 torques, gate 0.1 s, 500 samples a second.
fn settings() -> Settings {
    let text = include_str!("../../../protocols/quick.json");
    let protocol = Protocol::parse(text, "quick.json").unwrap();
    let order = schedule::draw(&protocol, 1, None).unwrap();
    let mut settings = Settings::new(&protocol, 1, &order[..4]).unwrap();
    settings.plan.retain(|planned| !planned.key.practice);
    settings.sample_rate_hz = 500.0;
    settings.gate_samples = 50;
    settings.timeout_samples = 400;
    settings.delay_samples = [5, 25];
    settings.rest_samples = 20;
    settings.offset_samples = None;
    settings.mvc = None;
    settings
}

/// Settings with an offset, two efforts each way and one trial for practice.
fn settings_with_everything() -> Settings {
    let mut settings = settings();
    settings.offset_samples = Some(30);
    settings.mvc = Some(Mvc { efforts: 2, duration_s: 0.1, rest_s: 0.05 });
    let mut practice = settings.plan[0];
    practice.key.practice = true;
    settings.plan.insert(0, practice);
    settings
}

/// Those settings with three rig trials before everything: a multisine and a ramp of the empty handle, and a weight.
fn settings_with_rig_trials() -> Settings {
    let mut settings = settings_with_everything();
    settings.rig_rest_samples = 5;
    settings.rig_settle_samples = 10;
    let ramp = settings.plan[0];
    let motions = [
        RigMotion::Multisine(Multisine::new(0.01, [10.0, 30.0], 0.1).unwrap()),
        RigMotion::Ramp { velocity_rad_s: ramp.velocity_rad_s, movement: ramp.movement },
        RigMotion::Still { duration_s: 0.1 },
    ];
    let weight = RigLoad::KnownWeight { mass_kg: 1.0, arm_m: 0.1, sign: 1, relative_error: 0.002 };
    let loads = [RigLoad::EmptyHandle, RigLoad::EmptyHandle, weight];
    settings.rig_plan = (1..)
        .zip(motions.into_iter().zip(loads))
        .map(|(position, (motion, load))| PlannedRigTrial {
            position,
            rejections: 0,
            load,
            motion,
            repetition: 1,
        })
        .collect();
    settings
}

/// A machine, and what the rig would show it.
#[derive(Clone)]
struct Bench {
    machine: Machine,
    command: Command,
    /// Added to the target while a trial waits for its gate, N m.
    error_nm: f64,
    /// What the torque shows when nothing is asked, N m.
    offset_nm: f64,
    ecr_mvc: f64,
    /// EMG of a maximal effort.
    effort_mvc: f64,
    /// Handed over with the next sample.
    punctuality: Option<Punctuality>,
    /// The rig is a motor, whose periods are tied to a clock.
    is_motor: bool,
    /// Angle that the motor is away from its command, as a function of time since the last onset, s.
    astray: fn(f64) -> f64,
    transitions: Vec<TransitionRecord>,
}

impl Bench {
    fn new(settings: Settings) -> Self {
        Self {
            machine: Machine::new(Arc::new(settings)),
            command: Command { motor: Motor::Safe, cue: Cue::Rest },
            error_nm: 0.0,
            offset_nm: 0.0,
            ecr_mvc: 0.0,
            effort_mvc: 1.0,
            punctuality: None,
            is_motor: false,
            astray: |_| 0.0,
            transitions: Vec::new(),
        }
    }

    /// Started.
    fn started(settings: Settings) -> Self {
        let mut bench = Self::new(settings);
        bench.say(Event::Start);
        bench
    }

    /// Run up to the first sample in `phase`.
    fn in_phase(settings: Settings, phase: Phase) -> Self {
        let mut bench = Self::started(settings);
        bench.run_to(phase);
        bench
    }

    /// What a person on target with a motor that follows would give.
    fn sample(&self) -> Sample {
        let theta_m_rad = match self.command.motor {
            Motor::Follow { angle_rad } => angle_rad,
            Motor::Safe => 0.0,
        };
        let onset = self.transitions.iter().rev().find(|transition| transition.event == Event::Onset);
        let since_s = onset.map_or(f64::NEG_INFINITY, |onset| {
            self.machine.sample().saturating_sub(onset.sample) as f64 / 500.0
        });
        let theta_m_rad = if matches!(self.command.cue, Cue::Moving) {
            theta_m_rad + (self.astray)(since_s)
        } else {
            theta_m_rad
        };
        let (torque_nm, emg) = match self.command.cue {
            Cue::Target { target_nm, .. } => (target_nm + self.error_nm, 0.2),
            Cue::Moving => (2.0, 0.2),
            Cue::Effort(_) => (8.0, self.effort_mvc),
            Cue::RigTrial(_) => (1.0, 0.0),
            Cue::Rest | Cue::Relax => (0.0, 0.0),
        };
        let ecr = if matches!(self.command.cue, Cue::Effort(_)) { self.effort_mvc } else { self.ecr_mvc };
        Sample {
            theta_m_rad,
            torque_l_nm: torque_nm + self.offset_nm,
            emg_fcr_mvc: Some(emg),
            emg_ecr_mvc: Some(ecr),
            ..Sample::default()
        }
    }

    fn feed(&mut self, input: Input) -> Output {
        let output = self.machine.step(&input);
        self.command = output.command;
        self.transitions.extend(output.transition);
        output
    }

    fn give(&mut self, reading: Reading, operator: Option<Event>) -> Output {
        let punctuality = self.punctuality.take().or(self.is_motor.then(Punctuality::default));
        self.feed(Input { reading, operator, on_disk: true, punctuality })
    }

    /// One sample.
    fn tick(&mut self) -> Output {
        self.give(Reading::Sample(self.sample()), None)
    }

    /// Feeds the given number of samples.
    fn ticks(&mut self, samples: usize) {
        for _ in 0..samples {
            self.tick();
        }
    }

    /// Feeds one sample with a command of the operator.
    fn say(&mut self, word: Event) -> Output {
        self.give(Reading::Sample(self.sample()), Some(word))
    }

    /// Samples until something happens; every load is mounted, and the subject seated, at once.
    #[track_caller]
    fn run_to_event(&mut self) -> TransitionRecord {
        for _ in 0..100_000 {
            let waits = self.machine.awaits_mounting();
            let output = if waits { self.say(Event::Resume) } else { self.tick() };
            if let Some(transition) = output.transition {
                return transition;
            }
        }
        panic!("nothing happens in {:?}", self.machine.phase());
    }

    /// Samples until `phase` is entered.
    #[track_caller]
    fn run_to(&mut self, phase: Phase) {
        for _ in 0..1000 {
            if self.machine.phase() == phase {
                return;
            }
            self.run_to_event();
        }
        panic!("{phase:?} is not reached");
    }

    fn statuses(&self) -> Vec<Option<Status>> {
        self.machine
            .progress()
            .attempts()
            .iter()
            .map(|attempt| attempt.ended.map(|(status, _)| status))
            .collect()
    }
}
