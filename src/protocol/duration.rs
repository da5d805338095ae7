//! The duration of a session.

use super::{Protocol, RampAndHold};

/// Time that a subject needs to reach the band after the target is shown, s: reaction and approach. Assumed; the paper
/// says only that its whole experiment took 45 minutes.
pub const APPROACH_S: f64 = 2.0;

/// Duration of a session without pauses and rejected trials, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duration {
    /// If every gate opens at the first possible moment.
    pub shortest_s: f64,
    /// If the subject needs 2 s to reach the band.
    pub expected_s: f64,
    /// If every gate opens at the last moment before its timeout.
    pub longest_s: f64,
}

impl Duration {
    /// The duration of a protocol whose conditions all have a movement.
    pub(super) fn of(protocol: &Protocol) -> Self {
        let conditions = protocol.velocities_rad_s.len() * protocol.torques_nm.len();
        let trials = (conditions * protocol.repetitions as usize) as f64;
        let familiarisation = f64::from(protocol.before.familiarisation_trials);

        let movements = protocol.velocities_rad_s.iter().filter_map(|velocity| {
            RampAndHold::new(&protocol.ramp, *velocity).ok().map(|movement| movement.duration_s())
        });
        let movement_s = movements.sum::<f64>() / protocol.velocities_rad_s.len() as f64;

        let gate = &protocol.gate;
        let [delay_low_s, delay_high_s] = gate.delay_s;
        let with_gates_of = |gate_s: f64| {
            let trial_s = gate_s + movement_s + protocol.rest_s;
            before_s(protocol) + (trials + familiarisation) * trial_s
        };
        let expected_gate_s = (APPROACH_S + gate.duration_s).min(gate.timeout_s);
        Self {
            shortest_s: with_gates_of(gate.duration_s + delay_low_s),
            expected_s: with_gates_of(expected_gate_s + (delay_low_s + delay_high_s) / 2.0),
            longest_s: with_gates_of(gate.timeout_s + delay_high_s),
        }
    }
}

/// Time before the trials, s: rig trials, torque offset, and maximal contractions in both directions.
fn before_s(protocol: &Protocol) -> f64 {
    let rig_trials_s = protocol.rig_trials_s();
    let offset_s = protocol.before.offset_s.unwrap_or(0.0);
    let mvc_s = protocol
        .before
        .mvc
        .as_ref()
        .map_or(0.0, |mvc| 2.0 * f64::from(mvc.efforts) * (mvc.duration_s + mvc.rest_s));
    rig_trials_s + offset_s + mvc_s
}
