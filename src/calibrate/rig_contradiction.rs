//! What the records of rig trials say against their table, in words.

use std::fmt;

use crate::protocol::RigLoad;

/// Something that the records say against the table.
#[derive(Debug, Clone, PartialEq)]
pub struct RigContradiction {
    /// Numbers of the trials.
    pub trials: Vec<u32>,
    /// What is at the handle in them, as stated.
    pub load: RigLoad,
    /// What was measured, and what was expected.
    pub measured: String,
    /// The mistake that would explain it.
    pub likely_mistake: Option<String>,
}

impl fmt::Display for RigContradiction {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.trials.iter().map(u32::to_string).collect();
        let trials = if numbers.len() == 1 { "trial" } else { "trials" };
        write!(formatter, "{trials} {} ({}): {}.", numbers.join(", "), named_load(self.load), self.measured)?;
        self.likely_mistake.as_ref().map_or(Ok(()), |mistake| write!(formatter, " {mistake}"))
    }
}

/// A load for messages, with its stated value.
pub fn named_load(load: RigLoad) -> String {
    match load {
        RigLoad::EmptyHandle | RigLoad::ClampedHandle => load.name().to_owned(),
        RigLoad::KnownWeight { mass_kg, arm_m, .. } => {
            format!("known_weight of {mass_kg} kg at {arm_m} m")
        }
        RigLoad::KnownInertia { inertia_kg_m2, .. } => format!("known_inertia of {inertia_kg_m2} kg m2"),
        RigLoad::KnownSpring { stiffness_nm_per_rad, .. } => {
            format!("known_spring of {stiffness_nm_per_rad} N m/rad")
        }
    }
}
