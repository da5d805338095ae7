//! EMG of other devices in an NWB file: a time series for each muscle of each attachment, at the rate of its device.

use hdf5_pure::GroupBuilder;

use super::objects::ObjectIds;
use super::series::{Series, add_series};
use crate::attach::{AttachedChannel, AttachedRecording};
use crate::export::attached_emg::{MUSCLES, written_unit};
use crate::export::trial_times::PlacedTrial;

/// Adds the EMG of an attachment: as a fraction of maximal voluntary contraction where that is known, else as it came.
pub fn add_attached(
    acquisition: &mut GroupBuilder,
    recording: &AttachedRecording,
    placed: &[PlacedTrial],
    ids: &ObjectIds,
) {
    for (muscle, (title, name)) in MUSCLES.into_iter().enumerate() {
        let Some(channel) = &recording.emg[muscle] else { continue };
        let (unit, scale) = written_unit(channel);
        let (values, times_s) = samples(recording, muscle, scale, placed);
        add_series(
            acquisition,
            Series {
                name: format!("{name}_{}", recording.name),
                description: described(recording, channel, title),
                comments: None,
                unit: unit.unwrap_or("unknown"),
                values,
                times_s,
            },
            ids,
        );
    }
}

/// The samples of a muscle in all trials, over `scale`, and their times, s.
fn samples(
    recording: &AttachedRecording,
    muscle: usize,
    scale: f64,
    placed: &[PlacedTrial],
) -> (Vec<f64>, Vec<f64>) {
    // Samples in a second of the session.
    let rate_hz = recording.rate_hz * (1.0 + 1e-6 * recording.drift_ppm.unwrap_or_default());
    let (mut values, mut times_s) = (Vec::new(), Vec::new());
    for placed in placed {
        let Some(own) = recording.trials.get(&placed.trial.number) else { continue };
        let Some(emg) = &own.values[muscle] else { continue };
        values.extend(emg.iter().map(|value| value / scale));
        times_s.extend((0..emg.len()).map(|sample| placed.record_s(own.start_s + sample as f64 / rate_hz)));
    }
    (values, times_s)
}

fn described(recording: &AttachedRecording, channel: &AttachedChannel, muscle: &str) -> String {
    let AttachedRecording { name, rate_hz, .. } = recording;
    let scaled = channel.at_mvc.map_or(String::new(), |at_mvc| {
        format!(", divided by {at_mvc}, the mean rectified EMG at maximal voluntary contraction")
    });
    let mut text = format!(
        "EMG of {muscle}: column {} of the attachment {name} in the trials, {rate_hz} samples a second by the clock of its device{scaled}.",
        channel.column
    );
    for frozen in recording.frozen.iter().filter(|frozen| frozen.column == channel.column) {
        let trials: Vec<String> = frozen.trials.iter().map(u32::to_string).collect();
        text += &format!(
            " In trials {} it keeps one value for longer than noise and resolution can explain.",
            trials.join(", ")
        );
    }
    text
}
