//! The diagnosis: the candidates for each cause, with their values and what they change.

use serde_json::Value;

use super::ReportSection;
use super::verdict::changes;
use crate::json_file;
use crate::report::diagnosed::{Candidate, Diagnosed, DiagnosedCause, parameter_in_words};
use crate::report::figures::{ResidualMap, law, residual_map};
use crate::report::fitted::{Fitted, SHOWN, Shown};
use crate::report::input::ReportInput;
use crate::report::scale::{escape, p_value, significant};
use crate::report::table::{Cell, HtmlTable};

/// The section; it also lists what is missing in the file.
pub fn diagnosis(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("diagnosis", "Diagnosis: what the model gets wrong");
    let Some(diagnosis) = &input.diagnosis else {
        section.absent("There is no diagnosis yet. Run: ramphold diagnose SESSION");
        if let Some(figure) = residual_map(&ResidualMap::of_fit(&input.traces)) {
            section.figure(figure);
        }
        return section;
    };
    let mut absent = diagnosis.absent.clone();
    misfit(&mut section, diagnosis);
    free_law(&mut section, &diagnosis.root);
    residual_term(&mut section, &diagnosis.root);
    causes(&mut section, diagnosis, input.fitted.as_ref());
    let map = match ResidualMap::of_diagnosis(&diagnosis.root["residual_map"]) {
        Ok(map) => map,
        Err(problem) => {
            absent.push(format!("residual_map ({problem}); the map below is of the fit alone"));
            ResidualMap::of_fit(&input.traces)
        }
    };
    let map = if diagnosis.causes.is_empty() { map.without_causes() } else { map };
    if let Some(figure) = residual_map(&map) {
        section.figure(figure);
    }
    if let Some(law) = diagnosis.root.pointer("/laws/elastic_limit/says").and_then(Value::as_str) {
        section.paragraph(&format!(
            "How the elastic limit depends on velocity: {law}. The slope is a time as x_t is, and another quantity: x_t is the SRS \
             period of a trial, from the onset until the joint angle reaches x_e."
        ));
    }
    for remark in diagnosis.root["remarks"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        section.paragraph(&format!("Note: {remark}."));
    }
    if !absent.is_empty() {
        section.absent(&format!("Missing in diagnosis.json: {}.", absent.join("; ")));
    }
    section
}

fn misfit(section: &mut ReportSection, diagnosis: &Diagnosed) {
    let show = |value: Option<f64>| value.map_or("–".into(), |value| significant(value, 2));
    let verdict = diagnosis.verdict.as_deref().unwrap_or("not stated");
    section.html += &format!(
        "<dl><dt>Verdict</dt><dd>{}</dd><dt>Misfit of the model as fitted</dt><dd>statistic {}, p {}</dd>",
        escape(verdict),
        show(diagnosis.statistic),
        diagnosis.p_value.map_or("–".into(), p_value)
    );
    if !diagnosis.causes.is_empty() {
        section.html += &format!(
            "<dt>Misfit that remains with the causes in the model</dt><dd>p {}</dd>",
            diagnosis.remaining_p_value.map_or("–".into(), p_value)
        );
    }
    section.html += "</dl>";
}

/// What describes the remaining residual without being a mechanism.
fn residual_term(section: &mut ReportSection, root: &Value) {
    let Some(rest) = root.get("residual_term").filter(|rest| !rest.is_null()) else { return };
    let text = json_file::pretty(rest);
    section.html += &format!(
        "<p>The remaining residual is described by a term that stands for no mechanism:</p><pre>{}</pre>",
        escape(text.trim_end())
    );
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
    if let Some(figure) = law("unknown-law", "The unknown law", entry) {
        section.figure(figure);
    }
}

fn causes(section: &mut ReportSection, diagnosis: &Diagnosed, fitted: Option<&Fitted>) {
    if diagnosis.causes.is_empty() {
        section.paragraph("The diagnosis names no cause.");
        return;
    }
    for (index, cause) in diagnosis.causes.iter().enumerate() {
        let id = cause.candidates.first().map_or("the cause", |own| own.id.as_str());
        if let Some(figure) = law(&format!("law-of-cause-{}", index + 1), &format!("Law of {id}"), &cause.law)
        {
            section.figure(figure);
        }
    }
    section.html += &candidates(diagnosis).html();
    section.html += &gains(diagnosis).html();
    let all = || diagnosis.causes.iter().flat_map(|cause| &cause.candidates);
    let is_told = |shown: &&Shown| all().any(|own| own.shift(shown.name).is_some());
    let told: Vec<&Shown> = SHOWN.iter().filter(is_told).collect();
    for part in told.chunks(4) {
        let signs: Vec<&str> = part.iter().map(|shown| shown.sign).collect();
        let caption = format!("Change of {} with each candidate in the model", signs.join(", "));
        section.html += &changes(diagnosis, fitted, part, &caption).html();
    }
}

/// Every candidate of every cause: a row each.
fn candidates(diagnosis: &Diagnosed) -> HtmlTable {
    let row = |(place, own): (usize, &Candidate)| {
        let values = own.parameters.iter().map(|(name, value)| parameter_in_words(name, value));
        let values: Vec<String> = values.collect();
        vec![
            Cell::Number((place + 1).to_string()),
            Cell::text(own.id.as_str()),
            Cell::text(own.title.as_str()),
            Cell::text(own.class.as_str()),
            Cell::text(if values.is_empty() { "–".into() } else { values.join("; ") }),
            Cell::number(own.probability, 3),
        ]
    };
    let all = diagnosis.causes.iter().enumerate();
    let all = all.flat_map(|(place, cause)| cause.candidates.iter().map(move |own| (place, own)));
    HtmlTable {
        caption: "Candidates for each cause".into(),
        head: ["cause", "candidate", "what it is", "class", "size [95 % interval]", "probability"]
            .map(String::from)
            .to_vec(),
        rows: all.map(row).collect(),
        note: diagnosis.causes.iter().any(|cause| cause.candidates.len() > 1).then(|| {
            "Candidates of the same cause are not distinguished by this session: one of them is at work."
                .into()
        }),
    }
}

/// What the most probable candidate of each cause gains.
fn gains(diagnosis: &Diagnosed) -> HtmlTable {
    let row = |(place, cause): (usize, &DiagnosedCause)| {
        let [value, low, high] =
            cause.held_out.map(|own| own.map_or("–".into(), |own| significant(own, 2)));
        let id = cause.candidates.first().map_or("", |own| own.id.as_str());
        vec![
            Cell::Number((place + 1).to_string()),
            Cell::text(id),
            Cell::Number(format!("{value} [{low}, {high}]")),
            Cell::number(cause.vaf[0], 4),
            Cell::number(cause.vaf[1], 4),
        ]
    };
    HtmlTable {
        caption: "What adding the cause to the model gains".into(),
        head: ["cause", "as", "held-out error, with / without", "VAF without", "VAF with"]
            .map(String::from)
            .to_vec(),
        rows: diagnosis.causes.iter().enumerate().map(row).collect(),
        note: None,
    }
}
