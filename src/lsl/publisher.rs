//! Publishes a running session: a stream of its samples, and a stream of its transitions.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use super::clock::LslClock;
use super::library::{LslError, LslLibrary, StreamDescription};
use crate::rig::Cue;
use crate::session::{Event, Phase, Progress, Step, StepConsumer, TransitionRecord};
use crate::timing::SampleClock;

/// Name of the stream of samples.
pub const SIGNALS_STREAM: &str = "ramphold signals";

/// Name of the stream of markers.
pub const MARKERS_STREAM: &str = "ramphold markers";

/// Steps that the ring holds: 6 s at 2.5 kHz.
const RING_STEPS: usize = 1 << 14;

/// Longest sleep of the thread while there is nothing to publish.
const SLEEP: Duration = Duration::from_millis(2);

/// How long the streams stay after the last sample, for readers that are still taking it.
const LINGER: Duration = Duration::from_millis(500);

/// What is published of a step.
#[derive(Debug, Clone, Copy)]
struct PublishedStep {
    had: Instant,
    sample: u64,
    /// Angle, torque, EMG of flexor and extensor, target angle, target torque; NaN where there is none.
    values: Option<[f64; 6]>,
    phase: Phase,
    transition: Option<TransitionRecord>,
    trial: Option<u32>,
    is_practice: bool,
}

/// The session's end: takes each step, and never waits.
#[derive(Debug)]
pub struct LslFeed {
    ring: Producer<PublishedStep>,
    lost: Arc<AtomicU64>,
    ahead: LslClock,
}

impl LslFeed {
    /// The clock of the streams, to be asked from any thread.
    pub fn clock(&self) -> LslClock {
        self.ahead.clone()
    }
}

/// The publishing thread.
#[derive(Debug)]
pub struct LslPublisher {
    thread: Option<JoinHandle<()>>,
    over: Arc<AtomicBool>,
    lost: Arc<AtomicU64>,
    version: i32,
}

impl LslPublisher {
    /// Begins to publish a session of `sample_rate_hz`, whose motor is at its target `motion_delay_samples` after the sample behind a
    /// command; `emg` says of flexor and extensor whether they are measured, `source` tells the session from others.
    ///
    /// # Errors
    /// If the library does not make the streams.
    pub fn start(
        library: LslLibrary,
        sample_rate_hz: f64,
        motion_delay_samples: u64,
        emg: [bool; 2],
        source: &str,
    ) -> Result<(Self, LslFeed), LslError> {
        let (ring, steps) = RingBuffer::new(RING_STEPS);
        let (over, lost) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (opened, is_open) = mpsc::channel();
        let version = library.version();
        let ahead = LslClock::unknown();
        ahead.read(&library);
        let published = Published {
            sample_rate_hz,
            onset_delay_s: motion_delay_samples as f64 / sample_rate_hz,
            emg,
            source: source.to_owned(),
        };
        let thread = thread::spawn({
            let (over, ahead) = (over.clone(), ahead.clone());
            move || published.publish(&library, steps, (&over, &ahead), &opened)
        });
        // The thread says it in any case, or it is gone.
        let refused =
            is_open.recv().unwrap_or(Some(LslError::NoStream { stream: SIGNALS_STREAM.to_owned() }));
        if let Some(error) = refused {
            let _ = thread.join();
            return Err(error);
        }
        let feed = LslFeed { ring, lost: lost.clone(), ahead };
        Ok((Self { thread: Some(thread), over, lost, version }, feed))
    }

    /// Version of liblsl, as 118 for 1.18.
    pub fn version(&self) -> i32 {
        self.version
    }

    /// Ends the streams once all steps are published. Returns the number of steps that the ring had no room for.
    pub fn finish(mut self) -> u64 {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed; the session is complete without it.
            let _ = thread.join();
        }
        self.lost.load(Ordering::Relaxed)
    }
}

