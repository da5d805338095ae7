//! The analog channels of a C3D file as a table.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::layout::{self, AnalogLayout};
use super::parameters::Parameters;
use crate::import::error::ImportError;
use crate::import::recording::{Recording, TIME_COLUMN};
use crate::import::source_table::SourceTable;

/// A channel whose scale is beyond these has no unit in which it could have been measured.
const SCALES: std::ops::RangeInclusive<f64> = 1e-15..=1e15;

/// Offset and scale of a channel: a value is (sample - offset) scale.
struct Scaling {
    offset: f64,
    scale: f64,
}

/// Reads the analog channels in `bytes`, in the units that the file gives them; `path` is for messages.
pub fn read(bytes: &[u8], path: &Path) -> Result<Recording, ImportError> {
    let broken = |found: String| ImportError::Source {
        path: path.into(),
        found,
        expected: "a C3D file that is whole and has analog channels; export the recording again",
    };
    let (parameters, layout) = layout::read(bytes).map_err(broken)?;
    let is_unsigned = is_unsigned(&parameters);
    let scalings = scalings(&parameters, layout.channels, is_unsigned).map_err(broken)?;
    let (names, labels_of_several) = names(&parameters, layout.channels);

    let mut table = SourceTable::new(format!("{}, analog channels", path.display()), Vec::new());
    table.unusable = labels_of_several;
    let samples = layout.frames.len() / layout.frame_bytes * layout.samples_in_frame;
    match &layout.rate_hz {
        Ok(rate_hz) => {
            let times_s = (0..samples).map(|sample| sample as f64 / rate_hz).collect();
            table.columns.push((TIME_COLUMN.to_owned(), times_s));
            table.stated.is_even = true;
        }
        Err(reason) => table.unusable.push((TIME_COLUMN.to_owned(), reason.clone())),
    }
    for (channel, (name, scaling)) in names.into_iter().zip(scalings).enumerate() {
        match scaling {
            Ok(scaling) => table.columns.push((name, values(&layout, channel, &scaling, is_unsigned))),
            Err(reason) => table.unusable.push((name, reason)),
        }
    }
    Ok(Recording { tables: vec![table], markers: Vec::new() })
}

/// Whether integers are stored without a sign.
fn is_unsigned(parameters: &Parameters) -> bool {
    parameters.texts("ANALOG", "FORMAT").first().is_some_and(|format| format.eq_ignore_ascii_case("UNSIGNED"))
}

/// Offset and scale of each channel, or why it has none.
fn scalings(
    parameters: &Parameters,
    channels: usize,
    is_unsigned: bool,
) -> Result<Vec<Result<Scaling, String>>, String> {
    let of_channels = |name: &str, are_integers_signed: bool| {
        let values = parameters.numbers("ANALOG", name, are_integers_signed);
        match values {
            Some(values) if values.len() < channels => {
                Err(format!("{} values in ANALOG:{name} for {channels} analog channels", values.len()))
            }
            values => Ok(values),
        }
    };
    let scales = of_channels("SCALE", true)?.ok_or("no ANALOG:SCALE")?;
    let offsets = of_channels("OFFSET", !is_unsigned)?.unwrap_or_else(|| vec![0.0; channels]);
    let general = parameters.count("ANALOG", "GEN_SCALE").unwrap_or(1.0);
    let pairs = scales.into_iter().zip(offsets).take(channels);
    Ok(pairs
        .map(|(own, offset)| {
            let scale = own * general;
            if !SCALES.contains(&scale.abs()) {
                return Err(format!("its ANALOG:SCALE is {own} and ANALOG:GEN_SCALE is {general}"));
            }
            if !offset.is_finite() {
                return Err(format!("its ANALOG:OFFSET is {offset}"));
            }
            Ok(Scaling { offset, scale })
        })
        .collect())
}

/// The names of the channels: their labels, and the number of the channel where it has none of its own. The labels that several channels
/// have, with their numbers.
fn names(parameters: &Parameters, channels: usize) -> (Vec<String>, Vec<(String, String)>) {
    let mut labels = parameters.texts("ANALOG", "LABELS");
    labels.resize(channels, String::new());
    let mut with_label: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (channel, label) in labels.iter().enumerate() {
        with_label.entry(label).or_default().push(channel + 1);
    }
    let number = |channel: usize| format!("channel_{}", channel + 1);
    let is_own = |label: &str| !label.is_empty() && label != TIME_COLUMN && with_label[label].len() == 1;
    let mut names: Vec<String> = labels
        .iter()
        .enumerate()
        .map(|(channel, label)| if is_own(label) { label.clone() } else { number(channel) })
        .collect();
    // A label may look like the number of another channel.
    if names.iter().collect::<BTreeSet<_>>().len() < channels {
        names = (0..channels).map(number).collect();
    }
    let of_several = with_label.iter().filter(|(label, own)| !label.is_empty() && own.len() > 1);
    let of_several = of_several.map(|(label, own)| {
        let numbers: Vec<String> = own.iter().map(|channel| format!("channel_{channel}")).collect();
        (
            (*label).to_owned(),
            format!("several channels have this label; they are called {}", numbers.join(" and ")),
        )
    });
    (names, of_several.collect())
}

/// The values of a channel.
fn values(layout: &AnalogLayout, channel: usize, scaling: &Scaling, is_unsigned: bool) -> Vec<f64> {
    let processor = layout.processor;
    let width = layout.sample_bytes;
    let sample = |bytes: &[u8]| match *bytes {
        [a, b] if is_unsigned => f64::from(processor.word([a, b])),
        [a, b] => f64::from(processor.word([a, b]) as i16),
        [a, b, c, d] => processor.float([a, b, c, d]),
        _ => f64::NAN,
    };
    layout
        .frames
        .chunks_exact(layout.frame_bytes)
        .flat_map(|frame| frame[layout.marker_bytes..].chunks_exact(width * layout.channels))
        .map(|own| (sample(&own[width * channel..][..width]) - scaling.offset) * scaling.scale)
        .collect()
}
