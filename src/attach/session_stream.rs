//! A stream that was recorded with a session, cut into its trials by the clock that both have.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use super::alignment::{Aligned, RecordingSource, cut};
use super::attachment::{ATTACHED, AttachedStream, ClockOffsets};
use super::error::AttachError;
use super::even_times::even_times;
use super::ramp_search::on_session_clock;
use super::request::{AttachRequest, ClockSource, Reference};
use super::timed_table::TimedTable;
use crate::dataset::{self, SessionClock, StreamFileName};
use crate::files::{self, Folder, limits};
use crate::import::{ImportError, RecordedStream, Recording, SourceTable, TIME_COLUMN, read_recorded};
use crate::rig::{StreamChannel, StreamSettings};

/// Cuts the stream in a `file` of `session` into the trials of the run that recorded it. Nothing is written. `None` if that was done before.
///
/// # Errors
/// If the session or the file cannot be read, or no trial is in it.
pub fn align_stream(
    session: &Path,
    file: &StreamFileName,
    settings: &StreamSettings,
) -> Result<Option<Aligned>, AttachError> {
    let name = if file.run == 1 { file.stem.clone() } else { format!("{}-{}", file.stem, file.run) };
    if files::exists(&session.join(ATTACHED).join(&name)) {
        return Ok(None);
    }
    let path = session.join(&file.file);
    let unreadable = |source| ImportError::Unreadable { path: path.clone(), source };
    let folder = Folder::open(session).map_err(unreadable)?;
    let bytes = folder.read(&file.file, limits::RECORDING_BYTES).map_err(unreadable)?;
    let stream = read_recorded(&bytes, &path)?;
    let column = |channel: Option<&StreamChannel>| channel.map(|own| column(&stream, own)).transpose();
    let [fcr, ecr] = settings.emg().map(|(_, channel)| channel);
    let mut request = AttachRequest {
        session: session.to_owned(),
        file: path.clone(),
        clock: ClockSource::Format,
        reference: Reference::SessionClock,
        table: None,
        emg: [None, None],
        emg_at_mvc: [fcr, ecr].map(|channel| channel.and_then(|own| own.at_mvc)),
        name: Some(name.clone()),
    };
    let unnamed = |(found, expected): (String, String)| request.unexpected(found, expected);
    let emg = [column(fcr).map_err(unnamed)?, column(ecr).map_err(unnamed)?];
    let details = [fcr, ecr].into_iter().zip(&emg).filter_map(|(channel, column)| {
        let details = channel?.details.clone();
        (!details.is_unknown()).then_some((column.clone()?, details))
    });
    let details: BTreeMap<_, _> = details.collect();
    request.emg = emg;
    if stream.times_s.iter().any(|time_s| !time_s.is_finite()) {
        return Err(request.unexpected("a time stamp that is no number".to_owned(), "times in every sample"));
    }

    let RecordedStream { columns, nominal_hz, times_s: stamps_s, clock_offsets, cut_off_bytes, .. } = stream;
    let off = dataset::samples_with_stamps_off(session, &settings.name, file.run)?;
    let right = parts_between(&off, stamps_s.len());
    let even = even_times(right.iter().map(|part| &stamps_s[part.clone()]), nominal_hz);
    let of_right = |values: Vec<f64>| right.iter().flat_map(|part| &values[part.clone()]).copied().collect();
    let columns = columns.into_iter().map(|(name, values)| (name, of_right(values)));
    let columns = std::iter::once((TIME_COLUMN.to_owned(), even.times_s)).chain(columns).collect();
    let recording = Recording {
        tables: vec![SourceTable::new(format!("{}, stream {}", path.display(), settings.name), columns)],
        markers: Vec::new(),
    };
    let table = TimedTable::new(&request, &recording)?;
    let loaded = dataset::load(session)?;
    let clock = SessionClock::read(session)?;
    let ramps: Vec<_> = dataset::ramp_times(session)?
        .unwrap_or_default()
        .into_iter()
        .filter(|ramp| clock.run_of(ramp.stretch) == Some(file.run))
        .collect();
    let found = on_session_clock(&loaded, &clock, &ramps, &table);
    let source = RecordingSource::InSession(format!("../../{}", file.file), dataset::sha256(&bytes));
    let mut aligned = cut(&request, name, &loaded, &table, found, source)?;
    // The trials of other runs are in other files.
    let own_trials: Vec<u32> = ramps.iter().filter_map(|ramp| ramp.trial).collect();
    aligned.attachment.left_out.retain(|left| own_trials.contains(&left.trial));
    aligned.attachment.stream = Some(AttachedStream {
        name: settings.name.clone(),
        run: file.run,
        unit: settings.unit.clone(),
        nominal_rate_hz: nominal_hz,
        clock_offsets: ClockOffsets::of(&clock_offsets),
        stamps_late_rms_s: even.late_rms_s,
        cut_off_bytes,
        channels: details,
    });
    Ok(Some(aligned))
}

/// What of `samples` lies between the parts that are `left_out`.
fn parts_between(left_out: &[Range<usize>], samples: usize) -> Vec<Range<usize>> {
    let ends = std::iter::once(0).chain(left_out.iter().map(|part| part.end));
    let starts = left_out.iter().map(|part| part.start).chain(std::iter::once(samples));
    ends.zip(starts)
        .map(|(from, to)| from.min(samples)..to.min(samples))
        .filter(|part| part.start < part.end)
        .collect()
}

/// The column of a channel.
fn column(stream: &RecordedStream, channel: &StreamChannel) -> Result<String, (String, String)> {
    let place = match (&channel.label, channel.number) {
        (Some(label), _) => stream.labels.iter().position(|own| own == label),
        (None, number) => (number.unwrap_or(0) as usize).checked_sub(1),
    };
    place.and_then(|place| stream.columns.get(place)).map(|(name, _)| name.clone()).ok_or_else(|| {
        let wanted = channel.label.clone().unwrap_or_else(|| channel.number.unwrap_or(0).to_string());
        let names: Vec<&str> = stream.columns.iter().map(|(name, _)| name.as_str()).collect();
        (format!("no channel {wanted}"), format!("one of {}", names.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_between_parts_that_are_left_out_is_kept() {
        assert_eq!(parts_between(&[], 9), std::slice::from_ref(&(0..9)));
        assert_eq!(parts_between(&[2..4, 7..usize::MAX], 9), [0..2, 4..7]);
        assert!(parts_between(&[0..5, 5..30], 9).is_empty());
    }
}
