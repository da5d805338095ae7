use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::*;
use crate::dataset;
use crate::rig::virtual_wrist::RigFile;

const PROTOCOLS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols");

/// A study of virtual subjects with the quick protocol, after a change of the file.
fn study(seed: u64, change: impl FnOnce(&mut serde_json::Value)) -> Study {
    try_study(seed, change).unwrap()
}

fn try_study(seed: u64, change: impl FnOnce(&mut serde_json::Value)) -> Result<Study, StudyError> {
    let mut file = serde_json::json!({
        "format": STUDY_FORMAT,
        "name": "a test",
        "units_per_part": 2,
        "persons": {
            "kind": "virtual",
            "count": 3,
            "protocol": "quick.json",
            "spread": { "short_range_stiffness": { "level": 0.1, "per_nm": 1.0 }, "joint_inertia": 0.1 },
        },
    });
    change(&mut file);
    let text = file.to_string();
    Study::new(&StudyFile::parse(&text, Path::new("study.json"))?, &text, Path::new(PROTOCOLS), seed)
}

#[test]
fn a_session_in_memory_equals_the_one_in_its_folder() {
    let study = study(3, |_| {});
    let unit = study.unit(1);
    let folder = tempfile::tempdir().unwrap();
    let from_folder = simulate_unit(&unit, SessionStorage::Folder(folder.path())).unwrap().unwrap();
    let in_memory = simulate_unit(&unit, SessionStorage::Memory).unwrap().unwrap();
    assert_eq!(in_memory.trials.len(), 8);
    for (own, kept) in in_memory.trials.iter().zip(&from_folder.trials) {
        // Equal to the last bit, the sign of zero included. The debug output is too long to print.
        assert!(format!("{own:?}") == format!("{kept:?}"), "trial {}", own.number);
    }
    let loaded = dataset::load(&folder.path().join("P0002-1")).unwrap();
    assert!(format!("{in_memory:?}") == format!("{loaded:?}"));
}

#[test]
fn a_unit_depends_on_its_number_and_the_seed_alone() {
    let (few, many) = (study(3, |_| {}), study(3, |file| file["persons"]["count"] = 1000.into()));
    assert_eq!(few.unit(2), many.unit(2));
    assert_ne!(few.unit(2), study(4, |_| {}).unit(2));
    let seeds: std::collections::BTreeSet<u64> = (0..1000)
        .map(|index| match many.unit(index).source {
            UnitSource::Virtual { seed, .. } => seed,
            UnitSource::Measured(_) => panic!("virtual"),
        })
        .collect();
    assert_eq!(seeds.len(), 1000);
}

fn subject(study: &Study, index: u64) -> Box<crate::rig::virtual_wrist::Person> {
    match study.unit(index).source {
        UnitSource::Virtual { person, .. } => person,
        UnitSource::Measured(_) => panic!("virtual"),
    }
}

#[test]
fn the_spread_of_one_parameter_changes_no_other() {
    let with = study(3, |_| {});
    let without = study(3, |file| file["persons"]["spread"]["joint_inertia"] = 0.0.into());
    let (a, b) = (subject(&with, 1), subject(&without, 1));
    assert_ne!(a.joint_inertia_kg_m2, b.joint_inertia_kg_m2);
    assert_eq!(a.short_range_stiffness_nm_per_rad, b.short_range_stiffness_nm_per_rad);
}

#[test]
fn subjects_spread_as_the_file_says() {
    let study = study(3, |file| file["persons"]["count"] = 2000.into());
    let persons: Vec<_> = (0..2000).map(|index| subject(&study, index)).collect();
    let sd = |of: &dyn Fn(&crate::rig::virtual_wrist::Person) -> f64| {
        let sample: crate::statistics::MeanVariance = persons.iter().map(|person| of(person)).collect();
        sample.variance().unwrap().sqrt()
    };
    let middle = sd(&|person| person.short_range_stiffness_nm_per_rad.at(2.275, 1.5).ln());
    assert!((middle - 0.1).abs() < 0.006, "{middle}");
    let inertia = sd(&|person| person.joint_inertia_kg_m2.ln());
    assert!((inertia - 0.1).abs() < 0.006, "{inertia}");
    // The rise with torque varies by its own spread and with the level: sqrt(1 + (0.1 x 6.67)^2).
    let rise = sd(&|person| person.short_range_stiffness_nm_per_rad.per_nm);
    assert!((rise - 1.2).abs() < 0.06, "{rise}");
}

