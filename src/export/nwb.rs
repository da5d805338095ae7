//! A session as an NWB file (Neurodata Without Borders 2, in HDF5): a time series for each channel and for the EMG of each
//! attachment, and a table of the trials.
//!
//! A session always makes the same bytes: identifiers follow from the session, and no date is that of the export.

mod attached;
mod objects;
mod series;
mod subject;
mod trials;

use std::path::Path;

use hdf5_pure::{FileBuilder, GroupBuilder};
use serde_json::json;

use self::attached::add_attached;
use self::objects::{NwbType, ObjectIds, fill_text, text};
use self::series::{Series, add_series};
use self::subject::add_subject;
use self::trials::add_trials;
use super::error::ExportError;
use super::fit_rows::fit_rows;
use super::new_file::{refuse_existing, write_new};
use super::record_channels::{RecordChannel, measured_channels};
use super::sidecars;
use super::trial_times::{PlacedTrial, TrialTimes};
use crate::attach::attached_recordings;
use crate::dataset::{self, Session, SessionCard, utc_seconds, utc_text, utc_text_us};

/// The version of the format that is written.
const NWB_VERSION: &str = "2.9.0";

/// Writes the session in `folder` to a new file.
///
/// # Errors
/// If the session or its `fit.csv` cannot be read, it has no journal and so no times, no trial has a time and samples, or the file exists
/// already or cannot be written.
pub fn write(folder: &Path, file: &Path) -> Result<(), ExportError> {
    refuse_existing(file)?;
    let session = dataset::load(folder)?;
    let card = SessionCard::read(folder)?;
    let fits = fit_rows(folder, &session)?;
    let times = TrialTimes::read(folder, "an NWB file")?;
    let stretches = times.place(&session);
    let has_unknown_breaks = times.origin_utc_ns.is_none() && stretches.len() > 1;
    let placed: Vec<PlacedTrial> = stretches.into_iter().flat_map(|stretch| stretch.trials).collect();
    if placed.is_empty() {
        return Err(ExportError::Nothing(folder.into()));
    }
    let digest = session.digest();
    let ids = ObjectIds::new(&digest);
    let start = SessionStart::of(card.about.started_utc.as_deref(), times.origin_utc_ns);

    let mut builder = FileBuilder::new();
    for (name, value) in ids.attributes(NwbType::File, "/") {
        builder.set_attr(name, value);
    }
    builder.set_attr("nwb_version", text(NWB_VERSION));
    fill_text(builder.create_dataset("identifier"), &digest);
    fill_text(builder.create_dataset("session_description"), &description(&start, has_unknown_breaks));
    fill_text(builder.create_dataset("session_start_time"), &start.utc);
    fill_text(builder.create_dataset("timestamps_reference_time"), &start.utc);
    builder.create_dataset("file_create_date").with_vlen_strings(&[start.utc.as_str()]);

    let mut acquisition = builder.create_group("acquisition");
    for channel in measured_channels(&session) {
        add_series(&mut acquisition, measured(&channel, &placed, &card), &ids);
    }
    for recording in attached_recordings(folder)? {
        add_attached(&mut acquisition, &recording, &placed, &ids);
    }
    builder.add_group(acquisition.finish());
    for name in ["analysis", "processing"] {
        let empty = builder.create_group(name);
        builder.add_group(empty.finish());
    }
    let mut stimulus = builder.create_group("stimulus");
    for name in ["presentation", "templates"] {
        let empty = stimulus.create_group(name);
        stimulus.add_group(empty.finish());
    }
    builder.add_group(stimulus.finish());
    let mut general = builder.create_group("general");
    add_general(&mut general, &session, &card);
    add_subject(&mut general, &card, &ids);
    builder.add_group(general.finish());
    let mut intervals = builder.create_group("intervals");
    add_trials(&mut intervals, &placed, session.trials.len() - placed.len(), &fits, &ids);
    builder.add_group(intervals.finish());
    let bytes = builder
        .finish()
        .map_err(|error| ExportError::Writer { path: file.into(), message: error.to_string() })?;
    write_new(file, &bytes)
}

