//! `ramphold cohort` and `ramphold power`: the same bytes however the work is cut up, and what becomes of bad input.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use crate::workspace::{Workspace, copy_folder, files};

impl Workspace {
    /// A folder with a study of `count` virtual subjects and the quick protocol.
    fn with_study(count: u32) -> Self {
        let workspace = Self::new();
        fs::write(workspace.path("quick.json"), include_str!("../../protocols/quick.json")).unwrap();
        workspace.write("study.json", &study(count));
        workspace
    }

    fn on_threads(&self, threads: &str, arguments: &[&str]) -> Output {
        self.ramphold(arguments).env("RAYON_NUM_THREADS", threads).output().unwrap()
    }

    #[track_caller]
    fn succeed(&self, arguments: &[&str]) -> Output {
        let output = self.on_threads("2", arguments);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    #[track_caller]
    fn refuse(&self, code: i32, arguments: &[&str], parts: &[&str]) {
        let output = self.on_threads("2", arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in: {message}");
        }
    }
}

fn study(count: u32) -> Value {
    json!({
        "format": "ramphold-study/1",
        "name": "a test",
        "units_per_part": 2,
        "persons": {
            "kind": "virtual", "count": count, "protocol": "quick.json",
            "spread": { "short_range_stiffness": { "level": 0.1 } },
        },
    })
}

#[track_caller]
fn assert_same(one: &Path, other: &Path) {
    let (one, other) = (files(one), files(other));
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(*bytes == other[name], "{name} differs");
    }
}

#[test]
fn a_study_has_the_rows_of_its_sessions_fits() {
    let workspace = Workspace::with_study(3);
    let output = workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "out", "--keep"]);
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert!(stdout.contains("3 subjects, 2 velocities x 2 torques"), "{stdout}");
    let table = fs::read_to_string(workspace.path("out/study.csv")).unwrap();
    let mut rows: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in table.lines().skip(1) {
        let (subject, row) = line.split_once(',').unwrap();
        let row = row.strip_suffix(",1,session,false").expect("session, fit and excluded");
        rows.entry(subject.to_owned()).or_default().push(row.to_owned());
    }
    assert_eq!(rows.keys().collect::<Vec<_>>(), ["P0001", "P0002", "P0003"]);
    for (subject, rows) in rows {
        let session = format!("out/sessions/{subject}-1");
        workspace.succeed(&["verify", &session]);
        workspace.succeed(&["fit", &session]);
        let fit = fs::read_to_string(workspace.path(&session).join("results/fit.csv")).unwrap();
        let mut lines = fit.lines();
        let header = lines.next().unwrap();
        assert_eq!(table.lines().next().unwrap(), format!("subject,{header},session,fit,excluded"));
        assert_eq!(lines.collect::<Vec<_>>(), rows, "{subject}");
    }
}

#[test]
fn a_study_has_the_same_bytes_whatever_the_threads_the_interruptions_and_the_order_of_its_parts() {
    let workspace = Workspace::with_study(5);
    assert!(
        workspace.on_threads("1", &["cohort", "study.json", "--seed", "7", "--out", "one"]).status.success()
    );
    workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "two"]);
    assert_same(&workspace.path("one"), &workspace.path("two"));

    // What is done is not done again; what is lost or damaged is.
    fs::remove_file(workspace.path("two/parts/part-000001.csv")).unwrap();
    let damaged = workspace.path("two/parts/part-000002.csv");
    let text = fs::read_to_string(&damaged).unwrap();
    fs::write(&damaged, &text[..text.len() - 30]).unwrap();
    fs::remove_file(workspace.path("two/study.csv")).unwrap();
    let untouched = fs::metadata(workspace.path("two/parts/part-000000.csv")).unwrap().modified().unwrap();
    let output = workspace.succeed(&["cohort", "study.json", "--out", "two", "--resume"]);
    assert!(String::from_utf8(output.stderr).unwrap().contains("2 sessions were done before"));
    assert_eq!(
        fs::metadata(workspace.path("two/parts/part-000000.csv")).unwrap().modified().unwrap(),
        untouched
    );
    assert_same(&workspace.path("one"), &workspace.path("two"));

    // As the workers of a cluster do it: each part by a program of its own, some twice, the last first.
    workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "three", "--plan"]);
    for (part, was_done) in [("2", false), ("0", false), ("2", true), ("1", false)] {
        let output =
            workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "three", "--part", part]);
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(told["was_done"], was_done, "{told}");
        assert_eq!(told["failed"], 0);
    }
    workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "three", "--resume"]);
    assert_same(&workspace.path("one"), &workspace.path("three"));

    workspace.refuse(
        2,
        &["cohort", "study.json", "--seed", "7", "--out", "two"],
        &["contains this study", "--resume"],
    );
    workspace.refuse(
        2,
        &["cohort", "study.json", "--seed", "8", "--out", "two", "--resume"],
        &["contains another study"],
    );
    workspace.refuse(2, &["cohort", "study.json", "--seed", "7", "--out", ".", "--resume"], &["not empty"]);
    workspace.refuse(
        2,
        &["cohort", "study.json", "--seed", "7", "--out", "three", "--part", "3"],
        &["expected 0 to 2"],
    );
    workspace.succeed(&["cohort", "one/study.csv", "--out", "again"]);
    for table in ["means.csv", "anova.csv", "trends.csv", "contrasts.csv"] {
        let read = |folder: &str| fs::read(workspace.path(folder).join(table)).unwrap();
        assert!(read("one") == read("again"), "{table} differs");
    }
    workspace.refuse(2, &["cohort", "one/study.csv", "--out", "again"], &["contains the tables"]);
}

