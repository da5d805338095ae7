//! `ramphold report`: a page of what there is, which says what there is not.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use sha2::Digest;

use crate::workspace::{QUICK, Workspace, copy_folder};

impl Workspace {
    /// A folder with a session that was run and fitted.
    fn with_session() -> Self {
        let workspace = Self::new();
        workspace.call(0, &["run", QUICK, "--seed", "3", "--out", "s"]);
        workspace
    }

    fn page(&self) -> String {
        fs::read_to_string(self.path("s/results/report.html")).unwrap()
    }
}

fn figures(results: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(results.join("figures"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The example of the format, with a residual map.
fn diagnosis() -> Value {
    serde_json::from_str(include_str!("../../fixtures/report/diagnosis.json")).unwrap()
}

#[test]
fn a_run_ends_with_a_report_and_every_figure_as_a_file() {
    let workspace = Workspace::with_session();
    let names = figures(&workspace.path("s/results"));
    assert_eq!(names.iter().filter(|name| name.starts_with("trial-")).count(), 8);
    for name in [
        "fig-3-stiffness",
        "fig-5-parameters",
        "fig-6-balance",
        "residual-map",
        "session-gates",
        "session-order",
    ] {
        assert!(names.contains(&format!("{name}.svg")), "{name} is not among {names:?}");
        assert!(workspace.page().contains(&format!("<figure id=\"{name}\">")));
    }
    for name in names {
        let svg = fs::read_to_string(workspace.path("s/results/figures").join(&name)).unwrap();
        assert!(
            svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n") && !svg.contains("NaN"),
            "{name}"
        );
        assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count(), "{name}");
    }
}

/// A link leads to the first of several places of the same name.
#[test]
fn no_two_parts_of_the_page_have_the_same_name() {
    let workspace = Workspace::with_session();
    let page = workspace.page();
    let mut names: Vec<&str> =
        page.split(" id=\"").skip(1).filter_map(|part| part.split('"').next()).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert!(count > 10 && names.len() == count, "{names:?}");
}

#[test]
fn the_page_needs_nothing_from_outside_and_is_the_same_when_made_again() {
    let workspace = Workspace::with_session();
    let page = workspace.page();
    assert!(page.contains("Content-Security-Policy") && page.contains("default-src 'none'"));
    // Escaping is not all that protects the page: only its own script and style are allowed, by their sums.
    assert!(!page.contains("unsafe-inline"));
    for (tag, source) in [("script", "script-src"), ("style", "style-src")] {
        let text = page
            .split(&format!("<{tag}>"))
            .nth(1)
            .and_then(|rest| rest.split(&format!("</{tag}>")).next())
            .unwrap();
        let sum = data_encoding::BASE64.encode(&sha2::Sha256::digest(text));
        assert!(page.contains(&format!("{source} 'sha256-{sum}'")), "{tag}: {sum}");
    }
    for outside in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside} is in the page");
    }
    assert_eq!(workspace.call(0, &["report", "s"]).0, "s/results/report.html\n");
    assert!(workspace.page() == page);
}

#[test]
fn without_fit_and_diagnosis_there_is_a_report_of_what_there_is() {
    let workspace = Workspace::with_session();
    fs::remove_dir_all(workspace.path("s/results")).unwrap();
    fs::create_dir(workspace.path("s/results")).unwrap();
    let told = workspace.call(0, &["report", "s"]).1;
    for part in ["There is no fit yet", "There is no diagnosis yet", "ramphold fit", "ramphold diagnose"] {
        assert!(told.contains(part) && workspace.page().contains(part), "{part}");
    }
    assert_eq!(
        figures(&workspace.path("s/results")).iter().filter(|name| name.starts_with("trial-")).count(),
        8
    );
}

#[test]
fn a_fit_elsewhere_has_its_report_there() {
    let workspace = Workspace::with_session();
    workspace.call(0, &["fit", "s", "--out", "other"]);
    assert!(workspace.path("other/report.html").exists());
    assert_eq!(figures(&workspace.path("other")), figures(&workspace.path("s/results")));
}

