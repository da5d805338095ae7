//! What a stream says of itself: its rate, the format of its values, and its channels with their units.

use crate::rig::{StreamChannel, StreamSettings};

/// Channels of a stream, at most.
const MOST_CHANNELS: usize = 10_000;

/// What is wrong with a stream: what was found, and what was expected.
pub type StreamProblem = (String, String);

/// The format in which the values of a stream come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueFormat {
    /// `int8`
    Int8,
    /// `int16`
    Int16,
    /// `int32`
    Int32,
    /// `float32`
    Float32,
    /// `double64`
    Double64,
}

impl ValueFormat {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "int8" => Self::Int8,
            "int16" => Self::Int16,
            "int32" => Self::Int32,
            "float32" => Self::Float32,
            "double64" => Self::Double64,
            _ => return None,
        })
    }

    /// Adds a value as it came: each of these formats goes into a double and back without loss.
    pub fn push(self, bytes: &mut Vec<u8>, value: f64) {
        match self {
            Self::Int8 => bytes.extend_from_slice(&(value as i8).to_le_bytes()),
            Self::Int16 => bytes.extend_from_slice(&(value as i16).to_le_bytes()),
            Self::Int32 => bytes.extend_from_slice(&(value as i32).to_le_bytes()),
            Self::Float32 => bytes.extend_from_slice(&(value as f32).to_le_bytes()),
            Self::Double64 => bytes.extend_from_slice(&value.to_le_bytes()),
        }
    }
}

/// A stream by its own description.
#[derive(Debug, Clone, PartialEq)]
pub struct DescribedStream {
    /// The description as it came.
    pub xml: String,
    /// What tells the device from others; without it, a stream that stops cannot be found again.
    pub source_id: String,
    /// Samples a second that it says it has.
    pub rate_hz: f64,
    /// Format of its values.
    pub format: ValueFormat,
    /// Label, empty where there is none, and unit, if it says one, of each channel.
    pub channels: Vec<(String, Option<String>)>,
}

impl DescribedStream {
    /// Reads the description, and holds it against what the rig file says.
    ///
    /// # Errors
    /// What is not as the rig file says, or not as it must be to be recorded.
    pub fn read(xml: String, settings: &StreamSettings) -> Result<Self, StreamProblem> {
        let problem = |found: String, expected: &str| Err((found, expected.to_owned()));
        let document = match roxmltree::Document::parse(&xml) {
            Ok(document) => document,
            Err(error) => {
                return problem(format!("a description that is no XML ({error})"), "one by liblsl");
            }
        };
        let info = document.root_element();
        let child = |node: roxmltree::Node, name: &str| {
            let own = node.children().find(|node| node.has_tag_name(name));
            own.and_then(|node| node.text()).map_or(String::new(), |text| text.trim().to_owned())
        };
        let field = |name: &str| child(info, name);
        let (count, rate, format) = (field("channel_count"), field("nominal_srate"), field("channel_format"));
        let Some(value_format) = ValueFormat::named(&format) else {
            let expected = "float32, double64, int8, int16 or int32: a stream of numbers that a double holds without loss";
            return problem(format!("values of the format {format}"), expected);
        };
        let Some(count) = count.parse::<usize>().ok().filter(|own| (1..=MOST_CHANNELS).contains(own)) else {
            return problem(
                format!("a description with channel_count {count:?}"),
                &format!("a number of channels from 1 to {MOST_CHANNELS}"),
            );
        };
        if settings.channel_count.is_some_and(|expected| expected as usize != count) {
            let expected = settings.channel_count.unwrap_or(0);
            return problem(
                format!("{count} channels"),
                &format!("{expected}, as channel_count says: is it the right device?"),
            );
        }
        // A description without the field has no rate either.
        let rate_hz: f64 = if rate.is_empty() { 0.0 } else { rate.parse().unwrap_or(f64::NAN) };
        if !(rate_hz >= 0.0 && rate_hz.is_finite()) {
            return problem(
                format!("a description with nominal_srate {rate:?}"),
                "a number of samples a second, more than 0",
            );
        }
        if rate_hz == 0.0 {
            return problem(
                "a stream without a rate (nominal_srate 0)".to_owned(),
                "samples at a steady rate: samples that come now and then have no place between others",
            );
        }
        if let Some(expected) = settings.rate_hz
            && (rate_hz / expected - 1.0).abs() > 1e-3
        {
            return problem(format!("{rate_hz} samples a second"), &format!("{expected}, as rate_hz says"));
        }
        let described: Vec<(String, Option<String>)> = info
            .descendants()
            .filter(|node| node.has_tag_name("channel"))
            .map(|node| (child(node, "label"), Some(child(node, "unit")).filter(|unit| !unit.is_empty())))
            .collect();
        let channels = if described.len() == count { described } else { vec![(String::new(), None); count] };
        let own =
            Self { source_id: field("source_id"), rate_hz, format: value_format, channels, xml: xml.clone() };
        for (name, channel) in settings.emg() {
            if let Some(channel) = channel {
                own.check_channel(name, channel, &settings.unit)?;
            }
        }
        Ok(own)
    }

    /// Names in the rig file and places of the channels that are EMG; none is left out of a stream that was read.
    pub fn emg_places(&self, settings: &StreamSettings) -> Vec<(&'static str, usize)> {
        let place = |(name, channel): (_, Option<&StreamChannel>)| Some((name, self.place(channel?).ok()?));
        settings.emg().into_iter().filter_map(place).collect()
    }

