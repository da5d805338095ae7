//! A calibration of the rig from the command line: which file is used, what it changes, and what is refused.

use std::fs;

use ramphold::dataset::{
    CalibratedQuantity, CalibrationNoise, Disk, NoiseSpectrum, RigCalibration, RigQuantity,
};
use serde_json::{Value, json};

use crate::workspace::{QUICK, Workspace};

/// The virtual wrist's lever.
const STATED: [(RigQuantity, f64); 5] = [
    (RigQuantity::LeverInertia, 0.0016),
    (RigQuantity::LeverDamping, 0.4),
    (RigQuantity::LeverStiffness, 900.0),
    (RigQuantity::TorqueGain, 1.0),
    (RigQuantity::AngleGain, 1.0),
];

/// A calibration in which `different` are as given, the others of [`STATED`] as stated, each known to 0.5 %.
fn calibration(different: &[(RigQuantity, f64)]) -> RigCalibration {
    let stated = |name| STATED.iter().find(|(own, _)| *own == name).map(|(_, value)| *value);
    let quantity = |name: RigQuantity| {
        let value = different.iter().find(|(own, _)| *own == name).map(|(_, value)| *value).or(stated(name));
        CalibratedQuantity {
            name,
            value,
            se: value.map(|value| 0.005 * value),
            stated: stated(name),
            reason: value.is_none().then(|| "no load tells it".to_owned()),
            above: None,
        }
    };
    let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(quantity).to_vec();
    let variances: Vec<f64> = quantities.iter().filter_map(|own| own.se).map(|se| se * se).collect();
    let row = |i: usize| (0..variances.len()).map(|j| if i == j { variances[i] } else { 0.0 }).collect();
    let covariance = (0..variances.len()).map(row).collect();
    let mut own = RigCalibration::new("ramphold".into(), "rig-day".into(), quantities, covariance);
    own.measured_utc = Some("2026-11-20T10:00:00Z".into());
    own.noise = CalibrationNoise {
        torque_nm: 0.01,
        spectrum: NoiseSpectrum { frequency_hz: vec![2.0, 500.0], power_nm2_per_hz: vec![2e-7, 2e-7] },
    };
    own
}

/// A session of the quick protocol, and a folder `rig` with a calibration.
fn workspace(calibration: &RigCalibration, arguments: &[&str]) -> Workspace {
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("rig")).unwrap();
    calibration.write(&Disk::default(), &workspace.path("rig")).unwrap();
    let run = ["run", QUICK, "--seed", "1", "--out", "session"];
    workspace.call(0, &[&run, arguments].concat());
    workspace
}

const FILE: &str = "rig/rig-calibration.json";

fn json_of(workspace: &Workspace, file: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(workspace.path(file)).unwrap()).unwrap()
}

fn se_of_k_srs(fit: &Value) -> f64 {
    fit["trials"][0]["se_relative"]["k_srs_nm_per_rad"].as_f64().unwrap()
}

#[test]
fn a_session_that_is_run_with_a_calibration_keeps_it_byte_for_byte_and_its_fits_use_it() {
    let own = calibration(&[]);
    let workspace = workspace(&own, &["--calibration", FILE]);
    let copied = fs::read(workspace.path("session/rig-calibration.json")).unwrap();
    assert_eq!(copied, fs::read(workspace.path(FILE)).unwrap());
    let manifest = json_of(&workspace, "session/manifest.json");
    assert!(
        manifest["files"]["rig-calibration.json"].is_object()
            || manifest["files"]["rig-calibration.json"].is_string()
    );
    let fit = json_of(&workspace, "session/results/fit.json");
    assert_eq!(fit["rig"]["lever"], "measured");
    assert_eq!(fit["rig"]["calibration"]["session"], "rig-day");
    assert_eq!(fit["settings"]["calibration_sha256"].as_str().unwrap().len(), 64);
    let page = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(page.contains("measured in the rig trials of rig-day"), "the report says so");
    let (_, said) = workspace.call(0, &["fit", "session"]);
    assert!(said.contains("constants of the rig from session/rig-calibration.json"), "{said}");
    // Without it the standard errors are smaller, and the results with it stay.
    let (_, said) = workspace.call(0, &["fit", "session", "--calibration", "none"]);
    assert!(!said.contains("constants of the rig from"), "{said}");
    assert!(said.contains("results/window-40ms"), "{said}");
    let without = json_of(&workspace, "session/results/window-40ms/fit.json");
    assert_eq!(without["settings"]["calibration_sha256"], Value::Null);
    assert!(se_of_k_srs(&fit) > se_of_k_srs(&without));
    assert_eq!(json_of(&workspace, "session/results/fit.json")["rig"]["lever"], "measured");
    workspace.call(0, &["verify", "session"]);
}

