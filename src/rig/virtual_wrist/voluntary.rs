//! The voluntary torque: the subject tracks the displayed target with a reaction time, slow variation and tremor.

use super::noise::{Biquad, SlowNoise};
use super::person::{Person, VoluntaryParameters};
use crate::random::Stream;
use crate::rig::{Cue, Direction};

/// Deviations of the muscle in one trial from its average: standard normal numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrialSpread {
    /// Of k_srs.
    pub short_range_stiffness: f64,
    /// Of k_dec.
    pub stiffness_decrement: f64,
    /// Of x_e.
    pub elastic_limit: f64,
    /// Of the flexor's EMG.
    pub flexor_emg: f64,
    /// Of the antagonist's activity.
    pub cocontraction: f64,
}

/// The voluntary torque of a virtual subject.
#[derive(Debug, Clone)]
pub struct VoluntaryTorque {
    parameters: VoluntaryParameters,
    flexion_nm: f64,
    extension_nm: f64,
    sample_s: f64,
    /// Part of the remaining difference to the aim that each of the two lags covers per sample.
    share: f64,
    stream: Stream,
    wander: SlowNoise,
    tremor: SlowNoise,
    /// The displayed torque during the last reaction time, N m; the subject acts on the oldest value.
    displayed_nm: Vec<f64>,
    next: usize,
    /// Samples since the cue changed.
    since_cue: u64,
    task: Task,
    first_error: f64,
    correction_nm: f64,
    aim_nm: f64,
    level: [f64; 2],
    torque_nm: f64,
}

/// The task that the cue sets, without its numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    Nothing,
    Torque,
    Effort(Direction),
}

impl VoluntaryTorque {
    /// A subject at rest.
    pub fn new(person: &Person, sample_rate_hz: f64, stream: Stream) -> Self {
        let parameters = person.voluntary;
        let reaction_samples = (parameters.reaction_s * sample_rate_hz).round().max(1.0) as usize;
        Self {
            parameters,
            flexion_nm: person.muscles.flexion_nm,
            extension_nm: person.muscles.extension_nm,
            sample_s: 1.0 / sample_rate_hz,
            share: 1.0 - libm::exp(-1.0 / (parameters.rise_s * sample_rate_hz)),
            stream,
            wander: SlowNoise::new(|rate| Biquad::low_pass(2.5, rate), sample_rate_hz),
            tremor: SlowNoise::new(|rate| Biquad::band_pass(8.5, 10.5, rate), sample_rate_hz),
            displayed_nm: vec![0.0; reaction_samples],
            next: 0,
            since_cue: 0,
            task: Task::Nothing,
            first_error: 0.0,
            correction_nm: 0.0,
            aim_nm: 0.0,
            level: [0.0; 2],
            torque_nm: 0.0,
        }
    }

    /// Resets to rest and takes a new stream of random numbers.
    pub fn restart(&mut self, stream: Stream) {
        self.stream = stream;
        self.wander.restart();
        self.tremor.restart();
        self.task = Task::Nothing;
        (self.aim_nm, self.level, self.torque_nm) = (0.0, [0.0; 2], 0.0);
    }

    /// Draws the deviations of this trial.
    pub fn draw_trial(&mut self) -> TrialSpread {
        self.first_error = self.parameters.first_error * self.stream.normal();
        TrialSpread {
            short_range_stiffness: self.stream.normal(),
            stiffness_decrement: self.stream.normal(),
            elastic_limit: self.stream.normal(),
            flexor_emg: self.stream.normal(),
            cocontraction: self.stream.normal(),
        }
    }

    /// The torque at the next sample, N m.
    pub fn step(&mut self, cue: &Cue) -> f64 {
        self.react(cue);
        let [first, second] = &mut self.level;
        *first += self.share * (self.aim_nm - *first);
        *second += self.share * (*first - *second);
        let level = *second;
        let unsteady = self.parameters.wander * self.wander.step(&mut self.stream)
            + self.parameters.tremor * self.tremor.step(&mut self.stream);
        self.torque_nm = level * (1.0 + unsteady);
        self.torque_nm
    }

    /// The torque at this sample, N m.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// Activity of flexors and extensors, as fractions of their maximum.
    pub fn activity(&self) -> [f64; 2] {
        let level = self.level[1];
        [level.max(0.0) / self.flexion_nm, (-level).max(0.0) / self.extension_nm]
    }

    fn react(&mut self, cue: &Cue) {
        let (task, shown) = match *cue {
            Cue::Rest | Cue::Relax | Cue::RigTrial(_) => (Task::Nothing, None),
            Cue::Effort(direction) => (Task::Effort(direction), None),
            Cue::Target { target_nm, shown_nm, .. } => (Task::Torque, Some((target_nm, shown_nm))),
            // The ramp is over before a subject can react to it.
            Cue::Moving => return,
        };
        if task != self.task {
            self.task = task;
            self.since_cue = 0;
            self.correction_nm = 0.0;
        }
        self.since_cue += 1;
        let has_reacted = self.since_cue > self.displayed_nm.len() as u64;
        let seen_nm = match shown {
            Some((_, shown_nm)) => {
                let seen_nm = std::mem::replace(&mut self.displayed_nm[self.next], shown_nm);
                self.next = (self.next + 1) % self.displayed_nm.len();
                seen_nm
            }
            None => 0.0,
        };
        if !has_reacted {
            return;
        }
        self.aim_nm = match (task, shown) {
            (Task::Torque, Some((target_nm, _))) => {
                // A first attempt is corrected only after it has settled and been displayed.
                let settled_s = 2.0 * self.parameters.reaction_s + 4.0 * self.parameters.rise_s;
                if self.since_cue as f64 * self.sample_s > settled_s {
                    self.correction_nm +=
                        self.parameters.correction_per_s * self.sample_s * (target_nm - seen_nm);
                }
                target_nm * (1.0 + self.first_error) + self.correction_nm
            }
            (Task::Effort(Direction::Flexion), _) => self.flexion_nm,
            (Task::Effort(Direction::Extension), _) => -self.extension_nm,
            _ => 0.0,
        };
    }
}
