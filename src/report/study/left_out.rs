//! Who was measured, and which sessions were left out and why.

use crate::report::scale::escape;
use crate::report::sections::ReportSection;
use crate::study::StudyResults;

/// The section: facts of the study, and the sessions and subjects that its tables leave out.
pub fn left_out(study: &StudyResults) -> ReportSection {
    let mut section = ReportSection::new("left-out", "Subjects, and who was left out");
    let summary = &study.summary;
    let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let mut facts = vec![
        ("Subjects in the tables", summary.subjects.to_string()),
        ("Sessions of each", summary.sessions.to_string()),
        ("Velocities", format!("{} rad/s", list(&summary.grid.velocities_rad_s))),
        ("Target torques", format!("{} N m", list(&summary.grid.torques_nm))),
    ];
    facts.extend(study.units.map(|units| ("Sessions of the study", units.to_string())));
    facts.extend(study.seed.map(|seed| ("Seed", seed.to_string())));
    facts.extend(study.fit.as_deref().map(|fit| {
        let text = match fit {
            "session" => "all trials of a session together",
            _ => "each trial on its own, as in the paper",
        };
        ("Fit", text.to_owned())
    }));
    let facts = facts.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{}</dd>", escape(value)));
    section.html += &format!("<dl>{}</dl>", facts.collect::<String>());
    if study.issue_count == 0 {
        section.paragraph("Every session and every subject is in the tables.");
        return section;
    }
    section.html += "<div class=\"missing\"><b>Left out</b><ul>";
    for issue in &study.issues {
        section.html += &format!("<li>{}</li>", escape(issue));
    }
    let told = study.issues.len() as u64;
    if study.issue_count > told {
        section.html += &format!("<li>and {} more like these</li>", study.issue_count - told);
    }
    section.html += "</ul></div>";
    section
}
