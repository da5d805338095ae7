//! The streams of a session: found before it begins, recorded while it runs, cut into its trials at its end.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::attach::align_stream;
use crate::console::OperatorNotice;
use crate::dataset::{
    ActionOrigin, AuditEntry, AuditSender, OperatorAction, RecordError, STREAMS, SessionClock, stream_files,
};
use crate::lsl::{
    ConnectedStreams, LslClock, LslLibrary, StreamEvent, StreamRecording, StreamWatch, TellStream, stamps_off,
};
use crate::rig::StreamSettings;
use crate::session::{Progress, Step, StepConsumer};

use super::console::Console;
use super::failure::Failure;
use super::session_rig::stored_streams;

/// Largest difference of a stream's measured rate from the rate that it states, as a part of it, of which the operator hears nothing.
const RATE_TOLERANCE: f64 = 0.01;

/// The streams of a session that is about to run.
pub struct SessionStreams(ConnectedStreams);

impl SessionStreams {
    /// Finds the streams of a rig file; `None` if it has none.
    ///
    /// # Errors
    /// If the library or a stream is not there, a stream is not as it must be, or the session does not run in real time.
    pub fn connect(
        streams: &[StreamSettings],
        library: Option<&Path>,
        in_real_time: bool,
        console: &Console,
    ) -> Result<Option<Self>, Failure> {
        if streams.is_empty() {
            return Ok(None);
        }
        if !in_real_time {
            return Err(Failure::Usage(
                "the rig file has streams (field streams), which other devices send in real time; add --real-time".to_owned(),
            ));
        }
        let library = LslLibrary::load(library)?;
        let names: Vec<String> = streams.iter().map(|stream| format!("{:?}", stream.name)).collect();
        console.message(format_args!("Lab Streaming Layer: looking for {}", names.join(", ")));
        let connected = ConnectedStreams::connect(library, streams)?;
        for line in connected.described() {
            console.message(line);
        }
        Ok(Some(Self(connected)))
    }

    /// The watches of the streams, for the rig.
    pub fn watches(&self) -> Vec<StreamWatch> {
        self.0.watches()
    }

    /// The clock of Lab Streaming Layer.
    pub fn clock(&self) -> LslClock {
        self.0.clock()
    }

    /// Begins to record the streams into the folder of the session. Each event of a stream (silence, return, loss) goes to the operator and into
    /// the journal.
    ///
    /// # Errors
    /// If a file cannot be begun.
    pub fn record(
        self,
        session: &Path,
        tell: Arc<dyn Fn(OperatorNotice) + Send + Sync>,
        journal: AuditSender,
    ) -> Result<RecordedStreams, Failure> {
        let run = SessionClock::read(session)?.runs;
        let sample = Arc::new(AtomicU64::new(0));
        let on_threads: TellStream = Arc::new({
            let sample = sample.clone();
            move |stream: &str, event: StreamEvent| {
                let (action, notice) = told(stream, &event);
                let sample = sample.load(Ordering::Relaxed);
                // Where the journal is closed, the session is over.
                journal.send(AuditEntry { sample, origin: ActionOrigin::Program, action });
                tell(notice);
            }
        });
        let recording = self.0.record(session, run, &on_threads)?;
        Ok(RecordedStreams { recording, sample })
    }
}

