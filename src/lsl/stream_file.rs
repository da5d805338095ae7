//! The file of a stream as it came: XDF, chunk by chunk, so that a file whose writer was killed is whole up to its last chunk.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::inlet::ClockOffset;
use super::stream_description::DescribedStream;
use crate::dataset::{
    Disk, PROGRAM, RecordError, STREAMS, XdfTag, xdf_chunk, xdf_file_header, xdf_footer, xdf_stream_chunk,
};
use crate::files::Folder;

/// The only stream of the file.
const STREAM: u32 = 1;

/// Time after which what was written is brought to the disk: as much as the death of the machine can take.
const SYNC_PERIOD: Duration = Duration::from_secs(1);

/// A file that a stream is written to.
#[derive(Debug)]
pub struct StreamFile {
    disk: Disk,
    file: File,
    path: PathBuf,
    stream: DescribedStream,
    bytes: Vec<u8>,
    synced: Instant,
    ends_s: Option<[f64; 2]>,
    samples: u64,
}

impl StreamFile {
    /// Begins the file `name` in the folder of the streams of `session`.
    ///
    /// # Errors
    /// If it is there, or cannot be written.
    pub fn begin(session: &Path, name: &str, stream: DescribedStream) -> Result<Self, RecordError> {
        let path = session.join(STREAMS).join(name);
        let disk = Disk::default();
        let create = || {
            let folder = Folder::open(session)?.folder_made(STREAMS)?;
            let file = disk.create(&folder, name)?;
            disk.sync_names(&folder, name)?;
            io::Result::Ok(file)
        };
        let file = create().map_err(RecordError::at(&path))?;
        let mut bytes = xdf_file_header(PROGRAM, "");
        xdf_stream_chunk(&mut bytes, XdfTag::StreamHeader, STREAM, &stream.xml);
        let mut own =
            Self { disk, file, path, stream, bytes, synced: Instant::now(), ends_s: None, samples: 0 };
        own.hand_over()?;
        Ok(own)
    }

    /// Adds samples, with the time stamps that they came with.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn samples(&mut self, times_s: &[f64], values: &[f64]) -> Result<(), RecordError> {
        let [Some(first_s), Some(last_s)] = [times_s.first(), times_s.last()] else { return Ok(()) };
        let channels = self.stream.channels.len();
        let mut content = STREAM.to_le_bytes().to_vec();
        content.push(8);
        content.extend_from_slice(&(times_s.len() as u64).to_le_bytes());
        for (time_s, values) in times_s.iter().zip(values.chunks(channels)) {
            content.push(8);
            content.extend_from_slice(&time_s.to_le_bytes());
            values.iter().for_each(|value| self.stream.format.push(&mut content, *value));
        }
        xdf_chunk(&mut self.bytes, XdfTag::Samples, &content);
        self.samples += times_s.len() as u64;
        self.ends_s = Some([self.ends_s.map_or(*first_s, |ends| ends[0]), *last_s]);
        self.hand_over()
    }

    /// Adds a measurement of the clock.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn clock_offset(&mut self, measured: ClockOffset) -> Result<(), RecordError> {
        let ClockOffset { remote_s, offset_s, .. } = measured;
        let mut content = STREAM.to_le_bytes().to_vec();
        content.extend_from_slice(&remote_s.to_le_bytes());
        content.extend_from_slice(&offset_s.to_le_bytes());
        xdf_chunk(&mut self.bytes, XdfTag::ClockOffset, &content);
        self.hand_over()
    }

    /// Ends the file. Returns how many samples are in it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<u64, RecordError> {
        xdf_footer(&mut self.bytes, STREAM, self.ends_s.unwrap_or_default(), self.samples);
        self.hand_over()?;
        self.disk.sync(&self.file).map_err(RecordError::at(&self.path))?;
        Ok(self.samples)
    }

    /// Hands what there is to the operating system, whole chunks: the death of the program does not take it any more.
    fn hand_over(&mut self) -> Result<(), RecordError> {
        let mut write = || {
            self.disk.append(&mut self.file, &self.bytes)?;
            self.bytes.clear();
            if self.synced.elapsed() >= SYNC_PERIOD {
                self.disk.sync(&self.file)?;
                self.synced = Instant::now();
            }
            Ok(())
        };
        write().map_err(RecordError::at(&self.path))
    }
}
