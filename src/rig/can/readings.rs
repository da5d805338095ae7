//! What the frames of one period say, in the units of the handle.

use super::bus::Frame;
use super::canopen::Kind;
use super::fault::CanFault;
use super::file::{Carried, EmgSignal, RigFile};
use crate::rig::Channel;

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

impl Readings {
    /// The first channel that has no measurement.
    pub fn without_number(&self, samples: usize) -> Option<Channel> {
        let torque = self.torque_nm[..samples].iter().any(|torque| !torque.is_finite());
        let [fcr, ecr] = self.emg_mvc.map(|emg| !emg.is_finite());
        let found = [(torque, Channel::Torque), (fcr, Channel::EmgFcr), (ecr, Channel::EmgEcr)];
        found.into_iter().find_map(|(missing, channel)| missing.then_some(channel))
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::can::file::ValidRigFile;

    fn rig(name: &str) -> ValidRigFile {
        let text = match name {
            "packed" => include_str!("../../../fixtures/can/rigs/packed.json"),
            _ => include_str!("../../../fixtures/can/rigs/plain.json"),
        };
        ValidRigFile::parse(text, name).unwrap()
    }

    #[test]
    fn four_torques_in_a_frame_are_told_apart_and_an_invalid_one_is_no_number() {
        let mut decoder = Decoder::new(&rig("packed"));
        decoder.begin();
        let mut data = [0u8; 8];
        for (at, count) in [100i16, -200, 0, -32768].into_iter().enumerate() {
            data[2 * at..2 * at + 2].copy_from_slice(&count.to_le_bytes());
        }
        assert_eq!(decoder.take(&Frame::new(0x285, &data)), Ok(Taken::Yes));
        let torque = decoder.readings().torque_nm;
        assert_eq!(torque[..3], [0.05, -0.1, 0.0]);
        assert!(torque[3].is_nan());
        assert_eq!(decoder.readings().without_number(4), Some(Channel::Torque));
    }

    #[test]
    fn a_period_is_complete_with_each_frame_once() {
        let mut decoder = Decoder::new(&rig("plain"));
        decoder.begin();
        assert_eq!(decoder.first_missing(), Some(0x185));
        let status = Frame::new(0x185, &[0x37, 0x16, 1, 0, 0, 0, 100, 0]);
        assert_eq!(decoder.take(&status), Ok(Taken::Yes));
        assert_eq!(decoder.take(&status), Ok(Taken::Twice));
        assert_eq!(decoder.take(&Frame::new(0x186, &[0; 8])), Ok(Taken::Foreign));
        assert!(matches!(
            decoder.take(&Frame::new(0x285, &[0; 5])),
            Err(CanFault::Malformed { length: 5, expected: 6, .. })
        ));
        assert_eq!(decoder.take(&Frame::new(0x285, &[7, 0, 0, 0, 0, 0])), Ok(Taken::Yes));
        assert!(decoder.complete());
        let readings = decoder.readings();
        assert_eq!((readings.statusword, readings.position, readings.counter), (0x1637, 1, 7));
        decoder.begin();
        assert!(!decoder.complete());
    }

    #[test]
    fn a_counter_that_does_not_go_on_by_one_is_stale_and_one_that_wraps_is_not() {
        let file = rig("plain");
        let check = |counters: &[u32]| {
            let mut fresh = Freshness::new(&file);
            counters.iter().enumerate().try_for_each(|(at, counter)| {
                let mut readings = Readings { counter: *counter, ..Readings::default() };
                readings.torque_nm[0] = at as f64;
                fresh.check(&readings)
            })
        };
        assert_eq!(check(&[65_534, 65_535, 0, 1]), Ok(()));
        for stale in [[5, 5], [5, 7], [5, 4]] {
            assert!(matches!(check(&stale), Err(CanFault::StaleSample { .. })), "{stale:?}");
        }
    }

    #[test]
    fn a_torque_that_stands_still_to_the_last_digit_is_stale_after_a_while() {
        let mut fresh = Freshness::new(&rig("plain"));
        let periods = (0..100)
            .find(|counter| fresh.check(&Readings { counter: *counter, ..Readings::default() }).is_err());
        assert_eq!(periods, Some(51), "50 are tolerated after the first");
    }
}