impl StepConsumer for LslFeed {
    type Error = Infallible;

    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), Infallible> {
        let target_nm = match step.cue {
            Cue::Target { target_nm, .. } => target_nm,
            _ => f64::NAN,
        };
        let values = step.measured.map(|sample| {
            let emg = [sample.emg_fcr_mvc, sample.emg_ecr_mvc].map(|emg| emg.unwrap_or(f64::NAN));
            [sample.theta_m_rad, sample.torque_l_nm, emg[0], emg[1], step.target_rad, target_nm]
        });
        let published = PublishedStep {
            had: Instant::now(),
            sample: step.sample,
            values,
            phase: step.phase,
            transition: step.transition,
            trial: (progress.last_number() > 0).then(|| progress.last_number()),
            is_practice: progress.attempts().last().is_some_and(|attempt| attempt.planned.key.practice),
        };
        if self.ring.push(published).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// What the streams of a session are.
struct Published {
    sample_rate_hz: f64,
    onset_delay_s: f64,
    emg: [bool; 2],
    source: String,
}

impl Published {
    fn publish(
        &self,
        library: &LslLibrary,
        mut steps: Consumer<PublishedStep>,
        (over, ahead): (&AtomicBool, &LslClock),
        opened: &mpsc::Sender<Option<LslError>>,
    ) {
        // Place in the values of a step, name and unit. A muscle that is not measured is no channel.
        let all = [
            (0, "theta_m_rad", "rad"),
            (1, "torque_l_nm", "N m"),
            (2, "emg_fcr_mvc", "MVC"),
            (3, "emg_ecr_mvc", "MVC"),
            (4, "target_rad", "rad"),
            (5, "target_nm", "N m"),
        ];
        let is_measured = |place: usize| !(2..4).contains(&place) || self.emg[place - 2];
        let places: Vec<usize> = all.iter().map(|own| own.0).filter(|place| is_measured(*place)).collect();
        let mut channels: Vec<(&str, &str)> =
            places.iter().map(|place| (all[*place].1, all[*place].2)).collect();
        channels.push(("state", ""));
        let signals = StreamDescription {
            name: SIGNALS_STREAM,
            kind: "Mixed",
            channels: &channels,
            rate_hz: self.sample_rate_hz,
            is_text: false,
            source: &format!("{} signals", self.source),
        };
        let markers = StreamDescription {
            name: MARKERS_STREAM,
            kind: "Markers",
            channels: &[("event", "")],
            rate_hz: 0.0,
            is_text: true,
            source: &format!("{} markers", self.source),
        };
        let (signals, markers) = match (library.outlet(&signals), library.outlet(&markers)) {
            (Ok(signals), Ok(markers)) => (signals, markers),
            (Err(error), _) | (_, Err(error)) => {
                let _ = opened.send(Some(error));
                return;
            }
        };
        if opened.send(None).is_err() {
            return;
        }
        let mut clock = SampleClock::new(self.sample_rate_hz);
        let mut values = Vec::with_capacity(channels.len());
        loop {
            // Read before the ring is emptied, so that the last steps are still published.
            let is_over = over.load(Ordering::Acquire);
            // The two clocks run alike; where one is on the other is taken anew each time.
            let (now, now_s) = (Instant::now(), library.now_s());
            ahead.read(library);
            while let Ok(step) = steps.pop() {
                let had_s = now_s - now.saturating_duration_since(step.had).as_secs_f64()
                    + step.had.saturating_duration_since(now).as_secs_f64();
                let time_s = clock.time_s(step.sample, had_s);
                if let Some(own) = step.values {
                    values.clear();
                    values.extend(places.iter().map(|place| own[*place]));
                    values.push(step.phase as u8 as f64);
                    signals.push(&values, time_s);
                }
                if let Some(transition) = &step.transition {
                    let delay_s = if transition.event == Event::Onset { self.onset_delay_s } else { 0.0 };
                    markers.push_text(&marker(transition, step.trial, step.is_practice), time_s + delay_s);
                }
            }
            if is_over {
                thread::sleep(LINGER);
                return;
            }
            thread::sleep(SLEEP);
        }
    }
}

/// Text of the marker of a transition: the event, and the number of the trial that it belongs to.
fn marker(transition: &TransitionRecord, trial: Option<u32>, is_practice: bool) -> String {
    let event = transition.event.name();
    let in_trial = transition.from.in_trial() || transition.to.in_trial();
    match trial.filter(|_| in_trial) {
        Some(number) if transition.from.in_rig_trial() || transition.to.in_rig_trial() => {
            format!("rig {event} {number}")
        }
        Some(number) if is_practice => format!("practice {event} {number}"),
        Some(number) => format!("{event} {number}"),
        None => event.to_owned(),
    }
}