#[test]
fn sessions_of_a_subject_differ_by_the_given_spread_and_follow_each_other() {
    let twice = study(3, |file| {
        file["persons"]["sessions"] = 2.into();
        file["persons"]["between_sessions"] = serde_json::json!({ "joint_inertia": 0.05 });
    });
    let (first, second) = (twice.unit(2), twice.unit(3));
    assert_eq!((first.subject.as_str(), first.session, second.session), ("P0002", 1, 2));
    assert_eq!(second.subject, "P0002");
    let (a, b) = (subject(&twice, 2), subject(&twice, 3));
    assert_ne!(a.joint_inertia_kg_m2, b.joint_inertia_kg_m2);
    assert_eq!(a.short_range_stiffness_nm_per_rad, b.short_range_stiffness_nm_per_rad);
}

#[test]
fn williams_orders_are_counterbalanced_over_subjects() {
    let folder = tempfile::tempdir().unwrap();
    let quick = fs::read_to_string(Path::new(PROTOCOLS).join("quick.json")).unwrap();
    fs::write(folder.path().join("quick.json"), quick.replace("\"shuffled\"", "\"williams\"")).unwrap();
    let text = serde_json::json!({
        "format": STUDY_FORMAT, "name": "balanced",
        "persons": { "kind": "virtual", "count": 4, "protocol": "quick.json", "spread": {} },
    })
    .to_string();
    let file = StudyFile::parse(&text, Path::new("study.json")).unwrap();
    let study = Study::new(&file, &text, folder.path(), 1).unwrap();
    let mut first: Vec<(u64, u64)> = (0..4)
        .map(|index| {
            let trials = simulate_unit(&study.unit(index), SessionStorage::Memory).unwrap().unwrap().trials;
            (trials[0].velocity_rad_s.to_bits(), trials[0].torque_nm.to_bits())
        })
        .collect();
    first.sort_unstable();
    first.dedup();
    assert_eq!(first.len(), 4, "each of the four conditions is the first of one subject");
}

#[test]
fn a_part_is_used_only_if_it_is_intact_and_of_this_study() {
    let study = study(3, |_| {});
    let folder = tempfile::tempdir().unwrap();
    let taken = StudyFolder::open(folder.path(), &study, true).unwrap();
    assert_eq!(taken.pending_parts(&study).len(), 2);
    let part = StudyPart::of(folder.path(), 0);
    part.run(&study, SessionStorage::Memory, || ()).unwrap();
    assert!(part.is_done(&study));
    let file = folder.path().join("parts/part-000000.csv");
    let whole = fs::read_to_string(&file).unwrap();
    // A part that was truncated or changed does not count as done.
    for cut in [0, 1, whole.len() / 2, whole.len() - 1] {
        fs::write(&file, &whole[..cut]).unwrap();
        assert!(!part.is_done(&study), "cut at {cut}");
    }
    fs::write(&file, whole.replacen("P0001", "P0009", 1)).unwrap();
    assert!(!part.is_done(&study));
    fs::write(&file, &whole).unwrap();
    assert!(part.is_done(&study));
    assert!(!part.is_done(&try_study(4, |_| {}).unwrap()), "another seed");
    assert_eq!(taken.pending_parts(&study).len(), 1);
}

