//! `ramphold report`: a page of what there is, which says what there is not.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use serde_json::{Value, json};

/// A folder with a session that was run and fitted.
struct Desk(tempfile::TempDir);

impl Desk {
    fn new() -> Self {
        let desk = Self(tempfile::tempdir().unwrap());
        let protocol = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/quick.json");
        desk.ramphold(&["run", protocol, "--seed", "3", "--out", "s"]).code(0);
        desk
    }

    fn ramphold(&self, arguments: &[&str]) -> Assert {
        Command::cargo_bin("ramphold").unwrap().current_dir(self.0.path()).args(arguments).assert()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn page(&self) -> String {
        fs::read_to_string(self.path("s/results/report.html")).unwrap()
    }
}

fn stderr(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
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
    serde_json::from_str(include_str!("../fixtures/report/diagnosis.json")).unwrap()
}

#[test]
fn a_run_ends_with_a_report_and_every_figure_as_a_file() {
    let desk = Desk::new();
    let names = figures(&desk.path("s/results"));
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
        assert!(desk.page().contains(&format!("<figure id=\"{name}\">")));
    }
    for name in names {
        let svg = fs::read_to_string(desk.path("s/results/figures").join(&name)).unwrap();
        assert!(
            svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n") && !svg.contains("NaN"),
            "{name}"
        );
        assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count(), "{name}");
    }
}

#[test]
fn the_page_needs_nothing_from_outside_and_is_the_same_when_made_again() {
    let desk = Desk::new();
    let page = desk.page();
    assert!(page.contains("Content-Security-Policy") && page.contains("default-src 'none'"));
    for outside in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside} is in the page");
    }
    desk.ramphold(&["report", "s"]).code(0).stdout("s/results/report.html\n");
    assert!(desk.page() == page);
}

#[test]
fn without_fit_and_diagnosis_there_is_a_report_of_what_there_is() {
    let desk = Desk::new();
    fs::remove_dir_all(desk.path("s/results")).unwrap();
    fs::create_dir(desk.path("s/results")).unwrap();
    let told = stderr(&desk.ramphold(&["report", "s"]).code(0));
    for part in ["There is no fit yet", "There is no diagnosis yet", "ramphold fit", "ramphold diagnose"] {
        assert!(told.contains(part) && desk.page().contains(part), "{part}");
    }
    assert_eq!(figures(&desk.path("s/results")).iter().filter(|name| name.starts_with("trial-")).count(), 8);
}

#[test]
fn a_fit_elsewhere_has_its_report_there() {
    let desk = Desk::new();
    desk.ramphold(&["fit", "s", "--out", "other"]).code(0);
    assert!(desk.path("other/report.html").exists());
    assert_eq!(figures(&desk.path("other")), figures(&desk.path("s/results")));
}

#[test]
fn a_result_that_cannot_be_read_is_refused_with_file_line_and_field() {
    let desk = Desk::new();
    let fit = desk.path("s/results/fit.json");
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
        let told = stderr(&desk.ramphold(&["report", "s"]).code(2));
        assert!(parts.iter().all(|part| told.contains(part)) && told.contains("ramphold fit"), "{told}");
    }
    fs::write(&fit, good).unwrap();
    fs::write(desk.path("s/results/diagnosis.json"), "{\n\"verdict\": }").unwrap();
    let told = stderr(&desk.ramphold(&["report", "s"]).code(2));
    assert!(told.contains("diagnosis.json, line 2") && told.contains("ramphold diagnose"), "{told}");
}

#[test]
fn a_diagnosis_is_shown_and_what_it_does_not_say_is_said() {
    let desk = Desk::new();
    let file = desk.path("s/results/diagnosis.json");
    fs::write(&file, diagnosis().to_string()).unwrap();
    desk.ramphold(&["report", "s"]).code(0);
    let page = desk.page();
    for part in ["channel_skew", "0.000810 [0.000750, 0.000880]", "after the extension", "k_srs_nm_per_rad"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("does not say"));

    let mut partial = diagnosis();
    partial["causes"][0]["indistinguishable"] = json!(["lever_stiffness", "torque_gain"]);
    partial["causes"][0].as_object_mut().unwrap().remove("gain");
    partial.as_object_mut().unwrap().remove("misfit");
    partial["residual_map"]["conditions"][0]["mean_nm"] = json!("none");
    partial["residual_term"] = json!({ "form": "<b>" });
    fs::write(&file, partial.to_string()).unwrap();
    desk.ramphold(&["report", "s"]).code(0);
    let page = desk.page();
    for part in [
        "lever_stiffness, torque_gain",
        "diagnosis.json does not say: misfit.statistic; misfit.p_value; causes.0.gain.held_out_rmse_ratio.value",
        "residual_map (conditions[0].mean_nm is no list of numbers); the map below is of the fit alone",
        "&lt;b&gt;",
    ] {
        assert!(page.contains(part), "{part}");
    }

    fs::write(&file, "[]").unwrap();
    desk.ramphold(&["report", "s"]).code(0);
    assert!(desk.page().contains("does not say: verdict;"));
}

#[test]
fn words_of_a_session_cannot_become_a_script() {
    let desk = Desk::new();
    let file = desk.path("s/session.json");
    let text = fs::read_to_string(&file).unwrap().replace("\"V00\"", "\"<script>alert(1)</script>\"");
    fs::write(&file, text).unwrap();
    desk.ramphold(&["report", "s"]).code(0);
    assert!(!desk.page().contains("<script>alert") && desk.page().contains("&lt;script&gt;alert"));
}

#[test]
fn the_lateness_of_a_real_rig_is_drawn_where_there_is_one() {
    let desk = Desk::new();
    let lateness = json!({ "p50_us": 25, "p99_us": 53, "p999_us": 148, "longest_us": 826, "buckets": [[32, 900], [64, 90]] });
    fs::write(desk.path("s/bus.json"), json!({ "lateness": lateness }).to_string()).unwrap();
    desk.ramphold(&["report", "s"]).code(0);
    assert!(desk.page().contains("99 % within 53 µs, the latest 826 µs"));
    assert!(desk.path("s/results/figures/session-lateness.svg").exists());
}

#[test]
fn a_folder_that_is_no_session_is_refused() {
    let desk = Desk::new();
    fs::create_dir(desk.path("empty")).unwrap();
    assert_eq!(desk.ramphold(&["report", "none"]).get_output().status.code(), Some(2));
    assert_eq!(desk.ramphold(&["report", "empty"]).get_output().status.code(), Some(2));
}
