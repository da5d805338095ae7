//! Reads XDF, the format in which LabRecorder keeps streams of Lab Streaming Layer.
//!
//! "XDF Specification 1.0", the Swartz Center: `XDF:`, then chunks with a length, a tag and content. Time stamps are on the
//! clock of each stream's computer; clock offsets bring them to that of the recorder.

use std::collections::BTreeSet;
use std::path::Path;

use super::byte_cursor::Cursor;
use super::error::ImportError;
use super::recording::{Marker, Recording, TIME_COLUMN};
use super::source_table::SourceTable;
use crate::dataset::XDF_MAGIC;
use crate::statistics::{SD_BY_MEDIAN, upper_median};

/// The most streams, and the most channels of a stream, that are read.
const MOST_STREAMS: usize = 1000;
const MOST_CHANNELS: usize = 10_000;

/// Tags of chunks.
const STREAM_HEADER_CHUNK: u16 = 2;
const SAMPLES_CHUNK: u16 = 3;
const CLOCK_OFFSET_CHUNK: u16 = 4;

/// A type of values.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ValueKind {
    Int8,
    Int16,
    Int32,
    Int64,
    Float32,
    Double64,
    Text,
}

impl ValueKind {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "int8" => Self::Int8,
            "int16" => Self::Int16,
            "int32" => Self::Int32,
            "int64" => Self::Int64,
            "float32" => Self::Float32,
            "double64" => Self::Double64,
            "string" => Self::Text,
            _ => return None,
        })
    }
}

/// A stream while it is read.
struct XdfStream {
    id: u32,
    name: String,
    /// Labels as they came; empty if not every channel has one.
    described: Vec<String>,
    /// Names of the columns.
    labels: Vec<String>,
    kind: ValueKind,
    nominal_hz: f64,
    times_s: Vec<f64>,
    values: Vec<Vec<f64>>,
    texts: Vec<String>,
    /// Time of measurement and value of each clock offset, s.
    offsets: Vec<(f64, f64)>,
}

