//! Streams of Lab Streaming Layer that are recorded beside the channels of the rig.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::recorded_channel::ChannelDetails;

/// Longest silence that can be let pass, s.
const LONGEST_SILENCE_S: f64 = 3600.0;

/// Shortest tolerated silence that a rig file may set, s: a device may pause that long between two parcels of samples.
const SHORTEST_SILENCE_S: f64 = 0.1;

/// A stream of Lab Streaming Layer, such as that of an EMG amplifier, which is recorded with the session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamSettings {
    /// Its name, as the device publishes it.
    pub name: String,
    /// Its type, such as `EMG`; needed where several streams have the name.
    #[serde(rename = "type", default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// What tells the device from others of its kind; needed where several streams have name and type.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_id: Option<String>,
    /// How many channels it must have; without it, any number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel_count: Option<u32>,
    /// How many samples a second it must say that it has; without it, any number above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Unit of its channels, such as `uV`. A stream that gives another one to a channel of EMG is refused.
    pub unit: String,
    /// The channel that is the EMG of the flexor carpi radialis, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_fcr: Option<StreamChannel>,
    /// The channel that is the EMG of the extensor carpi radialis, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emg_ecr: Option<StreamChannel>,
    /// How much of what goes wrong is let pass before it is a fault.
    pub tolerate: StreamTolerance,
}

/// A channel of a stream: by its label, or by its number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamChannel {
    /// Its label in the description of the stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// Its number, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number: Option<u32>,
    /// Mean rectified EMG at maximal effort, in the unit of the stream. Without it the EMG is kept, and the report does not show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mvc: Option<f64>,
    /// What is known of the channel: delay, filters, range (in the unit of the stream), origin.
    #[serde(default, skip_serializing_if = "ChannelDetails::is_unknown")]
    pub details: ChannelDetails,
}

/// How much of what goes wrong with a stream is let pass before it is a fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamTolerance {
    /// Time without a sample, or with one and the same value in a channel of EMG, s; after it the motor is made safe, as by any fault of a
    /// sensor, and the trial is run again. `null`: the session goes on without the stream, and says so.
    #[serde(deserialize_with = "Option::deserialize")]
    pub silent_s: Option<f64>,
}

/// A mistake in the streams of a rig file: the path of the field, and what was expected.
pub type StreamMistake = (String, String);