#[test]
fn a_result_that_cannot_be_read_is_refused_with_file_line_and_field() {
    let workspace = Workspace::with_session();
    let fit = workspace.path("s/results/fit.json");
    let good = fs::read_to_string(&fit).unwrap();
    for (text, parts) in [
        ("{".to_owned(), ["fit.json, line 1", "EOF"]),
        (
            good.replace("\"velocity_rad_s\": 1.3", "\"velocity_rad_s\": \"fast\""),
            ["trials[0].velocity_rad_s", "fast"],
        ),
        (good.replace("ramphold-fit/1", "ramphold-fit/9"), ["field format", "ramphold-fit/9"]),
    ] {
        fs::write(&fit, text).unwrap();
        let told = workspace.call(2, &["report", "s"]).1;
        assert!(parts.iter().all(|part| told.contains(part)) && told.contains("ramphold fit"), "{told}");
    }
    fs::write(&fit, good).unwrap();
    fs::write(workspace.path("s/results/diagnosis.json"), "{\n\"verdict\": }").unwrap();
    let told = workspace.call(2, &["report", "s"]).1;
    assert!(told.contains("diagnosis.json, line 2") && told.contains("ramphold diagnose"), "{told}");
}

#[test]
fn a_diagnosis_is_shown_and_what_it_does_not_say_is_said() {
    let workspace = Workspace::with_session();
    let file = workspace.path("s/results/diagnosis.json");
    fs::write(&file, diagnosis().to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    for part in ["channel_skew", "delay 0.810 ms [0.750, 0.880]", "with the causes in the model"] {
        assert!(page.contains(part), "{part}");
    }
    // The wrist is extended; a model is not.
    assert!(!page.to_lowercase().contains("extension"));
    assert!(!page.contains("Missing in diagnosis.json"));

    let mut partial = diagnosis();
    partial["causes"][0]["indistinguishable"] = json!(["lever_stiffness"]);
    partial["causes"][0]["alternatives"] = json!([{
        "mechanism": "lever_stiffness", "class": "rig", "probability": 0.2,
        "parameters": { "stiffness_nm_per_rad": { "value": 800.0, "low": 790.0, "high": 810.0 } },
        "parameter_shift": { "k_srs_nm_per_rad": { "before": 19.2, "after": 12.3 } },
    }]);
    partial["causes"][0].as_object_mut().unwrap().remove("gain");
    partial.as_object_mut().unwrap().remove("misfit");
    partial["residual_map"]["conditions"][0]["mean_nm"] = json!("none");
    partial["residual_term"] = json!({ "form": "<b>" });
    fs::write(&file, partial.to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    for part in [
        "with lever_stiffness",
        "Missing in diagnosis.json: misfit.statistic; misfit.p_value; causes.0.gain.held_out_rmse_ratio.value",
        "residual_map (conditions[0].mean_nm is not a list of numbers); the map below is of the fit alone",
        "&lt;b&gt;",
    ] {
        assert!(page.contains(part), "{part}");
    }

    fs::write(&file, "[]").unwrap();
    workspace.call(0, &["report", "s"]);
    assert!(workspace.page().contains("Missing in diagnosis.json: verdict;"));
}

#[test]
fn the_page_begins_with_its_verdict_and_marks_what_is_biased() {
    let workspace = Workspace::with_session();
    let page = workspace.page();
    assert!(page.contains("It is not known whether the model is adequate."), "without a diagnosis");
    let first_section =
        |page: &str| page.split("<section id=\"").nth(1).unwrap().split('"').next().unwrap().to_owned();
    assert_eq!(first_section(&page), "verdict");
    assert!(!page.contains('†'), "nothing was found biased");

    let file = workspace.path("s/results/diagnosis.json");
    let mut ambiguous = diagnosis();
    ambiguous["verdict"] = json!("ambiguous");
    ambiguous["causes"][0]["indistinguishable"] = json!(["lever_stiffness"]);
    ambiguous["causes"][0]["alternatives"] = json!([{
        "mechanism": "lever_stiffness", "class": "rig", "probability": 0.2,
        "parameters": { "stiffness_nm_per_rad": { "value": 800.0, "low": 790.0, "high": 810.0 } },
        "parameter_shift": { "k_srs_nm_per_rad": { "before": 19.2, "after": 12.3 } },
    }]);
    fs::write(&file, ambiguous.to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    let verdict = page.split("<section id=\"").nth(1).unwrap();
    for part in [
        "The model is not adequate",
        "with channel_skew",
        ">18.1<",
        "stiffness 800 N m/rad [790, 810]",
        ">12.3<",
    ] {
        assert!(verdict.contains(part), "{part} is not in {verdict}");
    }
    for part in
        ["k_srs (N m/rad)\u{a0}†, short range stiffness", "k_srs\u{a0}†: short range stiffness", "† Biased"]
    {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("x_e (mrad)\u{a0}†"), "the diagnosis says nothing of x_e");

    let mut adequate = diagnosis();
    adequate["verdict"] = json!("adequate");
    adequate["causes"] = json!([]);
    fs::write(&file, adequate.to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    assert!(page.contains("The model is adequate.") && !page.contains('†'));
    // Two equal maps say nothing.
    let map = page.split("<figure id=\"residual-map\">").nth(1).unwrap().split("</figure>").next().unwrap();
    assert_eq!(map.matches("<svg class=\"panel\"").count(), 1);
}

#[test]
fn a_trial_that_was_judged_after_the_session_is_listed_with_who_and_why() {
    let workspace = Workspace::with_session();
    workspace.call(0, &["trials", "s", "--reject", "2", "--because", "hand slipped", "--by", "Ada"]);
    workspace.call(0, &["trials", "s", "--reject", "3", "--because", "cough", "--by", "Ada"]);
    workspace.call(0, &["trials", "s", "--accept", "3", "--because", "no, it is fine", "--by", "Bo"]);
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    for part in [
        "rejected afterwards by Ada",
        ": hand slipped",
        "accepted again",
        "ok afterwards by Bo",
        "no, it is fine",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn notes_stand_apart_from_incidents_and_emg_has_its_panel_and_its_section() {
    let workspace = Workspace::with_session();
    let page = workspace.page();
    assert!(page.contains("E  EMG, rectified") && page.contains("<section id=\"emg\">"));
    assert!(page.contains("motor angle (mrad)") && !page.contains("angle (rad)"), "one unit for angles");
    let notes = workspace.path("noted");
    copy_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/session-with-notes"), &notes);
    workspace.call(0, &["report", "noted"]);
    let page = fs::read_to_string(notes.join("results/report.html")).unwrap();
    assert!(page.contains("Notes of the operator") && page.contains("electrodes checked"));
    assert!(!page.contains("note: electrodes checked"));
}

#[test]
fn words_of_a_session_cannot_become_a_script() {
    let workspace = Workspace::with_session();
    let file = workspace.path("s/session.json");
    let text = fs::read_to_string(&file).unwrap().replace("\"V00\"", "\"<script>alert(1)</script>\"");
    fs::write(&file, text).unwrap();
    workspace.call(0, &["report", "s"]);
    assert!(!workspace.page().contains("<script>alert") && workspace.page().contains("&lt;script&gt;alert"));
}

#[test]
fn the_lateness_of_a_real_rig_is_drawn_where_there_is_one() {
    let workspace = Workspace::with_session();
    let lateness = json!({ "p50_us": 25, "p99_us": 53, "p999_us": 148, "longest_us": 826, "buckets": [[32, 900], [64, 90]] });
    fs::write(workspace.path("s/bus.json"), json!({ "lateness": lateness }).to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    assert!(workspace.page().contains("99th percentile 53 µs, maximum 826 µs"));
    assert!(workspace.path("s/results/figures/session-lateness.svg").exists());
}

#[test]
fn a_folder_that_is_no_session_is_refused() {
    let workspace = Workspace::with_session();
    fs::create_dir(workspace.path("empty")).unwrap();
    workspace.call(2, &["report", "none"]);
    workspace.call(2, &["report", "empty"]);
}
