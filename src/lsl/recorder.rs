//! Records the streams of a session, each on a thread of its own: the control loop never waits for them.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::clock::LslClock;
use super::connected_streams::{ConnectedStream, ConnectedStreams};
use super::inlet::{ClockOffset, Inlet, InletFailure, PULL_PERIOD, room};
use super::library::LslLibrary;
use super::stamp_watch::{StampChange, StampWatch};
use super::stream_description::DescribedStream;
use super::stream_file::StreamFile;
use super::stream_watch::{StreamHealth, StreamWatch, longest_silence_s};
use crate::consistency::{EmgChange, FrozenWatch};
use crate::dataset::{RecordError, STREAMS, stream_file_name};
use crate::rig::StreamSettings;

/// Time between two measurements of the clock that are kept: the library measures every 5 s.
const CLOCK_PERIOD: Duration = Duration::from_secs(2);

/// Longest wait at the end of a session for samples that were taken before it.
const END_WAIT: Duration = Duration::from_secs(2);

/// What happens to a stream in a session.
#[derive(Debug, Clone, PartialEq)]
pub enum StreamEvent {
    /// It has been silent for this time, s.
    Silent {
        /// For how long, s.
        for_s: f64,
        /// Whether it is gone for good: it says no source id by which it could be found again.
        is_lost: bool,
        /// Whether that is a fault.
        is_fault: bool,
    },
    /// Its samples come again, after this time, s.
    Back {
        /// After how long, s.
        after_s: f64,
    },
    /// A channel of EMG keeps one value, as that of an amplifier that has stopped.
    Frozen {
        /// Name of the channel in the rig file.
        channel: &'static str,
        /// The value, in the unit of the channel.
        value: f64,
        /// For how long, s.
        for_s: f64,
        /// Whether that is a fault.
        is_fault: bool,
    },
    /// A channel of EMG changes again.
    Live {
        /// Name of the channel in the rig file.
        channel: &'static str,
        /// After how long, s.
        after_s: f64,
    },
    /// Its time stamps cannot be when its samples were taken.
    StampsOff {
        /// How far they are behind the clock when the samples come, s; negative in the future.
        late_s: f64,
        /// How many samples had been recorded when they were last right.
        after_samples: u64,
        /// Whether that is a fault.
        is_fault: bool,
    },
    /// Its time stamps are right again.
    StampsRight {
        /// How many samples had been recorded by then.
        after_samples: u64,
    },
    /// Its samples cannot be written.
    NotRecorded {
        /// Why.
        reason: String,
    },
}

/// How a session hears of its streams: name of the stream, and what happened.
pub type TellStream = Arc<dyn Fn(&str, StreamEvent) + Send + Sync>;

impl ConnectedStreams {
    /// Begins to record the streams into the folder of a session, in the `run`th run of the program on it, counted from 1.
    ///
    /// # Errors
    /// If a file cannot be begun.
    pub fn record(
        self,
        session: &Path,
        run: usize,
        tell: &TellStream,
    ) -> Result<StreamRecording, RecordError> {
        let over = Arc::new(AtomicBool::new(false));
        let mut recording = StreamRecording { threads: Vec::new(), over: over.clone() };
        for stream in self.streams {
            let ConnectedStream { settings, described, inlet, watch, offset } = stream;
            let name = stream_file_name(&settings.file_stem(), run);
            let file = StreamFile::begin(session, &name, described.clone())?;
            let taken = TakenStream {
                room: room(described.rate_hz),
                channels: described.channels.len(),
                emg: WatchedEmg::all(&described, &settings),
                stamps: StampWatch::new(longest_silence_s(&settings)),
                can_be_found_again: !described.source_id.is_empty(),
                settings,
                inlet,
                watch,
                file,
                tell: tell.clone(),
            };
            let (library, clock, over) = (self.library.clone(), self.clock.clone(), over.clone());
            let thread = thread::Builder::new().name("stream".to_owned()).spawn(move || {
                taken.take(offset, &library, &clock, &over);
            });
            // Without threads there is no session at all.
            recording.threads.push(thread.map_err(RecordError::at(&session.join(STREAMS).join(&name)))?);
        }
        Ok(recording)
    }
}

/// The streams of a session while they are recorded.
#[derive(Debug)]
pub struct StreamRecording {
    threads: Vec<JoinHandle<()>>,
    over: Arc<AtomicBool>,
}

impl StreamRecording {
    /// Ends the files, with everything that came until now.
    pub fn finish(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.over.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            // If the thread panicked, it has said so; the file is whole up to its last chunk.
            let _ = thread.join();
        }
    }
}

impl Drop for StreamRecording {
    fn drop(&mut self) {
        self.end();
    }
}

/// A stream on its thread.
struct TakenStream {
    settings: StreamSettings,
    inlet: Inlet,
    watch: StreamWatch,
    file: StreamFile,
    tell: TellStream,
    channels: usize,
    /// The channels that are EMG.
    emg: Vec<WatchedEmg>,
    stamps: StampWatch,
    /// Samples that are taken at once.
    room: usize,
    can_be_found_again: bool,
}

impl TakenStream {
    fn take(mut self, first: ClockOffset, library: &LslLibrary, clock: &LslClock, over: &AtomicBool) {
        let tell = self.tell.clone();
        let (name, watch) = (self.settings.name.clone(), self.watch.clone());
        let failed = |error: RecordError| {
            watch.set(StreamHealth::NotRecorded);
            tell(&name, StreamEvent::NotRecorded { reason: error.to_string() });
        };
        match self.take_until(first, library, clock, over) {
            Ok(()) => drop(self.file.finish().map_err(failed)),
            Err(error) => failed(error),
        }
    }

