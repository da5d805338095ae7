//! A session as an XDF file, the format of LabRecorder: a stream of samples and a stream of markers for each stretch of the session.
//!
//! Streams that were recorded with the session follow.

use std::path::Path;

use super::error::ExportError;
use super::new_file::{refuse_existing, write_new};
use super::record_channels::common_channels;
use super::trial_times::{PlacedStretch, PlacedTrial, TrialTimes};
use super::xdf_streams::add_streams;
use crate::dataset::{self, Session, XdfTag, xdf_chunk, xdf_file_header, xdf_footer, xdf_stream_chunk};

/// Pauses that readers do not take for jitter of the stamps, s and samples: a stream with a rate and shorter ones is smoothed over them, which
/// moves its samples (jitter_break_threshold_seconds and _samples of pyxdf).
const SHORTEST_PAUSE: (f64, f64) = (1.0, 500.0);

/// Writes the session in `folder` to a new file.
///
/// # Errors
/// If the session cannot be read, has no journal and so no times, or the file exists already or cannot be written.
pub fn write(folder: &Path, file: &Path) -> Result<(), ExportError> {
    refuse_existing(file)?;
    let session = dataset::load(folder)?;
    let times = TrialTimes::read(folder, "an XDF file")?;
    let (mut bytes, streams) = xdf(&session, &times.place(&session));
    if let Some(origin_utc_ns) = times.origin_utc_ns {
        add_streams(&mut bytes, folder, &times.clock, origin_utc_ns, streams + 1)?;
    }
    write_new(file, &bytes)
}

/// The bytes of a file, and how many streams it has.
fn xdf(session: &Session, stretches: &[PlacedStretch]) -> (Vec<u8>, u32) {
    let mut bytes = xdf_file_header(dataset::PROGRAM, "");
    let channels = common_channels(session);
    let rate_hz = session.sample_rate_hz;
    let described: String = channels
        .iter()
        .map(|own| {
            format!(
                "<channel><label>{}</label><unit>{}</unit><type>{}</type></channel>",
                own.column, own.unit, own.kind
            )
        })
        .collect();
    let mut streams = 0;
    for (stretch, PlacedStretch { began_utc, trials }) in stretches.iter().enumerate() {
        let [signals, markers] = [2 * stretch as u32 + 1, 2 * stretch as u32 + 2];
        streams = markers;
        let ending = if stretch == 0 { String::new() } else { format!(" {}", stretch + 1) };
        let head = Head { name: format!("ramphold signals{ending}"), kind: "Mixed", format: "double64" };
        let began = began_utc.as_ref().map_or(String::new(), |utc| format!("<began_utc>{utc}</began_utc>"));
        // A rate of 0 says that every sample is at its stamp.
        let told_hz = if are_parted(trials, rate_hz) { rate_hz } else { 0.0 };
        header(&mut bytes, signals, &head, channels.len(), told_hz, &described, &began);
        let head = Head { name: format!("ramphold markers{ending}"), kind: "Markers", format: "string" };
        header(&mut bytes, markers, &head, 1, 0.0, "<channel><label>event</label></channel>", &began);
        let mut ends = [Span::default(), Span::default()];
        for placed in trials {
            let samples = placed.samples();
            let mut content = signals.to_le_bytes().to_vec();
            content.push(8);
            content.extend_from_slice(&(samples as u64).to_le_bytes());
            for sample in 0..samples {
                let time_s = placed.sample_s(sample);
                ends[0].add(time_s);
                content.push(8);
                content.extend_from_slice(&time_s.to_le_bytes());
                for own in &channels {
                    let value = (own.samples)(&placed.trial.record).map_or(f64::NAN, |values| values[sample]);
                    content.extend_from_slice(&value.to_le_bytes());
                }
            }
            xdf_chunk(&mut bytes, XdfTag::Samples, &content);
            let events = [
                (placed.sample_s(0), "begin"),
                (placed.onset_s(), "onset"),
                (placed.end_s(), placed.trial.status.name()),
            ];
            for (time_s, event) in events {
                ends[1].add(time_s);
                marker(&mut bytes, markers, time_s, &format!("{event} {}", placed.trial.number));
            }
        }
        for (stream, span) in [(signals, &ends[0]), (markers, &ends[1])] {
            xdf_footer(&mut bytes, stream, span.ends_s.unwrap_or_default(), span.count);
        }
    }
    (bytes, streams)
}

/// Whether the pauses between all trials are so long that every reader sees them.
fn are_parted(trials: &[PlacedTrial<'_>], rate_hz: f64) -> bool {
    let (shortest_s, samples) = SHORTEST_PAUSE;
    let shortest_s = f64::max(shortest_s, samples / rate_hz);
    trials.windows(2).all(|own| own[1].sample_s(0) - own[0].end_s() > shortest_s)
}

/// What the header of a stream says first.
struct Head {
    name: String,
    kind: &'static str,
    format: &'static str,
}

/// First and last time of a stream, and its number of samples.
#[derive(Debug, Default)]
struct Span {
    ends_s: Option<[f64; 2]>,
    count: u64,
}

impl Span {
    fn add(&mut self, time_s: f64) {
        let [first_s, _] = self.ends_s.unwrap_or([time_s; 2]);
        self.ends_s = Some([first_s, time_s]);
        self.count += 1;
    }
}

fn header(
    bytes: &mut Vec<u8>,
    id: u32,
    head: &Head,
    count: usize,
    rate_hz: f64,
    channels: &str,
    began: &str,
) {
    let Head { name, kind, format } = head;
    let xml = format!(
        "<?xml version=\"1.0\"?><info><name>{name}</name><type>{kind}</type><channel_count>{count}</channel_count>\
         <nominal_srate>{rate_hz}</nominal_srate><channel_format>{format}</channel_format><source_id></source_id>\
         <created_at>0</created_at><desc><channels>{channels}</channels>{began}</desc></info>"
    );
    xdf_stream_chunk(bytes, XdfTag::StreamHeader, id, &xml);
}

fn marker(bytes: &mut Vec<u8>, id: u32, time_s: f64, text: &str) {
    let mut content = id.to_le_bytes().to_vec();
    content.extend_from_slice(&[1, 1, 8]);
    content.extend_from_slice(&time_s.to_le_bytes());
    content.push(4);
    content.extend_from_slice(&(text.len() as u32).to_le_bytes());
    content.extend_from_slice(text.as_bytes());
    xdf_chunk(bytes, XdfTag::Samples, &content);
}