/// When the session began, and how well that is known.
#[derive(Debug, PartialEq)]
struct SessionStart {
    /// In UTC, as ISO 8601 has it.
    utc: String,
    /// What the description of the session says of it.
    meaning: &'static str,
}

impl SessionStart {
    /// By the time stamp of the session's first sample, `origin_utc_ns`, where it has one; else by `started_utc` of `session.json`; else 1970,
    /// which no reader takes for the time of a measurement.
    fn of(started_utc: Option<&str>, origin_utc_ns: Option<i64>) -> Self {
        let started_s = started_utc.and_then(utc_seconds);
        match (origin_utc_ns, started_s) {
            (Some(utc_ns), _) => Self {
                utc: utc_text_us(utc_ns),
                meaning: "Times are counted from its first sample, which was at session_start_time.",
            },
            (None, Some(seconds)) => Self {
                utc: utc_text(seconds),
                meaning: "Times are counted from its first sample, soon after session_start_time.",
            },
            (None, None) => Self {
                utc: utc_text(0),
                meaning: "The session has no date, as one on the virtual wrist: session_start_time is \
                          1970-01-01T00:00:00Z because NWB asks for one. Times are counted from its first sample.",
            },
        }
    }
}

fn description(start: &SessionStart, has_unknown_breaks: bool) -> String {
    let breaks = if has_unknown_breaks {
        " Nobody knows how long its breaks were: what came after one is put right behind what was before."
    } else {
        ""
    };
    format!(
        "A session of ramp-and-hold trials of a wrist in a servo motor. Signals are those of the trials, raw: \
         unfiltered, offsets not removed. {}{breaks} file_create_date is session_start_time, so that the session \
         always makes the same file.",
        start.meaning
    )
}

/// The time series of a channel, the trials one after the other; without values where no trial with a time has the channel.
fn measured(channel: &RecordChannel, placed: &[PlacedTrial], card: &SessionCard) -> Series<'static> {
    let (mut values, mut times_s) = (Vec::new(), Vec::new());
    for own in placed {
        let Some(samples) = (channel.samples)(&own.trial.record) else { continue };
        values.extend_from_slice(samples);
        times_s.extend((0..samples.len()).map(|sample| own.sample_s(sample)));
    }
    let known = card.channels.get(channel.column);
    Series {
        name: channel.column.to_owned(),
        description: channel.title.to_owned(),
        comments: known.map(|known| format!("From session.json: {}", json!(known))),
        unit: channel.unit,
        values,
        times_s,
    }
}

/// Adds what is known of the experiment to the group `general`.
fn add_general(general: &mut GroupBuilder, session: &Session, card: &SessionCard) {
    fill_text(general.create_dataset("experiment_description"), sidecars::task());
    let rig = json!({
        "sample_rate_hz": session.sample_rate_hz,
        "lever": session.lever,
        "recorded_filter": session.recorded_filter,
    });
    fill_text(general.create_dataset("data_collection"), &format!("From session.json: {rig}"));
    if let Some(operator) = &card.about.operator {
        general.create_dataset("experimenter").with_vlen_strings(&[operator.as_str()]);
    }
    general.create_dataset("keywords").with_vlen_strings(&["ramp and hold", "wrist", "joint stiffness"]);
    general.create_dataset("was_generated_by").with_vlen_strings(&sidecars::program()).with_shape(&[1, 2]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_begins_at_its_first_stamp_else_when_it_says_else_in_1970() {
        let began = |started_utc, origin_utc_ns| SessionStart::of(started_utc, origin_utc_ns).utc;
        let started = Some("2026-11-24T15:00:00Z");
        assert_eq!(began(started, Some(1_500_000)), "1970-01-01T00:00:00.001500Z");
        assert_eq!(began(started, None), "2026-11-24T15:00:00Z");
        for unknown in [None, Some("yesterday")] {
            let start = SessionStart::of(unknown, None);
            assert_eq!(start.utc, "1970-01-01T00:00:00Z");
            assert!(description(&start, false).contains("has no date"));
        }
    }
}
