//! A rig whose session also needs streams: where one is silent for longer than is tolerated, that is a fault as of any other sensor.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use serde_json::{Map, Value};

use crate::protocol::Limits;
use crate::rig::{
    Armed, ArmingConsent, Command, DeviceFault, Fault, FaultClass, Origin, Punctuality, Rig, Sample,
    StreamSettings, Vitals,
};

/// Length of a tolerated silence after which the operator gets a message, s.
const NOTED_SILENCE_S: f64 = 1.0;

/// How a stream is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum StreamHealth {
    /// Its samples come, or their absence is tolerated.
    Good,
    /// It has been silent for longer than is tolerated.
    Silent,
    /// Its EMG has kept one value for longer than is tolerated.
    Frozen,
    /// Its time stamps cannot be when its samples were taken.
    StampsOff,
    /// Its samples cannot be written.
    NotRecorded,
}

/// The health of a stream: set by the thread that records it, read by the control loop, which never waits for it.
#[derive(Debug, Clone)]
pub struct StreamWatch {
    health: Arc<AtomicU8>,
    silent: Fault,
    frozen: Fault,
    stamps_off: Fault,
    not_recorded: Fault,
}

impl StreamWatch {
    /// The watch of a stream, which is good.
    pub fn new(stream: &StreamSettings) -> Self {
        let name = &stream.name;
        let fault = |code: &str, message: String| {
            let values = Map::from_iter([("stream".to_owned(), Value::from(name.clone()))]);
            Fault::Device(DeviceFault::new(code, FaultClass::Sensor, message, values))
        };
        let tolerated_s = stream.tolerate.silent_s.unwrap_or_default();
        Self {
            health: Arc::new(AtomicU8::new(StreamHealth::Good as u8)),
            silent: fault(
                "silent_stream",
                format!(
                    "the stream {name:?} gave no sample for more than the {tolerated_s} s that tolerate.silent_s of the rig file lets pass; \
                     check its device and its program"
                ),
            ),
            frozen: fault(
                "frozen_stream",
                format!(
                    "the EMG of the stream {name:?} kept one value for more than the {tolerated_s} s that tolerate.silent_s of the rig file \
                     lets pass; check its amplifier and its electrodes"
                ),
            ),
            stamps_off: fault(
                "stream_stamps_off",
                format!(
                    "the time stamps of the stream {name:?} cannot be when its samples were taken; its device must stamp them by the clock of \
                     Lab Streaming Layer: has its clock jumped?"
                ),
            ),
            not_recorded: fault(
                "stream_not_recorded",
                format!("the stream {name:?} cannot be written to the session's folder; check the disk"),
            ),
        }
    }

    /// Says how the stream is.
    pub fn set(&self, health: StreamHealth) {
        self.health.store(health as u8, Ordering::Release);
    }

    fn fault(&self) -> Option<Fault> {
        match self.health.load(Ordering::Acquire) {
            health if health == StreamHealth::Silent as u8 => Some(self.silent),
            health if health == StreamHealth::Frozen as u8 => Some(self.frozen),
            health if health == StreamHealth::StampsOff as u8 => Some(self.stamps_off),
            health if health == StreamHealth::NotRecorded as u8 => Some(self.not_recorded),
            _ => None,
        }
    }
}

/// Time without a new value that is let pass, s.
pub fn longest_silence_s(settings: &StreamSettings) -> f64 {
    settings.tolerate.silent_s.unwrap_or(NOTED_SILENCE_S)
}

/// A rig, and the streams that a session on it needs.
#[derive(Debug)]
pub struct WatchedRig<R> {
    rig: R,
    streams: Vec<StreamWatch>,
}

impl<R> WatchedRig<R> {
    /// A rig that is watched together with `streams`; without any it is as it was.
    pub fn new(rig: R, streams: Vec<StreamWatch>) -> Self {
        Self { rig, streams }
    }

    /// The rig itself.
    pub fn into_rig(self) -> R {
        self.rig
    }

    fn fault(&self) -> Option<Fault> {
        self.streams.iter().find_map(StreamWatch::fault)
    }
}

impl<R: Rig> Rig for WatchedRig<R> {
    type Armed = WatchedRig<R::Armed>;

    fn arm(self, word: ArmingConsent, limits: &Limits) -> Result<Self::Armed, (Self, Fault)> {
        if let Some(fault) = self.fault() {
            return Err((self, fault));
        }
        let Self { rig, streams } = self;
        match rig.arm(word, limits) {
            Ok(rig) => Ok(WatchedRig { rig, streams }),
            Err((rig, fault)) => Err((Self { rig, streams }, fault)),
        }
    }

    fn power_may_be_on(&self) -> bool {
        self.rig.power_may_be_on()
    }
}

impl<A: Armed> Armed for WatchedRig<A> {
    type Disarmed = WatchedRig<A::Disarmed>;

    /// The rig keeps its cycle whatever the streams do; the session makes it safe after a fault of theirs, as after a limit.
    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        let sample = self.rig.exchange(command)?;
        self.fault().map_or(Ok(sample), Err)
    }

    fn vitals(&self) -> Option<Vitals> {
        self.rig.vitals()
    }

    fn take_punctuality(&mut self) -> Option<Punctuality> {
        self.rig.take_punctuality()
    }

    fn origin(&self) -> Option<Origin> {
        self.rig.origin()
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        self.rig.rescale_emg(factors);
    }

    fn disarm(self) -> Self::Disarmed {
        WatchedRig { rig: self.rig.disarm(), streams: self.streams }
    }
}