#[test]
fn invalid_study_files_are_refused_with_field_and_expected_value() {
    let refuse = |change: fn(&mut serde_json::Value), parts: &[&str]| {
        let message = try_study(1, change).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in: {message}");
        }
    };
    refuse(|file| file["format"] = "ramphold-study/9".into(), &["study.json", "format", "ramphold-study/1"]);
    refuse(|file| file["persons"]["count"] = 0.into(), &["persons.count", "0", "1 to"]);
    refuse(|file| file["persons"]["count"] = "eight".into(), &["line 1", "persons", "eight"]);
    refuse(|file| file["units_per_part"] = 0.into(), &["units_per_part", "from 1 to"]);
    refuse(|file| file["persons"]["colour"] = 1.into(), &["colour"]);
    refuse(|file| file["persons"]["sessions"] = 101.into(), &["persons.sessions", "101"]);
    refuse(
        |file| file["persons"]["spread"]["elastic_limit"] = serde_json::json!({ "level": -0.1 }),
        &["persons.spread.elastic_limit.level", "-0.1", "from 0 up"],
    );
    refuse(|file| file["persons"]["protocol"] = "none.json".into(), &["none.json"]);
    refuse(
        |file| file["persons"] = serde_json::json!({ "kind": "measured", "folders": [] }),
        &["persons.folders", "at least one"],
    );
}

/// Writes a study.csv; a row is subject, session, velocity (rad/s), torque (N m) and k_srs (N m/rad).
fn table(rows: &[(&str, u32, f64, f64, f64)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.csv");
    let mut text = "subject,velocity_rad_s,torque_nm,k_srs_nm_per_rad,converged,session\n".to_owned();
    for (subject, session, velocity, torque, value) in rows {
        text += &format!("{subject},{velocity},{torque},{value},true,{session}\n");
    }
    fs::write(&path, text).unwrap();
    (folder, path)
}

const CELLS: [(f64, f64); 4] = [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0), (2.0, 2.0)];

fn all_cells(subject: &'static str, level: f64) -> Vec<(&'static str, u32, f64, f64, f64)> {
    CELLS.iter().map(|(v, t)| (subject, 1, *v, *t, level + v + 10.0 * t)).collect()
}

fn summary(rows: &[(&str, u32, f64, f64, f64)]) -> StudySummary {
    let (_folder, path) = table(rows);
    summarise(&path, TableOrigin::External, &[], Vec::new()).unwrap()
}

#[test]
fn a_study_takes_the_values_of_the_sessions_fit_unless_asked_for_those_of_single_trials() {
    let fit = |study: &Study| fit_unit(study, &study.unit(0), SessionStorage::Memory).unwrap();
    let together = fit(&study(3, |_| {}));
    let alone = fit(&study(3, |file| file["fit"] = "independent".into()));
    assert_eq!((together.fit, alone.fit), (StudyFit::Session, StudyFit::Independent));
    assert_ne!(together.trials[0].values[K_SRS], alone.trials[0].values[K_SRS]);
}

#[test]
fn a_session_without_a_model_is_in_no_table_of_sessions_that_have_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.csv");
    let mut text = "subject,velocity_rad_s,torque_nm,k_srs_nm_per_rad,converged,session,fit\n".to_owned();
    for (subject, fit) in [("A", "session"), ("B", "independent"), ("C", "session")] {
        for (_, session, velocity, torque, value) in all_cells(subject, 1.0) {
            text += &format!("{subject},{velocity},{torque},{value},true,{session},{fit}\n");
        }
    }
    fs::write(&path, &text).unwrap();
    let summary = summarise(&path, TableOrigin::External, &[], Vec::new()).unwrap();
    assert_eq!(summary.complete[K_SRS].count(), 2);
    assert!(issues(&summary).contains("B, session 1: the session has no model"), "{}", issues(&summary));
    fs::write(&path, text.replace(",true,1,session", ",true,1,independent")).unwrap();
    let alike = summarise(&path, TableOrigin::External, &[], Vec::new()).unwrap();
    assert!(issues(&alike).is_empty(), "{}", issues(&alike));
}

#[test]
fn a_column_that_was_renamed_is_refused_instead_of_left_out() {
    let (_folder, path) = table(&all_cells("A", 1.0));
    let text = fs::read_to_string(&path).unwrap();
    let read = |header: &str| {
        fs::write(&path, text.replace("k_srs_nm_per_rad", header)).unwrap();
        summarise(&path, TableOrigin::External, &[], Vec::new())
    };
    for renamed in ["k_srs", "k_srs_nm_rad", "k_srs_Nm_per_rad"] {
        let error = read(renamed).unwrap_err().to_string();
        assert!(error.contains(renamed) && error.contains("rename it to k_srs_nm_per_rad"), "{error}");
    }
    assert!(read("age").is_ok(), "another column is left alone");
}