/// The values of the format.
impl Cursor<'_> {
    /// A length with the count of its bytes before it: 1, 4 or 8.
    fn length(&mut self) -> Option<usize> {
        match self.number::<1>()? {
            [1] => Some(usize::from(self.number::<1>()?[0])),
            [4] => usize::try_from(u32::from_le_bytes(self.number()?)).ok(),
            [8] => usize::try_from(u64::from_le_bytes(self.number()?)).ok(),
            _ => None,
        }
    }

    fn value(&mut self, kind: ValueKind) -> Option<f64> {
        Some(match kind {
            ValueKind::Int8 => f64::from(i8::from_le_bytes(self.number()?)),
            ValueKind::Int16 => f64::from(i16::from_le_bytes(self.number()?)),
            ValueKind::Int32 => f64::from(i32::from_le_bytes(self.number()?)),
            ValueKind::Int64 => i64::from_le_bytes(self.number()?) as f64,
            ValueKind::Float32 => f64::from(f32::from_le_bytes(self.number()?)),
            ValueKind::Double64 => f64::from_le_bytes(self.number()?),
            ValueKind::Text => return None,
        })
    }

    fn text(&mut self) -> Option<String> {
        let length = self.length()?;
        Some(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// Whether the bytes begin as a file of this kind does.
pub fn is_xdf(bytes: &[u8]) -> bool {
    bytes.starts_with(XDF_MAGIC)
}

/// A stream that this program recorded, as it came but for its clock: on that of the recorder, with the jitter of its stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedStream {
    /// Its columns: labels, or numbers where labels are missing or not different.
    pub columns: Vec<(String, Vec<f64>)>,
    /// The labels of its channels as they came; empty if not every channel has one.
    pub labels: Vec<String>,
    /// Samples a second that it says it has.
    pub nominal_hz: f64,
    /// Times of the samples on the clock of the recorder, s.
    pub times_s: Vec<f64>,
    /// Time of measurement, on the stream's clock, and value of each clock offset, s.
    pub clock_offsets: Vec<(f64, f64)>,
    /// Bytes behind the last whole chunk: the recorder was killed while it wrote them.
    pub cut_off_bytes: usize,
}

/// Reads the one stream in `bytes`, which may be cut off: what was whole is read. `path` is for messages.
pub fn read_recorded(bytes: &[u8], path: &Path) -> Result<RecordedStream, ImportError> {
    let (mut streams, cut_off_bytes) = streams(bytes, path, true)?;
    let (Some(stream), true) = (streams.pop(), streams.is_empty()) else {
        return Err(ImportError::Source {
            path: path.into(),
            found: format!("{} streams", streams.len()),
            expected: "the one stream that was recorded with a session",
        });
    };
    let clock_offsets = stream.offsets.clone();
    let stream = on_recorders_clock(stream, path)?;
    Ok(RecordedStream {
        labels: stream.described,
        nominal_hz: stream.nominal_hz,
        columns: stream.labels.into_iter().zip(stream.values).collect(),
        times_s: stream.times_s,
        clock_offsets,
        cut_off_bytes,
    })
}

/// Reads the streams in `bytes`: a table for each stream of numbers, markers of those of text; `path` is for messages.
pub fn read(bytes: &[u8], path: &Path) -> Result<Recording, ImportError> {
    let mut recording = Recording::default();
    for stream in streams(bytes, path, false)?.0 {
        let stream = on_recorders_clock(stream, path)?;
        if let Some(row) = stream
            .times_s
            .windows(2)
            .position(|pair| pair[0].partial_cmp(&pair[1]).is_none_or(|order| order.is_gt()))
        {
            return Err(broken(
                path,
                format!(
                    "stream {:?}, sample {}: time goes from {} to {} s",
                    stream.name,
                    row + 2,
                    stream.times_s[row],
                    stream.times_s[row + 1]
                ),
            ));
        }
        if stream.kind == ValueKind::Text {
            let own = stream.times_s.iter().zip(stream.texts);
            recording.markers.extend(own.map(|(time_s, text)| Marker { time_s: *time_s, text }));
            continue;
        }
        let time = (TIME_COLUMN.to_owned(), stream.times_s);
        let columns = std::iter::once(time).chain(stream.labels.into_iter().zip(stream.values)).collect();
        recording
            .tables
            .push(SourceTable::new(format!("{}, stream {}", path.display(), stream.name), columns));
    }
    Ok(recording)
}

fn broken(path: &Path, found: String) -> ImportError {
    ImportError::Source {
        path: path.into(),
        found,
        expected: "an XDF file that is whole, as LabRecorder writes it",
    }
}

/// The streams in `bytes` as they came, and how many bytes stand behind the last whole chunk, where that is no mistake.
fn streams(bytes: &[u8], path: &Path, may_be_cut_off: bool) -> Result<(Vec<XdfStream>, usize), ImportError> {
    let broken = |found: String| broken(path, found);
    let mut cursor = Cursor(bytes.strip_prefix(XDF_MAGIC).unwrap_or(bytes));
    let mut streams: Vec<XdfStream> = Vec::new();
    while !cursor.0.is_empty() {
        let at = bytes.len() - cursor.0.len();
        let cut = || broken(format!("a chunk at byte {at} that is cut off or no chunk"));
        let content = cursor.length().and_then(|length| cursor.take(length));
        if content.is_none() && may_be_cut_off {
            return Ok((streams, bytes.len() - at));
        }
        let mut chunk = Cursor(content.ok_or_else(cut)?);
        let tag = u16::from_le_bytes(chunk.number().ok_or_else(cut)?);
        if !(STREAM_HEADER_CHUNK..=CLOCK_OFFSET_CHUNK).contains(&tag) {
            continue;
        }
        let id = u32::from_le_bytes(chunk.number().ok_or_else(cut)?);
        let count = streams.len();
        let known = streams.iter_mut().find(|stream| stream.id == id);
        match (tag, known) {
            (STREAM_HEADER_CHUNK, None) if count < MOST_STREAMS => {
                let text = String::from_utf8_lossy(chunk.0);
                streams.push(header(id, &text).map_err(|found| broken(format!("stream {id}: {found}")))?);
            }
            (STREAM_HEADER_CHUNK, None) => return Err(broken(format!("more than {MOST_STREAMS} streams"))),
            (STREAM_HEADER_CHUNK, Some(_)) => return Err(broken(format!("two headers of stream {id}"))),
            (SAMPLES_CHUNK, Some(stream)) => samples(&mut chunk, stream).ok_or_else(|| {
                broken(format!(
                    "stream {:?}: samples at byte {at} that are not as its header says",
                    stream.name
                ))
            })?,
            (CLOCK_OFFSET_CHUNK, Some(stream)) => {
                let measured = chunk.number().zip(chunk.number());
                let (time, offset) = measured.ok_or_else(cut)?;
                let pair = (f64::from_le_bytes(time), f64::from_le_bytes(offset));
                if pair.0.is_finite() && pair.1.is_finite() {
                    stream.offsets.push(pair);
                }
            }
            _ => return Err(broken(format!("a chunk at byte {at} of stream {id}, which has no header"))),
        }
    }
    Ok((streams, 0))
}

/// A stream with its times on the clock of the recorder.
fn on_recorders_clock(mut stream: XdfStream, path: &Path) -> Result<XdfStream, ImportError> {
    if let Some((at_s, step_s)) = clock_step(&stream.offsets) {
        return Err(broken(
            path,
            format!(
                "stream {:?}: its clock jumps by {:.1} ms after {at_s:.3} s, as that of a computer that began anew; expected one clock: cut \
                 the recording there",
                stream.name,
                step_s * 1e3
            ),
        ));
    }
    let correction = clock_line(&stream.offsets);
    for time_s in &mut stream.times_s {
        *time_s += correction.0 + correction.1 * *time_s;
    }
    Ok(stream)
}

/// What the XML header of a stream says.
fn header(id: u32, text: &str) -> Result<XdfStream, String> {
    let document =
        roxmltree::Document::parse(text).map_err(|error| format!("its header is no XML ({error})"))?;
    let info = document.root_element();
    let field = |name: &str| {
        let node = info.children().find(|node| node.has_tag_name(name));
        node.and_then(|node| node.text()).map_or(String::new(), |text| text.trim().to_owned())
    };
    let kind = field("channel_format");
    let kind = ValueKind::named(&kind).ok_or_else(|| format!("its channel_format is {kind:?}"))?;
    let count = field("channel_count");
    let count: usize = count.parse().map_err(|_| format!("its channel_count is {count:?}"))?;
    if count == 0 || count > MOST_CHANNELS {
        return Err(format!("it has {count} channels; expected 1 to {MOST_CHANNELS}"));
    }
    let rate = field("nominal_srate");
    let nominal_hz: f64 = if rate.is_empty() { 0.0 } else { rate.parse().unwrap_or(f64::NAN) };
    if !(nominal_hz >= 0.0 && nominal_hz.is_finite()) {
        return Err(format!("its nominal_srate is {rate:?}"));
    }
    let mut described: Vec<String> = info
        .descendants()
        .filter(|node| node.has_tag_name("label"))
        .filter_map(|node| node.text().map(|text| text.trim().to_owned()))
        .collect();
    if described.len() != count {
        described.clear();
    }
    let different: BTreeSet<&String> = described.iter().collect();
    let labels = match different.len() == count {
        true => described.clone(),
        false => (1..=count).map(|channel| format!("channel_{channel}")).collect(),
    };
    Ok(XdfStream {
        id,
        name: field("name"),
        described,
        labels,
        kind,
        nominal_hz,
        times_s: Vec::new(),
        values: vec![Vec::new(); if kind == ValueKind::Text { 0 } else { count }],
        texts: Vec::new(),
        offsets: Vec::new(),
    })
}

/// Adds the samples of a chunk; `None` if it has not as many bytes as its counts need.
fn samples(chunk: &mut Cursor, stream: &mut XdfStream) -> Option<()> {
    let count = chunk.length()?;
    // Each sample has at least the byte that says whether it has a time stamp.
    if count > chunk.0.len() {
        return None;
    }
    for _ in 0..count {
        let time_s = match chunk.number::<1>()? {
            [0] => {
                let step_s = if stream.nominal_hz > 0.0 { 1.0 / stream.nominal_hz } else { 0.0 };
                stream.times_s.last().map_or(0.0, |last| last + step_s)
            }
            [8] => f64::from_le_bytes(chunk.number()?),
            _ => return None,
        };
        if stream.kind == ValueKind::Text {
            let texts: Option<Vec<String>> = stream.labels.iter().map(|_| chunk.text()).collect();
            stream.texts.push(texts?.join(" "));
        } else {
            for values in &mut stream.values {
                values.push(chunk.value(stream.kind)?);
            }
        }
        stream.times_s.push(time_s);
    }
    chunk.0.is_empty().then_some(())
}

/// Intercept and slope of the line through the clock offsets; a constant where there is one, none without any.
fn clock_line(offsets: &[(f64, f64)]) -> (f64, f64) {
    let count = offsets.len().max(1) as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| offsets.iter().map(of).sum::<f64>() / count;
    let (time, offset) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let (mut square, mut product) = (0.0, 0.0);
    for (t, o) in offsets {
        square += (t - time) * (t - time);
        product += (t - time) * (o - offset);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    (offset - slope * time, slope)
}

/// Least and largest number of offsets on either side of a step: of three one may be late.
const OFFSETS_BESIDE_STEP: (usize, usize) = (3, 5);

/// Standard deviations that noise alone exceeds with a probability of 1e-6.
const STEP_IN_SDS: f64 = 4.9;

/// A step of a clock below this is below what recordings are aligned to, s.
const SMALLEST_STEP_S: f64 = 1e-3;

/// Time after which a clock steps, and by how much, s. Measurements that are late make single offsets wrong, but not all after them: medians
/// are compared.
fn clock_step(offsets: &[(f64, f64)]) -> Option<(f64, f64)> {
    let mut slopes: Vec<f64> =
        offsets.windows(2).map(|pair| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).collect();
    slopes.retain(|slope| slope.is_finite());
    let slope = if slopes.is_empty() { 0.0 } else { median(&slopes) };
    let left: Vec<f64> = offsets.iter().map(|(time_s, offset_s)| offset_s - slope * time_s).collect();
    let changes: Vec<f64> = left.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    if changes.is_empty() {
        return None;
    }
    // The difference of two medians of noise is less uncertain than that of two values.
    let sd_s = SD_BY_MEDIAN * median(&changes);
    let least_s = SMALLEST_STEP_S.max(STEP_IN_SDS * sd_s);
    let (least, most) = OFFSETS_BESIDE_STEP;
    let step = |at: usize| {
        let before = &left[at.saturating_sub(most)..at];
        let after = &left[at..(at + most).min(left.len())];
        median(after) - median(before)
    };
    let (near, step_s) = (least..(left.len() + 1).saturating_sub(least))
        .map(|at| (at, step(at)))
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    // The medians step alike a few offsets before and after.
    let change = |at: &usize| (left[*at] - left[at - 1]).abs();
    let at = (near - 2..=near + 2).max_by(|a, b| change(a).total_cmp(&change(b)))?;
    (step_s.abs() > least_s).then(|| (offsets[at - 1].0, step_s))
}

/// The middle one of some values; zero of none.
fn median(values: &[f64]) -> f64 {
    upper_median(values.iter().copied()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
