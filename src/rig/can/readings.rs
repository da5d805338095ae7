//! What the frames of one period say, in the units of the handle.

use super::bus::Frame;
use super::canopen::Kind;
use super::fault::CanFault;
use super::file::{Carried, EmgSignal, RigFile};

/// The most samples that fit into a frame.
pub const MOST_SAMPLES: usize = 8;
const MOST_FRAMES: usize = 8;
const MOST_PARTS: usize = 4;

/// What was measured in one period, oldest sample first, the last one at SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Readings {
    /// 6041h, for drives that have it.
    pub statusword: u16,
    /// 6064h at SYNC, counts; of motors without CANopen the drive says it itself.
    pub position: i32,
    /// Positions less that at SYNC, counts.
    pub steps: [f64; MOST_SAMPLES],
    /// Handle torque, N m; NaN where the sensor says that there is none.
    pub torque_nm: [f64; MOST_SAMPLES],
    /// EMG of FCR and ECR, MVC.
    pub emg_mvc: [f64; 2],
    /// Sample counter.
    pub counter: u32,
}

#[derive(Debug, Clone, Copy)]
struct Part {
    carried: Carried,
    offset: usize,
}

#[derive(Debug, Clone, Copy)]
struct Layout {
    id: u16,
    bytes: usize,
    parts: [Option<Part>; MOST_PARTS],
}

/// Takes the frames of a period apart; knows which are still to come.
#[derive(Debug, Clone)]
pub struct Decoder {
    layouts: [Option<Layout>; MOST_FRAMES],
    file: Scales,
    seen: u8,
    readings: Readings,
}

#[derive(Debug, Clone, Copy)]
struct Scales {
    torque: (Kind, f64, Option<f64>),
    samples: usize,
    steps: Option<Kind>,
    emg: [Option<(Kind, f64, Option<f64>)>; 2],
    counter: Option<Kind>,
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taken {
    /// It was awaited.
    Yes,
    /// It was there already in this period.
    Twice,
    /// It is none of this rig's.
    Foreign,
}

impl Decoder {
    /// For the frames of a rig file.
    pub fn new(file: &RigFile) -> Self {
        let mut layouts = [None; MOST_FRAMES];
        for (slot, frame) in layouts.iter_mut().zip(&file.frames) {
            let mut parts = [None; MOST_PARTS];
            let mut offset = 0;
            for (part, carried) in parts.iter_mut().zip(&frame.carries) {
                *part = Some(Part { carried: *carried, offset });
                offset += file.bytes(*carried);
            }
            *slot = frame.identifier().map(|id| Layout { id, bytes: offset, parts });
        }
        let signals = &file.signals;
        let count = |invalid: Option<i64>| invalid.map(|count| count as f64);
        let emg = |signal: Option<EmgSignal>| {
            signal.map(|signal| (signal.kind, signal.mvc_per_count, count(signal.invalid)))
        };
        let torque = &signals.torque;
        let scales = Scales {
            torque: (torque.kind, torque.nm_per_count, count(torque.invalid)),
            samples: torque.samples.min(MOST_SAMPLES),
            steps: signals.position_steps.map(|steps| steps.kind),
            emg: [emg(signals.emg_fcr), emg(signals.emg_ecr)],
            counter: signals.counter.map(|counter| counter.kind),
        };
        Self { layouts, file: scales, seen: 0, readings: Readings::default() }
    }

    /// A new period begins: everything is still to come.
    pub fn begin(&mut self) {
        self.seen = 0;
    }

    /// Whether everything has come.
    pub fn complete(&self) -> bool {
        self.first_missing().is_none()
    }

    /// The identifier of a frame that has not come.
    pub fn first_missing(&self) -> Option<u16> {
        self.layouts
            .iter()
            .enumerate()
            .find_map(|(at, layout)| layout.filter(|_| self.seen & 1 << at == 0).map(|layout| layout.id))
    }

    /// Whether a frame is one of this rig's.
    pub fn knows(&self, id: u16) -> bool {
        self.layouts.iter().flatten().any(|layout| layout.id == id)
    }

    /// The latest readings.
    pub fn readings(&self) -> &Readings {
        &self.readings
    }

