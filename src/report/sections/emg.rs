//! EMG in the holds, and the onset of the reflex response.

use super::ReportSection;
use crate::report::derived::mean_sd;
use crate::report::emg::CHANCE;
use crate::report::figures::by_condition;
use crate::report::fitted::condition_name;
use crate::report::input::ReportInput;
use crate::report::scale::milliseconds;
use crate::report::table::{Cell, HtmlTable};
use crate::report::traces::Trace;

/// The section; `None` if no trial has EMG.
pub fn emg(input: &ReportInput) -> Option<ReportSection> {
    let measured = || input.traces.iter().filter_map(|trace| trace.emg.as_ref());
    measured().next()?;
    let mut section = ReportSection::new("emg", "EMG and reflexes");
    let onsets: Vec<f64> = measured().filter_map(|emg| emg.onset_s).collect();
    let window_s = input.window_s();
    let within = onsets.iter().filter(|onset_s| **onset_s < window_s).count();
    section.paragraph(&format!(
        "The EMG of the stretched muscle responds to the ramp in {} of {} trials, in {within} of them within the analysed window of {} ms. \
         By chance alone {:.0} % of the trials would show a response. The torque of a reflex follows its EMG.",
        onsets.len(),
        measured().count(),
        milliseconds(window_s),
        100.0 * CHANCE
    ));
    let head = [
        "condition",
        "trials",
        "response in",
        "onset (ms), median",
        "earliest",
        "FCR in the hold (% MVC)",
        "ECR in the hold (% MVC)",
    ];
    section.html += &HtmlTable {
        caption: "EMG by condition".into(),
        head: head.map(String::from).to_vec(),
        rows: by_condition(&input.traces).into_iter().map(row).collect(),
        note: None,
    }
    .html();
    section.paragraph(
        "Rectified EMG, averaged over 5 ms, relative to its mean in the last 0.5 s of the hold. The onset is the first time within 100 ms \
         at which it exceeds the level that 5 % of the 100 ms stretches of all holds exceed somewhere.",
    );
    Some(section)
}

fn row(own: &[Trace]) -> Vec<Cell> {
    let emg: Vec<_> = own.iter().filter_map(|trace| trace.emg.as_ref()).collect();
    let mut onsets: Vec<f64> =
        emg.iter().filter_map(|emg| emg.onset_s).map(|onset_s| 1e3 * onset_s).collect();
    onsets.sort_by(f64::total_cmp);
    let level = |muscle: usize| {
        let found = mean_sd(emg.iter().map(|emg| emg.hold_mvc[muscle].map(|level| 100.0 * level)));
        Cell::Spread(found.map(|own| own.0), found.and_then(|own| own.1))
    };
    vec![
        Cell::text(condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm)),
        Cell::Number(emg.len().to_string()),
        Cell::Number(emg.iter().filter(|emg| emg.onset_s.is_some()).count().to_string()),
        Cell::number(onsets.get(onsets.len() / 2).copied(), 3),
        Cell::number(onsets.first().copied(), 3),
        level(0),
        level(1),
    ]
}
