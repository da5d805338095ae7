//! EMG in the holds, and the onset of the reflex response.

use super::ReportSection;
use crate::attach::LOWEST_ONSET_HZ;
use crate::report::derived::mean_sd;
use crate::report::emg::CHANCE;
use crate::report::figures::by_condition;
use crate::report::fitted::condition_name;
use crate::report::input::ReportInput;
use crate::report::scale::milliseconds;
use crate::report::table::{Cell, HtmlTable};
use crate::report::traces::Trace;
use crate::statistics::upper_median;

/// The section; `None` if no trial has EMG.
pub fn emg(input: &ReportInput) -> Option<ReportSection> {
    let measured = || input.traces.iter().filter_map(|trace| trace.emg.as_ref());
    measured().next()?;
    let mut section = ReportSection::new("emg", "EMG and reflexes");
    let shows_onsets = measured().any(|emg| emg.shows_onsets);
    section.paragraph(&if shows_onsets { responses(input) } else { no_latency() });
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
    section.html += &trials_table(input).html();
    if let Some(efforts) = efforts_table(input) {
        section.html += &efforts.html();
    }
    if let Some(source) = &input.emg_from {
        section.paragraph(&source.sentence());
    }
    section.paragraph(
        "Rectified EMG, averaged over 5 ms, relative to its mean in the last 0.5 s of the hold. The onset is the first time within 100 ms \
         at which it exceeds the level that 5 % of the 100 ms stretches of all holds exceed somewhere.",
    );
    Some(section)
}

/// In how many trials the stretched muscle responds.
fn responses(input: &ReportInput) -> String {
    let measured = || input.traces.iter().filter_map(|trace| trace.emg.as_ref());
    let onsets: Vec<f64> = measured().filter_map(|emg| emg.onset_s).collect();
    let window_s = input.window_s();
    let within = onsets.iter().filter(|onset_s| **onset_s < window_s).count();
    format!(
        "The EMG of the stretched muscle responds to the ramp in {} of {} trials, in {within} of them within the analysed window of {} ms. \
         By chance alone {:.0} % of the trials would show a response. The torque of a reflex follows its EMG.",
        onsets.len(),
        measured().count(),
        milliseconds(window_s),
        100.0 * CHANCE
    )
}

/// Why slow EMG has no latency.
fn no_latency() -> String {
    format!(
        "No latency of a response is given: the EMG has fewer than {LOWEST_ONSET_HZ} samples a second. Surface EMG reaches up to some 450 Hz, \
         so that slower samples show neither its size over 5 ms nor when it begins."
    )
}

/// Background and latency of each trial.
fn trials_table(input: &ReportInput) -> HtmlTable {
    let head = [
        "trial",
        "condition",
        "FCR in the hold (% MVC)",
        "ECR in the hold (% MVC)",
        "latency of the response (ms)",
    ];
    let mut traces: Vec<&Trace> = input.traces.iter().filter(|trace| trace.emg.is_some()).collect();
    traces.sort_by_key(|trace| trace.number);
    let row = |trace: &Trace| {
        let emg = trace.emg.as_ref();
        let level =
            |muscle: usize| Cell::number(emg.and_then(|emg| emg.hold_mvc[muscle]).map(|own| 100.0 * own), 3);
        vec![
            Cell::Number(trace.number.to_string()),
            Cell::text(condition_name(trace.label.as_ref(), trace.velocity_rad_s, trace.torque_nm)),
            level(0),
            level(1),
            latency(emg.and_then(|emg| emg.onset_s)),
        ]
    };
    HtmlTable {
        caption: "EMG by trial".into(),
        head: head.map(String::from).to_vec(),
        rows: traces.into_iter().map(row).collect(),
        note: Some("A dash: no response stands out, the muscle was not measured, or its EMG has too few samples a second.".into()),
    }
}

/// The maximal efforts, from the journal; `None` if there were none.
fn efforts_table(input: &ReportInput) -> Option<HtmlTable> {
    let efforts = &input.times.as_ref()?.efforts;
    let row = |(number, effort): (usize, &[f64; 3])| {
        let [torque_nm, fcr, ecr] = *effort;
        vec![
            Cell::Number((number + 1).to_string()),
            Cell::number(Some(torque_nm), 3),
            Cell::number(Some(fcr), 3),
            Cell::number(Some(ecr), 3),
        ]
    };
    (!efforts.is_empty()).then(|| HtmlTable {
        caption: "Maximal efforts".into(),
        head: ["effort", "peak torque (N m)", "peak FCR", "peak ECR"].map(String::from).to_vec(),
        rows: efforts.iter().enumerate().map(row).collect(),
        note: Some(
            "Highest smoothed values; EMG in the unit of the rig file. The largest of each muscle is 100 % MVC.".into(),
        ),
    })
}

fn row(own: &[Trace]) -> Vec<Cell> {
    let emg: Vec<_> = own.iter().filter_map(|trace| trace.emg.as_ref()).collect();
    let onsets = || emg.iter().filter_map(|emg| emg.onset_s);
    let level = |muscle: usize| {
        let found = mean_sd(emg.iter().map(|emg| emg.hold_mvc[muscle].map(|level| 100.0 * level)));
        Cell::Spread(found.map(|own| own.0), found.and_then(|own| own.1))
    };
    vec![
        Cell::text(condition_name(own[0].label.as_ref(), own[0].velocity_rad_s, own[0].torque_nm)),
        Cell::Number(emg.len().to_string()),
        Cell::Number(onsets().count().to_string()),
        latency(upper_median(onsets())),
        latency(onsets().min_by(f64::total_cmp)),
        level(0),
        level(1),
    ]
}

/// A latency in ms with one decimal, as the console shows it: the samples are some tenths of a millisecond apart.
fn latency(onset_s: Option<f64>) -> Cell {
    Cell::Number(onset_s.map_or("–".into(), |onset_s| format!("{:.1}", 1e3 * onset_s)))
}

#[cfg(test)]
mod tests {
    use super::{Cell, latency};

    #[test]
    fn a_latency_has_one_decimal_as_on_the_console_however_short_it_is() {
        for (onset_s, shown) in
            [(Some(0.0045), "4.5"), (Some(0.0385), "38.5"), (Some(0.1), "100.0"), (None, "–")]
        {
            assert!(matches!(latency(onset_s), Cell::Number(own) if own == shown), "{onset_s:?}");
        }
    }
}
