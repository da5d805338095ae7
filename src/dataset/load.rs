//! Reading a session folder: everything is checked here, once, and nothing is guessed.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use serde::Deserialize;

use super::amendments::{AMENDMENTS, Amendments, record_sum};
use super::channel_ranges::ParsedChannels;
use super::csv_input::{CsvTable, SessionFolder};
use super::description_json::{check_format, parse_json};
use super::error::{DatasetError, FilePlace};
use super::{FurtherChannel, Record, SESSION_FORMAT, Session, Status, Subject, Trial, trial_csv_reader};
use crate::files::{excerpt, limits};
use crate::signal::{FilterSpec, SLOWEST_CUTOFF_HZ};
use crate::wrist::Lever;

/// What must lie before and after the onset of a trial that is analysed, s.
const AROUND_ONSET_S: f64 = 0.040;

/// Reads and checks the session in `folder`.
///
/// Trials of status `aborted` or `rejected` are read too, if they have a record: their `file` may be empty, and their
/// record may be short or have no rows at all, but what is there must be sound.
///
/// # Errors
/// The first thing wrong, in the order session.json, trials.csv, records; it names file, line, column and what was
/// expected. No file is changed, none outside the folder is opened.
pub fn load(folder: &Path) -> Result<Session, DatasetError> {
    let amendments = Amendments::of(&SessionFolder::open(folder)?)?;
    load_amended(folder, &amendments)
}

/// As [`load`], with other judgements on the trials than those in the folder.
///
/// # Errors
/// As [`load`], and if a judgement is on a trial that is not there, or accepts one that cannot be analysed.
pub fn load_amended(folder: &Path, amendments: &Amendments) -> Result<Session, DatasetError> {
    let folder = SessionFolder::open(folder)?;
    let about = read_description(&folder)?;
    let mut rows = read_table(&folder)?;
    amend(&folder, &mut rows, amendments)?;
    check_total_size(&folder, rows.iter().map(|row| (row.trial.file.as_str(), &row.file_at)))?;
    // Every record is read before the first error is chosen, so that the message does not depend on threads.
    let trials: Vec<Result<Trial, DatasetError>> =
        rows.into_par_iter().map(|row| row.with_record(&folder, about.sample_rate_hz)).collect();
    let trials = trials.into_iter().collect::<Result<Vec<_>, _>>()?;
    check_further_channels(&trials, |trial| FilePlace::line(folder.name(&trial.file), 1))?;
    Ok(Session {
        subject: about.subject,
        sample_rate_hz: about.sample_rate_hz,
        lever: about.rig.lever,
        recorded_filter: about.recorded_filter,
        channel_ranges: about.channels.ranges(&folder.name("session.json"))?,
        trials,
    })
}

/// Refuses a record with other further channels than the first record of the session; `at` is the place of a trial's channels. A record
/// without rows may have any.
pub(super) fn check_further_channels(
    trials: &[Trial],
    at: impl Fn(&Trial) -> FilePlace,
) -> Result<(), DatasetError> {
    let mut recorded = trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty());
    let Some(first) = recorded.next() else { return Ok(()) };
    let channels = first.record.further_channels();
    let Some(other) = recorded.find(|trial| trial.record.further_channels() != channels) else {
        return Ok(());
    };
    let names = |channels: &[FurtherChannel]| match channels {
        [] => "no further channel".to_owned(),
        some => some.iter().map(|channel| channel.column()).collect::<Vec<_>>().join(", "),
    };
    Err(DatasetError::FurtherChannels {
        at: at(other),
        found: names(&other.record.further_channels()),
        expected: names(&channels),
        first: at(first).file.into(),
    })
}

