//! A session as an XDF file, the format of LabRecorder: a stream of samples and a stream of markers for each stretch of the session.
//!
//! Times are counted from the session's start: by UTC where the session kept when its samples were had, otherwise by its samples. Nobody then
//! knows how long a break was, and what comes after it is put behind it. Streams that were recorded with the session follow.

use std::path::{Path, PathBuf};

use super::error::ExportError;
use super::xdf_streams::add_streams;
use crate::dataset::{
    self, FurtherChannel, RampTime, Record, Session, SessionClock, Trial, XdfTag, utc_text_us, xdf_chunk,
    xdf_file_header, xdf_footer, xdf_stream_chunk,
};
use crate::files::{self, Folder};

/// Writes the session in `folder` to a new file.
///
/// # Errors
/// If the session cannot be read, has no journal and so no times, or the file exists already or cannot be written.
pub fn write(folder: &Path, file: &Path) -> Result<(), ExportError> {
    if files::exists(file) {
        return Err(ExportError::Exists(file.into()));
    }
    let session = dataset::load(folder)?;
    let ramps = dataset::ramp_times(folder)?.ok_or_else(|| ExportError::NoTimes(folder.into()))?;
    let clock = SessionClock::read(folder)?;
    // The zero of the file is that of the first stretch.
    let origin_utc_ns = ramps.first().and_then(|ramp| clock.utc_ns(ramp.stretch, 0.0));
    let (mut bytes, streams) = xdf(&session, &ramps, &clock, origin_utc_ns);
    if let Some(origin_utc_ns) = origin_utc_ns {
        add_streams(&mut bytes, folder, &clock, origin_utc_ns, streams + 1)?;
    }
    let above = Folder::open(file.parent().unwrap_or(Path::new("")));
    above
        .and_then(|above| above.write(PathBuf::from(file.file_name().unwrap_or_default()), &bytes))
        .map_err(ExportError::at(file))
}

/// Name, type, unit and samples of a channel.
type XdfChannel = (&'static str, &'static str, &'static str, fn(&Record) -> Option<&Vec<f64>>);

/// The channels that every record of `session` with samples has.
fn channels(session: &Session) -> Vec<XdfChannel> {
    let all: [XdfChannel; 4 + FurtherChannel::COUNT] = [
        ("theta_m_rad", "Angle", "rad", |record| Some(&record.theta_m_rad)),
        ("torque_l_nm", "Torque", "N m", |record| Some(&record.torque_l_nm)),
        ("emg_fcr_mvc", "EMG", "MVC", |record| record.emg_fcr_mvc.as_ref()),
        ("emg_ecr_mvc", "EMG", "MVC", |record| record.emg_ecr_mvc.as_ref()),
        ("theta_l_rad", "Angle", "rad", |record| record.theta_l_rad.as_ref()),
        ("alpha_l_rad_s2", "Acceleration", "rad/s2", |record| record.alpha_l_rad_s2.as_ref()),
        ("torque_h_nm", "Torque", "N m", |record| record.torque_h_nm.as_ref()),
        ("theta_j_rad", "Angle", "rad", |record| record.theta_j_rad.as_ref()),
    ];
    let recorded = || session.trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty());
    all.into_iter().filter(|(_, _, _, of)| recorded().all(|trial| of(&trial.record).is_some())).collect()
}

/// Where the zero of a stretch is on the axis of the file, and in which words its header says how that is known.
#[derive(Debug, Clone, PartialEq)]
struct StretchPlace {
    zero_s: f64,
    began_utc: Option<String>,
}

/// The place of a stretch with the ramps `ramps`, before which the file ends at `end_s`. `origin_utc_ns` is that of the file's zero.
fn place(
    ramps: &[RampTime],
    clock: &SessionClock,
    origin_utc_ns: Option<i64>,
    (first_s, end_s): (f64, f64),
) -> StretchPlace {
    let stretch = ramps.first().map_or(0, |ramp| ramp.stretch);
    let began_ns = clock.utc_ns(stretch, first_s);
    match began_ns.zip(origin_utc_ns) {
        Some((began_ns, origin_ns)) => StretchPlace {
            zero_s: (began_ns - origin_ns) as f64 * 1e-9 - first_s,
            began_utc: Some(utc_text_us(began_ns)),
        },
        // Samples are counted on over a time without power, and from 0 again after a program that was begun anew.
        None => StretchPlace { zero_s: (end_s - first_s).max(0.0), began_utc: None },
    }
}