    fn take_until(
        &mut self,
        first: ClockOffset,
        library: &LslLibrary,
        clock: &LslClock,
        over: &AtomicBool,
    ) -> Result<(), RecordError> {
        let mut values = vec![0.0; self.room * self.channels];
        let mut times_s = vec![0.0; self.room];
        self.file.clock_offset(first)?;
        let (mut last_offset, mut asked) = (first, Instant::now());
        let (mut last_sample, mut is_silent) = (Instant::now(), false);
        let (mut last_stamp_s, mut ending) = (f64::NEG_INFINITY, None);
        loop {
            clock.read(library);
            let mut is_lost = false;
            loop {
                let count = match self.inlet.pull(self.channels, &mut values, &mut times_s) {
                    Ok(count) => count,
                    Err(failure) => {
                        is_lost = failure == InletFailure::Lost;
                        0
                    }
                };
                if count == 0 {
                    break;
                }
                self.file.samples(&times_s[..count], &values[..count * self.channels])?;
                last_stamp_s = times_s[count - 1];
                if std::mem::take(&mut is_silent) {
                    self.back(last_sample.elapsed());
                }
                self.stamps.samples(&times_s[..count]);
                self.watch_emg(&values[..count * self.channels]);
                last_sample = Instant::now();
                if count < self.room {
                    // Nothing newer has come.
                    let now_s = library.now_s();
                    self.watch_stamps(now_s - (last_stamp_s + last_offset.offset_s), now_s);
                    break;
                }
            }
            let silence = last_sample.elapsed();
            if !is_silent && (is_lost || silence > self.longest_silence()) {
                is_silent = true;
                self.silent(silence, is_lost);
            }
            if !is_silent && asked.elapsed() >= CLOCK_PERIOD {
                asked = Instant::now();
                // The library has the last measurement ready, and never waits for the next.
                if let Ok(offset) = self.inlet.clock_offset(0.0)
                    && offset.remote_s != last_offset.remote_s
                {
                    last_offset = offset;
                    self.file.clock_offset(offset)?;
                }
            }
            if over.load(Ordering::Acquire) {
                // The last samples of the last trial are still on their way.
                let (end_s, since) = *ending.get_or_insert_with(|| (library.now_s(), Instant::now()));
                let has_come = last_stamp_s + last_offset.offset_s >= end_s;
                if is_silent || has_come || since.elapsed() >= END_WAIT {
                    return Ok(());
                }
            }
            thread::sleep(PULL_PERIOD);
        }
    }

    fn longest_silence(&self) -> Duration {
        Duration::from_secs_f64(longest_silence_s(&self.settings))
    }

    /// An amplifier that has stopped may repeat its last value: that is no better than silence.
    fn watch_emg(&mut self, values: &[f64]) {
        let is_fault = self.settings.tolerate.silent_s.is_some();
        for sample in values.chunks_exact(self.channels) {
            for at in 0..self.emg.len() {
                let own = &mut self.emg[at];
                let channel = own.name;
                let event = match own.watch.take(sample[own.place]) {
                    None => continue,
                    Some(EmgChange::Frozen { value, for_s }) => {
                        own.is_frozen = true;
                        StreamEvent::Frozen { channel, value, for_s, is_fault }
                    }
                    Some(EmgChange::Live { after_s }) => {
                        own.is_frozen = false;
                        StreamEvent::Live { channel, after_s }
                    }
                };
                self.set_health();
                (self.tell)(&self.settings.name, event);
            }
        }
    }

    /// Samples whose time nobody knows are no better than none.
    fn watch_stamps(&mut self, late_s: f64, at_s: f64) {
        let event = match self.stamps.take(late_s, at_s) {
            None => return,
            Some(StampChange::Off { late_s, after_samples }) => {
                let is_fault = self.settings.tolerate.silent_s.is_some();
                StreamEvent::StampsOff { late_s, after_samples, is_fault }
            }
            Some(StampChange::Right { after_samples }) => StreamEvent::StampsRight { after_samples },
        };
        self.set_health();
        (self.tell)(&self.settings.name, event);
    }

    /// Says how the stream is while its samples come.
    fn set_health(&self) {
        let is_fault = self.settings.tolerate.silent_s.is_some();
        self.watch.set(if is_fault && self.stamps.is_off() {
            StreamHealth::StampsOff
        } else if is_fault && self.emg.iter().any(|own| own.is_frozen) {
            StreamHealth::Frozen
        } else {
            StreamHealth::Good
        });
    }

    fn silent(&self, silence: Duration, is_lost: bool) {
        let is_fault = self.settings.tolerate.silent_s.is_some();
        if is_fault {
            self.watch.set(StreamHealth::Silent);
        }
        let is_lost = is_lost || !self.can_be_found_again;
        let event = StreamEvent::Silent { for_s: silence.as_secs_f64(), is_lost, is_fault };
        (self.tell)(&self.settings.name, event);
    }

    fn back(&mut self, silence: Duration) {
        for own in &mut self.emg {
            own.watch.interrupt();
            own.is_frozen = false;
        }
        self.stamps.interrupt();
        self.set_health();
        (self.tell)(&self.settings.name, StreamEvent::Back { after_s: silence.as_secs_f64() });
    }
}

/// A channel of EMG while it is recorded.
struct WatchedEmg {
    /// Its name in the rig file.
    name: &'static str,
    /// Its place among the channels.
    place: usize,
    watch: FrozenWatch,
    is_frozen: bool,
}

impl WatchedEmg {
    /// Those of a stream.
    fn all(described: &DescribedStream, settings: &StreamSettings) -> Vec<Self> {
        let watch = FrozenWatch::new(described.rate_hz, longest_silence_s(settings));
        let own = |(name, place)| Self { name, place, watch: watch.clone(), is_frozen: false };
        described.emg_places(settings).into_iter().map(own).collect()
    }
}
