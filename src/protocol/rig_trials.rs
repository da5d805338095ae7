//! Rig trials: motions with known loads on the handle, run before the subject sits down, that tell the constants of the rig.

use super::{BlockMotion, Multisine, Protocol, RampAndHold, RigLoad, RigTrialBlock};

/// Time at rest at the start position that the record of a rig trial begins with, s: long enough to measure the noise that
/// the analysis must judge against (0.5 s, as in the hold of a trial).
pub const RIG_SETTLE_S: f64 = 0.5;

/// Time for which the record of a motion goes on after it, s: its Fourier coefficients describe it exactly only if the motor has come to rest
/// where it began. A servo of 10 Hz has by then, to a ten-thousandth.
const RIG_END_S: f64 = 0.2;

/// Time between two rig trials with the same load, s: what still swings after a motion comes to rest. Assumed.
pub const RIG_REST_S: f64 = 0.5;

/// Time in which a load is mounted on the handle, s. Assumed.
pub const MOUNTING_S: f64 = 60.0;

/// What the motor does in a rig trial, after it was at rest for [`RIG_SETTLE_S`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "the control loop copies motions and must not allocate")]
pub enum RigMotion {
    /// It stays at the start position.
    Still {
        /// Time for which it stays, s.
        duration_s: f64,
    },
    /// A ramp of the protocol, its hold and the return.
    Ramp {
        /// Velocity of the ramp, rad/s.
        velocity_rad_s: f64,
        /// The movement.
        movement: RampAndHold,
    },
    /// A sum of sines.
    Multisine(Multisine),
}

/// A rig trial of a protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedRigTrial {
    /// Its place in the protocol, from 1.
    pub position: u32,
    /// How often it was rejected before.
    pub rejections: u32,
    /// What is mounted on the handle.
    pub load: RigLoad,
    /// What the motor does.
    pub motion: RigMotion,
    /// Repetition index of this load and motion in its block, from 1.
    pub repetition: u32,
}

impl RigTrialBlock {
    /// The loads of the block in the order in which they are mounted.
    pub(super) fn loads(&self) -> Vec<RigLoad> {
        match *self {
            Self::EmptyHandle { .. } => vec![RigLoad::EmptyHandle],
            Self::KnownWeight { mass_kg, arm_m, relative_error, .. } => {
                [1, -1].map(|sign| RigLoad::KnownWeight { mass_kg, arm_m, sign, relative_error }).into()
            }
            Self::KnownInertia { inertia_kg_m2, relative_error, .. } => {
                vec![RigLoad::KnownInertia { inertia_kg_m2, relative_error }]
            }
            Self::ClampedHandle { .. } => vec![RigLoad::ClampedHandle],
            Self::KnownSpring { stiffness_nm_per_rad, relative_error, .. } => {
                vec![RigLoad::KnownSpring { stiffness_nm_per_rad, relative_error }]
            }
        }
    }

    /// The motions of one repetition; those that cannot be made, which the checks of a protocol find, are left out.
    pub(super) fn motions(&self, protocol: &Protocol) -> Vec<RigMotion> {
        let motion = match self {
            Self::KnownWeight { duration_s, .. } => {
                return vec![RigMotion::Still { duration_s: *duration_s }];
            }
            Self::EmptyHandle { motion, .. }
            | Self::KnownInertia { motion, .. }
            | Self::ClampedHandle { motion, .. }
            | Self::KnownSpring { motion, .. } => motion,
        };
        match *motion {
            BlockMotion::Ramps => {
                let ramp = |velocity_rad_s: &f64| {
                    let movement = RampAndHold::new(&protocol.ramp, *velocity_rad_s).ok()?;
                    Some(RigMotion::Ramp { velocity_rad_s: *velocity_rad_s, movement })
                };
                protocol.velocities_rad_s.iter().filter_map(ramp).collect()
            }
            BlockMotion::Multisine { amplitude_rad, lowest_hz, highest_hz, duration_s } => {
                let multisine = Multisine::new(amplitude_rad, [lowest_hz, highest_hz], duration_s);
                multisine.map(RigMotion::Multisine).into_iter().collect()
            }
        }
    }
}

impl Protocol {
    /// The rig trials in the order in which they are run. A load is mounted once: all repetitions with it follow each other.
    pub fn rig_plan(&self) -> Vec<PlannedRigTrial> {
        let mut plan = Vec::new();
        for block in &self.rig_trials {
            for load in block.loads() {
                for repetition in 1..=block.repetitions() {
                    for motion in block.motions(self) {
                        plan.push(PlannedRigTrial {
                            position: plan.len() as u32 + 1,
                            rejections: 0,
                            load,
                            motion,
                            repetition,
                        });
                    }
                }
            }
        }
        plan
    }

    /// Expected time of all rig trials, mounting included, s.
    pub fn rig_trials_s(&self) -> f64 {
        let mut mounted = None;
        let mut all_s = 0.0;
        for block in &self.rig_trials {
            let motions = block.motions(self);
            let motions_s: f64 = motions.iter().map(RigMotion::duration_s).sum();
            for load in block.loads() {
                let before_s = (RIG_REST_S + RIG_SETTLE_S) * motions.len() as f64;
                all_s += f64::from(block.repetitions()) * (before_s + motions_s);
                if mounted.replace(load) != Some(load) {
                    all_s += MOUNTING_S - RIG_REST_S;
                }
            }
        }
        all_s
    }
}

/// What the operator does when every rig trial is done.
pub const SEAT_SUBJECT: &str =
    "Take every load off the handle, seat the subject and fix the hand in the handle.";

impl RigMotion {
    /// Name in tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Still { .. } => "still",
            Self::Ramp { .. } => "ramp",
            Self::Multisine(_) => "multisine",
        }
    }

    /// Duration from rest to rest at the start position, s, with the time in which the motor comes to rest.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Still { duration_s } => *duration_s,
            Self::Ramp { movement, .. } => movement.duration_s() + RIG_END_S,
            Self::Multisine(multisine) => multisine.duration_s() + RIG_END_S,
        }
    }

    /// Where the motor is `t_s` after the start of the motion; at rest at the start position before and after.
    pub fn at(&self, t_s: f64) -> super::Motion {
        match self {
            Self::Still { .. } => super::Motion::default(),
            Self::Ramp { movement, .. } => movement.at(t_s),
            Self::Multisine(multisine) => multisine.at(t_s),
        }
    }
}

impl PlannedRigTrial {
    /// Expected time of the rig trial, s, from the end of the one before; `mounted` is the load of that one.
    pub fn expected_s(&self, mounted: Option<RigLoad>) -> f64 {
        let before_s = if mounted == Some(self.load) { RIG_REST_S } else { MOUNTING_S };
        before_s + RIG_SETTLE_S + self.motion.duration_s()
    }
}