/// The bytes of a file, and how many streams it has.
fn xdf(
    session: &Session,
    ramps: &[RampTime],
    clock: &SessionClock,
    origin_utc_ns: Option<i64>,
) -> (Vec<u8>, u32) {
    let mut bytes = xdf_file_header(dataset::PROGRAM, "");
    let channels = channels(session);
    let mut end_s = 0.0_f64;
    let mut streams = 0;
    for (stretch, ramps) in ramps.chunk_by(|a, b| a.stretch == b.stretch).enumerate() {
        let [signals, markers] = [2 * stretch as u32 + 1, 2 * stretch as u32 + 2];
        streams = markers;
        let ending = if stretch == 0 { String::new() } else { format!(" {}", stretch + 1) };
        let rate_hz = session.sample_rate_hz;
        let recorded: Vec<(&RampTime, &Trial, f64)> = ramps
            .iter()
            .filter_map(|ramp| {
                let trial = trial(session, ramp)?;
                Some((ramp, trial, ramp.onset_s - (trial.onset_s? - trial.record.start_s)))
            })
            .collect();
        let first_s = recorded.first().map_or(0.0, |(_, _, start_s)| *start_s);
        let StretchPlace { zero_s, began_utc } = place(ramps, clock, origin_utc_ns, (first_s, end_s));
        let described: String = channels
            .iter()
            .map(|(name, kind, unit, _)| {
                format!("<channel><label>{name}</label><unit>{unit}</unit><type>{kind}</type></channel>")
            })
            .collect();
        let head = Head { name: format!("ramphold signals{ending}"), kind: "Mixed", format: "double64" };
        let began = began_utc.as_ref().map_or(String::new(), |utc| format!("<began_utc>{utc}</began_utc>"));
        header(&mut bytes, signals, &head, channels.len(), rate_hz, &described, &began);
        let head = Head { name: format!("ramphold markers{ending}"), kind: "Markers", format: "string" };
        header(&mut bytes, markers, &head, 1, 0.0, "<channel><label>event</label></channel>", &began);
        let mut ends = [Span::default(), Span::default()];
        for (ramp, trial, start_s) in recorded {
            // Each trial by its own stamp: the crystal of the samples runs unlike that of the computer.
            let at = |time_s: f64| match clock.utc_ns(ramp.stretch, start_s).zip(origin_utc_ns) {
                Some((began_ns, origin_ns)) => (began_ns - origin_ns) as f64 * 1e-9 + (time_s - start_s),
                None => zero_s + time_s,
            };
            let samples = trial.record.theta_m_rad.len();
            let mut content = signals.to_le_bytes().to_vec();
            content.push(8);
            content.extend_from_slice(&(samples as u64).to_le_bytes());
            for sample in 0..samples {
                let time_s = at(start_s + sample as f64 / rate_hz);
                ends[0].add(time_s);
                content.push(8);
                content.extend_from_slice(&time_s.to_le_bytes());
                for (_, _, _, of) in &channels {
                    let value = of(&trial.record).map_or(f64::NAN, |values| values[sample]);
                    content.extend_from_slice(&value.to_le_bytes());
                }
            }
            xdf_chunk(&mut bytes, XdfTag::Samples, &content);
            let own_end_s = at(start_s + samples as f64 / rate_hz);
            end_s = end_s.max(own_end_s);
            let events = [(at(start_s), "begin".to_owned()), (at(ramp.onset_s), "onset".to_owned())];
            let ended = (own_end_s, trial.status.name().to_owned());
            for (time_s, event) in events.into_iter().chain([ended]) {
                ends[1].add(time_s);
                marker(&mut bytes, markers, time_s, &format!("{event} {}", trial.number));
            }
        }
        for (stream, span) in [(signals, &ends[0]), (markers, &ends[1])] {
            xdf_footer(&mut bytes, stream, span.ends_s.unwrap_or_default(), span.count);
        }
    }
    (bytes, streams)
}

/// The trial of a ramp, if it has samples.
fn trial<'a>(session: &'a Session, ramp: &RampTime) -> Option<&'a Trial> {
    let trial = session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
    (!trial.record.theta_m_rad.is_empty()).then_some(trial)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::StampedSample;
    use crate::timing::ClockStamp;

    fn ramp(stretch: usize, onset_s: f64) -> RampTime {
        RampTime { stretch, trial: Some(1), onset_s }
    }

    #[test]
    fn a_stretch_is_where_utc_has_it_and_without_utc_behind_what_was_before() {
        let stamp =
            |utc_ns| ClockStamp { utc_ns, monotonic_ns: 0, lsl_s: None, late_ns: None, read_within_ns: 0 };
        let stamped = vec![
            StampedSample { stretch: 0, time_s: 0.0, run: 1, stamp: stamp(1_000_000_000) },
            StampedSample { stretch: 1, time_s: 0.0, run: 1, stamp: stamp(601_000_000_000) },
        ];
        let (known, unknown) = (SessionClock { stamped, runs: 1 }, SessionClock::default());
        let placed =
            |stretch, clock: &SessionClock, origin| place(&[ramp(stretch, 9.0)], clock, origin, (8.0, 50.0));
        let at = |found: StretchPlace| (found.zero_s, found.began_utc);
        let began = "1970-01-01T00:10:09.000000Z".to_owned();
        assert_eq!(at(placed(1, &known, Some(1_000_000_000))), (600.0, Some(began)));
        // Resumed: counted from 0 again, and put behind what was before.
        assert_eq!(at(placed(1, &unknown, None)), (42.0, None));
        // Armed again: the count goes on.
        assert_eq!(at(place(&[ramp(1, 81.0)], &unknown, None, (80.0, 50.0))), (0.0, None));
    }
}
