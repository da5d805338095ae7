//! What a mechanism does to the torque of the average virtual subject in the default rig, for figures.

use super::person::Person;
use super::setup::Setup;
use crate::protocol::Sweep;
use crate::wrist::mechanisms::{CATALOGUE, Covariates, MechanismKind, ProbeContext};
use crate::wrist::{
    Kinematics, SimulatedTorque, SimulationSettings, TrialInput, VectorWidth, simulate, steps_per_sample,
};

/// Ramp velocity of the figure, rad/s, its amplitude, rad, and its rise time, s: of the paper's protocol.
const VELOCITY_RAD_S: f64 = 2.6;
const AMPLITUDE_RAD: f64 = 0.14;
const RISE_S: f64 = 0.020;

/// Target torque of the figure, N m.
const TORQUE_NM: f64 = 1.5;

/// Sampling rate, Hz, samples after the onset (40 ms), and samples simulated before it.
const SAMPLE_RATE_HZ: f64 = 2500.0;
const SAMPLES: usize = 100;
const LEAD_SAMPLES: usize = 60;

/// The torque with and without a mechanism, as a change from the hold, unfiltered.
#[derive(Debug, Clone, PartialEq)]
pub struct TypicalEffect {
    /// Time since the onset, s.
    pub time_s: Vec<f64>,
    /// Torque of the base model, N m.
    pub base_nm: Vec<f64>,
    /// Torque with the mechanism, N m.
    pub changed_nm: Vec<f64>,
    /// Values of the mechanism's parameters: the last that a diagnosis probes.
    pub values: Vec<f64>,
}

impl TypicalEffect {
    /// Simulates a ramp of 2.6 rad/s at 1.5 N m without and with `kind`, in the last trial of a session.
    ///
    /// A mechanism that shows in single trials changes nothing here.
    pub fn of(kind: MechanismKind) -> Self {
        let (subject, setup) = (Person::default(), Setup::default());
        let period_s = 1.0 / SAMPLE_RATE_HZ;
        let base: Vec<f64> = vec![
            subject.joint_inertia_kg_m2,
            subject.interface_damping_nm_s_per_rad,
            subject.interface_stiffness_nm_per_rad.at(VELOCITY_RAD_S, TORQUE_NM),
            subject.short_range_stiffness_nm_per_rad.at(VELOCITY_RAD_S, TORQUE_NM),
            subject.stiffness_decrement_nm_per_rad.at(VELOCITY_RAD_S, TORQUE_NM),
            subject.elastic_limit_rad.at(VELOCITY_RAD_S, TORQUE_NM),
        ];
        let active = TORQUE_NM / subject.muscles.flexion_nm;
        let covariates = Covariates {
            velocity_rad_s: VELOCITY_RAD_S,
            torque_before_nm: TORQUE_NM,
            progress: 1.0,
            rest_s: 5.0,
            flexor_emg_excess_mvc: subject.spread.flexor_emg * active,
            extensor_emg_mvc: subject.muscles.cocontraction * active,
        };
        let trial = TrialInput { motion: ramp(period_s), onset: LEAD_SAMPLES, covariates };
        let torque = |kinds: &[MechanismKind], parameters: &[f64]| {
            let settings = SimulationSettings {
                lever: setup.lever,
                kinds,
                period_s,
                samples: SAMPLES,
                lead_samples: LEAD_SAMPLES,
                baseline_samples: 0,
                substeps: steps_per_sample(setup.lever, kinds, &trial, parameters, period_s),
                filter: &[],
                further: &[],
                derivatives: &[],
                width: VectorWidth::One,
            };
            let mut torque = SimulatedTorque::default();
            simulate(&settings, &[&trial], parameters, &mut torque);
            torque.torque_nm
        };
        let base_nm = torque(&[], &base);
        let highest_nm = base_nm.iter().copied().fold(0.0, f64::max) + TORQUE_NM;
        let context = ProbeContext {
            lever: setup.lever,
            highest_torque_nm: highest_nm,
            window_s: SAMPLES as f64 * period_s,
        };
        let values = kind.probes(&context).pop().unwrap_or_default();
        let time_s: Vec<f64> = (0..SAMPLES).map(|sample| sample as f64 * period_s).collect();
        let parameters: Vec<f64> = base.iter().chain(&values).copied().collect();
        let mut changed_nm = torque(&[kind], &parameters);
        for (changed, time_s) in changed_nm.iter_mut().zip(&time_s) {
            *changed += kind.disturbance_nm(&values, *time_s);
        }
        Self { time_s, base_nm, changed_nm, values }
    }

    /// Every mechanism of the catalogue with its effect.
    pub fn catalogue() -> Vec<(MechanismKind, Self)> {
        CATALOGUE.iter().map(|kind| (*kind, Self::of(*kind))).collect()
    }
}

/// The motor's motion from before the onset to the end of the window and a few samples more.
fn ramp(period_s: f64) -> Vec<Kinematics<f64>> {
    let sweep = Sweep::new(AMPLITUDE_RAD, VELOCITY_RAD_S, RISE_S).expect("the paper's ramp is possible");
    (0..LEAD_SAMPLES + SAMPLES + LEAD_SAMPLES)
        .map(|sample| {
            let motion = sweep.at((sample as f64 - LEAD_SAMPLES as f64).max(0.0) * period_s);
            Kinematics { theta: motion.angle_rad, omega: motion.velocity_rad_s }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wrist::mechanisms::EvidenceSource;

    #[test]
    fn every_mechanism_but_those_of_single_trials_changes_the_torque() {
        for (kind, effect) in TypicalEffect::catalogue() {
            let differs = |(a, b): (&f64, &f64)| (a - b).abs();
            let largest = effect.base_nm.iter().zip(&effect.changed_nm).map(differs).fold(0.0, f64::max);
            assert!(largest.is_finite() && largest < 5.0, "{}: {largest} N m", kind.id());
            assert_eq!(
                largest > 1e-3,
                kind.evidence() != EvidenceSource::SingleTrials,
                "{}: {largest} N m",
                kind.id()
            );
        }
    }
}