/// Index of k_srs in the quantities.
const K_SRS: usize = 3;

fn issues(summary: &StudySummary) -> String {
    summary.issues.iter().map(StudyIssue::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_subject_without_a_condition_is_reported_and_the_others_are_analysed() {
    let mut rows = [all_cells("A", 0.0), all_cells("B", 1.0), all_cells("C", 5.0)].concat();
    rows.remove(9);
    let summary = summary(&rows);
    assert_eq!(summary.complete[K_SRS].count(), 2);
    assert_eq!(summary.cells[K_SRS].iter().map(|cell| cell.count()).collect::<Vec<_>>(), [3, 2, 3, 3]);
    assert_eq!(summary.subjects, 3);
    assert_eq!(
        issues(&summary),
        "C: no usable trial of k_srs_nm_per_rad in 1 of 4 conditions (first: 1 rad/s at 2 N m). The subject is left out of the \
         analysis of variance of that quantity; scripts/mixed-model uses all rows"
    );
    assert_eq!(summary.grid.conditions, CELLS);
}

#[test]
fn a_subject_with_other_conditions_is_in_no_table() {
    let mut rows = [all_cells("A", 0.0), all_cells("B", 1.0), all_cells("C", 2.0)].concat();
    rows[8].2 = 1.5;
    let summary = summary(&rows);
    assert_eq!(summary.complete[K_SRS].count(), 2);
    assert_eq!(summary.cells[K_SRS][0].count(), 2);
    assert!(issues(&summary).contains("C: measured with another protocol (it has 1.5 rad/s at 1 N m"));
}

#[test]
fn a_subject_who_appears_twice_counts_once() {
    let rows = [all_cells("A", 0.0), all_cells("B", 1.0), all_cells("A", 7.0)].concat();
    let summary = summary(&rows);
    assert_eq!(summary.complete[K_SRS].count(), 2);
    assert_eq!(summary.cells[K_SRS][0].mean(), 11.5);
    assert!(issues(&summary).contains("A: appears twice") && issues(&summary).contains("line 10"));
}

#[test]
fn one_subject_has_means_and_no_statistics() {
    let summary = summary(&all_cells("A", 0.0));
    assert!(issues(&summary).contains("statistics need at least 2"));
    assert_eq!(summary.cells[K_SRS][0].mean(), 11.0);
    let tables = ResultTables::of(&summary);
    assert!(tables.effects.iter().all(Vec::is_empty));
}

#[test]
fn trends_are_slopes_per_unit_of_the_factor() {
    let rows = [all_cells("A", 0.0), all_cells("B", 1.0), all_cells("C", 5.0)].concat();
    let summary = summary(&rows);
    let [slope, intercept] = summary.grid.trend_weights(0).unwrap();
    let moments = &summary.complete[K_SRS];
    assert!((moments.contrast(&slope).unwrap().estimate - 1.0).abs() < 1e-12);
    // Mean level 2, and 15 from the mean torque.
    assert!((moments.contrast(&intercept).unwrap().estimate - 17.0).abs() < 1e-12);
    let [slope, _] = summary.grid.trend_weights(1).unwrap();
    assert!((moments.contrast(&slope).unwrap().estimate - 10.0).abs() < 1e-12);
}

#[test]
fn sessions_of_a_subject_are_repetitions_in_the_means_and_retests_in_the_reliability() {
    let mut rows = Vec::new();
    for (subject, level) in [("A", 0.0), ("B", 4.0), ("C", 9.0)] {
        for session in [1, 2] {
            let shift = f64::from(session) * 0.25;
            rows.extend(
                all_cells(subject, level + shift)
                    .into_iter()
                    .map(|row| (row.0, session, row.2, row.3, row.4)),
            );
        }
    }
    let summary = summary(&rows);
    assert_eq!(summary.sessions, 2);
    assert_eq!(summary.complete[K_SRS].count(), 3);
    assert_eq!(summary.by_session[K_SRS].count(), 3);
    let found = crate::statistics::reliability(&summary.by_session[K_SRS]).unwrap();
    assert!(found.sem < 1e-6 && found.icc_consistency > 0.999_999, "all subjects changed alike: {found:?}");
    assert!(found.icc_agreement < found.icc_consistency);
}

#[test]
fn an_invalid_table_is_refused_with_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.csv");
    for (text, part) in [
        ("subject,velocity_rad_s\nA,1\n", "torque_nm is missing"),
        ("subject,velocity_rad_s,torque_nm,x_e_rad\nA,1,1,wide\n", "line 2: column x_e_rad: \"wide\""),
        ("subject,velocity_rad_s,torque_nm,session\nA,1,1,0\n", "column session: \"0\""),
        ("subject,velocity_rad_s,torque_nm\nA,1\n", "line 2"),
    ] {
        fs::write(&path, text).unwrap();
        let error = summarise(&path, TableOrigin::External, &[], Vec::new()).unwrap_err().to_string();
        assert!(error.contains(part), "{part:?} is not in: {error}");
    }
}

#[test]
fn power_rises_with_the_number_of_subjects_and_a_zero_change_is_not_found() {
    use super::power::{ParameterShift, ResamplingPlan, SoughtEffect, power};
    let study = study(3, |_| {});
    let resampling =
        ResamplingPlan { subjects: vec![3, 12], repetitions: vec![1, 2], studies: 400, pool: 6, alpha: 0.05 };
    let large: ParameterShift = "k_srs=-0.3".parse().unwrap();
    let (found, pool) = power(&study, SoughtEffect::Difference(large), &resampling, || ()).unwrap();
    assert_eq!((pool.len(), pool[0].first.len(), pool[1].second.len()), (2, 6, 6));
    let by: BTreeMap<(u32, u32), f64> =
        found.iter().map(|found| ((found.repetitions, found.subjects), found.power().0)).collect();
    assert!(by[&(2, 12)] > 0.95 && by[&(2, 3)] < by[&(2, 12)], "{by:?}");
    let effect = found[0].effect;
    assert!((-9.0..-4.0).contains(&effect), "30 % of about 20 N m/rad less: {effect}");
    let nothing: ParameterShift = "k_srs=1e-12".parse().unwrap();
    // Without spread between sessions, two sessions differ by their noise alone.
    let (found, _) = power(&study, SoughtEffect::Change(nothing), &resampling, || ()).unwrap();
    assert!(found.iter().all(|found| found.effect.abs() < 1.0), "{found:?}");
}

#[test]
fn shifts_are_parsed_and_invalid_text_is_refused() {
    use super::power::ParameterShift;
    assert_eq!("k_srs=-0.15".parse::<ParameterShift>().unwrap().to_string(), "k_srs=-0.15");
    for invalid in ["k_srs", "k_srs=", "k_x=0.1", "k_srs=0", "k_srs=NaN", "k_srs=-1", ""] {
        assert!(invalid.parse::<ParameterShift>().unwrap_err().contains("expected one of"), "{invalid}");
    }
}

#[test]
fn the_schema_in_the_repository_is_up_to_date() {
    let file = Path::new(PROTOCOLS).join("study.schema.json");
    assert!(fs::read_to_string(file).unwrap() == schema_text(), "run: ramphold schema study");
}

#[test]
fn a_person_who_can_never_hold_the_torque_ends_the_session_with_a_reason() {
    let rig = r#"{ "kind": "virtual", "mechanisms": [
        { "mechanism": "mains_hum", "parameters": { "amplitude_nm": 0.2, "frequency_hz": 50.0 } }
    ] }"#;
    let RigFile::Virtual(hums) = RigFile::parse(rig, Path::new("rig.json")).unwrap();
    let study = study(3, |_| {});
    let mut unit = study.unit(1);
    let UnitSource::Virtual { setup, .. } = &mut unit.source else { panic!("virtual") };
    *setup = &hums;
    let error = simulate_unit(&unit, SessionStorage::Memory).unwrap_err();
    assert!(matches!(error, UnitError::EveryTrialFails(_)), "{error}");
    let told = error.to_string();
    assert!(told.contains("100 trials in a row failed") && told.contains("gate"), "{told}");
}
