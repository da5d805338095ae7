//! The torque gate: it opens when the torque has stayed in a band around the target for the gate's time without a break.

use crate::protocol::Gate;

/// Torque gate of a trial. It counts samples, and knows no clock.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueGate {
    gate: Gate,
    /// Samples for which the torque must stay in the band.
    required: u64,
    /// Samples in the band without a break.
    in_band: u64,
}

impl TorqueGate {
    /// Makes a closed gate that opens after `required` samples in the band.
    pub fn new(gate: Gate, required: u64) -> Self {
        Self { gate, required, in_band: 0 }
    }

    /// Closes the gate and begins to count anew.
    pub fn restart(&mut self) {
        self.in_band = 0;
    }

    /// Counts one more sample; a torque outside the band sets the count to zero.
    pub fn add(&mut self, in_band: bool) {
        self.in_band = if in_band { self.in_band + 1 } else { 0 };
    }

    /// Whether the latest sample was in the band.
    pub fn is_counting(&self) -> bool {
        self.in_band > 0
    }

    /// Whether the torque has stayed in the band long enough.
    pub fn is_open(&self) -> bool {
        self.in_band >= self.required
    }

    /// Part of the required time that has passed in the band, from 0 to 1.
    pub fn fraction(&self) -> f64 {
        self.in_band as f64 / self.required as f64
    }

    /// Whether a torque lies in the band around a target, both in N m.
    pub fn contains(&self, torque_nm: f64, target_nm: f64) -> bool {
        (torque_nm - target_nm).abs() < self.gate.band_fraction * target_nm.abs()
    }

    /// Whether the gate depends on the antagonist's EMG.
    pub fn needs_antagonist(&self) -> bool {
        self.gate.antagonist_limit_mvc.is_some()
    }

    /// Whether the antagonist's EMG, a fraction of MVC, exceeds the limit of the protocol, if there is one.
    pub fn antagonist_is_active(&self, ecr_mvc: f64) -> bool {
        self.gate.antagonist_limit_mvc.is_some_and(|limit| ecr_mvc > limit)
    }
}
