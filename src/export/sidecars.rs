//! The JSON and TSV files that describe a BIDS recording.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::record_channels::title;
use crate::dataset::{FurtherChannel, PROGRAM, Session, Trial};
use crate::rig::{ChannelFilter, RecordedChannel};

/// The task's name in files.
pub const TASK: &str = "rampandhold";

/// The version of BIDS that is written.
const BIDS_VERSION: &str = "1.11.0";

/// The version of the Hierarchical Event Descriptors with which events are tagged.
const HED_VERSION: &str = "8.4.0";

/// `dataset_description.json` of the dataset.
pub fn dataset() -> Value {
    json!({
        "Name": "Ramp-and-hold experiments on the human wrist",
        "BIDSVersion": BIDS_VERSION,
        "HEDVersion": HED_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [generated_by()],
    })
}

/// `dataset_description.json` of the derivatives.
pub fn derivatives() -> Value {
    json!({
        "Name": "Fits and diagnoses of ramp-and-hold sessions",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [generated_by()],
    })
}

fn generated_by() -> Value {
    let [name, version] = program();
    json!({ "Name": name, "Version": version })
}

/// Name and version of this program.
pub fn program() -> [&'static str; 2] {
    let (name, version) = PROGRAM.split_once(' ').unwrap_or((PROGRAM, ""));
    [name, version]
}

/// The README that BIDS asks for.
pub const README: &str = "\
# Ramp-and-hold experiments on the human wrist

A stiff servo motor holds a wrist, the person pushes with a set torque, and the motor extends the wrist with a fast ramp.
Each run is a trial: motor angle (rad), torque in the lever (N m) and, where it was measured, EMG of flexor and extensor
carpi radialis as a fraction of maximal voluntary contraction. Signals are raw: unfiltered, offsets not removed.
EMG of another device has its own rate and clock: it is a recording of its own (recording-NAME), which begins within a sample
of the trial.

The sessions as they were recorded are in sourcedata/, fits, diagnoses and reports in derivatives/ramphold/.
";

/// `_emg.json` of a recording with so many channels of EMG and `other` ones.
pub fn emg(rate_hz: f64, samples: usize, muscles: usize, other: usize, software_filters: Value) -> Value {
    json!({
        "TaskName": TASK,
        "TaskDescription": task(),
        "SamplingFrequency": rate_hz,
        "PowerLineFrequency": "n/a",
        "SoftwareFilters": software_filters,
        "RecordingType": "continuous",
        "RecordingDuration": samples as f64 / rate_hz,
        "EMGChannelCount": muscles,
        "MISCChannelCount": other,
        "EMGPlacementScheme": "Other",
        "EMGPlacementSchemeDescription": "On the bellies of flexor carpi radialis (FCR) and extensor carpi radialis (ECR)",
        "EMGReference": "bipolar",
        "EMGGround": "n/a",
    })
}

/// `_motion.json`.
pub fn motion(session: &Session, further: &[FurtherChannel]) -> Value {
    let angles = further.iter().filter(|channel| channel.is_angle()).count();
    json!({
        "TaskName": TASK,
        "TaskDescription": task(),
        "SamplingFrequency": session.sample_rate_hz,
        "TrackingSystemName": "servo motor with encoder and strain gauges",
        "MotionChannelCount": 2 + further.len(),
        "JNTANGChannelCount": 1 + angles,
        "MISCChannelCount": 1 + further.len() - angles,
        "MissingValues": "n/a",
        "SoftwareFilters": filters(session),
    })
}

/// What is done in a trial.
pub fn task() -> &'static str {
    "Hold a target torque against the motor; once it is steady, a fast ramp extends the wrist and holds it there"
}

/// `SoftwareFilters`: what was filtered before recording.
pub fn filters(session: &Session) -> Value {
    session.recorded_filter.map_or(json!("n/a"), |filter| json!({ "BeforeRecording": filter }))
}

/// `_channels.tsv` of an EMG recording with the channels named, whose samples come at `rate_hz`; `known` is what the session says of them.
pub fn emg_channels<'a>(
    names: impl Iterator<Item = &'a str>,
    rate_hz: f64,
    known: &BTreeMap<String, RecordedChannel>,
) -> String {
    let rows = names.map(|name| {
        let known = known.iter().find(|(column, _)| column.strip_prefix(name).is_some_and(is_unit_of_column));
        let filters = cutoffs(known.and_then(|(_, channel)| channel.filter.as_deref()));
        let rest = match EMG_CHANNELS.iter().find(|row| row[0] == name) {
            Some([name, kind, unit, rest]) => format!("{name}\t{kind}\t{unit}\t{}\t{rest}", title(name)),
            None => match FurtherChannel::ALL.into_iter().find(|channel| channel.symbol() == name) {
                Some(channel) => {
                    format!("{name}\tMISC\t{}\t{}\tn/a\tn/a\tn/a", unit(channel), channel.title())
                }
                None => format!("{name}\tMISC\tn/a\tn/a\tn/a\tn/a\tn/a"),
            },
        };
        format!("{rest}\t{rate_hz}\t{filters}\n")
    });
    "name\ttype\tunits\tdescription\treference\tgroup\ttarget_muscle\tsampling_frequency\tlow_cutoff\thigh_cutoff\tnotch\n"
        .to_owned()
        + &rows.collect::<String>()
}