#[test]
fn a_calibration_that_knows_the_gains_badly_is_not_taken_for_less_noise() {
    let mut own = calibration(&[]);
    for name in [RigQuantity::TorqueGain, RigQuantity::AngleGain] {
        let place = own.covariance_of.iter().position(|of| *of == name).unwrap();
        own.covariance[place][place] = 0.02 * 0.02;
        own.quantities.iter_mut().find(|quantity| quantity.name == name).unwrap().se = Some(0.02);
    }
    let workspace = workspace(&own, &["--calibration", FILE]);
    workspace.call(0, &["diagnose", "session"]);
    let found = json_of(&workspace, "session/results/diagnosis.json");
    assert_eq!(found["verdict"], "adequate");
    let probabilities = found["probabilities"].as_object().unwrap();
    let largest = probabilities.values().filter_map(Value::as_f64).fold(0.0, f64::max);
    assert_eq!(probabilities["none"].as_f64(), Some(largest), "{probabilities:?}");
}

#[test]
fn a_delay_that_the_session_contradicts_has_changed_after_the_rig_trials() {
    let mut own = calibration(&[(RigQuantity::TorqueDelay, 0.001)]);
    let place = own.covariance_of.iter().position(|of| *of == RigQuantity::TorqueDelay).unwrap();
    own.covariance[place][place] = 1e-12;
    own.quantities.iter_mut().find(|own| own.name == RigQuantity::TorqueDelay).unwrap().se = Some(1e-6);
    let workspace = workspace(&own, &["--calibration", FILE]);
    workspace.call(0, &["diagnose", "session"]);
    let found = json_of(&workspace, "session/results/diagnosis.json");
    let causes = found["causes"].as_array().unwrap();
    let named: Vec<&str> = causes.iter().filter_map(|cause| cause["mechanism"].as_str()).collect();
    assert_eq!(named, ["channel_skew"], "{}", found["probabilities"]);
    let delay_s = causes[0]["parameters"]["delay_s"]["value"].as_f64().unwrap();
    assert!((delay_s + 0.001).abs() < 0.000_1, "on top of the measured delay: {delay_s}");
    let remarks = found["remarks"].to_string();
    assert!(remarks.contains("channel_skew is not as the rig trials show it"), "{remarks}");
}

#[test]
fn a_session_without_a_calibration_says_what_errors_of_its_lever_would_do() {
    let workspace = workspace(&calibration(&[]), &[]);
    let fit = json_of(&workspace, "session/results/fit.json");
    assert_eq!(fit["rig"]["lever"], "assumed");
    let assumed = fit["rig"]["assumed"].as_array().unwrap();
    assert_eq!(assumed.len(), 5);
    for own in assumed {
        for quantity in ["k_srs_percent", "x_e_percent"] {
            for percent in own[quantity].as_array().unwrap() {
                assert!(percent.as_f64().unwrap().abs() < 60.0, "{own}");
            }
        }
    }
    let page = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(page.contains("The constants of the lever are assumed"));
    assert!(page.contains("off by 20 %"));
}