/// Gives each trial the status of the last judgement on it.
fn amend(folder: &SessionFolder, rows: &mut [Row], amendments: &Amendments) -> Result<(), DatasetError> {
    for (index, amendment) in amendments.amendments.iter().enumerate() {
        let place =
            |field| FilePlace::field(folder.name(AMENDMENTS), &format!("amendments[{index}].{field}"));
        let at = || place("trial");
        let row = rows.iter_mut().find(|row| row.trial.number == amendment.trial);
        let Some(row) = row else {
            let expected = "the number of a trial in trials.csv".to_owned();
            return Err(DatasetError::Value { at: at(), found: amendment.trial.to_string(), expected });
        };
        if amendment.status == Status::Ok && row.trial.file.is_empty() {
            let expected = "a trial with a record; this one has no file in trials.csv".to_owned();
            return Err(DatasetError::Value { at: at(), found: amendment.trial.to_string(), expected });
        }
        if let Some(judged) = &amendment.record_sha256
            && record_sum(folder, &row.trial)?.is_some_and(|sum| sum != *judged)
        {
            return Err(DatasetError::OtherRecord {
                at: place("record_sha256"),
                trial: amendment.trial,
                record: folder.name(&row.trial.file),
            });
        }
        row.trial.status = amendment.status;
        let reason = format!("{} ({})", amendment.because, amendment.by);
        row.trial.extra.insert("reason".to_owned(), reason);
    }
    Ok(())
}

#[derive(Deserialize)]
struct Version {
    format: String,
}

/// `session.json`; further fields are allowed and belong to whoever wrote them.
#[derive(Deserialize)]
pub(super) struct ParsedDescription {
    subject: Subject,
    pub sample_rate_hz: f64,
    pub rig: ParsedRigDescription,
    // `null` says that nothing was filtered; not to say anything is not the same.
    #[serde(deserialize_with = "Option::deserialize")]
    recorded_filter: Option<FilterSpec>,
    #[serde(default)]
    channels: ParsedChannels,
}

#[derive(Deserialize)]
pub(super) struct ParsedRigDescription {
    #[serde(deserialize_with = "Option::deserialize")]
    pub lever: Option<Lever>,
}

pub(super) fn read_description(folder: &SessionFolder) -> Result<ParsedDescription, DatasetError> {
    let name = folder.name("session.json");
    let text = folder.text("session.json", limits::SETTINGS_BYTES, None)?;
    if text.trim().is_empty() {
        let expected = "a JSON object that describes the session".to_owned();
        return Err(DatasetError::Empty { at: FilePlace::file(name), expected });
    }
    // The version comes before everything else: of an unknown one, no field can be judged.
    let version: Version = parse_json(&name, &text)?;
    check_format(|| FilePlace::field(name.clone(), "format"), &version.format, SESSION_FORMAT)?;
    missing_fields(&name, &text)?;
    let about: ParsedDescription = parse_json(&name, &text)?;
    check_values(&name, about.sample_rate_hz, about.rig.lever.as_ref(), about.recorded_filter.as_ref())?;
    Ok(about)
}

/// Tells of all missing fields at once.
fn missing_fields(name: &str, text: &str) -> Result<(), DatasetError> {
    const FIELDS: [&str; 4] = ["subject.id", "sample_rate_hz", "rig.lever", "recorded_filter"];
    let about: serde_json::Value = parse_json(name, text)?;
    let is_missing = |path: &&str| about.pointer(&format!("/{}", path.replace('.', "/"))).is_none();
    let missing: Vec<&str> = FIELDS.into_iter().filter(is_missing).collect();
    if missing.len() < 2 {
        // If only one is missing, the parser reports it, with its line.
        return Ok(());
    }
    Err(DatasetError::MissingFields { at: FilePlace::file(name), fields: missing.join(", ") })
}

