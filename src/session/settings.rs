//! Settings of the state machine: a protocol with its times in samples.

use crate::protocol::{
    Gate, Limits, Mvc, PlannedRigTrial, RIG_REST_S, RIG_SETTLE_S, RampAndHold, TooShort, ValidProtocol,
};
use crate::rig::TrialKey;
use crate::schedule;

/// A protocol as the state machine sees it: all times in samples, the trials in the order drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Seed of every random draw of the session.
    pub seed: u64,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// The trials to run, those for practice first.
    pub plan: Vec<PlannedTrial>,
    /// The rig trials to run before the subject is seated.
    pub rig_plan: Vec<PlannedRigTrial>,
    /// Rest between rig trials with the same load.
    pub rig_rest_samples: u64,
    /// How long the motor rests at the beginning of a rig trial.
    pub rig_settle_samples: u64,
    /// When a ramp may start.
    pub gate: Gate,
    /// How long the torque must stay in the band.
    pub gate_samples: u64,
    /// When a trial is given up.
    pub timeout_samples: u64,
    /// Shortest and longest delay after the gate.
    pub delay_samples: [u64; 2],
    /// Rest before each trial.
    pub rest_samples: u64,
    /// How long the offset is measured, if it is.
    pub offset_samples: Option<u64>,
    /// The maximal efforts, if there are any.
    pub mvc: Option<Mvc>,
    /// Speed on the way back and to the start position, rad/s.
    pub return_velocity_rad_s: f64,
    /// Rise time of the speed, s.
    pub rise_time_s: f64,
    /// Largest difference between the measured and the asked ramp velocity, fraction of the asked one.
    pub velocity_tolerance: f64,
    /// Cut-off of the smoothing of the torque on the display, Hz.
    pub display_cutoff_hz: f64,
    /// Limits of the measured angle, speed and torque.
    pub limits: Limits,
    /// Delay of the motion after a command, samples beyond the next one. The onset of a trial is that of the motion.
    pub motion_delay_samples: u64,
}

/// A trial that is to be run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedTrial {
    /// Place in the schedule, and number of rejections so far.
    pub key: TrialKey,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Repetition index of its condition, from 1.
    pub repetition: u32,
    /// Its place in the schedule, from 0 (first) to 1 (last).
    pub progress: f64,
    /// Movement of the motor.
    pub movement: RampAndHold,
}

impl Settings {
    /// The settings of a session of `protocol` with the trials in `order`, as [`schedule::draw`] gives it.
    ///
    /// # Errors
    /// If the order has a velocity that the protocol's amplitude does not suffice for.
    pub fn new(
        protocol: &ValidProtocol,
        seed: u64,
        order: &[schedule::ScheduledTrial],
    ) -> Result<Self, TooShort> {
        let plan = plan(protocol, seed, order)?;
        let rate = protocol.signal.sample_rate_hz;
        let samples = |seconds: f64| (seconds * rate).round() as u64;
        let crate::signal::FilterSpec::Butterworth { cutoff_hz, .. } = protocol.signal.filter;
        Ok(Self {
            seed,
            sample_rate_hz: rate,
            plan,
            rig_plan: protocol.rig_plan(),
            rig_rest_samples: samples(RIG_REST_S),
            rig_settle_samples: samples(RIG_SETTLE_S),
            gate: protocol.gate.clone(),
            gate_samples: samples(protocol.gate.duration_s).max(1),
            timeout_samples: samples(protocol.gate.timeout_s),
            delay_samples: protocol.gate.delay_s.map(samples),
            rest_samples: samples(protocol.rest_s),
            offset_samples: protocol.before.offset_s.map(samples),
            mvc: protocol.before.mvc.clone(),
            return_velocity_rad_s: protocol.ramp.return_velocity_rad_s,
            rise_time_s: protocol.ramp.rise_time_s,
            velocity_tolerance: protocol.ramp.velocity_tolerance,
            display_cutoff_hz: cutoff_hz,
            limits: protocol.limits.clone(),
            motion_delay_samples: 0,
        })
    }

    /// Seconds as samples.
    pub fn samples(&self, seconds: f64) -> u64 {
        (seconds * self.sample_rate_hz).round() as u64
    }
}

/// The trials for practice, then those of the order.
fn plan(
    protocol: &ValidProtocol,
    seed: u64,
    order: &[schedule::ScheduledTrial],
) -> Result<Vec<PlannedTrial>, TooShort> {
    let last = order.len().saturating_sub(1).max(1) as f64;
    let mut plan = Vec::with_capacity(order.len() + protocol.before.familiarisation_trials as usize);
    for (condition, position) in schedule::familiarisation(protocol, seed).iter().zip(1..) {
        plan.push(PlannedTrial {
            key: TrialKey { practice: true, position, rejections: 0 },
            velocity_rad_s: condition.velocity_rad_s,
            torque_nm: condition.torque_nm,
            repetition: 1,
            progress: 0.0,
            movement: protocol.ramp_and_hold(condition.velocity_rad_s)?,
        });
    }
    for trial in order {
        plan.push(PlannedTrial {
            key: TrialKey { practice: false, position: trial.position, rejections: 0 },
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            repetition: trial.repetition,
            progress: f64::from(trial.position.saturating_sub(1)) / last,
            movement: protocol.ramp_and_hold(trial.velocity_rad_s)?,
        });
    }
    Ok(plan)
}
