//! The diagnosis: what the model gets wrong, and which mechanisms explain it.

use serde_json::Value;

use super::ReportSection;
use crate::report::figures::{ResidualMap, law, residual_map};
use crate::report::input::ReportInput;
use crate::report::scale::{escape, significant};
use crate::report::table::{Cell, HtmlTable};
use crate::wrist::mechanisms::CATALOGUE;

/// The section; it also lists what is missing in the file.
pub fn diagnosis(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("diagnosis", "Diagnosis: what the model gets wrong");
    let Some(file) = &input.diagnosis else {
        section.absent("There is no diagnosis yet. Run: ramphold diagnose SESSION");
        if let Some(figure) = residual_map(&ResidualMap::of_fit(&input.traces)) {
            section.figure(figure);
        }
        return section;
    };
    let mut file = File { root: file, absent: Vec::new() };
    verdict(&mut section, &mut file);
    causes(&mut section, &mut file);
    let map = match ResidualMap::of_diagnosis(&file.root["residual_map"]) {
        Ok(map) => map,
        Err(problem) => {
            file.absent.push(format!("residual_map ({problem}); the map below is of the fit alone"));
            ResidualMap::of_fit(&input.traces)
        }
    };
    if let Some(figure) = residual_map(&map) {
        section.figure(figure);
    }
    if let Some(law) = file.root.pointer("/laws/elastic_limit/says").and_then(Value::as_str) {
        section.paragraph(&format!("Elastic limit: {law}."));
    }
    for remark in file.root["remarks"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        section.paragraph(&format!("Note: {remark}."));
    }
    if !file.absent.is_empty() {
        section.absent(&format!("Missing in diagnosis.json: {}.", file.absent.join("; ")));
    }
    section
}

/// The file, and the fields that are missing in it.
struct File<'a> {
    root: &'a Value,
    absent: Vec<String>,
}

impl<'a> File<'a> {
    fn number(&mut self, path: &str) -> Option<f64> {
        let found = self.root.pointer(path).and_then(Value::as_f64);
        if found.is_none() {
            self.absent.push(path.trim_start_matches('/').replace('/', "."));
        }
        found
    }

    fn text(&mut self, path: &str) -> &'a str {
        match self.root.pointer(path).and_then(Value::as_str) {
            Some(text) => text,
            None => {
                self.absent.push(path.trim_start_matches('/').replace('/', "."));
                "not stated"
            }
        }
    }

    /// `value [low, high]`.
    fn interval(&mut self, path: &str, digits: i32) -> String {
        let [value, low, high] = ["value", "low", "high"].map(|name| self.number(&format!("{path}/{name}")));
        let show = |value: Option<f64>| value.map_or("–".into(), |value| significant(value, digits));
        format!("{} [{}, {}]", show(value), show(low), show(high))
    }
}

fn verdict(section: &mut ReportSection, file: &mut File) {
    let verdict = file.text("/verdict");
    let meaning = match verdict {
        "adequate" => "The residuals do not exceed the measured noise.",
        "named" => "Each cause below has a probability of at least 0.95.",
        "ambiguous" => {
            "The model misfits, and at least one cause cannot be distinguished from another candidate."
        }
        "unexplained" => {
            "A misfit remains that no candidate explains; the causes that were found are listed."
        }
        _ => "This version of the program does not know this verdict.",
    };
    let [statistic, p_value, left_over] =
        ["/misfit/statistic", "/misfit/p_value", "/left_over/p_value"].map(|path| file.number(path));
    let show = |value: Option<f64>| value.map_or("–".into(), |value| significant(value, 2));
    section.html += &format!(
        "<p class=\"verdict\"><b>{}</b> {}</p><dl><dt>Misfit</dt><dd>statistic {}, p = {}</dd><dt>Misfit after the \
         extension</dt><dd>p = {}</dd></dl>",
        escape(verdict),
        meaning,
        show(statistic),
        show(p_value),
        show(left_over)
    );
    free_law(section, file.root);
    if let Some(rest) = file.root.get("residual_term").filter(|rest| !rest.is_null()) {
        let text = serde_json::to_string_pretty(rest).unwrap_or_default();
        section.html += &format!(
            "<p>The remaining residual is described by a term that stands for no mechanism:</p><pre>{}</pre>",
            escape(&text)
        );
    }
}

/// Place, argument and curve of an unknown law, if the diagnosis found one.
fn free_law(section: &mut ReportSection, root: &Value) {
    let Some(entry) = root.get("free_law").filter(|law| !law.is_null()) else { return };
    let title =
        |law: &Value| law["title"].as_str().or_else(|| law["mechanism"].as_str()).unwrap_or("?").to_owned();
    let others: Vec<String> = entry["alternatives"].as_array().into_iter().flatten().map(title).collect();
    let or =
        if others.is_empty() { String::new() } else { format!(" It could also be: {}.", others.join("; ")) };
    section.paragraph(&format!(
        "An unknown law explains the session better than the catalogue: {}.{or}",
        title(entry)
    ));
    let column = |name: &str| -> Vec<Option<f64>> {
        entry["curve"][name].as_array().into_iter().flatten().map(Value::as_f64).collect()
    };
    let columns = ["at", "value", "low", "high"].map(column);
    let count = columns.iter().map(Vec::len).min().unwrap_or(0);
    let rows: Vec<Vec<Cell>> = (0..count)
        .step_by(count.div_ceil(9).max(1))
        .map(|row| columns.iter().map(|column| Cell::number(column[row], 3)).collect())
        .collect();
    if !rows.is_empty() {
        let argument = entry["argument"].as_str().unwrap_or("argument").to_owned();
        let head = vec![argument, "law".into(), "95 % from".into(), "95 % to".into()];
        section.html += &HtmlTable { caption: "The unknown law".into(), head, rows }.html();
    }
    if let Some(figure) = law("unknown-law", "The unknown law", entry) {
        section.figure(figure);
    }
}