#[test]
fn a_study_ends_with_a_page_which_report_makes_again() {
    let workspace = Workspace::with_study(3);
    workspace.succeed(&["cohort", "study.json", "--seed", "7", "--out", "out"]);
    let page = fs::read_to_string(workspace.path("out/report.html")).unwrap();
    for part in [
        "What the study found",
        "Every session and every subject is in the tables.",
        "partial η²",
        "k_srs by torque, mean over velocities",
        "k_srs by velocity, mean over torques",
        "By condition: mean ± SD over subjects",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let figure = fs::read_to_string(workspace.path("out/figures/study-k-srs.svg")).unwrap();
    assert_eq!(figure.matches("class=\"line thin").count(), 2 * 3, "a curve for each subject in both panels");
    fs::remove_file(workspace.path("out/report.html")).unwrap();
    let told = String::from_utf8(workspace.succeed(&["report", "out"]).stdout).unwrap();
    assert_eq!(told, "out/report.html\n");
    assert!(fs::read_to_string(workspace.path("out/report.html")).unwrap() == page);

    // From the table alone, the same means.
    workspace.succeed(&["cohort", "out/study.csv", "--out", "again"]);
    let again = fs::read_to_string(workspace.path("again/report.html")).unwrap();
    let means = |page: &str| {
        page.split("<section id=\"means\">").nth(1).unwrap().split("</section>").next().unwrap().to_owned()
    };
    assert!(means(&again) == means(&page));

    workspace.refuse(2, &["report", "out", "--beside", "x"], &["--beside", "is a study"]);
    fs::remove_file(workspace.path("out/study.json")).unwrap();
    workspace.refuse(2, &["report", "out"], &["not finished", "--resume"]);
}

/// A workspace with three measured sessions in `measured`.
fn measured() -> Workspace {
    let workspace = Workspace::with_study(1);
    for (subject, seed) in [("S01", "1"), ("S02", "2"), ("S03", "3")] {
        let out = format!("measured/{subject}");
        workspace.succeed(&["run", "quick.json", "--subject", subject, "--seed", seed, "--out", &out]);
    }
    workspace.write(
        "study.json",
        &json!({
            "format": "ramphold-study/1", "name": "measured",
            "persons": { "kind": "measured", "folders": ["measured"] },
        }),
    );
    workspace
}

#[test]
fn measured_sessions_are_fitted_and_one_that_is_broken_is_told_of() {
    let workspace = measured();
    workspace.succeed(&["cohort", "study.json", "--seed", "1", "--out", "whole"]);
    let whole = fs::read_to_string(workspace.path("whole/study.csv")).unwrap();
    let table = fs::read_to_string(workspace.path("measured/S02/results/fit.csv")).unwrap();
    for row in table.lines().skip(1) {
        assert!(whole.contains(&format!("S02,{row},1,")), "{row}");
    }
    let record = workspace.path("measured/S03/trials/trial-002.csv");
    fs::write(&record, fs::read_to_string(&record).unwrap().replacen("0.0000,", "NaN,", 1)).unwrap();
    workspace.refuse(
        1,
        &["cohort", "study.json", "--seed", "1", "--out", "broken"],
        &["S03, session 1: ", "trial-002.csv, line 2, column t_s", "1 problems exclude subjects"],
    );
    let broken = fs::read_to_string(workspace.path("broken/study.csv")).unwrap();
    assert_eq!(
        broken,
        whole.lines().filter(|line| !line.starts_with("S03")).fold(String::new(), |t, l| t + l + "\n")
    );
    let results: Value =
        serde_json::from_slice(&fs::read(workspace.path("broken/study.json")).unwrap()).unwrap();
    assert_eq!((&results["persons"], &results["problem_count"]), (&json!(2), &json!(1)));
    assert!(
        fs::read_to_string(workspace.path("broken/anova.csv"))
            .unwrap()
            .contains("k_srs_nm_per_rad,velocity,2,")
    );
}

/// It was in all means with a VAF of -815.
#[test]
fn a_session_that_the_model_does_not_describe_is_in_no_table() {
    let workspace = measured();
    let about = workspace.path("measured/S03/session.json");
    let mut card: Value = serde_json::from_slice(&fs::read(&about).unwrap()).unwrap();
    card["rig"]["lever"]["inertia_kg_m2"] = json!(0.16);
    card["rig"]["lever"]["stiffness_nm_per_rad"] = json!(9000.0);
    fs::write(&about, card.to_string()).unwrap();
    for fit in ["session", "independent"] {
        let mut study: Value =
            serde_json::from_slice(&fs::read(workspace.path("study.json")).unwrap()).unwrap();
        study["fit"] = json!(fit);
        workspace.write("study.json", &study);
        workspace.refuse(
            1,
            &["cohort", "study.json", "--seed", "1", "--out", fit],
            &["S03, session 1: the model does not describe the session: the best VAF"],
        );
        assert!(!fs::read_to_string(workspace.path(&format!("{fit}/study.csv"))).unwrap().contains("S03"));
    }
}

/// It made five subjects of four, and the effects more significant than they are.
#[test]
fn a_session_under_two_names_counts_once() {
    let workspace = measured();
    copy_folder(&workspace.path("measured/S02"), &workspace.path("measured/S09"));
    let about = workspace.path("measured/S09/session.json");
    fs::write(&about, fs::read_to_string(&about).unwrap().replace("\"S02\"", "\"S09\"")).unwrap();
    workspace.refuse(
        1,
        &["cohort", "study.json", "--seed", "1", "--out", "out"],
        &["S09: the first record in", "is that of S02, byte by byte"],
    );
    let means = fs::read_to_string(workspace.path("out/means.csv")).unwrap();
    assert!(means.contains("k_srs_nm_per_rad,1.3,0.9,3,"), "{means}");
}

#[test]
fn a_subject_whose_name_was_spelt_in_two_ways_does_not_count_as_two() {
    let workspace = measured();
    workspace.succeed(&["run", "quick.json", "--subject", "s02", "--seed", "5", "--out", "measured/S04"]);
    workspace.refuse(
        1,
        &["cohort", "study.json", "--seed", "1", "--out", "out"],
        &["s02: differs from the subject S02 in nothing but case or separators", "same subject.id"],
    );
    let means = fs::read_to_string(workspace.path("out/means.csv")).unwrap();
    assert!(means.contains("k_srs_nm_per_rad,1.3,0.9,3,"), "{means}");
}

#[test]
fn a_person_who_was_measured_otherwise_or_twice_is_in_study_csv_and_in_no_other_table() {
    let workspace = measured();
    let longer = include_str!("../../protocols/quick.json")
        .replace("\"rise_time_s\": 0.020", "\"rise_time_s\": 0.025");
    fs::write(workspace.path("longer.json"), longer).unwrap();
    workspace.succeed(&["run", "longer.json", "--subject", "S04", "--seed", "4", "--out", "measured/S04"]);
    workspace.succeed(&["run", "quick.json", "--subject", "S01", "--seed", "5", "--out", "measured/S05"]);
    workspace.refuse(
        1,
        &["cohort", "study.json", "--seed", "1", "--out", "out"],
        &[
            "S04: measured with another protocol (ramp, compared with S01)",
            "S01: appears twice (",
            "measured/S05",
        ],
    );
    let table = fs::read_to_string(workspace.path("out/study.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.starts_with("S04,")).count(), 8);
    assert_eq!(table.lines().filter(|line| line.starts_with("S01,")).count(), 16);
    let page = fs::read_to_string(workspace.path("out/report.html")).unwrap();
    assert!(
        page.contains("S04: measured with another protocol") && page.contains("S01: appears twice"),
        "the page says why"
    );
    let means = fs::read_to_string(workspace.path("out/means.csv")).unwrap();
    assert!(means.contains("k_srs_nm_per_rad,1.3,0.9,3,"), "{means}");

    // They stay out when the tables are made of study.csv again.
    workspace.refuse(
        1,
        &["cohort", "out/study.csv", "--out", "again"],
        &["S01, session 2: is excluded in study.csv", "S04, session 1: is excluded in study.csv"],
    );
    assert_eq!(fs::read_to_string(workspace.path("again/means.csv")).unwrap(), means);

    // The same two sessions as repeated measurements of one person.
    workspace.write(
        "study.json",
        &json!({
            "format": "ramphold-study/1", "name": "measured",
            "persons": { "kind": "measured", "folders": ["measured/S01", "measured/S02", "measured/S05"], "repeated": true },
        }),
    );
    let output = workspace.succeed(&["cohort", "study.json", "--seed", "1", "--out", "retest"]);
    assert!(String::from_utf8(output.stdout).unwrap().starts_with("2 subjects"));
    assert!(workspace.path("retest/reliability.csv").exists());
}

#[test]
fn one_person_is_too_few_for_statistics_and_has_means() {
    let workspace = Workspace::with_study(1);
    workspace.refuse(
        1,
        &["cohort", "study.json", "--seed", "1", "--out", "out"],
        &["statistics need at least 2"],
    );
    assert!(fs::read_to_string(workspace.path("out/means.csv")).unwrap().lines().count() > 30);
    assert_eq!(fs::read_to_string(workspace.path("out/anova.csv")).unwrap().lines().count(), 1);
}

#[test]
fn a_study_file_that_is_wrong_is_refused_before_anything_is_written() {
    let workspace = Workspace::with_study(2);
    workspace.write("bad.json", &json!({ "format": "ramphold-study/1", "name": "bad" }));
    workspace.refuse(
        2,
        &["cohort", "bad.json", "--out", "out"],
        &["bad.json, line 4", "missing field `persons`"],
    );
    workspace.refuse(2, &["cohort", "none.json", "--out", "out"], &["none.json", "cannot be read"]);
    workspace.refuse(2, &["power", "study.json", "--difference", "k_srs"], &["expected one of"]);
    workspace.refuse(
        2,
        &["power", "study.json", "--change", "x_t=0.002", "--repetitions", "3"],
        &["--repetitions 3"],
    );
    workspace.refuse(2, &["power", "study.json"], &["--difference"]);
    workspace.refuse(
        2,
        &["power", "study.json", "--change", "x_t=0.002", "--limit", "time"],
        &["cannot be used with"],
    );
    workspace.refuse(
        2,
        &["power", "study.json", "--mechanism", "ghost"],
        &["\"ghost\" is not in the catalogue"],
    );
    workspace.refuse(
        2,
        &["power", "study.json", "--mechanism", "joint_damping:b=1"],
        &["expected finite numbers for"],
    );
    assert!(!workspace.path("out").exists());
}

#[test]
fn power_writes_curves_as_table_and_figure_the_same_every_time() {
    let workspace = Workspace::with_study(1);
    let arguments = |out| {
        [
            "power",
            "study.json",
            "--difference",
            "k_srs=-0.3",
            "--pool",
            "4",
            "--studies",
            "50",
            "--persons",
            "3,6",
            "--repetitions",
            "1,2",
            "--seed",
            "1",
            "--out",
            out,
        ]
    };
    let output = workspace.succeed(&arguments("one"));
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(
        told.contains("2 repetitions: power 0.8 takes") && told.contains("subjects in each group"),
        "{told}"
    );
    let table = fs::read_to_string(workspace.path("one/power.csv")).unwrap();
    assert_eq!(table.lines().count(), 5, "{table}");
    let figure = fs::read_to_string(workspace.path("one/power.svg")).unwrap();
    assert!(figure.starts_with("<svg") && figure.contains(">subjects in each group</text>"));
    // Both axes begin at zero, with nothing before it.
    let numbers = figure.split("class=\"tick\"").skip(1).map(|own| own.split(['>', '<']).nth(1).unwrap());
    assert!(numbers.clone().filter(|own| *own == "0" || *own == "0.0").count() == 2, "{figure}");
    let first_at = figure.split("text-anchor=\"middle\" x=\"").nth(1).unwrap();
    assert!(
        first_at.starts_with("56.0\""),
        "the first number of the axis is not at its beginning: {first_at}"
    );
    assert!(workspace.on_threads("1", &arguments("two")).status.success());
    assert_same(&workspace.path("one"), &workspace.path("two"));
    workspace.refuse(2, &arguments("one"), &["not overwritten"]);
    let output = workspace.succeed(&[
        "power",
        "study.json",
        "--limit",
        "angle",
        "--pool",
        "4",
        "--studies",
        "20",
        "--persons",
        "3",
        "--repetitions",
        "2",
        "--seed",
        "1",
        "--out",
        "limit",
    ]);
    assert!(String::from_utf8(output.stdout).unwrap().contains("undecided"));
}
