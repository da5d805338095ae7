//! The streams that were recorded with a session, in its XDF file: as they came, with clock offsets that lead to the time of the file.

use std::path::Path;

use super::error::ExportError;
use crate::dataset::{
    STREAMS, SessionClock, StampedSample, XdfTag, stream_files, xdf_chunk, xdf_chunks, xdf_stream_chunk,
};
use crate::files::{Folder, limits};

/// Adds the recorded streams of the session in `folder` to the bytes of a file, with the numbers from `first` on. `origin_utc_ns` is the zero
/// of the file. A run whose samples are not known on the clock of the streams has none.
pub fn add_streams(
    bytes: &mut Vec<u8>,
    folder: &Path,
    clock: &SessionClock,
    origin_utc_ns: i64,
    first: u32,
) -> Result<(), ExportError> {
    let files = stream_files(folder).map_err(ExportError::at(folder.join(STREAMS)))?;
    for (stream, file) in (first..).zip(files) {
        let stamps: Vec<(f64, f64)> = clock
            .stamped
            .iter()
            .filter(|known| known.run == file.run)
            .filter_map(|known| on_both(known, origin_utc_ns))
            .collect();
        if stamps.is_empty() {
            continue;
        }
        let read = Folder::open(folder).and_then(|own| own.read(&file.file, limits::RECORDING_BYTES));
        add(bytes, stream, &read.map_err(ExportError::at(folder.join(&file.file)))?, &stamps);
    }
    Ok(())
}

/// A moment on the clock of the streams, and in the file, s.
fn on_both(known: &StampedSample, origin_utc_ns: i64) -> Option<(f64, f64)> {
    Some((known.stamp.lsl_s?, (known.stamp.utc_ns - origin_utc_ns) as f64 * 1e-9))
}

/// Adds the chunks of a recorded stream. Its offsets lead to the recorder's clock; those of the file lead to the file's time, by the moment
/// nearest to each.
fn add(bytes: &mut Vec<u8>, stream: u32, recorded: &[u8], stamps: &[(f64, f64)]) {
    for (tag, content) in xdf_chunks(recorded) {
        let Some((_, rest)) = content.split_first_chunk::<4>() else { continue };
        match tag {
            XdfTag::FileHeader => {}
            XdfTag::ClockOffset => {
                let Some((remote_s, offset_s)) = offset(rest) else { continue };
                let recorder_s = remote_s + offset_s;
                let off = |own: &&(f64, f64)| (own.0 - recorder_s).abs();
                let nearest = stamps.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
                let (lsl_s, file_s) = nearest.copied().unwrap_or_default();
                let mut moved = stream.to_le_bytes().to_vec();
                moved.extend_from_slice(&remote_s.to_le_bytes());
                moved.extend_from_slice(&(offset_s + file_s - lsl_s).to_le_bytes());
                xdf_chunk(bytes, tag, &moved);
            }
            XdfTag::StreamHeader | XdfTag::StreamFooter => {
                xdf_stream_chunk(bytes, tag, stream, &String::from_utf8_lossy(rest));
            }
            XdfTag::Samples => xdf_chunk(bytes, tag, &[&stream.to_le_bytes(), rest].concat()),
        }
    }
}

/// Time and value of a clock offset, s.
fn offset(content: &[u8]) -> Option<(f64, f64)> {
    let (time, rest) = content.split_first_chunk::<8>()?;
    let (value, _) = rest.split_first_chunk::<8>()?;
    Some((f64::from_le_bytes(*time), f64::from_le_bytes(*value)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::xdf_file_header;

    #[test]
    fn clock_offsets_lead_to_the_time_of_the_file_and_samples_stay_as_they_came() {
        let mut recorded = xdf_file_header("test", "");
        xdf_stream_chunk(&mut recorded, XdfTag::StreamHeader, 1, "<info/>");
        let offset_chunk = |time_s: f64, offset_s: f64| {
            [1u32.to_le_bytes().as_slice(), &time_s.to_le_bytes(), &offset_s.to_le_bytes()].concat()
        };
        // The stream's clock is 5 s behind that of the recorder, whose 1000 s and 2000 s are 10 s and 1010.25 s of the file.
        xdf_chunk(&mut recorded, XdfTag::ClockOffset, &offset_chunk(996.0, 5.0));
        xdf_chunk(&mut recorded, XdfTag::ClockOffset, &offset_chunk(1990.0, 5.0));
        xdf_chunk(&mut recorded, XdfTag::Samples, &[1, 0, 0, 0, 1, 0]);
        recorded.extend_from_slice(&[8, 0, 1]);
        let mut bytes = Vec::new();
        add(&mut bytes, 7, &recorded, &[(1000.0, 10.0), (2000.0, 1010.25)]);
        let chunks: Vec<_> = xdf_chunks(&bytes).collect();
        let tags: Vec<XdfTag> = chunks.iter().map(|chunk| chunk.0).collect();
        let expected = [XdfTag::StreamHeader, XdfTag::ClockOffset, XdfTag::ClockOffset, XdfTag::Samples];
        assert_eq!(tags, expected);
        assert_eq!(offset(&chunks[1].1[4..]), Some((996.0, -985.0)));
        assert_eq!(offset(&chunks[2].1[4..]), Some((1990.0, -984.75)));
        assert_eq!(chunks[3].1, [7, 0, 0, 0, 1, 0]);
    }
}