fn causes(section: &mut ReportSection, file: &mut File) {
    let Some(causes) = file.root["causes"].as_array() else {
        file.absent.push("causes".into());
        return;
    };
    let mut named = Vec::new();
    let mut shifts = Vec::new();
    for index in 0..causes.len() {
        let at = format!("/causes/{index}");
        let mechanism = file.text(&format!("{at}/mechanism"));
        named.push(cause(file, &at, mechanism));
        shifts.extend(shift(file, &at, mechanism));
    }
    for (index, cause) in causes.iter().enumerate() {
        let title = format!("Law of {}", cause["mechanism"].as_str().unwrap_or("the cause"));
        if let Some(figure) = law(&format!("law-of-cause-{}", index + 1), &title, &cause["law"]) {
            section.figure(figure);
        }
    }
    if named.is_empty() {
        section.paragraph("The diagnosis names no cause.");
        return;
    }
    let head = [
        "cause",
        "class",
        "size [95 % interval]",
        "probability",
        "not distinguished from",
        "held-out error, after / before",
        "VAF before",
        "VAF after",
    ];
    let caption = "Causes, by gain".to_owned();
    section.html += &HtmlTable { caption, head: head.map(String::from).to_vec(), rows: named }.html();
    if !shifts.is_empty() {
        let head = ["cause", "parameter", "before", "after", "change (%)"].map(String::from).to_vec();
        section.html += &HtmlTable {
            caption: "Change of the parameters when the causes are added".into(),
            head,
            rows: shifts,
        }
        .html();
    }
}

fn cause(file: &mut File, at: &str, mechanism: &str) -> Vec<Cell> {
    let title =
        CATALOGUE.iter().find(|kind| kind.id() == mechanism).map(|kind| format!(": {}", kind.title()));
    let names: Vec<String> = match file.root.pointer(&format!("{at}/parameters")).and_then(Value::as_object) {
        Some(parameters) => parameters.keys().cloned().collect(),
        None => {
            file.absent.push(format!("{}.parameters", at.trim_start_matches('/').replace('/', ".")));
            Vec::new()
        }
    };
    let sizes: Vec<String> = names
        .iter()
        .map(|name| {
            let key = name.replace('~', "~0").replace('/', "~1");
            let path = format!("{at}/parameters/{key}");
            match file.root.pointer(&format!("{path}/value")).and_then(Value::as_array) {
                Some(list) => {
                    format!("{name} {}", list.iter().map(Value::to_string).collect::<Vec<_>>().join(", "))
                }
                None => format!("{name} {}", file.interval(&path, 3)),
            }
        })
        .collect();
    let rivals = match file.root.pointer(&format!("{at}/indistinguishable")).and_then(Value::as_array) {
        Some(rivals) if rivals.is_empty() => "none".to_owned(),
        Some(rivals) => rivals
            .iter()
            .map(|rival| rival.as_str().map_or_else(|| rival.to_string(), str::to_owned))
            .collect::<Vec<_>>()
            .join(", "),
        None => {
            file.absent.push(format!("{}.indistinguishable", at.trim_start_matches('/').replace('/', ".")));
            "not stated".into()
        }
    };
    vec![
        Cell::text(format!("{mechanism}{}", title.unwrap_or_default())),
        Cell::text(file.text(&format!("{at}/class"))),
        Cell::text(sizes.join("; ")),
        Cell::number(file.number(&format!("{at}/probability")), 3),
        Cell::text(rivals),
        Cell::text(file.interval(&format!("{at}/gain/held_out_rmse_ratio"), 2)),
        Cell::number(file.number(&format!("{at}/gain/vaf_before")), 4),
        Cell::number(file.number(&format!("{at}/gain/vaf_after")), 4),
    ]
}

fn shift(file: &mut File, at: &str, mechanism: &str) -> Vec<Vec<Cell>> {
    let Some(shifts) = file.root.pointer(&format!("{at}/parameter_shift")).and_then(Value::as_object) else {
        file.absent.push(format!("{}.parameter_shift", at.trim_start_matches('/').replace('/', ".")));
        return Vec::new();
    };
    shifts
        .iter()
        .map(|(parameter, shift)| {
            let (before, after) = (shift["before"].as_f64(), shift["after"].as_f64());
            let change = before.zip(after).map(|(before, after)| 100.0 * (after - before) / before);
            vec![
                Cell::text(mechanism),
                Cell::text(parameter),
                Cell::number(before, 4),
                Cell::number(after, 4),
                Cell::number(change, 2),
            ]
        })
        .collect()
}