    /// Place of a channel.
    fn place(&self, channel: &StreamChannel) -> Result<usize, StreamProblem> {
        let count = self.channels.len();
        match (&channel.label, channel.number) {
            (Some(label), _) => {
                let own: Vec<usize> = (0..count).filter(|place| self.channels[*place].0 == *label).collect();
                match own.as_slice() {
                    [place] => Ok(*place),
                    [] => Err((format!("no channel {label:?}"), self.labels())),
                    several => Err((
                        format!("{} channels with the label {label:?}", several.len()),
                        "one; give its number in place of the label".to_owned(),
                    )),
                }
            }
            (None, number) => {
                let number = number.unwrap_or(0) as usize;
                let expected = format!("a number from 1 to {count}");
                (1..=count)
                    .contains(&number)
                    .then(|| number - 1)
                    .ok_or((format!("no channel {number}"), expected))
            }
        }
    }

    fn labels(&self) -> String {
        let labels: Vec<&str> = self.channels.iter().map(|(label, _)| label.as_str()).collect();
        if labels.iter().all(|label| label.is_empty()) {
            return format!("a number from 1 to {}, for its channels have no labels", labels.len());
        }
        format!("one of {}", labels.join(", "))
    }

    fn check_channel(&self, name: &str, channel: &StreamChannel, unit: &str) -> Result<(), StreamProblem> {
        let in_field = |(found, expected): StreamProblem| (format!("{name}: {found}"), expected);
        let place = self.place(channel).map_err(in_field)?;
        match &self.channels[place].1 {
            Some(own) if plain_unit(own) != plain_unit(unit) => Err(in_field((
                format!("channel {} in {own}", place + 1),
                format!("{unit}, as unit says: at_mvc is in that unit"),
            ))),
            _ => Ok(()),
        }
    }
}

/// A unit without the ways in which it is written: the micro sign, and the whole word.
fn plain_unit(unit: &str) -> String {
    let plain = unit.trim().replace(['µ', 'μ'], "u");
    let known = match plain.to_ascii_lowercase().as_str() {
        "microvolt" | "microvolts" => "uV",
        "millivolt" | "millivolts" => "mV",
        "volt" | "volts" => "V",
        "newton" | "newtons" => "N",
        _ => return plain,
    };
    known.to_owned()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn described(
        xml: impl Fn(&str) -> String,
        emg: serde_json::Value,
    ) -> Result<DescribedStream, StreamProblem> {
        let settings = json!({
            "name": "EMG", "unit": "uV", "channel_count": 2, "emg_fcr": emg, "tolerate": { "silent_s": 1.0 }
        });
        let channels = "<desc><channels><channel><label>FCR</label><unit>microvolts</unit></channel>\
                        <channel><label>ECR</label><unit>mV</unit></channel></channels></desc>";
        DescribedStream::read(xml(channels), &serde_json::from_value(settings).unwrap())
    }

    fn info(format: &str, count: impl std::fmt::Display, rate: &str, channels: &str) -> String {
        format!(
            "<info><name>EMG</name><channel_count>{count}</channel_count><nominal_srate>{rate}</nominal_srate>\
             <channel_format>{format}</channel_format><source_id>s</source_id>{channels}</info>"
        )
    }

    #[test]
    fn a_stream_that_is_not_as_the_rig_file_says_is_refused_with_what_is_wrong() {
        let good = described(|own| info("float32", 2, "2000", own), json!({ "label": "FCR" })).unwrap();
        assert_eq!((good.rate_hz, good.format), (2000.0, ValueFormat::Float32));
        assert_eq!(good.channels[0], ("FCR".to_owned(), Some("microvolts".to_owned())));
        for (xml, emg, words) in [
            (("string", 2, "2000"), json!({ "number": 1 }), "values of the format string"),
            (("float32", 3, "2000"), json!({ "number": 1 }), "3 channels"),
            (("float32", 2, "0"), json!({ "number": 1 }), "without a rate"),
            (("float32", 2, "2000"), json!({ "label": "Biceps" }), "emg_fcr: no channel \"Biceps\""),
            (("float32", 2, "2000"), json!({ "number": 3 }), "emg_fcr: no channel 3"),
            (("float32", 2, "2000"), json!({ "label": "ECR" }), "emg_fcr: channel 2 in mV"),
        ] {
            let (format, count, rate) = xml;
            let (found, expected) = described(|own| info(format, count, rate, own), emg).unwrap_err();
            assert!(found.contains(words) && !expected.is_empty(), "{found}; expected {expected}");
        }
    }

    #[test]
    fn a_number_that_cannot_be_read_is_named_as_it_stands() {
        for (count, rate, words) in [
            ("two", "2000", "channel_count \"two\""),
            ("", "2000", "channel_count \"\""),
            ("-1", "2000", "channel_count \"-1\""),
            ("0", "2000", "channel_count \"0\""),
            ("18446744073709551615", "2000", "channel_count \"18446744073709551615\""),
            ("2", "2000 Hz", "nominal_srate \"2000 Hz\""),
            ("2", "2000,5", "nominal_srate \"2000,5\""),
            ("2", "-1", "nominal_srate \"-1\""),
            ("2", "inf", "nominal_srate \"inf\""),
            ("2", "", "without a rate"),
        ] {
            let emg = json!({ "number": 1 });
            let (found, expected) = described(|own| info("float32", count, rate, own), emg).unwrap_err();
            assert!(found.contains(words) && !expected.is_empty(), "{found}; expected {expected}");
        }
    }
}
