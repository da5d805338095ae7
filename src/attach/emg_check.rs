//! What is wrong with EMG that is attached: its size, its rate, its range.

use std::ops::Range;

use super::clipping::clipped;
use super::emg_warning::{EmgWarning, shows_onsets};
use super::request::{AttachRequest, Reference};
use super::timed_table::TimedTable;
use crate::consistency::{SignalCheck, contradictions};
use crate::dataset::{Record, Session, Status, Trial};

/// Trials by their number, with their samples in the recording.
pub type TrialSpans = [(u32, Range<usize>)];

/// What was found and what was expected, if the EMG is no fraction of a maximal effort: the check of `fit` of a session's own EMG.
pub fn no_fraction_of_mvc(
    request: &AttachRequest,
    session: &Session,
    table: &TimedTable,
    spans: &TrialSpans,
) -> Option<(String, String)> {
    let scaled = |muscle: usize, span: &Range<usize>| -> Option<Vec<f64>> {
        let values = table.table.column(request.emg[muscle].as_ref()?)?;
        let at_mvc = request.emg_at_mvc[muscle]?;
        Some(values[span.clone()].iter().map(|value| value / at_mvc).collect())
    };
    let has_both = request.emg.iter().all(Option::is_some) && request.emg_at_mvc.iter().all(Option::is_some);
    let of_span = |(number, span): &(u32, Range<usize>)| {
        let trial = session.trials.iter().find(|own| own.number == *number && own.status == Status::Ok)?;
        Some(Trial {
            number: *number,
            file: trial.file.clone(),
            velocity_rad_s: trial.velocity_rad_s,
            // Of one muscle alone nobody knows whether it is the active one.
            torque_nm: if has_both { trial.torque_nm } else { 0.0 },
            repetition: trial.repetition,
            condition: trial.condition.clone(),
            onset_s: trial.onset_s,
            status: Status::Ok,
            extra: trial.extra.clone(),
            record: Record {
                emg_fcr_mvc: scaled(0, span),
                emg_ecr_mvc: scaled(1, span),
                ..Record::default()
            },
        })
    };
    let trials: Vec<Trial> = spans.iter().filter_map(of_span).collect();
    let of_emg = Session {
        subject: session.subject.clone(),
        sample_rate_hz: table.rate_hz,
        lever: None,
        recorded_filter: None,
        channel_ranges: Default::default(),
        trials,
    };
    let found = contradictions(&of_emg).into_iter().find(|one| one.check == SignalCheck::Emg)?;
    let muscle = usize::from(found.place.contains("emg_ecr_mvc"));
    let (column, at_mvc) = (request.emg[muscle].as_ref()?, request.emg_at_mvc[muscle]?);
    let of_stream = matches!(request.reference, Reference::SessionClock);
    let option = if of_stream { "at_mvc of the rig file" } else { ["--fcr-at-mvc", "--ecr-at-mvc"][muscle] };
    let values = |trial: &Trial| match muscle {
        0 => trial.record.emg_fcr_mvc.clone(),
        _ => trial.record.emg_ecr_mvc.clone(),
    };
    let level = |own: &[f64]| own.iter().map(|value| value.abs()).sum::<f64>() / own.len().max(1) as f64;
    let levels = of_emg.trials.iter().filter_map(|trial| Some((trial.number, level(&values(trial)?))));
    let largest = levels.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let measured = format!(
        "EMG in column {column:?}, divided by {option} {at_mvc}: {}, and at most {:.4} in a trial, number {}",
        found.measured, largest.1, largest.0
    );
    let remedy = if of_stream {
        "Give it in the unit of the stream".to_owned()
    } else {
        format!(
            "Give {option} in the unit of the column, or attach without it: the report then does not show this EMG"
        )
    };
    let expected = format!("{}. {} {remedy}", found.stated, found.likely_mistake.unwrap_or_default());
    Some((measured, expected))
}

/// What to know of the EMG before it is trusted.
pub fn emg_warnings(request: &AttachRequest, table: &TimedTable, spans: &TrialSpans) -> Vec<EmgWarning> {
    let mut warnings = Vec::new();
    if request.emg.iter().any(Option::is_some) && !shows_onsets(table.rate_hz) {
        warnings.push(EmgWarning::Slow { rate_hz: table.rate_hz });
    }
    for column in request.emg.iter().flatten() {
        let Some(values) = table.table.column(column) else { continue };
        let trials: Vec<(u32, &[f64])> =
            spans.iter().map(|(number, span)| (*number, &values[span.clone()])).collect();
        warnings.extend(clipped(column, &trials).into_iter().map(EmgWarning::Clipped));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::attach::request::ClockSource;
    use crate::dataset::Subject;
    use crate::import::{Recording, SourceTable};
    use crate::random::Stream;

    /// What is said of noise of a size of 0.1 mV, attached with a value at maximal effort of `at_mvc`.
    fn said_of(at_mvc: f64, reference: Reference) -> Option<(String, String)> {
        let mut stream = Stream::new(1, "emg");
        let values: Vec<f64> = (0..8000).map(|_| 0.125 * stream.normal()).collect();
        let request = AttachRequest {
            session: "S".into(),
            file: "emg.csv".into(),
            clock: ClockSource::Rate(2000.0),
            reference,
            table: None,
            emg: [Some("FCR".into()), None],
            emg_at_mvc: [Some(at_mvc), None],
            name: None,
        };
        let table = SourceTable::new("emg.csv".into(), vec![("FCR".to_owned(), values)]);
        let recording = Recording { tables: vec![table], markers: Vec::new() };
        let table = TimedTable::new(&request, &recording).unwrap();
        let trial = Trial {
            number: 7,
            file: String::new(),
            velocity_rad_s: 2.0,
            torque_nm: 1.0,
            repetition: 1,
            condition: None,
            onset_s: Some(1.0),
            status: Status::Ok,
            extra: BTreeMap::new(),
            record: Record::default(),
        };
        let session = Session {
            subject: Subject { id: "S".into() },
            sample_rate_hz: 2500.0,
            lever: None,
            recorded_filter: None,
            channel_ranges: Default::default(),
            trials: vec![trial],
        };
        no_fraction_of_mvc(&request, &session, &table, &[(7, 0..8000)])
    }

    #[test]
    fn emg_in_another_unit_than_its_maximal_effort_is_told_with_column_size_and_unit() {
        let marker = || Reference::Marker("onset".into());
        assert_eq!(said_of(0.4, marker()), None);
        // In V, of a column in mV.
        let (measured, expected) = said_of(0.4e-3, marker()).unwrap();
        assert!(measured.contains("column \"FCR\", divided by --fcr-at-mvc 0.0004"), "{measured}");
        assert!(measured.contains("in a trial, number 7"), "{measured}");
        assert!(expected.starts_with("at most 1.5") && expected.contains("millivolts"), "{expected}");
        let (_, expected) = said_of(0.4e-3, Reference::SessionClock).unwrap();
        assert!(expected.contains("unit of the stream"), "{expected}");
    }

    #[test]
    fn of_one_muscle_alone_nobody_knows_whether_it_is_the_silent_one() {
        assert_eq!(said_of(400.0, Reference::Marker("onset".into())), None);
    }
}