/// What the journal and the operator hear of an event of a stream.
fn told(stream: &str, event: &StreamEvent) -> (OperatorAction, OperatorNotice) {
    let name = stream.to_owned();
    match event {
        StreamEvent::Silent { for_s, is_lost, is_fault } => {
            let again = if *is_lost { "; it says no source id, so it cannot be found again" } else { "" };
            let then = if *is_fault {
                ""
            } else {
                "; the rig file tolerates it, and the session goes on without it"
            };
            let text = format!("the stream {stream:?} has given no sample for {for_s:.2} s{again}{then}");
            (OperatorAction::StreamSilent { stream: name, for_s: *for_s }, OperatorNotice::Alarm(text))
        }
        StreamEvent::Back { after_s } => {
            let text = format!("the stream {stream:?} is back after {after_s:.2} s");
            (OperatorAction::StreamBack { stream: name, after_s: *after_s }, OperatorNotice::Message(text))
        }
        StreamEvent::Frozen { channel, value, for_s, is_fault } => {
            let then = if *is_fault {
                ""
            } else {
                "; the rig file tolerates it, and the session goes on; do not trust this EMG"
            };
            let text = format!(
                "the stream {stream:?} has had the same value, {value}, in {channel} for {for_s:.2} s: has the amplifier stopped, or is an \
                 electrode off?{then}"
            );
            let channel = (*channel).to_owned();
            (
                OperatorAction::StreamFrozen { stream: name, channel, value: *value, for_s: *for_s },
                OperatorNotice::Alarm(text),
            )
        }
        StreamEvent::Live { channel, after_s } => {
            let text = format!("{channel} of the stream {stream:?} changes again after {after_s:.2} s");
            let channel = (*channel).to_owned();
            (
                OperatorAction::StreamLive { stream: name, channel, after_s: *after_s },
                OperatorNotice::Message(text),
            )
        }
        StreamEvent::StampsOff { late_s, after_samples, is_fault } => {
            let then = if *is_fault {
                ""
            } else {
                "; the rig file tolerates it, and the session goes on; what it sends until they are right has no place in the trials"
            };
            let text = format!("the stream {stream:?}: {}{then}", stamps_off(*late_s));
            let (late_s, after_samples) = (*late_s, *after_samples);
            (
                OperatorAction::StreamStampsOff { stream: name, late_s, after_samples },
                OperatorNotice::Alarm(text),
            )
        }
        StreamEvent::StampsRight { after_samples } => {
            let text = format!("the time stamps of the stream {stream:?} are right again");
            let after_samples = *after_samples;
            (OperatorAction::StreamStampsRight { stream: name, after_samples }, OperatorNotice::Message(text))
        }
        StreamEvent::NotRecorded { reason } => {
            let text = format!("the stream {stream:?} is not recorded any more: {reason}");
            (
                OperatorAction::StreamNotRecorded { stream: name, because: reason.clone() },
                OperatorNotice::Alarm(text),
            )
        }
    }
}

/// The streams of a session while they are recorded. Told of each step, so that the journal can say when something happened to them.
pub struct RecordedStreams {
    recording: StreamRecording,
    sample: Arc<AtomicU64>,
}

impl RecordedStreams {
    /// Ends the files.
    pub fn finish(self) {
        self.recording.finish();
    }
}

impl StepConsumer for RecordedStreams {
    type Error = Infallible;

    fn consume(&mut self, step: &Step, _: &Progress) -> Result<(), Infallible> {
        self.sample.store(step.sample, Ordering::Relaxed);
        Ok(())
    }
}

/// Cuts the recorded streams of a session into its trials. A stream that cannot be cut makes a message, and its file stays as it is.
///
/// # Errors
/// If the folder of the streams cannot be read.
pub fn attach_streams(session: &Path, console: &Console) -> Result<(), Failure> {
    let files = stream_files(session).map_err(RecordError::at(&session.join(STREAMS)))?;
    if files.is_empty() {
        return Ok(());
    }
    let streams = stored_streams(session)?;
    for file in files {
        let Some(stream) = streams.iter().find(|stream| stream.file_stem() == file.stem) else {
            console.announce(format_args!(
                "{}: is of no stream of the session's rig.json, and was left as it is",
                session.join(&file.file).display()
            ));
            continue;
        };
        match align_stream(session, &file, stream) {
            Ok(None) => {}
            Ok(Some(aligned)) => {
                aligned.write()?;
                let attachment = &aligned.attachment;
                let (trials, left) = (attachment.trials.len(), attachment.left_out.len());
                console.message(format_args!(
                    "stream {:?}: {trials} trials, {left} left out, {:.4} samples a second; {}",
                    stream.name,
                    attachment.clock.rate_hz,
                    aligned.folder().display()
                ));
                let nominal_hz = attachment.stream.as_ref().map_or(0.0, |own| own.nominal_rate_hz);
                if (attachment.clock.rate_hz / nominal_hz - 1.0).abs() > RATE_TOLERANCE {
                    console.announce(format_args!(
                        "stream {:?}: says that it has {nominal_hz} samples a second, and has {:.2}",
                        stream.name, attachment.clock.rate_hz
                    ));
                }
                for frozen in &attachment.frozen_emg {
                    console.announce(format_args!("stream {:?}: {frozen}", stream.name));
                }
                for warning in &attachment.emg_warnings {
                    console.announce(format_args!("stream {:?}: {warning}", stream.name));
                }
                for left in &attachment.left_out {
                    console.announce(format_args!(
                        "stream {:?}, trial {} left out: {}",
                        stream.name, left.trial, left.because
                    ));
                }
            }
            Err(error) => console.announce(format_args!(
                "the stream {:?} was not cut into the trials: {error}; its file is whole",
                stream.name
            )),
        }
    }
    Ok(())
}
