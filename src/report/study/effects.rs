//! What a study found: effects of velocity and torque with their sizes, and slopes.

use super::measured::measured;
use crate::report::fitted::{SPOKEN_OF, Shown};
use crate::report::scale::{escape, p_value, significant};
use crate::report::sections::ReportSection;
use crate::report::table::{Cell, HtmlTable};
use crate::statistics::AnovaEffect;
use crate::study::{StudyResults, effect_name};

/// Level at which an effect is called found, as in the paper.
const LEVEL: f64 = 0.05;

/// The section that begins the page.
pub fn found(study: &StudyResults) -> ReportSection {
    let mut section = ReportSection::new("verdict", "What the study found");
    if study.is_virtual {
        section.html += "<p class=\"verdict\"><b>VIRTUAL SUBJECTS.</b> This study is a simulation; nobody was measured.</p>";
    }
    let summary = &study.summary;
    section.paragraph(&format!(
        "{} subjects, {} velocities × {} torques{}.",
        summary.subjects,
        summary.grid.velocities_rad_s.len(),
        summary.grid.torques_nm.len(),
        match study.issue_count {
            0 => "; nobody was left out".to_owned(),
            1 => "; 1 session or subject was left out".to_owned(),
            count => format!("; {count} sessions or subjects were left out, see below"),
        }
    ));
    let spoken_of = || measured(study).filter(|(quantity, _)| SPOKEN_OF.contains(quantity));
    if study.tables.effects.iter().all(Vec::is_empty) {
        section.absent("Too few subjects have all conditions for tests over subjects; means are shown.");
        return section;
    }
    section.html += "<ul>";
    for (quantity, shown) in spoken_of() {
        section.html += &format!("<li>{}</li>", in_words(study, quantity, shown));
    }
    section.html += "</ul>";
    section.paragraph(&format!(
        "An effect is called found at p < {LEVEL} after the correction of Greenhouse and Geisser. The size is partial eta squared: the \
         part of the variation within subjects that the effect explains. The sessions are fitted and not diagnosed here: what the model \
         gets wrong in all of them is in these means; `ramphold diagnose` finds it in a session."
    ));
    section
}

/// What was found of a quantity, as HTML.
fn in_words(study: &StudyResults, quantity: usize, shown: &Shown) -> String {
    let effects = &study.tables.effects[quantity];
    let of = |factors: [bool; 2]| effects.iter().find(|effect| effect.factors == factors);
    let numbers = |effect: &AnovaEffect| {
        format!("p {}, size {}", p_value(effect.p_gg), significant(effect.partial_eta_squared, 2))
    };
    let part = |(factor, name): (usize, &str)| {
        let effect = of([factor == 0, factor == 1])?;
        let slope = slope(study, quantity, factor).map(|(slope, _, _)| slope);
        let how = match slope {
            Some(slope) if slope < 0.0 => "falls with",
            _ => "rises with",
        };
        Some(if effect.p_gg < LEVEL {
            format!("<b>{how} {name}</b> ({})", numbers(effect))
        } else {
            format!("no effect of {name} is found ({})", numbers(effect))
        })
    };
    let parts: Vec<String> = [(1, "torque"), (0, "velocity")].into_iter().filter_map(part).collect();
    format!("{}, {}: {}.", escape(shown.sign), escape(shown.meaning), escape_marks(&parts.join("; ")))
}

/// The signs of a p-value made safe, in text that has its own bold parts.
fn escape_marks(text: &str) -> String {
    text.replace("p < ", "p &lt; ")
}

/// Slope of a quantity over a factor with its 95 % interval, in SI units.
fn slope(study: &StudyResults, quantity: usize, factor: usize) -> Option<(f64, f64, f64)> {
    let [weights, _] = study.summary.grid.trend_weights(factor)?;
    let contrast = study.summary.complete[quantity].contrast(&weights)?;
    let (low, high) = contrast.interval();
    Some((contrast.estimate, low, high))
}

/// The section with the analysis of variance of every quantity.
pub fn analysis_of_variance(study: &StudyResults) -> ReportSection {
    let mut section = ReportSection::new("anova", "Analysis of variance");
    let row = |shown: &Shown, effect: &AnovaEffect| {
        vec![
            Cell::text(shown.sign),
            Cell::text(effect_name(effect).replace(" x ", " × ")),
            Cell::Number(format!("{}, {}", effect.df[0], effect.df[1])),
            Cell::number(Some(effect.f), 3),
            Cell::Number(plain(effect.p)),
            Cell::Number(plain(effect.p_gg)),
            Cell::number(Some(effect.partial_eta_squared), 2),
            Cell::number(Some(effect.generalised_eta_squared), 2),
        ]
    };
    let rows: Vec<Vec<Cell>> = measured(study)
        .flat_map(|(quantity, shown)| {
            study.tables.effects[quantity].iter().map(move |effect| row(shown, effect))
        })
        .collect();
    if rows.is_empty() {
        section.absent("Too few subjects have all conditions.");
        return section;
    }
    let head = ["quantity", "effect", "df", "F", "p", "p, corrected", "partial η²", "generalised η²"];
    section.html += &HtmlTable {
        caption: "Repeated measures, velocity × torque".into(),
        head: head.map(String::from).to_vec(),
        rows,
        note: Some(
            "p, corrected: both degrees of freedom times the epsilon of Greenhouse and Geisser. anova.csv also has Huynh and Feldt's, and \
             Mauchly's test; contrasts.csv compares the levels in pairs."
                .into(),
        ),
    }
    .html();
    section
}

fn plain(p: f64) -> String {
    p_value(p).trim_start_matches("= ").to_owned()
}

/// The section with slopes over velocity and torque.
pub fn trends(study: &StudyResults) -> ReportSection {
    let mut section = ReportSection::new("trends", "Slopes over velocity and torque");
    let cell = |value: Option<(f64, f64, f64)>, factor: f64| {
        let text = value.map_or("–".into(), |(slope, low, high)| {
            let [slope, low, high] = [slope, low, high].map(|own| significant(own * factor, 3));
            format!("{slope} [{low}, {high}]")
        });
        Cell::Number(text)
    };
    let rows: Vec<Vec<Cell>> = measured(study)
        .map(|(quantity, shown)| {
            let [velocity, torque] = [0, 1].map(|factor| slope(study, quantity, factor));
            vec![Cell::text(shown.with_unit()), cell(velocity, shown.factor), cell(torque, shown.factor)]
        })
        .collect();
    section.html += &HtmlTable {
        caption: "Slope of each quantity, mean over subjects with its 95 % interval".into(),
        head: ["quantity", "per rad/s of velocity", "per N m of torque"].map(String::from).to_vec(),
        rows,
        note: Some(
            "The slope of x_e over velocity, in mrad per rad/s, is a time in ms. It is the SRS period x_t only if the limit is proportional \
             to velocity and the joint moves as the motor does."
                .into(),
        ),
    }
    .html();
    section
}