#[test]
fn a_calibration_that_cannot_be_used_is_refused_before_anything_is_written() {
    let workspace = workspace(&calibration(&[]), &[]);
    let good = json_of(&workspace, FILE);
    let refusal = |change: &dyn Fn(&mut Value)| {
        let mut changed = good.clone();
        change(&mut changed);
        workspace.write("changed.json", &changed);
        let run = ["run", QUICK, "--seed", "2", "--out", "other", "--calibration", "changed.json"];
        let (_, of_run) = workspace.call(2, &run);
        assert!(!workspace.path("other").exists(), "{of_run}");
        let (_, of_fit) = workspace.call(2, &["fit", "session", "--calibration", "changed.json"]);
        let diagnose = ["diagnose", "session", "--calibration", "changed.json"];
        assert_eq!(of_fit, workspace.call(2, &diagnose).1);
        of_fit
    };
    type Change<'a> = &'a dyn Fn(&mut Value);
    let expected: [(Change<'_>, &str); 7] = [
        (&|own| own["format"] = json!("ramphold-rig-calibration/2"), "field format"),
        (&|own| own["covariance"][0][1] = json!(1.0), "field covariance[0][1]"),
        (&|own| own["quantities"].as_array_mut().unwrap().swap(0, 1), "in this order"),
        (&|own| own["warnings"] = json!(["the bar of 0.004 kg m2 looks like 0.006"]), "looks like 0.006"),
        (
            &|own| {
                own["quantities"][0]["value"] = json!(0.9);
            },
            "mistake of units",
        ),
        (
            &|own| own["quantities"][0]["value"] = json!(16.0),
            "field quantities[0]: lever_inertia_kg_m2 is 16; expected 0.000001 to 1: a gram at 3 cm",
        ),
        (&|own| own["extra"] = json!(1), "unknown field"),
    ];
    for (change, message) in expected {
        let said = refusal(change);
        assert!(said.contains(message), "{said}");
    }
    let (_, said) = workspace.call(2, &["fit", "session", "--calibration", "rig"]);
    assert!(said.contains("rig: cannot be read"), "a folder: {said}");
    let (_, said) = workspace.call(2, &["fit", "session", "--calibration", "nowhere.json"]);
    assert!(said.contains("nowhere.json: cannot be read"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_link_in_a_sessions_folder_is_not_followed_to_a_calibration() {
    let workspace = workspace(&calibration(&[]), &[]);
    std::os::unix::fs::symlink(workspace.path(FILE), workspace.path("session/rig-calibration.json")).unwrap();
    let (_, said) = workspace.call(2, &["fit", "session"]);
    assert!(said.contains("rig-calibration.json") && said.contains("link"), "{said}");
}

#[test]
fn a_calibration_of_a_lever_is_refused_where_the_session_has_a_rigid_one_and_the_other_way_round() {
    let workspace = workspace(&calibration(&[]), &[]);
    let mut rigid = json_of(&workspace, FILE);
    for place in 0..3 {
        for field in ["value", "se", "stated"] {
            rigid["quantities"][place][field] = Value::Null;
        }
        rigid["quantities"][place]["reason"] = json!("the lever is rigid");
    }
    rigid["covariance_of"] = json!(["torque_gain", "angle_gain"]);
    rigid["covariance"] = json!([[0.000_025, 0.0], [0.0, 0.000_025]]);
    workspace.write("rigid.json", &rigid);
    let (_, said) = workspace.call(2, &["fit", "session", "--calibration", "rigid.json"]);
    assert!(said.contains("of a rigid lever"), "{said}");
    let mut session = json_of(&workspace, "session/session.json");
    session["rig"]["lever"] = Value::Null;
    workspace.write("session/session.json", &session);
    let (_, said) = workspace.call(2, &["fit", "session", "--calibration", FILE]);
    assert!(said.contains("the session states a rigid one"), "{said}");
}

#[test]
fn a_lever_that_rig_trials_measured_is_named_and_corrected_and_nothing_else_is() {
    // The lever of the virtual rig has half as much inertia again as its session states.
    let own = calibration(&[(RigQuantity::LeverInertia, 0.0024)]);
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("rig")).unwrap();
    own.write(&Disk::default(), &workspace.path("rig")).unwrap();
    workspace.write(
        "model.json",
        &json!({
            "format": "ramphold-model/1",
            "mechanisms": [{
                "mechanism": "lever_inertia",
                "parameters": { "inertia_kg_m2": { "scope": "fixed", "value": 0.0024 } },
            }],
        }),
    );
    let run = ["run", QUICK, "--seed", "1", "--out", "session", "--model", "model.json"];
    workspace.call(0, &[&run[..], &["--calibration", FILE]].concat());
    workspace.call(0, &["diagnose", "session"]);
    let diagnosis = json_of(&workspace, "session/results/diagnosis.json");
    let causes = diagnosis["causes"].as_array().unwrap();
    assert_eq!(causes.len(), 1, "{causes:?}");
    assert_eq!(causes[0]["mechanism"], "lever_inertia");
    assert_eq!(causes[0]["indistinguishable"], json!([]));
    assert_eq!(causes[0]["parameters"]["inertia_kg_m2"]["value"], 0.0024);
    assert_eq!(diagnosis["verdict"], "named");
    let shift = &causes[0]["parameter_shift"]["k_srs_nm_per_rad"];
    assert!(
        (shift["before"].as_f64().unwrap() / shift["after"].as_f64().unwrap() - 1.0).abs() > 0.01,
        "{shift}"
    );
    // The numbers of the page are right already.
    let page = fs::read_to_string(workspace.path("session/results/report.html")).unwrap();
    assert!(!page.contains("† Biased"), "the fit uses the measured lever");
}

#[test]
fn a_rig_within_its_tolerances_has_no_cause() {
    let own = calibration(&[
        (RigQuantity::TorqueGain, 1.003),
        (RigQuantity::AngleGain, 0.9995),
        (RigQuantity::LeverStiffness, 910.0),
    ]);
    let workspace = workspace(&own, &["--calibration", FILE]);
    workspace.call(0, &["diagnose", "session"]);
    let diagnosis = json_of(&workspace, "session/results/diagnosis.json");
    assert_eq!(diagnosis["verdict"], "adequate", "{}", diagnosis["causes"]);
    assert_eq!(diagnosis["settings"]["calibration_sha256"].as_str().unwrap().len(), 64);
}

#[test]
fn the_calibration_of_a_virtual_rig_finds_its_lever_its_gain_and_its_servo() {
    let workspace = Workspace::new();
    let mut protocol: Value = serde_json::from_str(&fs::read_to_string(QUICK).unwrap()).unwrap();
    let with_loads = fs::read_to_string("protocols/de-vlugt-2011-rig-trials.json").unwrap();
    let with_loads: Value = serde_json::from_str(&with_loads).unwrap();
    protocol["rig_trials"] = with_loads["rig_trials"].clone();
    workspace.write("protocol.json", &protocol);
    let rig = json!({
        "kind": "virtual",
        "gauge_noise_nm": 0.003,
        "gauge_step_nm": 0.0001,
        "encoder_counts_per_revolution": 1_048_576,
        "mechanisms": [
            { "mechanism": "lever_stiffness", "parameters": { "stiffness_nm_per_rad": 600 } },
            { "mechanism": "torque_gain", "parameters": { "factor": 1.04 } },
        ],
    });
    workspace.write("rig.json", &rig);
    workspace.call(0, &["run", "protocol.json", "--rig", "rig.json", "--seed", "7", "--out", "session"]);
    workspace.call(0, &["calibrate", "session"]);
    let found = RigCalibration::read(&workspace.path("session/rig-calibration.json")).unwrap();
    for (name, truth) in [
        (RigQuantity::LeverInertia, 0.0016),
        (RigQuantity::LeverDamping, 0.4),
        (RigQuantity::LeverStiffness, 600.0),
        (RigQuantity::TorqueGain, 1.04),
        (RigQuantity::AngleGain, 1.0),
        (RigQuantity::ServoBandwidth, 80.0),
    ] {
        let (value, se) = (found.value(name).unwrap(), found.se(name).unwrap());
        assert!((value - truth).abs() < 4.0 * se && se < 0.05 * truth, "{}: {value} +- {se}", name.name());
    }
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

/// What a run with this calibration says of the rig before the subject is seated. The protocol begins with the empty handle.
fn said_before_the_subject_is_seated(different: &[(RigQuantity, f64)]) -> String {
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("rig")).unwrap();
    calibration(different).write(&Disk::default(), &workspace.path("rig")).unwrap();
    let mut protocol: Value = serde_json::from_str(&fs::read_to_string(QUICK).unwrap()).unwrap();
    let multisine = json!({ "kind": "multisine", "amplitude_rad": 0.005, "lowest_hz": 1, "highest_hz": 60, "duration_s": 4 });
    protocol["rig_trials"] = json!([
        { "kind": "empty_handle", "motion": { "kind": "ramps" }, "repetitions": 3 },
        { "kind": "empty_handle", "motion": multisine, "repetitions": 3 },
    ]);
    workspace.write("protocol.json", &protocol);
    let run = ["run", "protocol.json", "--seed", "1", "--out", "session", "--calibration", FILE];
    let (_, messages) = workspace.call(0, &run);
    messages.lines().find(|line| line.starts_with("check of the day")).unwrap_or_default().to_owned()
}

#[test]
fn a_run_compares_the_empty_handle_with_its_calibration_and_names_what_differs() {
    let same = said_before_the_subject_is_seated(&[]);
    assert!(same.contains("agree (p ="), "{same}");
    // The handle of the virtual wrist has 0.0016 kg m2.
    let other = said_before_the_subject_is_seated(&[(RigQuantity::LeverInertia, 0.0020)]);
    assert!(
        other.contains("differ: ")
            && other.contains("lever_inertia_kg_m2 by -")
            && other.contains("before a person"),
        "{other}"
    );
}
