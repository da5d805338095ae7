//! What is known of a channel besides its values: rate, unit, delay, filters, range and origin.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::signal::FilterSpec;

/// A filter that a channel passed before it was recorded, in the amplifier or in a device's firmware.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ChannelFilter {
    /// Low-pass.
    LowPass {
        /// Cut-off frequency (-3 dB), Hz.
        cutoff_hz: f64,
        /// Order, if it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        order: Option<u32>,
    },
    /// High-pass.
    HighPass {
        /// Cut-off frequency (-3 dB), Hz.
        cutoff_hz: f64,
        /// Order, if it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        order: Option<u32>,
    },
    /// Notch, as against mains hum.
    Notch {
        /// Frequency that is taken out, Hz.
        frequency_hz: f64,
    },
    /// Rectifier with a moving mean: what is recorded is an envelope.
    Envelope {
        /// Length of the mean, s.
        length_s: f64,
    },
}

impl ChannelFilter {
    /// The names of its fields that must be positive, and their values.
    pub fn positive_fields(&self) -> [(&'static str, f64); 1] {
        match *self {
            Self::LowPass { cutoff_hz, .. } | Self::HighPass { cutoff_hz, .. } => [("cutoff_hz", cutoff_hz)],
            Self::Notch { frequency_hz } => [("frequency_hz", frequency_hz)],
            Self::Envelope { length_s } => [("length_s", length_s)],
        }
    }
}

/// What a laboratory knows of a channel of its rig. Everything may be left out: what is left out is not known.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ChannelDetails {
    /// How late the channel is recorded, s: from the event at the wrist to the time of its sample.
    pub delay_s: Option<f64>,
    /// Filters before the recording, in their order; an empty list says that there is none.
    pub filter: Option<Vec<ChannelFilter>>,
    /// Lowest and highest value that it can show, in its unit.
    pub range: Option<[f64; 2]>,
    /// What measured it: sensor, amplifier, serial number.
    pub origin: Option<String>,
}

impl ChannelDetails {
    /// Whether nothing is known.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// What is wrong with it: the path of each field, and what was expected.
    pub fn mistakes(&self) -> Vec<(String, String)> {
        let mut found = Vec::new();
        let mut in_range = |path: String, value: f64, low: f64, high: f64| {
            if !(low..=high).contains(&value) {
                found.push((path, format!("a number from {low} to {high}")));
            }
        };
        in_range("delay_s".to_owned(), self.delay_s.unwrap_or(0.0), -1.0, 1.0);
        for (at, filter) in self.filter.iter().flatten().enumerate() {
            for (field, value) in filter.positive_fields() {
                in_range(format!("filter[{at}].{field}"), value, 1e-6, 1e6);
            }
        }
        if let Some([low, high]) = self.range
            && !(low < high && low.is_finite() && high.is_finite())
        {
            found.push(("range".to_owned(), "[lowest, highest]".to_owned()));
        }
        found
    }
}

/// A channel of a session as `session.json` describes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RecordedChannel {
    /// Measurements a second. Where it is below the session's rate, a record repeats each of them until the next.
    pub rate_hz: Option<f64>,
    /// Unit: `rad`, `N m`, `MVC`, `rad/s2`.
    pub unit: Option<String>,
    /// How late the channel is recorded, s; `null` if it is not known.
    pub delay_s: Option<f64>,
    /// Filters before the recording, in their order; an empty list says that there is none, `null` that it is not known.
    pub filter: Option<Vec<ChannelFilter>>,
    /// Lowest and highest value that the channel can show, in its unit; `null` if it is not known.
    pub range: Option<[f64; 2]>,
    /// What measured it; `null` if it is not known.
    pub origin: Option<String>,
}

/// What a rig does to its signals before they are recorded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordedSignals {
    /// The filter that both angle and torque passed; the analysis takes it out of both and filters with it. `None`: no filter.
    pub recorded_filter: Option<FilterSpec>,
    /// The channels by the name of their column.
    pub channels: BTreeMap<String, RecordedChannel>,
}

impl RecordedChannel {
    /// A channel with what the laboratory knows of it.
    pub fn new(rate_hz: f64, unit: &str, details: ChannelDetails) -> Self {
        let ChannelDetails { delay_s, filter, range, origin } = details;
        Self { rate_hz: Some(rate_hz), unit: Some(unit.to_owned()), delay_s, filter, range, origin }
    }
}
