//! A stream that is taken in.

use std::ffi::{CStr, c_ulong};
use std::sync::Arc;
use std::time::Duration;

use super::library::{LslLibrary, Pointer, text};

/// Longest time between two looks for samples.
pub const PULL_PERIOD: Duration = Duration::from_millis(20);

/// Time that samples are taken for at once, s; more are taken at the next look.
const CHUNK_S: f64 = 0.5;

/// Seconds of a stream that the library keeps while nobody takes them.
const INLET_KEPT_S: i32 = 360;

/// `lsl_lost_error` of lsl_c.h: the stream is gone and cannot be found again.
const LOST: i32 = -2;

/// What a stream could not give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InletFailure {
    /// Nothing came in time.
    TimedOut,
    /// The stream is gone, and has nothing by which the library could find it again.
    Lost,
}

/// How far the clock of this computer was ahead of that of a stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// When it was measured, on the clock of the stream, s.
    pub remote_s: f64,
    /// The offset, s.
    pub offset_s: f64,
    /// By how much it can be wrong: the round trip of the measurement, s.
    pub uncertainty_s: f64,
}

/// A stream that is taken in. It finds its stream again by itself where the stream has a source id.
#[derive(Debug)]
pub struct Inlet {
    library: Arc<LslLibrary>,
    inlet: Pointer,
}

// SAFETY: the functions of an inlet may be called from any thread, and here from one at a time: they need `&mut`.
unsafe impl Send for Inlet {}

/// A stream that was found.
pub struct FoundStream {
    library: Arc<LslLibrary>,
    info: Pointer,
}

impl Drop for FoundStream {
    fn drop(&mut self) {
        // SAFETY: the description is this one's own, and is not used after this.
        unsafe { (self.library.inlets.destroy_info)(self.info) };
    }
}

impl FoundStream {
    /// The streams for which `predicate` (XPath 1.0, over the fields of their description) holds: returns once there are `enough`, or
    /// after `wait_s`.
    pub fn resolve(library: &Arc<LslLibrary>, predicate: &str, enough: i32, wait_s: f64) -> Vec<Self> {
        let predicate = text(predicate);
        let mut found: [Pointer; 8] = [std::ptr::null_mut(); 8];
        // SAFETY: there is room for as many descriptions as are asked for, and the text lives during the call.
        let count =
            unsafe { (library.inlets.resolve)(found.as_mut_ptr(), 8, predicate.as_ptr(), enough, wait_s) };
        let count = usize::try_from(count).unwrap_or(0).min(found.len());
        found[..count].iter().map(|info| Self { library: library.clone(), info: *info }).collect()
    }

    /// Its description as XML; without the channels, which only an inlet gets.
    pub fn xml(&self) -> String {
        self.library.xml(self.info)
    }

    /// Takes the stream in; `None` if the library refuses.
    pub fn inlet(&self) -> Option<Inlet> {
        // SAFETY: the description is that of a stream that was found; the inlet copies it.
        let inlet = unsafe { (self.library.inlets.create)(self.info, INLET_KEPT_S, 0, 1) };
        (!inlet.is_null()).then(|| Inlet { library: self.library.clone(), inlet })
    }
}

impl LslLibrary {
    /// A description as XML.
    fn xml(&self, info: Pointer) -> String {
        // SAFETY: `info` is a description; the text is copied before it is given back.
        unsafe {
            let given = (self.inlets.xml)(info);
            if given.is_null() {
                return String::new();
            }
            let copied = CStr::from_ptr(given).to_string_lossy().into_owned();
            (self.inlets.destroy_text)(given);
            copied
        }
    }
}

impl Inlet {
    fn outcome<T>(value: T, error: i32) -> Result<T, InletFailure> {
        match error {
            0 => Ok(value),
            LOST => Err(InletFailure::Lost),
            _ => Err(InletFailure::TimedOut),
        }
    }

    /// The whole description of the stream as XML.
    pub fn description(&mut self, wait_s: f64) -> Result<String, InletFailure> {
        let mut error = 0;
        // SAFETY: the inlet is alive; the description is this one's own and is destroyed once.
        unsafe {
            let info = (self.library.inlets.full_info)(self.inlet, wait_s, &mut error);
            if info.is_null() {
                return Self::outcome(String::new(), if error == 0 { LOST } else { error });
            }
            let xml = self.library.xml(info);
            (self.library.inlets.destroy_info)(info);
            Ok(xml)
        }
    }

    /// Begins to take its samples in.
    pub fn open(&mut self, wait_s: f64) -> Result<(), InletFailure> {
        let mut error = 0;
        // SAFETY: the inlet is alive.
        unsafe { (self.library.inlets.open)(self.inlet, wait_s, &mut error) };
        Self::outcome((), error)
    }

    /// The last measurement of its clock; the first call waits for it.
    pub fn clock_offset(&mut self, wait_s: f64) -> Result<ClockOffset, InletFailure> {
        let (mut remote_s, mut uncertainty_s, mut error) = (0.0, 0.0, 0);
        // SAFETY: the inlet is alive, and the places of the results live during the call.
        let offset_s = unsafe {
            (self.library.inlets.correction)(
                self.inlet,
                &mut remote_s,
                &mut uncertainty_s,
                wait_s,
                &mut error,
            )
        };
        Self::outcome(ClockOffset { remote_s, offset_s, uncertainty_s }, error)
    }

    /// Takes what has come since: as many samples of `channels` values as fit into `values`, and their times. Does not wait. Returns the
    /// number of samples.
    pub fn pull(
        &mut self,
        channels: usize,
        values: &mut [f64],
        times_s: &mut [f64],
    ) -> Result<usize, InletFailure> {
        let samples = times_s.len().min(values.len() / channels.max(1));
        let mut error = 0;
        // SAFETY: the inlet is alive and has as many channels; the call gets the lengths of both buffers and writes no more.
        let count = unsafe {
            (self.library.inlets.pull)(
                self.inlet,
                values.as_mut_ptr(),
                times_s.as_mut_ptr(),
                (samples * channels) as c_ulong,
                samples as c_ulong,
                0.0,
                &mut error,
            )
        };
        Self::outcome(count as usize / channels.max(1), error)
    }
}

impl Drop for Inlet {
    fn drop(&mut self) {
        // SAFETY: the inlet is alive and is not used after this.
        unsafe { (self.library.inlets.destroy)(self.inlet) };
    }
}

/// Samples of a stream that are taken at once.
pub fn room(rate_hz: f64) -> usize {
    (CHUNK_S * rate_hz).ceil().max(64.0) as usize
}
