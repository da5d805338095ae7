//! The worked example of `docs/how-to/add-a-mechanism.md`, from the simulation to the diagnosis.

use std::collections::BTreeMap;

use super::{DiagnosisInput, diagnose};
use crate::dataset::{Record, Session, Status, Subject, Trial};
use crate::fit::{Fit, Model, Observations, PreprocessingSettings, Weighting};
use crate::random::Stream;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{self, Lever, SimulationSettings, TrialInput, VectorWidth};

const PERIOD_S: f64 = 4e-4;
const LEVER: Lever = Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
const SUBJECT: [f64; 6] = [0.005, 1.2, 300.0, 20.0, 13.0, 0.04];
const TRUTH: [f64; 2] = [60.0, 0.05];
const HOLD_SAMPLES: usize = 1250;
const RAMP: usize = 150;

fn trial(number: u32, velocity_rad_s: f64, repetition: u32, stream: &mut Stream) -> Trial {
    let sweep = crate::protocol::Sweep::new(0.14, velocity_rad_s, 0.018).unwrap();
    let angle = |sample: usize| sweep.at((sample as f64 - HOLD_SAMPLES as f64).max(0.0) * PERIOD_S).angle_rad;
    let theta_m_rad: Vec<f64> = (0..HOLD_SAMPLES + RAMP).map(angle).collect();
    let input = TrialInput {
        motion: wrist::motor_motion(&theta_m_rad, PERIOD_S),
        onset: HOLD_SAMPLES,
        covariates: Default::default(),
    };
    let settings = SimulationSettings {
        lever: Some(LEVER),
        kinds: &[MechanismKind::EndRangeStiffness],
        period_s: PERIOD_S,
        samples: RAMP,
        lead_samples: 10,
        baseline_samples: 0,
        substeps: 8,
        filter: &[],
        further: &[],
        derivatives: &[],
        width: VectorWidth::One,
    };
    let parameters: Vec<f64> = SUBJECT.into_iter().chain(TRUTH).collect();
    let ramp = wrist::trace(&settings, &input, &parameters);
    let changes =
        std::iter::repeat_n(0.0, HOLD_SAMPLES).chain(ramp.iter().map(|sample| sample.torques.measured));
    Trial {
        number,
        file: format!("trials/trial-{number:03}.csv"),
        velocity_rad_s,
        torque_nm: 1.5,
        repetition,
        condition: None,
        onset_s: Some(0.0),
        status: Status::Ok,
        extra: BTreeMap::new(),
        record: Record {
            start_s: -(HOLD_SAMPLES as f64) * PERIOD_S,
            torque_l_nm: changes.map(|change| 1.5 + change + 0.01 * stream.normal()).collect(),
            theta_m_rad,
            ..Record::default()
        },
    }
}

/// Three velocities, four repetitions each.
fn session() -> Session {
    let mut stream = Stream::new(1, "example mechanism");
    let mut trials = Vec::new();
    for repetition in 1..=4 {
        for velocity_rad_s in [1.95, 2.6, 3.25] {
            trials.push(trial(trials.len() as u32 + 1, velocity_rad_s, repetition, &mut stream));
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

#[test]
fn a_fit_with_the_example_mechanism_finds_its_parameters() {
    let observations = Observations::new(&session(), PreprocessingSettings::default()).unwrap();
    let model = Model::paper().with(MechanismKind::EndRangeStiffness);
    let fit = Fit::new(&observations, &model, Weighting::MeasuredNoise);
    let found = &fit.parameters[0][6..];
    assert!((found[0] / TRUTH[0] - 1.0).abs() < 0.3, "stiffness {} instead of {}", found[0], TRUTH[0]);
    assert!((found[1] - TRUTH[1]).abs() < 0.01, "start {} instead of {}", found[1], TRUTH[1]);
}

#[test]
fn a_diagnosis_names_the_example_mechanism() {
    let look = DiagnosisInput::new(&session(), PreprocessingSettings::default(), &Model::paper()).unwrap();
    let diagnosis = diagnose(&look, &Model::paper(), 1, &|_| {});
    let names = diagnosis.causes.iter().flat_map(|cause| {
        std::iter::once(cause.kind)
            .chain(cause.alternatives.iter().map(|own| own.kind))
            .map(MechanismKind::id)
    });
    let names: Vec<&str> = names.collect();
    assert!(names.contains(&"end_range_stiffness"), "{:?}: {names:?}", diagnosis.verdict);
}

#[test]
fn the_page_shows_the_code_that_is_compiled() {
    let page = include_str!("../../docs/how-to/add-a-mechanism.md");
    let file = include_str!("../wrist/mechanisms/end_range_stiffness.rs");
    let catalogue = include_str!("../wrist/mechanisms/mod.rs");
    let line = "    end_range_stiffness::EndRangeStiffness,\n";
    assert!(page.contains(file), "copy end_range_stiffness.rs into docs/how-to/add-a-mechanism.md");
    assert!(page.contains(line) && catalogue.contains(line), "{line} is not in the page and the catalogue");
}
