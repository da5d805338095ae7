//! The field `rig_trials` of a protocol: what is mounted on the handle and how the motor moves it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Some repetitions of rig trials with one load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RigTrialBlock {
    /// Nothing but the handle itself.
    EmptyHandle {
        /// What the motor does.
        motion: BlockMotion,
        /// Number of repetitions.
        #[schemars(range(min = 1, max = 100))]
        repetitions: u32,
    },
    /// A mass on a thread over a disc at the handle's axis, so that its torque does not depend on the angle; the motor stands
    /// still. Each repetition is done in both directions.
    KnownWeight {
        /// The mass, kg.
        #[schemars(range(min = 0.001, max = 100))]
        mass_kg: f64,
        /// Radius of the disc, m.
        #[schemars(range(min = 0.001, max = 1))]
        arm_m: f64,
        /// One standard deviation of the torque of mass and arm, as a fraction.
        #[schemars(range(min = 0.00001, max = 0.5))]
        relative_error: f64,
        /// Time for which the torque is measured, s.
        #[schemars(range(min = 0.5, max = 60))]
        duration_s: f64,
        /// Number of repetitions in each direction.
        #[schemars(range(min = 1, max = 100))]
        repetitions: u32,
    },
    /// A bar bolted on the handle, which adds to its inertia.
    KnownInertia {
        /// Inertia of the bar about the handle's axis, kg m2.
        #[schemars(range(min = 0.00001, max = 1))]
        inertia_kg_m2: f64,
        /// One standard deviation of the inertia, as a fraction.
        #[schemars(range(min = 0.00001, max = 0.5))]
        relative_error: f64,
        /// What the motor does.
        motion: BlockMotion,
        /// Number of repetitions.
        #[schemars(range(min = 1, max = 100))]
        repetitions: u32,
    },
    /// The handle is held by a stop and cannot turn; the motor turns against the lever alone.
    ClampedHandle {
        /// What the motor does.
        motion: BlockMotion,
        /// Number of repetitions.
        #[schemars(range(min = 1, max = 100))]
        repetitions: u32,
    },
    /// A linear spring between handle and ground, without torque at the start position.
    KnownSpring {
        /// Stiffness of the spring about the handle's axis, N m/rad.
        #[schemars(range(min = 0.01, max = 10_000))]
        stiffness_nm_per_rad: f64,
        /// One standard deviation of the stiffness, as a fraction.
        #[schemars(range(min = 0.00001, max = 0.5))]
        relative_error: f64,
        /// What the motor does.
        motion: BlockMotion,
        /// Number of repetitions.
        #[schemars(range(min = 1, max = 100))]
        repetitions: u32,
    },
}

/// What the motor does in the rig trials of a block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum BlockMotion {
    /// Each velocity of the protocol once: its ramp, hold and return.
    Ramps,
    /// A sum of sines, faded in and out.
    Multisine {
        /// Highest angle, rad, either sign.
        #[schemars(range(min = 0.00001, max = 1.5))]
        amplitude_rad: f64,
        /// Lowest frequency, Hz.
        #[schemars(range(min = 0.01, max = 50_000))]
        lowest_hz: f64,
        /// Highest frequency, Hz; below half the sample rate.
        #[schemars(range(min = 0.01, max = 50_000))]
        highest_hz: f64,
        /// Duration with both fades, s.
        #[schemars(range(min = 0.5, max = 60))]
        duration_s: f64,
    },
}

impl RigTrialBlock {
    /// How often each motion is run with each load.
    pub(super) fn repetitions(&self) -> u32 {
        match self {
            Self::EmptyHandle { repetitions, .. }
            | Self::KnownWeight { repetitions, .. }
            | Self::KnownInertia { repetitions, .. }
            | Self::ClampedHandle { repetitions, .. }
            | Self::KnownSpring { repetitions, .. } => *repetitions,
        }
    }
}
