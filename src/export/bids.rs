//! A BIDS dataset of sessions: `emg` recordings where there is EMG, `motion` recordings where there is none.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::attached_emg::AttachedRecordings;
use super::bdf::BdfChannel;
use super::bids_folder::BidsFolder;
use super::current_results::current_files;
use super::error::ExportError;
use super::sidecars::{self, TASK};
use crate::dataset::{
    self, FurtherChannel, RampTime, Session, SessionCard, SessionClock, Trial, utc_seconds, utc_text,
    utc_text_us,
};
use crate::files::{self, Folder};

/// A session to export, with the label of its subject.
#[derive(Debug, Clone)]
pub struct Participant {
    /// The session's folder.
    pub folder: PathBuf,
    /// The label after `sub-`; the session's subject if not given.
    pub label: Option<String>,
}

/// A session that was read, with its position in the dataset.
struct Entry {
    card: SessionCard,
    folder: PathBuf,
    session: Session,
    attached: AttachedRecordings,
    label: String,
    /// Session number, from 1, if the subject has several sessions.
    number: Option<usize>,
}

/// Writes a dataset of `participants` into `target`, which must be new or empty.
///
/// # Errors
/// If a session cannot be read, the identifier of a subject cannot be part of a file name, or the target is not empty or
/// cannot be written. All checks are done before anything is written.
pub fn write(participants: &[Participant], target: &Path) -> Result<(), ExportError> {
    let is_empty = || Folder::open(target)?.entries().map(|entries| entries.is_empty());
    if files::exists(target) && !is_empty().map_err(ExportError::at(target))? {
        return Err(ExportError::NotEmpty(target.into()));
    }
    let entries = load(participants)?;
    let open = || {
        files::make_folders(target)?;
        Folder::open(target)
    };
    let target = BidsFolder::new(open().map_err(ExportError::at(target))?);
    target.put_json("dataset_description.json", &sidecars::dataset())?;
    target.put("README.md", sidecars::README)?;
    target.put_json(&format!("task-{TASK}_events.json"), &sidecars::events_meaning())?;
    let people: BTreeSet<&str> = entries.iter().map(|entry| entry.label.as_str()).collect();
    let (table, meaning) = participants_table(&people, &entries);
    target.put("participants.tsv", &table)?;
    target.put_json("participants.json", &meaning)?;
    target.put_json("derivatives/ramphold/dataset_description.json", &sidecars::derivatives())?;
    entries.iter().try_for_each(|entry| entry.write(&target))
}

/// When a recording of a trial began whose first sample is at `start_s` on the axis of the trial: to the microsecond where the session kept
/// the time of its samples. Without it, to the second from the session's start; nobody then knows how long a break was, so a trial after one
/// has no such time.
fn began_utc(
    started: &str,
    clock: &SessionClock,
    ramps: &[RampTime],
    trial: &Trial,
    start_s: f64,
) -> Option<String> {
    let ramp = ramps.iter().find(|ramp| ramp.trial == Some(trial.number))?;
    let since_start_s = ramp.onset_s + start_s - trial.onset_s?;
    if let Some(utc_ns) = clock.utc_ns(ramp.stretch, since_start_s) {
        return Some(utc_text_us(utc_ns));
    }
    (ramp.stretch == 0).then_some(())?;
    Some(utc_text(utc_seconds(started)? + libm::floor(since_start_s) as i64))
}

