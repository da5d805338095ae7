//! The verdict: whether the model is adequate, what is wrong, and how much that changes k_srs and x_e.

use super::ReportSection;
use crate::fit::{DESCRIBING_VAF, onset_warnings, plain_warning, reflex_warning};
use crate::report::bias::{MeanChange, as_fitted};
use crate::report::diagnosed::{Candidate, Diagnosed, DiagnosedCause, parameter_in_words};
use crate::report::fitted::{Fitted, SHOWN, SPOKEN_OF, Shown};
use crate::report::input::ReportInput;
use crate::report::scale::{escape, p_value, significant};
use crate::report::table::{Cell, HtmlTable};

/// The section, the first of the page.
pub fn verdict(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("verdict", "Verdict");
    section.html += &virtual_wrist(input);
    warnings(&mut section, input);
    match &input.diagnosis {
        Some(diagnosis) => diagnosed(&mut section, diagnosis, input.fitted.as_ref()),
        None => {
            statement(
                &mut section,
                "It is not known whether the model is adequate.",
                "The session has no diagnosis that can be shown. Without one, the standard errors on this page hold only if the \
                 model is right. Run: ramphold diagnose SESSION",
            );
            if let Some(fitted) = &input.fitted {
                section.html += &in_short(fitted).html();
            }
        }
    }
    if !input.missing.is_empty() {
        section.html += "<div class=\"missing\"><b>Not in this report</b><ul>";
        for missing in &input.missing {
            section.html += &format!("<li>{}</li>", escape(missing));
        }
        section.html += "</ul></div>";
    }
    section
}

fn statement(section: &mut ReportSection, bold: &str, text: &str) {
    section.html += &format!("<p class=\"verdict\"><b>{}</b> {}</p>", escape(bold), escape(text));
}

/// Says that nobody was measured, with the seed of the simulation.
fn virtual_wrist(input: &ReportInput) -> String {
    if !input.is_virtual {
        return String::new();
    }
    let seed = input.card.seed.map_or(String::new(), |seed| format!(", seed {seed}"));
    format!(
        "<p class=\"verdict\"><b>VIRTUAL WRIST{seed}.</b> This session is a simulation; nobody was measured.</p>"
    )
}

/// What a reader must know before any number: a model that describes nothing, and contradictions that were accepted.
fn warnings(section: &mut ReportSection, input: &ReportInput) {
    if input.is_unfinished {
        statement(section, "The session is unfinished: what follows is of the trials so far.", "");
    }
    let Some(fitted) = &input.fitted else { return };
    if let Some(best) = fitted.best_vaf().filter(|best| *best < DESCRIBING_VAF) {
        statement(
            section,
            &format!(
                "The model does not describe these data: the best VAF of any trial is {}. Its parameters mean nothing.",
                significant(best, 2)
            ),
            "",
        );
    }
    let undescribed = fitted.undescribed();
    if !undescribed.is_empty() && undescribed.len() < fitted.trials.len() {
        let numbers: Vec<String> = undescribed.iter().map(u32::to_string).collect();
        statement(
            section,
            &format!("The model does not describe {} of {} trials.", undescribed.len(), fitted.trials.len()),
            &format!("They are in the means all the same: {}.", numbers.join(", ")),
        );
    }
    if let Some(warning) = plain_warning(&fitted.settings.weighting.as_str().into()) {
        statement(section, "", warning);
    }
    let settings = &fitted.settings;
    for warning in onset_warnings(settings.stated_onsets_late_s, settings.stated_onsets_early_s) {
        statement(section, "", &warning);
    }
    if let Some(warning) = reflex_warning(fitted.settings.window_s, &fitted.model) {
        statement(section, "", &warning);
    }
    for accepted in &fitted.accepted {
        let what = format!(
            "Accepted with --accept {}: {}; expected {}.",
            accepted.check, accepted.measured, accepted.stated
        );
        statement(section, &what, "");
    }
}

fn diagnosed(section: &mut ReportSection, diagnosis: &Diagnosed, fitted: Option<&Fitted>) {
    let p = diagnosis.p_value.map_or(String::new(), |p| format!(" (p {})", p_value(p)));
    let (bold, text) = match diagnosis.verdict.as_deref() {
        Some("adequate") => (
            "The model is adequate.",
            format!(
                "Its residuals do not exceed the measured noise{p}. The diagnosis finds nothing that would change k_srs or x_e."
            ),
        ),
        Some("named") => (
            "The model is not adequate, and the cause is known.",
            format!(
                "It misfits beyond the measured noise{p}. Each cause below has a probability of at least 0.95."
            ),
        ),
        Some("ambiguous") => (
            "The model is not adequate, and the session does not tell the cause from others.",
            format!(
                "It misfits beyond the measured noise{p}. The candidates for a cause hold it with a probability of at least 0.95."
            ),
        ),
        Some("unexplained") => (
            "The model is not adequate, and no known mechanism explains all of its misfit.",
            format!(
                "It misfits beyond the measured noise{p}. The changes of k_srs and x_e below are those of the causes that were found; what the rest changes is not known."
            ),
        ),
        Some(other) => ("The verdict is not known to this version of the program:", format!("{other}.")),
        None => ("The diagnosis states no verdict.", String::new()),
    };
    statement(section, bold, &text);
    if !diagnosis.causes.is_empty() {
        section.html += "<ul>";
        for cause in &diagnosis.causes {
            section.html += &format!("<li>{}</li>", escape(&in_words(cause)));
        }
        section.html += "</ul>";
        let caption = "What this changes: means over the trials, and their change from the model as fitted";
        let table = changes(diagnosis, fitted, &spoken_of().collect::<Vec<_>>(), caption);
        if table.rows.len() > 1 {
            section.html += &table.html();
        } else {
            section.paragraph("None of this changes the mean of k_srs or x_e.");
        }
    } else if let Some(fitted) = fitted {
        section.html += &in_short(fitted).html();
    }
}