/// Whether a session can have this rate, lever and filter; `name` is the file, or what was given instead.
pub(super) fn check_values(
    name: &str,
    rate: f64,
    lever: Option<&Lever>,
    recorded_filter: Option<&FilterSpec>,
) -> Result<(), DatasetError> {
    let field = |field: &str, found: f64, good: bool, expected: &str| {
        if good {
            return Ok(());
        }
        Err(DatasetError::Value {
            at: FilePlace::field(name, field),
            found: found.to_string(),
            expected: expected.to_owned(),
        })
    };
    let possible = rate > 0.0 && rate <= limits::MAX_SAMPLE_RATE_HZ;
    field("sample_rate_hz", rate, possible, "a number of samples a second above 0 and at most 1000000")?;
    if let Some((name, found, expected)) = lever.and_then(|own| own.impossible_constants().next()) {
        field(&format!("rig.lever.{name}"), found, false, expected)?;
    }
    if let Some(FilterSpec::Butterworth { order, cutoff_hz, .. }) = recorded_filter.copied() {
        field("recorded_filter.order", f64::from(order), (1..=10).contains(&order), "an order from 1 to 10")?;
        let possible = cutoff_hz > 0.0 && cutoff_hz < rate / 2.0;
        field("recorded_filter.cutoff_hz", cutoff_hz, possible, "a frequency below half the sample rate")?;
        let passes = cutoff_hz >= SLOWEST_CUTOFF_HZ;
        field(
            "recorded_filter.cutoff_hz",
            cutoff_hz,
            passes,
            "a frequency in Hz from 3.98 up; is it in kHz? A slower filter leaves nothing of the 40 ms that are analysed",
        )?;
    }
    Ok(())
}

/// A row of `trials.csv`, whose record is still to be read.
struct Row {
    trial: Trial,
    file_at: FilePlace,
    onset_at: FilePlace,
}

fn read_table(folder: &SessionFolder) -> Result<Vec<Row>, DatasetError> {
    let text = folder.text("trials.csv", limits::TABLE_BYTES, None)?;
    let header = "a header trial,file,velocity_rad_s,torque_nm,repetition,onset_s,status and a row a trial";
    let mut table = CsvTable::new(folder.name("trials.csv"), &text, header)?;
    let number = table.column("trial")?;
    let file = table.column("file")?;
    let velocity = table.column("velocity_rad_s")?;
    let torque = table.column("torque_nm")?;
    let repetition = table.column("repetition")?;
    let onset = table.column("onset_s")?;
    let status = table.column("status")?;
    let condition = table.find("condition");
    let rest = table.find("rest_s");
    let known = [number, file, velocity, torque, repetition, onset, status];

    let mut rows = Vec::new();
    let mut seen = BTreeMap::new();
    let mut records = BTreeMap::new();
    while table.next_row()? {
        if rows.len() == limits::MAX_SESSION_TRIALS {
            let at = FilePlace::line(folder.name("trials.csv"), table.line());
            return Err(DatasetError::TooMany { at, what: "trials", limit: limits::MAX_SESSION_TRIALS });
        }
        let trial_number = table.count(number)?;
        if let Some(first_line) = seen.insert(trial_number, table.line()) {
            return Err(DatasetError::DuplicateTrial {
                at: table.place(number),
                number: trial_number,
                first_line,
            });
        }
        let trial_status = match table.text(status) {
            "ok" => Status::Ok,
            "aborted" => Status::Aborted,
            "rejected" => Status::Rejected,
            _ => return Err(table.invalid(status, "ok, aborted or rejected")),
        };
        if table.text(file).is_empty() && trial_status == Status::Ok {
            return Err(table.invalid(file, "the path of the trial's record, such as trials/trial-001.csv"));
        }
        if let Some(first_line) = records.insert(table.text(file).to_owned(), table.line())
            && !table.text(file).is_empty()
        {
            return Err(DatasetError::SharedRecord {
                at: table.place(file),
                file: excerpt(table.text(file)).into_owned(),
                first_line,
            });
        }
        let velocity_rad_s = table.number(velocity)?;
        if velocity_rad_s == 0.0 {
            return Err(table.invalid(velocity, "a velocity other than 0"));
        }
        let onset_s = if table.text(onset).is_empty() { None } else { Some(table.number(onset)?) };
        if let Some(rest) = rest
            && !table.text(rest).is_empty()
            && table.number(rest)? < 0.0
        {
            return Err(table.invalid(rest, "the rest before the trial in seconds, not below 0, or nothing"));
        }
        let extra = (0..table.header().len())
            .filter(|column| !known.contains(column) && Some(*column) != condition)
            .map(|column| (table.header()[column].clone(), table.text(column).to_owned()))
            .collect();
        rows.push(Row {
            trial: Trial {
                number: trial_number,
                file: table.text(file).to_owned(),
                velocity_rad_s,
                torque_nm: table.number(torque)?,
                repetition: table.count(repetition)?,
                condition: condition
                    .map(|column| table.text(column).to_owned())
                    .filter(|label| !label.is_empty()),
                onset_s,
                status: trial_status,
                extra,
                record: Record::default(),
            },
            file_at: table.place(file),
            onset_at: table.place(onset),
        });
    }
    Ok(rows)
}