/// `participants.tsv` and `participants.json`: the identifiers, and every field that a session has of its subject.
fn participants_table(people: &BTreeSet<&str>, entries: &[Entry]) -> (String, Value) {
    let fields: BTreeSet<&str> =
        entries.iter().flat_map(|entry| entry.card.subject.fields.keys()).map(String::as_str).collect();
    let mut meaning = serde_json::json!({ "participant_id": { "Description": "Identifier of the subject" } });
    for field in &fields {
        meaning[*field] = serde_json::json!({ "Description": "As the operator gave it in session.json" });
    }
    // A tab or a line end would be another cell.
    let cell = |value: &Value| {
        value.as_str().map_or_else(|| value.to_string(), str::to_owned).replace(['\t', '\n', '\r'], " ")
    };
    let row = |label: &&str| {
        let value = |field: &&str| {
            let own = entries.iter().filter(|entry| entry.label == **label);
            own.filter_map(|entry| entry.card.subject.fields.get(*field))
                .map(cell)
                .next()
                .unwrap_or_else(|| "n/a".to_owned())
        };
        let cells: Vec<String> =
            std::iter::once(format!("sub-{label}")).chain(fields.iter().map(value)).collect();
        cells.join("\t") + "\n"
    };
    let head: Vec<String> = std::iter::once("participant_id".to_owned())
        .chain(fields.iter().map(|field| cell(&Value::from(*field))))
        .collect();
    (head.join("\t") + "\n" + &people.iter().map(row).collect::<String>(), meaning)
}

fn load(participants: &[Participant]) -> Result<Vec<Entry>, ExportError> {
    let mut entries = Vec::new();
    let mut sessions_of: BTreeMap<String, usize> = BTreeMap::new();
    for participant in participants {
        let session = dataset::load(&participant.folder)?;
        let label = label(participant, &session)?;
        if session.trials.iter().all(|trial| trial.record.theta_m_rad.is_empty()) {
            return Err(ExportError::Nothing(participant.folder.clone()));
        }
        let number = sessions_of.entry(label.clone()).or_default();
        *number += 1;
        let card = SessionCard::read(&participant.folder)?;
        entries.push(Entry {
            folder: participant.folder.clone(),
            attached: AttachedRecordings::read(&participant.folder)?,
            card,
            session,
            label,
            number: Some(*number),
        });
    }
    // BIDS names sessions either everywhere or nowhere.
    if sessions_of.values().all(|count| *count == 1) {
        entries.iter_mut().for_each(|entry| entry.number = None);
    }
    Ok(entries)
}

fn label(participant: &Participant, session: &Session) -> Result<String, ExportError> {
    let label = participant.label.as_ref().unwrap_or(&session.subject.id);
    if !label.is_empty() && label.chars().all(|c| c.is_ascii_alphanumeric()) {
        return Ok(label.clone());
    }
    let kept: String = label.chars().filter(char::is_ascii_alphanumeric).collect();
    let suggestion = if kept.is_empty() { "S01".into() } else { kept };
    if participant.label.is_some() {
        return Err(ExportError::Participant { label: label.clone(), suggestion });
    }
    let session = participant.folder.join("session.json");
    Err(ExportError::Subject { session, id: label.clone(), suggestion })
}

impl Entry {
    /// `sub-S01`, or `sub-S01/ses-02`.
    fn folder(&self) -> String {
        let session = self.number.map_or(String::new(), |number| format!("/ses-{number:02}"));
        format!("sub-{}{session}", self.label)
    }