/// What is wrong, in a sentence.
fn in_words(cause: &DiagnosedCause) -> String {
    if let Some(trials) = cause.outliers() {
        return format!("Trials that do not belong to the others: {trials}.");
    }
    let one = |own: &Candidate| {
        let probability =
            own.probability.map_or(String::new(), |own| format!(", probability {}", significant(own, 2)));
        let title = if own.title.is_empty() { String::new() } else { format!("{}: ", own.title) };
        let values = own.parameters.iter().map(|(name, value)| parameter_in_words(name, value));
        let values: Vec<String> = values.collect();
        let values = if values.is_empty() { "value not stated".to_owned() } else { values.join(", ") };
        format!("{title}{values} ({}{probability})", own.id)
    };
    format!("{}.", cause.candidates.iter().map(one).collect::<Vec<_>>().join("; or "))
}

fn spoken_of() -> impl Iterator<Item = &'static Shown> {
    SPOKEN_OF.iter().map(|place| &SHOWN[*place])
}

/// Means over the trials as fitted, and with each candidate in the model: of the quantities `shown`.
pub fn changes(
    diagnosis: &Diagnosed,
    fitted: Option<&Fitted>,
    shown: &[&'static Shown],
    caption: &str,
) -> HtmlTable {
    let without = |shown: &Shown| as_fitted(diagnosis, fitted, shown.name);
    let mut head = vec!["model".to_owned()];
    let mut first = vec![Cell::text("as fitted")];
    for shown in shown {
        head.extend([shown.with_unit(), format!("change of {}", shown.sign)]);
        first.extend([
            Cell::number(without(shown).map(|own| own * shown.factor), 3),
            Cell::Number(String::new()),
        ]);
    }
    let row = |also: &str, own: &Candidate| {
        let mut row = vec![Cell::text(format!("{also} {}", own.id))];
        for shown in shown {
            let after = own.shift(shown.name).map(|shift| shift.after);
            let change = without(shown).zip(after).and_then(|(as_fitted, after)| {
                MeanChange { as_fitted, with_causes: [after, after] }.percent()
            });
            row.push(Cell::number(after.map(|own| own * shown.factor), 3));
            row.push(Cell::Number(change.unwrap_or("–".into())));
        }
        row
    };
    let mut rows = vec![first];
    for cause in &diagnosis.causes {
        let also = if rows.len() == 1 { "with" } else { "and with" };
        let changing = |own: &&Candidate| shown.iter().any(|shown| own.shift(shown.name).is_some());
        rows.extend(cause.candidates.iter().filter(changing).map(|own| row(also, own)));
    }
    let mut notes = Vec::new();
    if diagnosis.causes.len() > 1 {
        notes.push("Each cause is added to the first candidates of those above it.".to_owned());
    }
    let (analysed, all) = (diagnosis.trials.len(), fitted.map_or(0, |fitted| fitted.trials.len()));
    if analysed > 0 && analysed < all {
        notes.push(format!("Means over the {analysed} of {all} trials that the diagnosis analysed."));
    }
    let note = (!notes.is_empty()).then(|| notes.join(" "));
    HtmlTable { caption: caption.into(), head, rows, note }
}

/// Lowest and highest condition.
fn in_short(fitted: &Fitted) -> HtmlTable {
    let row = |shown: &'static Shown| {
        let means = fitted.conditions.iter().filter_map(|own| own.mean.get(shown.name).copied().flatten());
        let means = crate::report::figures::distinct(means.map(|mean| mean * shown.factor));
        vec![
            Cell::text(format!("{}, {}", shown.with_unit(), shown.meaning)),
            Cell::number(means.first().copied(), 3),
            Cell::number(means.last().copied(), 3),
        ]
    };
    HtmlTable {
        caption: "In short".into(),
        head: ["quantity", "lowest condition", "highest condition"].map(String::from).to_vec(),
        rows: spoken_of().map(row).collect(),
        note: None,
    }
}
