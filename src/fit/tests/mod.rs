//! Tests of the fit on synthetic sessions, simulated with the model, whose true parameters are known.

mod bearing_friction;
mod calibration;
mod covariates;
mod further_channels;
mod intervals;
mod model_specification;
mod noise;
mod onsets;
mod optimisation;
mod session_model;

use std::collections::BTreeMap;

use super::*;
use crate::dataset::{Record, Session, Status, Subject, Trial};
use crate::random::Stream;
use crate::signal::{self, FilterSpec};
use crate::statistics::upper_median;
use crate::wrist::{
    self, FurtherChannel, Lever, ScaledChannel, SimulatedTorque, SimulationSettings, VectorWidth,
};

const PERIOD_S: f64 = 4e-4;
const LEVER: Lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

/// The paper's conditions (section 2.2).
const VELOCITIES: [f64; 4] = [1.3, 1.95, 2.6, 3.25];
const TORQUES: [f64; 3] = [0.9, 1.5, 2.1];

/// True base parameters of a condition, from the values and slopes that the paper reports.
fn truth(velocity_rad_s: f64, torque_nm: f64) -> [f64; 6] {
    let x_e = 0.025 + 0.04 * (velocity_rad_s - 1.3) / 1.95;
    let k_srs = 15.0 + 8.0 * (torque_nm - 0.9) / 1.2;
    let k_dec = 9.0 + 3.0 * (torque_nm - 0.9) + 1.6 * (velocity_rad_s - 1.3);
    [0.005, 1.2, 300.0, k_srs, k_dec, x_e]
}

/// Generator of a session with the paper's conditions and white torque noise, and a hold before each ramp.
struct SyntheticSession {
    repetitions: u32,
    noise_nm: f64,
    hold_s: f64,
    seed: u64,
    /// The lever of the rig; the session states [`LEVER`].
    lever: Lever,
    truth: fn(f64, f64) -> [f64; 6],
    /// Further channels of the rig.
    further: Vec<FurtherChannel>,
    /// Whether a slow torque of the subject, which every channel shows, adds to the noise of the gauge.
    trembles: bool,
}

impl SyntheticSession {
    fn new(repetitions: u32) -> Self {
        Self {
            repetitions,
            noise_nm: 0.02,
            hold_s: 0.5,
            seed: 1,
            lever: LEVER,
            truth,
            further: Vec::new(),
            trembles: false,
        }
    }

    fn session(&self) -> Session {
        let mut stream = Stream::new(self.seed, "test session");
        let mut trials = Vec::new();
        for repetition in 1..=self.repetitions {
            for velocity in VELOCITIES {
                for torque in TORQUES {
                    let number = trials.len() as u32 + 1;
                    trials.push(Trial {
                        number,
                        file: format!("trials/trial-{number:03}.csv"),
                        velocity_rad_s: velocity,
                        torque_nm: torque,
                        repetition,
                        condition: None,
                        onset_s: Some(0.0),
                        status: Status::Ok,
                        extra: BTreeMap::new(),
                        record: self.record(number, velocity, torque, &mut stream),
                    });
                }
            }
        }
        Session {
            subject: Subject { id: "T".into() },
            sample_rate_hz: 1.0 / PERIOD_S,
            lever: Some(LEVER),
            recorded_filter: None,
            channel_ranges: Default::default(),
            trials,
        }
    }