    fn write(&self, target: &BidsFolder) -> Result<(), ExportError> {
        let stem = format!("{}_task-{TASK}", self.folder().replace('/', "_"));
        let mut scans = Vec::new();
        for trial in self.session.trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty()) {
            let has_emg = trial.record.emg_fcr_mvc.is_some() || trial.record.emg_ecr_mvc.is_some();
            let (kind, track) = if has_emg { ("emg", "") } else { ("motion", "_tracksys-motor") };
            let folder = format!("{}/{kind}", self.folder());
            let run = format!("run-{:03}", trial.number);
            let onset_s = trial.onset_s.map(|onset_s| onset_s - trial.record.start_s);
            target.put(&format!("{folder}/{stem}_{run}_events.tsv"), &sidecars::events(trial, onset_s))?;
            let name = |suffix: &str| format!("{folder}/{stem}{track}_{run}_{suffix}");
            let signal = if has_emg { "emg.bdf" } else { "motion.tsv" };
            scans.push((trial, trial.record.start_s, format!("{kind}/{stem}{track}_{run}_{signal}")));
            if has_emg {
                self.emg(trial, target, name)?
            } else {
                self.motion(trial, target, name)?
            }
            let stem = format!("{stem}_{run}");
            for (start_s, file) in
                self.attached.write(trial, &self.label, &format!("{}/emg", self.folder()), &stem, target)?
            {
                scans.push((trial, start_s, format!("emg/{file}")));
            }
        }
        if let Some(started) = &self.card.about.started_utc {
            let own = self.folder();
            let ramps = dataset::ramp_times(&self.folder)?.unwrap_or_default();
            let clock = SessionClock::read(&self.folder)?;
            let row = |(trial, start_s, file): &(&Trial, f64, String)| {
                let began = began_utc(started, &clock, &ramps, trial, *start_s);
                let began = began.unwrap_or_else(|| "n/a".to_owned());
                format!("{file}\t{began}\n")
            };
            let rows: String = scans.iter().map(row).collect();
            let table = format!("filename\tacq_time\n{rows}");
            target.put(&format!("{own}/{}_scans.tsv", own.replace('/', "_")), &table)?;
        }
        let from = Folder::open(&self.folder).map_err(ExportError::at(&self.folder))?;
        let files = dataset::session_files(&self.folder, &self.session)?;
        for file in current_files(&from, files, &self.session.digest())? {
            let to = match file.strip_prefix("results/") {
                Some(result) => format!("derivatives/ramphold/{}/{result}", self.folder()),
                None => format!("sourcedata/{}/{file}", self.folder()),
            };
            target.copy(&from, &file, &to)?;
        }
        Ok(())
    }

    fn emg(
        &self,
        trial: &Trial,
        target: &BidsFolder,
        name: impl Fn(&str) -> String,
    ) -> Result<(), ExportError> {
        let record = &trial.record;
        let muscles = [("emg_fcr", &record.emg_fcr_mvc), ("emg_ecr", &record.emg_ecr_mvc)];
        let measured = muscles.iter().filter_map(|(label, values)| Some((*label, "MVC", values.as_ref()?)));
        let moved = [("theta_m", "rad", &record.theta_m_rad), ("torque_l", "N.m", &record.torque_l_nm)];
        let further = FurtherChannel::ALL.into_iter().filter_map(|channel| {
            Some((channel.symbol(), sidecars::unit(channel), record.further(channel)?))
        });
        let channels: Vec<BdfChannel> = measured
            .chain(moved)
            .chain(further)
            .map(|(label, unit, values)| BdfChannel { label, unit, values })
            .collect();
        let further = record.further_channels().len();
        let rate_hz = self.session.sample_rate_hz;
        target.put_bdf(&name("emg.bdf"), &self.label, rate_hz, &channels)?;
        let muscles = channels.len() - 2 - further;
        let filters = sidecars::filters(&self.session);
        target.put_json(
            &name("emg.json"),
            &sidecars::emg(rate_hz, record.theta_m_rad.len(), muscles, 2 + further, filters),
        )?;
        target.put(
            &name("channels.tsv"),
            &sidecars::emg_channels(
                channels.iter().map(|channel| channel.label),
                rate_hz,
                &self.card.channels,
            ),
        )
    }

    fn motion(
        &self,
        trial: &Trial,
        target: &BidsFolder,
        name: impl Fn(&str) -> String,
    ) -> Result<(), ExportError> {
        let record = &trial.record;
        let further = record.further_channels();
        let mut text = String::new();
        for (sample, (angle, torque)) in record.theta_m_rad.iter().zip(&record.torque_l_nm).enumerate() {
            text += &format!("{angle}\t{torque}");
            for values in further.iter().filter_map(|channel| record.further(*channel)) {
                text += &format!("\t{}", values[sample]);
            }
            text += "\n";
        }
        target.put(&name("motion.tsv"), &text)?;
        target.put_json(&name("motion.json"), &sidecars::motion(&self.session, &further))?;
        target.put(&name("channels.tsv"), &sidecars::motion_channels(&further))
    }
}
