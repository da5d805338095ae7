//! Overview of the session.

use super::ReportSection;
use crate::dataset::{Amendment, Status, Trial};
use crate::fit::ExcludedTrial;
use crate::protocol::minutes;
use crate::report::figures;
use crate::report::input::ReportInput;
use crate::report::journal::SessionTimes;
use crate::report::scale::{escape, milliseconds, significant};
use crate::report::table::{Cell, HtmlTable};

/// The section: subject, protocol, duration, trials that were not kept and why, notes.
pub fn overview(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("session", "Overview of the session");
    section.html += &facts(input);
    let discarded = discarded_trials(input);
    if discarded.rows.is_empty() {
        section.paragraph("No trial was rejected or aborted.");
    } else {
        section.html += &discarded.html();
    }
    let notes = input.times.as_ref().map(notes).filter(|notes| !notes.rows.is_empty());
    section.html += &notes.map_or(String::new(), |notes| notes.html());
    section.html += "<div class=\"pair\">";
    if !input.session.trials.is_empty() {
        section.figure(figures::order(&input.session));
    }
    match &input.times {
        Some(times) if !times.gates.is_empty() => {
            let needed_s = input.protocol.as_ref().map(|protocol| protocol.gate.duration_s);
            section.figure(figures::gates(&times.gates, needed_s));
        }
        _ => {}
    }
    if let Some(lateness) = &input.lateness {
        section.figure(figures::lateness(lateness));
    }
    section.html += "</div>";
    section
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
    if input.times.is_none() {
        facts.push(("Gate times", "not known: the session has no journal".into()));
    }
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

/// The trials that were not kept, those that were judged after the session, and those that the analysis leaves out; with the reasons.
fn discarded_trials(input: &ReportInput) -> HtmlTable {
    let row = |trial: &Trial| {
        let judged = input.amendments.of_trial(trial.number);
        let left_out = input.excluded.iter().find(|own| own.trial == trial.number);
        if trial.status == Status::Ok && judged.is_none() && left_out.is_none() {
            return None;
        }
        let status = match left_out {
            Some(_) if trial.status == Status::Ok => "kept, not analysed",
            _ if trial.status == Status::Ok => "accepted again",
            _ => trial.status.name(),
        };
        Some(vec![
            Cell::Number(trial.number.to_string()),
            Cell::Number(trial.velocity_rad_s.to_string()),
            Cell::Number(trial.torque_nm.to_string()),
            Cell::text(status),
            Cell::text(reasons(trial, judged, left_out).join("; ")),
        ])
    };
    HtmlTable {
        caption: "Trials that were not kept, or were judged after the session".into(),
        head: ["trial", "velocity (rad/s)", "torque (N m)", "status", "reason"].map(String::from).to_vec(),
        rows: input.session.trials.iter().filter_map(row).collect(),
        note: None,
    }
}

/// Why a trial has its status: what the session recorded, the judgement after it, and what the analysis says.
fn reasons(trial: &Trial, judged: Option<&Amendment>, left_out: Option<&ExcludedTrial>) -> Vec<String> {
    let mut reasons = Vec::new();
    if let Some(reason) = trial.extra.get("reason").filter(|reason| !reason.is_empty()) {
        let when = if judged.is_some() { " in the session" } else { "" };
        reasons.push(format!("{}{when}", reason.replace('_', " ")));
    }
    if let Some(judged) = judged {
        let why = if judged.because.is_empty() { "no reason given" } else { &judged.because };
        reasons.push(format!(
            "{} afterwards by {}, {}: {why}",
            judged.status.name(),
            judged.by,
            judged.at_utc
        ));
    }
    reasons.extend(left_out.map(|own| own.reason.clone()));
    if reasons.is_empty() {
        reasons.push("not recorded".into());
    }
    reasons
}

/// The operator's notes.
fn notes(times: &SessionTimes) -> HtmlTable {
    let row =
        |(time_s, text): &(f64, String)| vec![Cell::Number(minutes(*time_s)), Cell::text(text.as_str())];
    HtmlTable {
        caption: "Notes of the operator".into(),
        head: ["after", "note"].map(String::from).to_vec(),
        rows: times.notes.iter().map(row).collect(),
        note: None,
    }
}
