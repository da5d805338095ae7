//! Overview of the session.

use super::ReportSection;
use crate::dataset::Status;
use crate::fit::DESCRIBING_VAF;
use crate::report::figures;
use crate::report::input::ReportInput;
use crate::report::scale::{escape, milliseconds, significant};
use crate::report::table::{Cell, HtmlTable};

/// The section: subject, protocol, duration, missing results, rejected trials and their reasons.
pub fn overview(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("session", "Overview of the session");
    section.html += &virtual_wrist(input);
    section.html += &warnings(input);
    section.html += &facts(input);
    if !input.missing.is_empty() {
        section.html += "<div class=\"missing\"><b>Not in this report</b><ul>";
        for missing in &input.missing {
            section.html += &format!("<li>{}</li>", escape(missing));
        }
        section.html += "</ul></div>";
    }
    let discarded = discarded_trials(input);
    if discarded.rows.is_empty() {
        section.paragraph("No trial was rejected or aborted.");
    } else {
        section.html += &discarded.html();
    }
    section.html += "<div class=\"pair\">";
    if !input.session.trials.is_empty() {
        section.figure(figures::order(&input.session));
    }
    match &input.times {
        Some(times) if !times.gates.is_empty() => {
            let needed_s = input.protocol.as_ref().map(|protocol| protocol.gate.duration_s);
            section.figure(figures::gates(&times.gates, needed_s));
        }
        _ => section.absent("The session has no journal, so gate times are not known."),
    }
    if let Some(lateness) = &input.lateness {
        section.figure(figures::lateness(lateness));
    }
    section.html += "</div>";
    section
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

/// When, who and what, as far as the session says it.
fn card(input: &ReportInput) -> Vec<(&'static str, String)> {
    let about = &input.card.about;
    let mut facts = Vec::new();
    if let Some(started) = &about.started_utc {
        let offset = about.utc_offset_s.map_or(String::new(), |offset| {
            let sign = if offset < 0 { '-' } else { '+' };
            format!(", local time {sign}{:02}:{:02}", offset.abs() / 3600, offset.abs() / 60 % 60)
        });
        let clock = about.clock.as_ref().map_or(String::new(), |clock| format!(" ({clock})"));
        facts.push(("Started", format!("{started}{offset}{clock}")));
    }
    facts.extend(about.operator.clone().map(|operator| ("Operator", operator)));
    facts.extend(about.hand.map(|hand| ("Hand", format!("{hand:?}").to_lowercase())));
    let fields = &input.card.subject.fields;
    if !fields.is_empty() {
        let text = |(field, value): (&String, &serde_json::Value)| match value.as_str() {
            Some(value) => format!("{field} {value}"),
            None => format!("{field} {value}"),
        };
        facts.push(("About the subject", fields.iter().map(text).collect::<Vec<_>>().join(", ")));
    }
    facts
}

/// What a reader must know before any number: a model that describes nothing, and contradictions that were accepted.
fn warnings(input: &ReportInput) -> String {
    let mut warnings = Vec::new();
    let Some(fitted) = &input.fitted else { return String::new() };
    if let Some(best) = fitted.best_vaf().filter(|best| *best < DESCRIBING_VAF) {
        warnings.push(format!(
            "The model does not describe these data: the best VAF of any trial is {}. Its parameters mean nothing.",
            significant(best, 2)
        ));
    }
    for accepted in &fitted.accepted {
        warnings.push(format!(
            "Accepted with --accept {}: {}; expected {}.",
            accepted.check, accepted.measured, accepted.stated
        ));
    }
    let paragraphs =
        warnings.iter().map(|warning| format!("<p class=\"verdict\"><b>{}</b></p>", escape(warning)));
    paragraphs.collect()
}

fn facts(input: &ReportInput) -> String {
    let session = &input.session;
    let count = |status: Status| session.trials.iter().filter(|trial| trial.status == status).count();
    let mut facts = vec![("Subject", session.subject.id.clone())];
    facts.extend(card(input));
    match &input.protocol {
        Some(protocol) => {
            facts.push(("Protocol", protocol.name.clone()));
            let design = format!(
                "{} velocities × {} torques × {} repetitions",
                protocol.velocities_rad_s.len(),
                protocol.torques_nm.len(),
                protocol.repetitions
            );
            facts.push(("Design", design));
        }
        None => facts.push(("Protocol", "none in the session".into())),
    }
    let trials = format!(
        "{} kept, {} rejected, {} aborted",
        count(Status::Ok),
        count(Status::Rejected),
        count(Status::Aborted)
    );
    facts.push(("Trials", trials));
    if let Some(times) = &input.times {
        facts.push(("Duration", minutes(times.duration_s)));
        let gates = figures::distinct(times.gates.iter().map(|(_, time_s)| *time_s));
        if let (Some(shortest), Some(longest)) = (gates.first(), gates.last()) {
            let typical = gates[gates.len() / 2];
            let three = [typical, *shortest, *longest].map(|time_s| significant(time_s, 2));
            facts.push((
                "Gate opened after",
                format!("{} s (median; {} to {} s)", three[0], three[1], three[2]),
            ));
        }
        if times.resumed > 0 {
            facts.push(("Resumed", format!("{} times", times.resumed)));
        }
        for (time_s, what) in &times.incidents {
            facts.push(("Incident", format!("{what} at {}", minutes(*time_s))));
        }
        if times.unread_lines > 0 {
            facts.push(("Journal", format!("{} lines could not be read", times.unread_lines)));
        }
    }
    facts.push(("Sampling", format!("{} Hz", session.sample_rate_hz)));
    facts.push((
        "Lever",
        session.lever.map_or("rigid: torque measured at the handle".into(), |lever| {
            format!(
                "{} kg m², {} N m s/rad, {} N m/rad",
                lever.inertia_kg_m2, lever.damping_nm_s_per_rad, lever.stiffness_nm_per_rad
            )
        }),
    ));
    if let Some(fitted) = &input.fitted {
        let weighting = fitted.settings.weighting.replace('_', " ");
        let window = milliseconds(fitted.settings.window_s);
        facts
            .push(("Fit", format!("window {window} ms, weighting: {weighting}, version {}", fitted.version)));
    }
    if let Some(lateness) = &input.lateness {
        facts.push((
            "Lateness",
            format!("99 % within {} µs, at most {} µs", lateness.p99_us, lateness.longest_us),
        ));
    }
    let rows = facts.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{}</dd>", escape(value)));
    format!("<dl>{}</dl>", rows.collect::<String>())
}

fn discarded_trials(input: &ReportInput) -> HtmlTable {
    let row = |trial: &crate::dataset::Trial| {
        let reason =
            trial.extra.get("reason").map_or("not recorded".into(), |reason| reason.replace('_', " "));
        vec![
            Cell::Number(trial.number.to_string()),
            Cell::Number(trial.velocity_rad_s.to_string()),
            Cell::Number(trial.torque_nm.to_string()),
            Cell::text(trial.status.name()),
            Cell::text(reason),
        ]
    };
    HtmlTable {
        caption: "Trials that were not kept".into(),
        head: ["trial", "velocity (rad/s)", "torque (N m)", "status", "reason"].map(String::from).to_vec(),
        rows: input.session.trials.iter().filter(|trial| trial.status != Status::Ok).map(row).collect(),
    }
}

fn minutes(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    format!("{} min {:02} s", seconds / 60, seconds % 60)
}
