//! The EMG of attached recordings, trial by trial: as it came, and as a fraction of maximal voluntary contraction.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use super::attachment::{ATTACHED, Attachment, AttachmentTrial, FrozenEmg, LeftOut};
use super::emg_warning::EmgWarning;
use super::error::AttachError;
use crate::files::{EntryKind, Folder, limits};
use crate::rig::ChannelDetails;

/// The EMG of an attachment as it came, or of all attachments of a stream that was recorded in several runs of the session.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedRecording {
    /// Name of the attachment; of several runs that of the first.
    pub name: String,
    /// Samples a second, by its own clock.
    pub rate_hz: f64,
    /// How much faster its clock runs than that of the session, parts per million, where that is known.
    pub drift_ppm: Option<f64>,
    /// The channels that are EMG of flexor and extensor carpi radialis.
    pub emg: [Option<AttachedChannel>; 2],
    /// The trials by their number.
    pub trials: BTreeMap<u32, AttachedTrial>,
    /// The trials that are not in it.
    pub left_out: Vec<LeftOut>,
    /// What of it does not go on changing.
    pub frozen: Vec<FrozenEmg>,
    /// What else to know of the EMG before it is trusted.
    pub warnings: Vec<EmgWarning>,
    /// Name of the stream, if it is one.
    stream: Option<String>,
}

/// A channel of EMG of an attachment.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedChannel {
    /// Its column.
    pub column: String,
    /// Its unit, where that is known.
    pub unit: Option<String>,
    /// Mean rectified EMG at maximal effort, in that unit.
    pub at_mvc: Option<f64>,
    /// What else is known of it.
    pub details: ChannelDetails,
}

/// A trial in an attachment.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedTrial {
    /// Time of the first sample on the axis of the trial's record, s.
    pub start_s: f64,
    /// EMG of flexor and extensor carpi radialis, in the unit of the channel.
    pub values: [Option<Vec<f64>>; 2],
}

/// The EMG of an attachment as a fraction of maximal voluntary contraction.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedEmg {
    /// Name of the attachment.
    pub name: String,
    /// Samples a second.
    pub rate_hz: f64,
    /// The trials by their number.
    pub trials: BTreeMap<u32, AttachedTrialEmg>,
    /// The trials that are not in it.
    pub left_out: Vec<LeftOut>,
    /// What of it does not go on changing.
    pub frozen: Vec<FrozenEmg>,
    /// What else to know of the EMG before it is trusted.
    pub warnings: Vec<EmgWarning>,
    /// Names of the other attachments of the session that have EMG.
    pub others: Vec<String>,
}

/// The EMG of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedTrialEmg {
    /// Time of the first sample on the axis of the trial's record, s.
    pub start_s: f64,
    /// EMG of flexor and extensor carpi radialis, fraction of MVC.
    pub mvc: [Option<Vec<f64>>; 2],
}

/// The EMG of the first attachment of `session`, by name, that has EMG and its value at maximal effort; `None` without such.
///
/// # Errors
/// If an attachment is there and is not what it should be.
pub fn attached_emg(session: &Path) -> Result<Option<AttachedEmg>, AttachError> {
    let has_mvc = |own: &AttachedRecording| own.emg.iter().flatten().any(|channel| channel.at_mvc.is_some());
    let mut recordings = attached_recordings(session)?;
    let Some(first) = recordings.iter().position(has_mvc) else { return Ok(None) };
    let own = recordings.remove(first);
    let others = recordings.into_iter().map(|other| other.name).collect();
    Ok(Some(own.of_mvc(others)))
}

/// The attachments of `session` that have EMG, by name. A stream that was recorded in several runs of the session is one attachment for
/// each, and is read as one.
///
/// # Errors
/// If an attachment is there and is not what it should be.
pub fn attached_recordings(session: &Path) -> Result<Vec<AttachedRecording>, AttachError> {
    let path = session.join(ATTACHED);
    let refused = |error: io::Error| unexpected(&path, error.to_string(), "a folder of attachments");
    let folder = match Folder::open(session).and_then(|own| own.folder(ATTACHED)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        opened => opened.map_err(refused)?,
    };
    let mut names: Vec<String> = folder
        .entries()
        .map_err(refused)?
        .into_iter()
        .filter(|entry| entry.kind == EntryKind::Folder)
        .filter_map(|entry| entry.name.into_string().ok())
        .filter(|name| !name.starts_with('.'))
        .collect();
    names.sort();
    let mut found: Vec<AttachedRecording> = Vec::new();
    for name in names {
        let Some(own) = AttachedRecording::read(&folder, name)? else { continue };
        match found.iter_mut().find(|earlier| earlier.is_of_stream(&own)) {
            Some(earlier) => {
                earlier.trials.extend(own.trials);
                earlier.left_out.extend(own.left_out);
                earlier.frozen.extend(own.frozen);
                earlier.warnings.extend(own.warnings);
            }
            None => found.push(own),
        }
    }
    Ok(found)
}