/// Refuses records that are too large together, before any of them is read: paths, and the cells that name them. A record that
/// is not there is an error of its own, later.
pub(super) fn check_total_size<'a>(
    folder: &SessionFolder,
    records: impl Iterator<Item = (&'a str, &'a FilePlace)>,
) -> Result<(), DatasetError> {
    let mut left = limits::ALL_RECORDS_BYTES;
    for (file, at) in records.filter(|(file, _)| !file.is_empty()) {
        let bytes = folder.folder().length(file).unwrap_or(0).min(limits::RECORD_BYTES);
        left = left
            .checked_sub(bytes)
            .ok_or_else(|| DatasetError::TooMuch { at: at.clone(), limit: limits::ALL_RECORDS_BYTES })?;
    }
    Ok(())
}

impl Row {
    fn with_record(mut self, folder: &SessionFolder, sample_rate_hz: f64) -> Result<Trial, DatasetError> {
        if self.trial.file.is_empty() {
            return Ok(self.trial);
        }
        let text = folder.text(&self.trial.file, limits::RECORD_BYTES, Some(&self.file_at))?;
        let name = folder.name(&self.trial.file);
        self.trial.record = trial_csv_reader::parse(&name, &text, sample_rate_hz)?;
        check_record(&self.trial, &name, &self.onset_at, sample_rate_hz)?;
        Ok(self.trial)
    }
}

/// Whether a trial's record, called `name` in messages, is long enough to be analysed, and its onset, given at `onset_at`, lies in it.
pub(super) fn check_record(
    trial: &Trial,
    name: &str,
    onset_at: &FilePlace,
    sample_rate_hz: f64,
) -> Result<(), DatasetError> {
    let record = &trial.record;
    let samples = record.theta_m_rad.len();
    let analysed = trial.status == Status::Ok;
    let needed = (2.0 * AROUND_ONSET_S * sample_rate_hz).floor() as usize;
    if analysed && samples < needed {
        return Err(DatasetError::TooShort { at: FilePlace::file(name), found: samples, expected: needed });
    }
    let Some(onset_s) = trial.onset_s else { return Ok(()) };
    let (first_s, last_s) =
        (record.start_s, record.start_s + samples.saturating_sub(1) as f64 / sample_rate_hz);
    // Onsets are printed with few digits too.
    let rounding_s = 0.5 / sample_rate_hz;
    let margin_s = if analysed { AROUND_ONSET_S - 2.0 * rounding_s } else { 0.0 };
    let inside = |margin_s: f64| {
        onset_s >= first_s + margin_s - rounding_s && onset_s <= last_s - margin_s + rounding_s
    };
    let expected = match (inside(0.0) && samples > 0, inside(margin_s)) {
        (false, _) => "inside the record",
        (true, false) => "with at least 40 ms of the record before and after it",
        (true, true) => return Ok(()),
    };
    let at = onset_at.clone();
    Err(DatasetError::Onset { at, onset_s, expected, record: name.to_owned(), first_s, last_s })
}
