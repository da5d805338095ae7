//! The EMG of attached recordings, trial by trial, as a fraction of maximal voluntary contraction.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use super::attachment::{ATTACHED, Attachment, FrozenEmg, LeftOut};
use super::error::AttachError;
use crate::files::{EntryKind, Folder, limits};

/// The EMG of an attachment.
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
}

/// The EMG of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct AttachedTrialEmg {
    /// Time of the first sample on the axis of the trial's record, s.
    pub start_s: f64,
    /// EMG of flexor and extensor carpi radialis, fraction of MVC.
    pub mvc: [Option<Vec<f64>>; 2],
}

/// The EMG of the first attachment of `session`, by name, that has EMG and its value at maximal effort; `None` without such. A stream that
/// was recorded in several runs of the session is one attachment for each, and is read as one.
///
/// # Errors
/// If an attachment is there and is not what it should be.
pub fn attached_emg(session: &Path) -> Result<Option<AttachedEmg>, AttachError> {
    let path = session.join(ATTACHED);
    let unexpected = |file: &Path, found: String, expected: &str| AttachError::Unexpected {
        file: file.to_owned(),
        found,
        expected: expected.to_owned(),
    };
    let refused = |error: io::Error| unexpected(&path, error.to_string(), "a folder of attachments");
    let folder = match Folder::open(session).and_then(|own| own.folder(ATTACHED)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
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
    let mut found: Option<(AttachedEmg, Option<String>)> = None;
    for name in names {
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
        let roles = [(own.emg_fcr, own.emg_fcr_at_mvc), (own.emg_ecr, own.emg_ecr_at_mvc)]
            .map(|(column, at_mvc)| column.zip(at_mvc));
        if roles.iter().all(Option::is_none) {
            continue;
        }
        let stream = own.stream.map(|stream| stream.name);
        if found.as_ref().is_some_and(|(_, first)| first.is_none() || *first != stream) {
            continue;
        }
        let mut trials = BTreeMap::new();
        for trial in own.trials {
            let file = format!("{name}/{}", trial.file);
            let at = folder.path_of(&file);
            let bytes = folder.read(&file, limits::RECORD_BYTES);
            let bytes =
                bytes.map_err(|error| unexpected(&at, error.to_string(), "a trial of the attachment"))?;
            let read = trial_emg(&bytes, &roles).ok_or_else(|| {
                unexpected(
                    &at,
                    "no such table".to_owned(),
                    "a column t_s, those of the EMG, and numbers in them",
                )
            })?;
            trials.insert(trial.trial, read);
        }
        match &mut found {
            Some((first, _)) => {
                first.trials.extend(trials);
                first.left_out.extend(own.left_out);
                first.frozen.extend(own.frozen_emg);
            }
            None => {
                let (rate_hz, left_out, frozen) = (own.clock.rate_hz, own.left_out, own.frozen_emg);
                found = Some((AttachedEmg { name, rate_hz, trials, left_out, frozen }, stream));
            }
        }
    }
    Ok(found.map(|(emg, _)| emg))
}

/// The EMG in the table of a trial; `None` if a column is missing or a cell is no number.
fn trial_emg(bytes: &[u8], roles: &[Option<(String, f64)>; 2]) -> Option<AttachedTrialEmg> {
    let mut reader = csv::Reader::from_reader(bytes);
    let names = reader.headers().ok()?.clone();
    let place = |name: &str| names.iter().position(|own| own == name);
    let time = place("t_s")?;
    let mut columns = [None, None];
    for (column, role) in columns.iter_mut().zip(roles) {
        if let Some((name, at_mvc)) = role {
            *column = Some((place(name)?, *at_mvc, Vec::new()));
        }
    }
    let mut start_s = None;
    for row in reader.records() {
        let row = row.ok()?;
        let number = |at: usize| row.get(at)?.parse::<f64>().ok().filter(|value| value.is_finite());
        start_s = start_s.or(Some(number(time)?));
        for (at, at_mvc, values) in columns.iter_mut().flatten() {
            values.push(number(*at)? / *at_mvc);
        }
    }
    Some(AttachedTrialEmg { start_s: start_s?, mvc: columns.map(|own| own.map(|(_, _, values)| values)) })
}