impl AttachedRecording {
    /// Reads the attachment `name` of those in `folder`; `None` if it has no EMG.
    fn read(folder: &Folder, name: String) -> Result<Option<Self>, AttachError> {
        let file = format!("{name}/attachment.json");
        let at = folder.path_of(&file);
        let text = folder.read_text(&file, limits::SETTINGS_BYTES);
        let text =
            text.map_err(|error| unexpected(&at, error.to_string(), "the description of an attachment"))?;
        let own: Attachment = serde_json::from_str(&text)
            .map_err(|error| unexpected(&at, error.to_string(), "a file that ramphold attach wrote"))?;
        if own.format != Attachment::format() {
            let expected = format!("the format {}", Attachment::format());
            return Err(unexpected(&at, format!("the format {:?}", own.format), &expected));
        }
        let unit = own.stream.as_ref().map(|stream| stream.unit.clone());
        let details = own.stream.as_ref().map(|stream| stream.channels.clone()).unwrap_or_default();
        let channel = |(column, at_mvc): (Option<String>, Option<f64>)| {
            let column = column?;
            let details = details.get(&column).cloned().unwrap_or_default();
            Some(AttachedChannel { column, unit: unit.clone(), at_mvc, details })
        };
        let emg = [(own.emg_fcr, own.emg_fcr_at_mvc), (own.emg_ecr, own.emg_ecr_at_mvc)].map(channel);
        if emg.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut trials = BTreeMap::new();
        for trial in own.trials {
            trials.insert(trial.trial, AttachedTrial::read(folder, &name, &trial, &emg)?);
        }
        Ok(Some(Self {
            name,
            rate_hz: own.clock.rate_hz,
            drift_ppm: own.clock.drift_ppm,
            emg,
            trials,
            left_out: own.left_out,
            frozen: own.frozen_emg,
            warnings: own.emg_warnings,
            stream: own.stream.map(|stream| stream.name),
        }))
    }

    /// Whether the other is of the same stream, in another run of the session.
    fn is_of_stream(&self, other: &Self) -> bool {
        self.stream.is_some() && self.stream == other.stream && self.emg == other.emg
    }

    /// The channels whose value at maximal effort is known; `others` are the other attachments with EMG.
    fn of_mvc(self, others: Vec<String>) -> AttachedEmg {
        let at_mvc = self.emg.map(|channel| channel.and_then(|own| own.at_mvc));
        let scaled = |values: Option<Vec<f64>>, at_mvc: Option<f64>| {
            values
                .zip(at_mvc)
                .map(|(values, at_mvc)| values.into_iter().map(|value| value / at_mvc).collect())
        };
        let of_trial = |(number, AttachedTrial { start_s, values: [fcr, ecr] })| {
            (number, AttachedTrialEmg { start_s, mvc: [scaled(fcr, at_mvc[0]), scaled(ecr, at_mvc[1])] })
        };
        AttachedEmg {
            name: self.name,
            rate_hz: self.rate_hz,
            trials: self.trials.into_iter().map(of_trial).collect(),
            left_out: self.left_out,
            frozen: self.frozen,
            warnings: self.warnings,
            others,
        }
    }
}

impl AttachedTrial {
    fn read(
        folder: &Folder,
        attachment: &str,
        trial: &AttachmentTrial,
        emg: &[Option<AttachedChannel>; 2],
    ) -> Result<Self, AttachError> {
        let file = format!("{attachment}/{}", trial.file);
        let at = folder.path_of(&file);
        let bytes = folder
            .read(&file, limits::RECORD_BYTES)
            .map_err(|error| unexpected(&at, error.to_string(), "a trial of the attachment"))?;
        let expected = "a column t_s, those of the EMG, and numbers in them";
        Self::of_table(&bytes, emg).ok_or_else(|| unexpected(&at, "no such table".to_owned(), expected))
    }

    /// The EMG in the table of a trial; `None` if a column is missing or a cell is no number.
    fn of_table(bytes: &[u8], emg: &[Option<AttachedChannel>; 2]) -> Option<Self> {
        let mut reader = csv::Reader::from_reader(bytes);
        let names = reader.headers().ok()?.clone();
        let place = |name: &str| names.iter().position(|own| own == name);
        let time = place("t_s")?;
        let mut columns = [None, None];
        for (column, channel) in columns.iter_mut().zip(emg) {
            if let Some(channel) = channel {
                *column = Some((place(&channel.column)?, Vec::new()));
            }
        }
        let mut start_s = None;
        for row in reader.records() {
            let row = row.ok()?;
            let number = |at: usize| row.get(at)?.parse::<f64>().ok().filter(|value| value.is_finite());
            start_s = start_s.or(Some(number(time)?));
            for (at, values) in columns.iter_mut().flatten() {
                values.push(number(*at)?);
            }
        }
        Some(Self { start_s: start_s?, values: columns.map(|own| own.map(|(_, values)| values)) })
    }
}

fn unexpected(file: &Path, found: String, expected: &str) -> AttachError {
    AttachError::Unexpected { file: file.to_owned(), found, expected: expected.to_owned() }
}