    fn record(&self, number: u32, velocity: f64, torque: f64, stream: &mut Stream) -> Record {
        let before = (self.hold_s / PERIOD_S).round() as usize;
        let theta: Vec<f64> =
            (0..before + 150).map(|i| angle(velocity, (i as f64 - before as f64) * PERIOD_S)).collect();
        let trial = wrist::TrialInput {
            motion: wrist::motor_motion(&theta, PERIOD_S),
            onset: before,
            covariates: Default::default(),
        };
        let request = SimulationSettings {
            lever: Some(self.lever),
            kinds: &[],
            period_s: PERIOD_S,
            samples: 150,
            lead_samples: 10,
            baseline_samples: 0,
            substeps: 8,
            filter: &[],
            further: &[],
            derivatives: &[],
            width: VectorWidth::One,
        };
        let ramp = wrist::trace(&request, &trial, &(self.truth)(velocity, torque));
        let clean =
            std::iter::repeat_n(0.0, before).chain(ramp.iter().map(|instant| instant.torques.measured));
        let mut record = Record {
            start_s: -(before as f64) * PERIOD_S,
            torque_l_nm: clean.map(|t| torque + t + self.noise_nm * stream.normal()).collect(),
            ..Record::default()
        };
        let further: Vec<ScaledChannel> = self
            .further
            .iter()
            .map(|channel| ScaledChannel { channel: *channel, nm_per_unit: 1.0 })
            .collect();
        let request = SimulationSettings { further: &further, ..request };
        let mut response = SimulatedTorque::default();
        wrist::simulate(&request, &[&trial], &(self.truth)(velocity, torque), &mut response);
        let mut own = Stream::new(self.seed, &format!("further/{number}"));
        let tremor = if self.trembles { tremor(&mut own, theta.len()) } else { vec![0.0; theta.len()] };
        for (torque, tremor) in record.torque_l_nm.iter_mut().zip(&tremor) {
            *torque += tremor;
        }
        for (place, channel) in self.further.iter().enumerate() {
            let ramp = response.torque_nm[(1 + place) * 150..(2 + place) * 150].iter().copied();
            let clean = std::iter::repeat_n(0.0, before).chain(ramp);
            // An encoder of 20000 counts, an accelerometer of 3 rad/s2, a load cell of 0.02 N m. The handle rests anywhere.
            let (offset, per_nm, noise, step) = match channel {
                FurtherChannel::HandleAngle => (1e-3 * own.uniform(), -1.0 / 900.0, 0.0, 3.14e-4),
                FurtherChannel::HandleAcceleration => (0.4, 0.0, 3.0, 0.0),
                FurtherChannel::HandTorque => (torque + 0.1, 1.0, 0.02, 0.0),
                FurtherChannel::JointAngle => {
                    (1e-3 * own.uniform(), -1.0 / 900.0 - 1.0 / 300.0, 0.0, 3.14e-4)
                }
            };
            let values = clean.zip(&tremor).map(|(value, tremor)| {
                let value = offset + value + per_nm * tremor + noise * own.normal();
                if step > 0.0 { (value / step).round() * step } else { value }
            });
            *record.further_mut(*channel) = Some(values.collect());
        }
        record.theta_m_rad = theta;
        record
    }

    fn observations(&self) -> Observations {
        Observations::new(&self.session(), PreprocessingSettings::default()).unwrap()
    }
}

/// Slow torque of a subject, N m: noise behind a low-pass at 10 Hz, 6 mN m.
fn tremor(stream: &mut Stream, samples: usize) -> Vec<f64> {
    let keep = libm::exp(-std::f64::consts::TAU * 10.0 * PERIOD_S);
    let drive = 0.006 * libm::sqrt(1.0 - keep * keep);
    let mut value = 0.006 * stream.normal();
    (0..samples)
        .map(|_| {
            value = keep * value + drive * stream.normal();
            value
        })
        .collect()
}

/// Motor angle at time `t` after the onset, rad, of a ramp whose velocity rises as a raised cosine in 18 ms.
fn angle(velocity: f64, t: f64) -> f64 {
    let rise = 0.018;
    let time = t.clamp(0.0, rise);
    let phase = std::f64::consts::PI / rise;
    velocity * (0.5 * (time - libm::sin(phase * time) / phase) + (t - rise).max(0.0))
}

/// Absolute relative error of `value`.
fn relative_error(value: f64, expected: f64) -> f64 {
    (value / expected - 1.0).abs()
}
