//! The torque that the person means to give: tracks the target by sight, late and never quite steady.

use super::noise::{Biquad, SlowNoise};
use super::person::{Person, Voluntary as Habits};
use crate::random::Stream;
use crate::rig::{Cue, Direction};

/// How the muscle differs in one trial from what it is on average: standard normal numbers.
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

/// The will and what becomes of it.
#[derive(Debug, Clone)]
pub struct Voluntary {
    habits: Habits,
    flexion_nm: f64,
    extension_nm: f64,
    sample_s: f64,
    /// Share of the way to the aim that each of two lags goes in a sample.
    share: f64,
    stream: Stream,
    wander: SlowNoise,
    tremor: SlowNoise,
    /// The display as it was, one reaction time long; the person acts on the oldest entry.
    seen_nm: Vec<f64>,
    next: usize,
    /// Samples since the person was shown something else.
    since_cue: u64,
    asked: Asked,
    first_error: f64,
    correction_nm: f64,
    aim_nm: f64,
    level: [f64; 2],
    torque_nm: f64,
}

/// What the person is asked, the numbers aside.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Asked {
    Nothing,
    Torque,
    Effort(Direction),
}

impl Voluntary {
    /// A person at rest.
    pub fn new(person: &Person, sample_rate_hz: f64, stream: Stream) -> Self {
        let habits = person.voluntary;
        let reaction_samples = (habits.reaction_s * sample_rate_hz).round().max(1.0) as usize;
        Self {
            habits,
            flexion_nm: person.muscles.flexion_nm,
            extension_nm: person.muscles.extension_nm,
            sample_s: 1.0 / sample_rate_hz,
            share: 1.0 - libm::exp(-1.0 / (habits.rise_s * sample_rate_hz)),
            stream,
            wander: SlowNoise::new(|rate| Biquad::low_pass(2.5, rate), sample_rate_hz),
            tremor: SlowNoise::new(|rate| Biquad::band_pass(8.5, 10.5, rate), sample_rate_hz),
            seen_nm: vec![0.0; reaction_samples],
            next: 0,
            since_cue: 0,
            asked: Asked::Nothing,
            first_error: 0.0,
            correction_nm: 0.0,
            aim_nm: 0.0,
            level: [0.0; 2],
            torque_nm: 0.0,
        }
    }

    /// At rest again, with random numbers of its own.
    pub fn restart(&mut self, stream: Stream) {
        self.stream = stream;
        self.wander.restart();
        self.tremor.restart();
        self.asked = Asked::Nothing;
        (self.aim_nm, self.level, self.torque_nm) = (0.0, [0.0; 2], 0.0);
    }

    /// What is different in this trial.
    pub fn draw_trial(&mut self) -> TrialSpread {
        self.first_error = self.habits.first_error * self.stream.normal();
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
        self.look(cue);
        let [first, second] = &mut self.level;
        *first += self.share * (self.aim_nm - *first);
        *second += self.share * (*first - *second);
        let level = *second;
        let unsteady = self.habits.wander * self.wander.step(&mut self.stream)
            + self.habits.tremor * self.tremor.step(&mut self.stream);
        self.torque_nm = level * (1.0 + unsteady);
        self.torque_nm
    }

    /// The torque at this sample, N m.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// Activity of flexors and extensors that the torque takes, as fractions of their greatest.
    pub fn activity(&self) -> [f64; 2] {
        let level = self.level[1];
        [level.max(0.0) / self.flexion_nm, (-level).max(0.0) / self.extension_nm]
    }

    fn look(&mut self, cue: &Cue) {
        let (asked, shown) = match *cue {
            Cue::Rest | Cue::Relax => (Asked::Nothing, None),
            Cue::Effort(direction) => (Asked::Effort(direction), None),
            Cue::Target { target_nm, shown_nm, .. } => (Asked::Torque, Some((target_nm, shown_nm))),
            // The ramp is over before a person can do anything about it.
            Cue::Moving => return,
        };
        if asked != self.asked {
            self.asked = asked;
            self.since_cue = 0;
            self.correction_nm = 0.0;
        }
        self.since_cue += 1;
        let has_reacted = self.since_cue > self.seen_nm.len() as u64;
        let seen_nm = match shown {
            Some((_, shown_nm)) => {
                let seen_nm = std::mem::replace(&mut self.seen_nm[self.next], shown_nm);
                self.next = (self.next + 1) % self.seen_nm.len();
                seen_nm
            }
            None => 0.0,
        };
        if !has_reacted {
            return;
        }
        self.aim_nm = match (asked, shown) {
            (Asked::Torque, Some((target_nm, _))) => {
                // The first attempt must have settled and been seen before it can be corrected.
                let settled_s = 2.0 * self.habits.reaction_s + 4.0 * self.habits.rise_s;
                if self.since_cue as f64 * self.sample_s > settled_s {
                    self.correction_nm +=
                        self.habits.correction_per_s * self.sample_s * (target_nm - seen_nm);
                }
                target_nm * (1.0 + self.first_error) + self.correction_nm
            }
            (Asked::Effort(Direction::Flexion), _) => self.flexion_nm,
            (Asked::Effort(Direction::Extension), _) => -self.extension_nm,
            _ => 0.0,
        };
    }
}