    /// Samples in a period.
    pub fn samples(&self) -> usize {
        self.file.samples
    }

    /// Takes a frame in.
    ///
    /// # Errors
    /// [`CanFault::Malformed`]
    pub fn take(&mut self, frame: &Frame) -> Result<Taken, CanFault> {
        let found = self
            .layouts
            .iter()
            .enumerate()
            .find_map(|(at, layout)| Some((at, (*layout)?)).filter(|(_, l)| l.id == frame.id));
        let Some((at, layout)) = found else { return Ok(Taken::Foreign) };
        let data = frame.data();
        if data.len() != layout.bytes {
            let (length, expected) = (data.len() as u8, layout.bytes as u8);
            return Err(CanFault::Malformed { id: frame.id, length, expected });
        }
        if self.seen & 1 << at != 0 {
            return Ok(Taken::Twice);
        }
        self.seen |= 1 << at;
        for part in layout.parts.iter().flatten() {
            self.read(part.carried, &data[part.offset.min(data.len())..]);
        }
        Ok(Taken::Yes)
    }

    fn read(&mut self, carried: Carried, data: &[u8]) {
        let (scales, readings) = (&self.file, &mut self.readings);
        let scaled = |(kind, scale, invalid): (Kind, f64, Option<f64>), data: &[u8]| match kind.read(data) {
            Some(count) if Some(count) != invalid => count * scale,
            _ => f64::NAN,
        };
        match carried {
            Carried::Statusword => readings.statusword = Kind::U16.read(data).unwrap_or(0.0) as u16,
            Carried::Position => readings.position = Kind::I32.read(data).unwrap_or(0.0) as i32,
            Carried::Torque => {
                for at in 0..scales.samples {
                    let from = at * scales.torque.0.bytes();
                    readings.torque_nm[at] = scaled(scales.torque, data.get(from..).unwrap_or(&[]));
                }
            }
            Carried::PositionSteps => {
                let Some(kind) = scales.steps else { return };
                for at in 0..scales.samples {
                    let from = at * kind.bytes();
                    readings.steps[at] = kind.read(data.get(from..).unwrap_or(&[])).unwrap_or(f64::NAN);
                }
            }
            Carried::Counter => {
                readings.counter = scales.counter.and_then(|kind| kind.read(data)).unwrap_or(0.0) as u32;
            }
            Carried::EmgFcr => readings.emg_mvc[0] = scales.emg[0].map_or(0.0, |emg| scaled(emg, data)),
            Carried::EmgEcr => readings.emg_mvc[1] = scales.emg[1].map_or(0.0, |emg| scaled(emg, data)),
        }
    }
}

/// Whether samples go on: the counter by one each period, or at least a torque that changes.
#[derive(Debug, Clone)]
pub struct Freshness {
    /// Largest number of the counter, if there is one.
    counter_mask: Option<u32>,
    before: Option<u32>,
    torque_before: [f64; MOST_SAMPLES],
    unchanged: u32,
    tolerated: u32,
}

impl Freshness {
    /// For the signals of a rig file.
    pub fn new(file: &RigFile) -> Self {
        let counter_mask = file.signals.counter.map(|counter| match counter.kind.bytes() {
            1 => 0xFF,
            2 => 0xFFFF,
            _ => u32::MAX,
        });
        Self {
            counter_mask,
            before: None,
            torque_before: [f64::NAN; MOST_SAMPLES],
            unchanged: 0,
            tolerated: file.tolerate.unchanged_torque_periods,
        }
    }

    /// The readings of one more period.
    ///
    /// # Errors
    /// [`CanFault::StaleSample`]
    pub fn check(&mut self, readings: &Readings) -> Result<(), CanFault> {
        let now = readings.counter;
        if let Some(mask) = self.counter_mask {
            let before = self.before.replace(now);
            if let Some(before) = before.filter(|before| before.wrapping_add(1) & mask != now & mask) {
                return Err(CanFault::StaleSample { before, now });
            }
        }
        self.unchanged = if readings.torque_nm == self.torque_before { self.unchanged + 1 } else { 0 };
        self.torque_before = readings.torque_nm;
        if self.unchanged > self.tolerated {
            return Err(CanFault::StaleSample { before: now, now });
        }
        Ok(())
    }
}