impl StreamSettings {
    /// The channels that are EMG, with the names of their fields: flexor and extensor.
    pub fn emg(&self) -> [(&'static str, Option<&StreamChannel>); 2] {
        [("emg_fcr", self.emg_fcr.as_ref()), ("emg_ecr", self.emg_ecr.as_ref())]
    }

    /// Its name as that of a file: letters, digits, `-`, `_` and `.`.
    pub fn file_stem(&self) -> String {
        let is_good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let stem: String = self.name.chars().map(|c| if is_good(c) { c } else { '-' }).collect();
        if stem.starts_with('.') { format!("stream{stem}") } else { stem }
    }

    fn mistakes(&self, path: &str, found: &mut Vec<StreamMistake>) {
        let mut add =
            |field: &str, expected: &str| found.push((format!("{path}.{field}"), expected.to_owned()));
        let is_name = |text: &str| {
            !text.trim().is_empty() && !text.contains('"') && !text.chars().any(char::is_control)
        };
        for (field, text) in [
            ("name", Some(&self.name)),
            ("type", self.kind.as_ref()),
            ("source_id", self.source_id.as_ref()),
            ("unit", Some(&self.unit)),
        ] {
            if text.is_some_and(|text| !is_name(text)) {
                add(field, "a text without \" and control characters");
            }
        }
        if self.channel_count == Some(0) {
            add("channel_count", "a number from 1 up");
        }
        if self.rate_hz.is_some_and(|rate_hz| !(rate_hz > 0.0 && rate_hz.is_finite())) {
            add("rate_hz", "samples a second, above 0");
        }
        let silence = SHORTEST_SILENCE_S..=LONGEST_SILENCE_S;
        if self.tolerate.silent_s.is_some_and(|silent_s| !silence.contains(&silent_s)) {
            add("tolerate.silent_s", "a number from 0.1 to 3600, or null");
        }
        for (field, channel) in self.emg() {
            let Some(channel) = channel else { continue };
            match (&channel.label, channel.number) {
                (Some(label), None) if is_name(label) => {}
                (None, Some(number)) if number >= 1 => {
                    if self.channel_count.is_some_and(|count| number > count) {
                        add(&format!("{field}.number"), "a number up to channel_count");
                    }
                }
                _ => add(field, "label or number, one of the two: a text, or a number from 1 up"),
            }
            if channel.at_mvc.is_some_and(|at_mvc| !(at_mvc > 0.0 && at_mvc.is_finite())) {
                add(&format!("{field}.at_mvc"), "a number above 0");
            }
            for (detail, expected) in channel.details.mistakes() {
                add(&format!("{field}.details.{detail}"), &expected);
            }
        }
    }
}

/// Everything that is wrong with the streams of a rig file.
pub fn stream_mistakes(streams: &[StreamSettings]) -> Vec<StreamMistake> {
    let mut found = Vec::new();
    for (at, stream) in streams.iter().enumerate() {
        let path = format!("streams[{at}]");
        stream.mistakes(&path, &mut found);
        let earlier = &streams[..at];
        let is_alike = |other: &StreamSettings| other.file_stem().eq_ignore_ascii_case(&stream.file_stem());
        if earlier.iter().any(is_alike) {
            let expected = "a name that differs from that of the other streams in letters or digits, for it names their files";
            found.push((format!("{path}.name"), expected.to_owned()));
        }
        let has_emg = |own: &StreamSettings| own.emg().iter().any(|(_, channel)| channel.is_some());
        if has_emg(stream) && earlier.iter().any(has_emg) {
            let expected =
                "emg_fcr and emg_ecr in one of the streams: the EMG of both muscles must have one clock";
            found.push((path, expected.to_owned()));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn told(change: impl FnOnce(&mut Value)) -> Vec<String> {
        let mut streams = json!([{
            "name": "Amplifier 1", "type": "EMG", "unit": "uV", "channel_count": 8,
            "emg_fcr": { "label": "FCR", "at_mvc": 120.0 }, "emg_ecr": { "number": 2 },
            "tolerate": { "silent_s": 1.0 }
        }, { "name": "Force plate", "unit": "N", "tolerate": { "silent_s": null } }]);
        change(&mut streams);
        let streams: Vec<StreamSettings> = serde_json::from_value(streams).unwrap();
        stream_mistakes(&streams).into_iter().map(|(path, _)| path).collect()
    }

    #[test]
    fn every_mistake_in_the_streams_is_told_with_its_field() {
        assert_eq!(told(|_| {}), Vec::<String>::new());
        type Change = fn(&mut Value);
        let changes: [(Change, &str); 9] = [
            (|own| own[0]["name"] = json!("a \" b"), "streams[0].name"),
            (|own| own[1]["name"] = json!("amplifier-1"), "streams[1].name"),
            (|own| own[0]["unit"] = json!(" "), "streams[0].unit"),
            (|own| own[0]["emg_ecr"]["number"] = json!(9), "streams[0].emg_ecr.number"),
            (|own| own[0]["emg_ecr"]["label"] = json!("ECR"), "streams[0].emg_ecr"),
            (|own| own[0]["emg_fcr"]["at_mvc"] = json!(0.0), "streams[0].emg_fcr.at_mvc"),
            (|own| own[0]["tolerate"]["silent_s"] = json!(0.0), "streams[0].tolerate.silent_s"),
            (|own| own[1]["emg_ecr"] = json!({ "number": 1 }), "streams[1]"),
            (
                |own| own[0]["emg_fcr"]["details"] = json!({ "delay_s": 3.0 }),
                "streams[0].emg_fcr.details.delay_s",
            ),
        ];
        for (change, path) in changes {
            assert_eq!(told(change), [path]);
        }
    }
}
