//! EMG of other devices in a BIDS dataset: a recording of its own for each trial, at the rate and on the clock of its device.
//!
//! It is not put into the file of the trial's own signals, for neither its rate nor its first sample is theirs.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::bdf::BdfChannel;
use super::bids_folder::BidsFolder;
use super::error::ExportError;
use super::sidecars;
use crate::attach::{AttachedChannel, AttachedRecording, AttachedTrial, attached_recordings};
use crate::dataset::Trial;

/// Muscle, and name of the channel, in the order of the channels.
pub const MUSCLES: [(&str, &str); 2] =
    [("flexor carpi radialis", "emg_fcr"), ("extensor carpi radialis", "emg_ecr")];

/// Unit of EMG whose value at maximal effort is known: that of the session's own EMG.
const FRACTION_OF_MVC: &str = "MVC";

/// The attachments of a session that have EMG, each with the label of its recordings.
#[derive(Debug)]
pub struct AttachedRecordings(Vec<(String, AttachedRecording)>);

impl AttachedRecordings {
    /// Those of `session`.
    pub fn read(session: &Path) -> Result<Self, ExportError> {
        let mut labels = BTreeSet::new();
        let labelled = |own: AttachedRecording| {
            let label = free_label(&own.name, &labels);
            labels.insert(label.clone());
            (label, own)
        };
        Ok(Self(attached_recordings(session)?.into_iter().map(labelled).collect()))
    }

    /// Writes the recordings of a trial into `folder`, with names that begin with `stem`. Returns for each when it begins on the axis of the
    /// trial, s, and the name of its file.
    pub fn write(
        &self,
        trial: &Trial,
        subject: &str,
        folder: &str,
        stem: &str,
        target: &BidsFolder,
    ) -> Result<Vec<(f64, String)>, ExportError> {
        let mut written = Vec::new();
        for (label, recording) in &self.0 {
            let Some(own) = recording.trials.get(&trial.number) else { continue };
            let stem = format!("{stem}_recording-{label}");
            let name = |suffix: &str| format!("{folder}/{stem}_{suffix}");
            let channels = channels(recording, own);
            let of_bdf: Vec<BdfChannel> = channels
                .iter()
                .map(|channel| BdfChannel {
                    label: channel.name,
                    unit: channel.unit.unwrap_or_default(),
                    values: &channel.values,
                })
                .collect();
            let samples = channels.first().map_or(0, |channel| channel.values.len());
            target.put_bdf(&name("emg.bdf"), subject, recording.rate_hz, &of_bdf)?;
            let about = sidecars::emg(recording.rate_hz, samples, channels.len(), 0, Value::from("n/a"));
            target.put_json(&name("emg.json"), &about)?;
            target.put(&name("channels.tsv"), &table(recording, trial.number, &channels))?;
            // On the clock of the recording, as its samples.
            let speed = 1.0 + 1e-6 * recording.drift_ppm.unwrap_or_default();
            let onset_s = trial.onset_s.map(|onset_s| (onset_s - own.start_s) * speed);
            target.put(&name("events.tsv"), &sidecars::events(trial, onset_s))?;
            written.push((own.start_s, format!("{stem}_emg.bdf")));
        }
        Ok(written)
    }
}

/// A channel of a recording as it is written.
struct WrittenChannel<'a> {
    about: &'a AttachedChannel,
    muscle: &'static str,
    name: &'static str,
    unit: Option<&'a str>,
    values: Vec<f64>,
}

fn channels<'a>(recording: &'a AttachedRecording, trial: &AttachedTrial) -> Vec<WrittenChannel<'a>> {
    let written = |((muscle, name), (about, values))| {
        let about: &AttachedChannel = Option::as_ref(about)?;
        let values: &Vec<f64> = Option::as_ref(values)?;
        let (unit, scale) = written_unit(about);
        let values = values.iter().map(|value| value / scale).collect();
        Some(WrittenChannel { about, muscle, name, unit, values })
    };
    MUSCLES.into_iter().zip(recording.emg.iter().zip(&trial.values)).filter_map(written).collect()
}

/// The unit in which a channel is written, where it is known, and how much of the channel's own that is: where EMG at maximal effort is known,
/// its fraction.
pub fn written_unit(channel: &AttachedChannel) -> (Option<&str>, f64) {
    match channel.at_mvc {
        Some(at_mvc) => (Some(FRACTION_OF_MVC), at_mvc),
        None => (channel.unit.as_deref(), 1.0),
    }
}

/// `_channels.tsv`. A channel that stood still in the trial is marked as bad.
fn table(recording: &AttachedRecording, trial: u32, channels: &[WrittenChannel]) -> String {
    let row = |channel: &WrittenChannel| {
        let WrittenChannel { about, muscle, name, unit, .. } = channel;
        let of_trial = recording
            .frozen
            .iter()
            .find(|frozen| frozen.column == about.column && frozen.trials.contains(&trial));
        let (status, because) = match of_trial {
            Some(_) => ("bad", "keeps one value for longer than noise and resolution can explain"),
            None => ("good", "n/a"),
        };
        let description = match about.at_mvc {
            Some(at_mvc) => format!(
                "{muscle}, fraction of maximal voluntary contraction: column {} of the attachment {}, divided by {at_mvc}",
                about.column, recording.name
            ),
            None => format!("{muscle}: column {} of the attachment {}", about.column, recording.name),
        };
        let cells = [
            (*name).to_owned(),
            "EMG".to_owned(),
            unit.unwrap_or("n/a").to_owned(),
            description,
            "bipolar".to_owned(),
            "wrist".to_owned(),
            (*muscle).to_owned(),
            recording.rate_hz.to_string(),
        ];
        // A tab or a line end would be another cell.
        let cells = cells.map(|cell| cell.replace(['\t', '\n', '\r'], " ")).join("\t");
        format!("{cells}\t{}\t{status}\t{because}\n", sidecars::cutoffs(about.details.filter.as_deref()))
    };
    "name\ttype\tunits\tdescription\treference\tgroup\ttarget_muscle\tsampling_frequency\tlow_cutoff\thigh_cutoff\tnotch\tstatus\t\
     status_description\n"
        .to_owned()
        + &channels.iter().map(row).collect::<String>()
}

/// The letters and digits of `name`, which are all that BIDS lets a label have; with a number if that is taken.
fn free_label(name: &str, taken: &BTreeSet<String>) -> String {
    let kept: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
    let kept = if kept.is_empty() { "attached".to_owned() } else { kept };
    let numbered = (2..).map(|number| format!("{kept}x{number}"));
    std::iter::once(kept.clone()).chain(numbered).find(|label| !taken.contains(label)).unwrap_or(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_has_letters_and_digits_and_is_of_one_attachment() {
        let taken = BTreeSet::from(["emg1".to_owned(), "emg1x2".to_owned()]);
        assert_eq!(free_label("Amplifier-7", &taken), "Amplifier7");
        assert_eq!(free_label("emg_1", &taken), "emg1x3");
        assert_eq!(free_label("-", &taken), "attached");
    }
}