/// Whether this is the part of a column's name after that of its channel, as `_mvc` of `emg_fcr_mvc`.
fn is_unit_of_column(rest: &str) -> bool {
    ["_mvc", "_rad", "_nm", "_rad_s2"].contains(&rest)
}

/// Cut-off frequencies of a channel's high-pass and low-pass, and its notch, Hz; `n/a` where there is none or it is not known.
pub fn cutoffs(filters: Option<&[ChannelFilter]>) -> String {
    let filters = filters.unwrap_or_default();
    let of = |cutoff: fn(&ChannelFilter) -> Option<f64>| {
        filters.iter().find_map(cutoff).map_or("n/a".to_owned(), |cutoff_hz| cutoff_hz.to_string())
    };
    // BIDS: the high-pass is the low cut-off.
    let low = of(|filter| match filter {
        ChannelFilter::HighPass { cutoff_hz, .. } => Some(*cutoff_hz),
        _ => None,
    });
    let high = of(|filter| match filter {
        ChannelFilter::LowPass { cutoff_hz, .. } => Some(*cutoff_hz),
        _ => None,
    });
    let notch = of(|filter| match filter {
        ChannelFilter::Notch { frequency_hz } => Some(*frequency_hz),
        _ => None,
    });
    format!("{low}\t{high}\t{notch}")
}

/// Name, type and unit of a channel, and what follows its description.
const EMG_CHANNELS: [[&str; 4]; 4] = [
    ["emg_fcr", "EMG", "MVC", "bipolar\twrist\tflexor carpi radialis"],
    ["emg_ecr", "EMG", "MVC", "bipolar\twrist\textensor carpi radialis"],
    ["theta_m", "MISC", "rad", "n/a\tn/a\tn/a"],
    ["torque_l", "MISC", "N.m", "n/a\tn/a\tn/a"],
];

/// `_channels.tsv` of a motion recording.
pub fn motion_channels(further: &[FurtherChannel]) -> String {
    let row = |name: &str, kind: &str, unit: &str, title: &str| {
        format!("{name}\tn/a\t{kind}\twrist\t{unit}\t{title}\n")
    };
    let further = further.iter().map(|channel| {
        let kind = if channel.is_angle() { "JNTANG" } else { "MISC" };
        row(channel.symbol(), kind, unit(*channel), channel.title())
    });
    "name\tcomponent\ttype\ttracked_point\tunits\tdescription\n".to_owned()
        + &row("theta_m", "JNTANG", "rad", title("theta_m"))
        + &row("torque_l", "MISC", "N.m", title("torque_l"))
        + &further.collect::<String>()
}

/// Unit of a further channel, as BIDS writes it.
pub fn unit(channel: FurtherChannel) -> &'static str {
    match channel {
        FurtherChannel::HandleAngle | FurtherChannel::JointAngle => "rad",
        FurtherChannel::HandleAcceleration => "rad/s^2",
        FurtherChannel::HandTorque => "N.m",
    }
}

/// What the columns of `_events.tsv` mean.
pub fn events_meaning() -> Value {
    json!({
        "trial_type": {
            "Description": "What happens",
            "Levels": { "ramp": "The motor begins to turn the wrist" },
            "HED": { "ramp": "Sensory-event, Experimental-stimulus, Somatic-presentation, (Machine, (Stretch, Wrist))" },
        },
        "velocity_rad_s": {
            "Description": "Ramp velocity", "Units": "rad/s",
            "HED": "(Parameter-label/Ramp-velocity, Parameter-value/#)",
        },
        "torque_nm": {
            "Description": "Target torque", "Units": "N.m",
            "HED": "(Parameter-label/Target-torque, Parameter-value/#)",
        },
        "repetition": {
            "Description": "Repetition index of its condition, from 1",
            "HED": "(Parameter-label/Repetition, Parameter-value/#)",
        },
        "trial": { "Description": "Number of the trial in the session", "HED": "Experimental-trial/#" },
        "status": { "Description": "Outcome of the trial", "Levels": {
            "ok": "complete", "rejected": "a rule of the protocol was broken", "aborted": "ended before its time" },
            "HED": {
                "ok": "Label/Trial-complete", "rejected": "Label/Trial-rejected", "aborted": "Label/Trial-aborted" } },
    })
}

/// `_events.tsv` of a recording of a trial, in which its onset is at `onset_s` after the first sample; no row where there is no onset.
pub fn events(trial: &Trial, onset_s: Option<f64>) -> String {
    let mut text =
        "onset\tduration\ttrial_type\tvelocity_rad_s\ttorque_nm\trepetition\ttrial\tstatus\n".to_owned();
    if let Some(onset_s) = onset_s {
        let amplitude: Option<f64> = trial.extra.get("amplitude_rad").and_then(|text| text.parse().ok());
        let duration = amplitude.map_or("n/a".into(), |rad| (rad / trial.velocity_rad_s).abs().to_string());
        text += &format!(
            "{onset_s}\t{duration}\tramp\t{}\t{}\t{}\t{}\t{}\n",
            trial.velocity_rad_s,
            trial.torque_nm,
            trial.repetition,
            trial.number,
            trial.status.name()
        );
    }
    text
}
