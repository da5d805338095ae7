//! The worked example of `docs/how-to/add-a-mechanism.md`, from the simulation to the diagnosis.

use super::test_session::session;
use super::{DiagnosisInput, diagnose};
use crate::fit::{Fit, Model, Observations, PreprocessingSettings, Weighting};
use crate::wrist::mechanisms::MechanismKind;

const TRUTH: [f64; 2] = [60.0, 0.05];

#[test]
fn a_fit_with_the_example_mechanism_finds_its_parameters() {
    // Stiff enough for these few trials: of 60 N m/rad they tell 20 less or more.
    let truth = [180.0, 0.05];
    let observations = Observations::new(
        &session(MechanismKind::EndRangeStiffness, |_| truth.to_vec()),
        PreprocessingSettings::default(),
    )
    .unwrap();
    let model = Model::paper().with(MechanismKind::EndRangeStiffness);
    let fit = Fit::new(&observations, &model, Weighting::MeasuredNoise);
    let found = &fit.parameters[0][6..];
    assert!((found[0] / truth[0] - 1.0).abs() < 0.3, "stiffness {} instead of {}", found[0], truth[0]);
    assert!((found[1] - truth[1]).abs() < 0.01, "start {} instead of {}", found[1], truth[1]);
}

#[test]
fn a_diagnosis_names_the_example_mechanism() {
    let look = DiagnosisInput::new(
        &session(MechanismKind::EndRangeStiffness, |_| TRUTH.to_vec()),
        PreprocessingSettings::default(),
        &Model::paper(),
    )
    .unwrap();
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
