//! `ramphold report`: a page of what there is, which says what there is not.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use sha2::Digest;

use crate::workspace::{QUICK, Workspace};

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
    for part in ["channel_skew", "0.000810 [0.000750, 0.000880]", "after the extension", "k_srs_nm_per_rad"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("Missing in diagnosis.json"));

    let mut partial = diagnosis();
    partial["causes"][0]["indistinguishable"] = json!(["lever_stiffness", "torque_gain"]);
    partial["causes"][0].as_object_mut().unwrap().remove("gain");
    partial.as_object_mut().unwrap().remove("misfit");
    partial["residual_map"]["conditions"][0]["mean_nm"] = json!("none");
    partial["residual_term"] = json!({ "form": "<b>" });
    fs::write(&file, partial.to_string()).unwrap();
    workspace.call(0, &["report", "s"]);
    let page = workspace.page();
    for part in [
        "lever_stiffness, torque_gain",
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
