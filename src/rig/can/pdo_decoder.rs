//! Decodes the frames of one period into the units of the handle.

use super::bus::Frame;
use super::canopen::DataType;
use super::fault::CanFault;
use super::file::{CanRigFile, Carried, EmgSignal};
use crate::rig::Channel;

/// The most samples that fit into a frame.
pub const MAX_SAMPLES: usize = 8;
const MAX_FRAMES: usize = 8;
const MAX_FIELDS: usize = 4;

/// What was measured in one period, oldest sample first, the last one at SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Readings {
    /// 6041h, for drives that have it.
    pub statusword: u16,
    /// 6064h at SYNC, counts; of motors without CANopen the drive says it itself.
    pub position: i32,
    /// Positions less that at SYNC, counts.
    pub steps: [f64; MAX_SAMPLES],
    /// Handle torque, N m; NaN where the sensor says that there is none.
    pub torque_nm: [f64; MAX_SAMPLES],
    /// EMG of FCR and ECR, MVC; `None` where it is not measured, NaN where the amplifier says that there is none.
    pub emg_mvc: [Option<[f64; MAX_SAMPLES]>; 2],
    /// Sample counter.
    pub counter: u32,
}

impl Readings {
    /// The first channel that has no measurement.
    pub fn channel_without_number(&self, samples: usize) -> Option<Channel> {
        let torque = self.torque_nm[..samples].iter().any(|torque| !torque.is_finite());
        let [fcr, ecr] = self
            .emg_mvc
            .map(|emg| emg.is_some_and(|values| values[..samples].iter().any(|emg| !emg.is_finite())));
        let found = [(torque, Channel::Torque), (fcr, Channel::EmgFcr), (ecr, Channel::EmgEcr)];
        found.into_iter().find_map(|(missing, channel)| missing.then_some(channel))
    }
}

#[derive(Debug, Clone, Copy)]
struct Field {
    carried: Carried,
    offset: usize,
}

#[derive(Debug, Clone, Copy)]
struct Layout {
    id: u16,
    bytes: usize,
    fields: [Option<Field>; MAX_FIELDS],
}

impl Layout {
    fn is_of_motor(&self) -> bool {
        let of_motor = |field: &Field| matches!(field.carried, Carried::Statusword | Carried::Position);
        self.fields.iter().flatten().any(of_motor)
    }
}

/// Decodes the frames of a period, and knows which are missing.
#[derive(Debug, Clone)]
pub struct PdoDecoder {
    layouts: [Option<Layout>; MAX_FRAMES],
    scales: Scales,
    seen: u8,
    /// How many frames of periods that were given up may still arrive, for each layout.
    owed: [u8; MAX_FRAMES],
    readings: Readings,
    /// The readings when the period began.
    before: Readings,
}

/// Whose frames a period needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Those of the motor and of every sensor.
    All,
    /// Those with the motor's state and position: enough to stop it.
    OfMotor,
}

#[derive(Debug, Clone, Copy)]
struct EmgScale {
    scale: (DataType, f64, Option<f64>),
    samples: usize,
}

#[derive(Debug, Clone, Copy)]
struct Scales {
    torque: (DataType, f64, Option<f64>),
    samples: usize,
    steps: Option<DataType>,
    emg: [Option<EmgScale>; 2],
    counter: Option<DataType>,
}

/// How a frame was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decoded {
    /// It was expected in this period.
    Expected,
    /// It arrived before in this period.
    Duplicate,
    /// It is not in the rig file.
    Foreign,
}

impl PdoDecoder {
    /// For the frames of a rig file.
    pub fn new(file: &CanRigFile) -> Self {
        let mut layouts = [None; MAX_FRAMES];
        for (slot, frame) in layouts.iter_mut().zip(&file.frames) {
            let mut fields = [None; MAX_FIELDS];
            let mut offset = 0;
            for (field, carried) in fields.iter_mut().zip(&frame.carries) {
                *field = Some(Field { carried: *carried, offset });
                offset += file.bytes(*carried);
            }
            *slot = frame.identifier().map(|id| Layout { id, bytes: offset, fields });
        }
        let signals = &file.signals;
        let count = |invalid: Option<i64>| invalid.map(|count| count as f64);
        let emg = |signal: Option<EmgSignal>| {
            signal.map(|signal| EmgScale {
                scale: (signal.kind, signal.mvc_per_count, count(signal.invalid)),
                samples: signal.samples.min(MAX_SAMPLES),
            })
        };
        let torque = &signals.torque;
        let scales = Scales {
            torque: (torque.kind, torque.nm_per_count, count(torque.invalid)),
            samples: torque.samples.min(MAX_SAMPLES),
            steps: signals.position_steps.map(|steps| steps.kind),
            emg: [emg(signals.emg_fcr), emg(signals.emg_ecr)],
            counter: signals.counter.map(|counter| counter.kind),
        };
        let emg_mvc = scales.emg.map(|emg| emg.map(|_| [0.0; MAX_SAMPLES]));
        let readings = Readings { emg_mvc, ..Readings::default() };
        Self { layouts, scales, seen: 0, owed: [0; MAX_FRAMES], readings, before: readings }
    }

    /// A new period begins: everything is still to come.
    pub fn begin(&mut self) {
        self.seen = 0;
        self.before = self.readings;
    }

    /// The identifier of a wanted frame that has not come.
    pub fn first_missing(&self, wanted: Wanted) -> Option<u16> {
        self.layouts
            .iter()
            .enumerate()
            .filter(|(at, _)| self.seen & 1 << at == 0)
            .find_map(|(_, layout)| layout.filter(|layout| wanted == Wanted::All || layout.is_of_motor()))
            .map(|layout| layout.id)
    }

    /// Whether a frame has not come in this period.
    pub fn is_missing(&self, id: u16) -> bool {
        self.place(id).is_some_and(|at| self.seen & 1 << at == 0)
    }

    /// Gives the period up: frames that have not come may still arrive, late. The readings are those of before; a torque of this
    /// period beside an angle of the last would be no sample.
    pub fn give_up(&mut self) {
        self.readings = self.before;
        for (at, owed) in self.owed.iter_mut().enumerate() {
            *owed = owed.saturating_add(u8::from(self.seen & 1 << at == 0));
        }
    }

    /// Whether a frame that is too much is one of a period that was given up; each is owed once.
    pub fn take_owed(&mut self, id: u16) -> bool {
        let Some(owed) = self.place(id).map(|at| &mut self.owed[at]).filter(|owed| **owed > 0) else {
            return false;
        };
        *owed -= 1;
        true
    }

    /// Whether the torque of this period has come.
    pub fn has_torque(&self) -> bool {
        let carries =
            |layout: &Layout| layout.fields.iter().flatten().any(|field| field.carried == Carried::Torque);
        self.layouts
            .iter()
            .enumerate()
            .any(|(at, layout)| self.seen & 1 << at != 0 && layout.as_ref().is_some_and(carries))
    }

    fn place(&self, id: u16) -> Option<usize> {
        self.layouts.iter().position(|layout| layout.is_some_and(|layout| layout.id == id))
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
        self.scales.samples
    }

    /// Takes a frame in.
    ///
    /// # Errors
    /// [`CanFault::Malformed`]
    pub fn decode(&mut self, frame: &Frame) -> Result<Decoded, CanFault> {
        let found = self
            .layouts
            .iter()
            .enumerate()
            .find_map(|(at, layout)| Some((at, (*layout)?)).filter(|(_, l)| l.id == frame.id));
        let Some((at, layout)) = found else { return Ok(Decoded::Foreign) };
        let data = frame.data();
        if data.len() != layout.bytes {
            let (length, expected) = (data.len() as u8, layout.bytes as u8);
            return Err(CanFault::Malformed { id: frame.id, length, expected });
        }
        // Where a frame is owed, the one before was late, and this one is that of the period.
        if self.seen & 1 << at != 0 && !self.take_owed(frame.id) {
            return Ok(Decoded::Duplicate);
        }
        self.seen |= 1 << at;
        for field in layout.fields.iter().flatten() {
            self.read(field.carried, &data[field.offset.min(data.len())..]);
        }
        Ok(Decoded::Expected)
    }

    fn read(&mut self, carried: Carried, data: &[u8]) {
        let (scales, readings) = (&self.scales, &mut self.readings);
        let scaled = |(kind, scale, invalid): (DataType, f64, Option<f64>), data: &[u8]| match kind.read(data)
        {
            Some(count) if Some(count) != invalid => count * scale,
            _ => f64::NAN,
        };
        match carried {
            Carried::Statusword => readings.statusword = DataType::U16.read(data).unwrap_or(0.0) as u16,
            Carried::Position => readings.position = DataType::I32.read(data).unwrap_or(0.0) as i32,
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
            Carried::EmgFcr | Carried::EmgEcr => {
                let muscle = usize::from(carried == Carried::EmgEcr);
                let Some((EmgScale { scale, samples }, values)) =
                    scales.emg[muscle].zip(readings.emg_mvc[muscle].as_mut())
                else {
                    return;
                };
                for (at, value) in values.iter_mut().enumerate() {
                    // A single value stands for its whole period.
                    let from = at.min(samples - 1) * scale.0.bytes();
                    *value = scaled(scale, data.get(from..).unwrap_or(&[]));
                }
            }
        }
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
        let mut decoder = PdoDecoder::new(&rig("packed"));
        decoder.begin();
        let mut data = [0u8; 8];
        for (at, count) in [100i16, -200, 0, -32768].into_iter().enumerate() {
            data[2 * at..2 * at + 2].copy_from_slice(&count.to_le_bytes());
        }
        assert_eq!(decoder.decode(&Frame::new(0x285, &data)), Ok(Decoded::Expected));
        let torque = decoder.readings().torque_nm;
        assert_eq!(torque[..3], [0.05, -0.1, 0.0]);
        assert!(torque[3].is_nan());
        assert_eq!(decoder.readings().channel_without_number(4), Some(Channel::Torque));
    }

    #[test]
    fn a_period_is_complete_with_each_frame_once() {
        let mut decoder = PdoDecoder::new(&rig("plain"));
        decoder.begin();
        assert_eq!(decoder.first_missing(Wanted::All), Some(0x185));
        let status = Frame::new(0x185, &[0x37, 0x16, 1, 0, 0, 0, 100, 0]);
        assert_eq!(decoder.decode(&status), Ok(Decoded::Expected));
        assert_eq!(decoder.decode(&status), Ok(Decoded::Duplicate));
        assert_eq!(decoder.decode(&Frame::new(0x186, &[0; 8])), Ok(Decoded::Foreign));
        assert!(matches!(
            decoder.decode(&Frame::new(0x285, &[0; 5])),
            Err(CanFault::Malformed { length: 5, expected: 6, .. })
        ));
        assert_eq!(decoder.decode(&Frame::new(0x285, &[7, 0, 0, 0, 0, 0])), Ok(Decoded::Expected));
        assert_eq!(decoder.first_missing(Wanted::All), None);
        let readings = decoder.readings();
        assert_eq!((readings.statusword, readings.position, readings.counter), (0x1637, 1, 7));
        decoder.begin();
        assert_eq!(decoder.first_missing(Wanted::OfMotor), Some(0x185));
        decoder.decode(&status).unwrap();
        assert_eq!(decoder.first_missing(Wanted::OfMotor), None);
        assert_eq!(decoder.first_missing(Wanted::All), Some(0x285));
        assert!(decoder.has_torque());
    }

    #[test]
    fn a_period_that_is_given_up_leaves_the_readings_of_before() {
        let mut decoder = PdoDecoder::new(&rig("plain"));
        decoder.begin();
        decoder.decode(&Frame::new(0x285, &[7, 0, 0, 0, 0, 0])).unwrap();
        decoder.give_up();
        let before = Readings { emg_mvc: [Some([0.0; MAX_SAMPLES]); 2], ..Readings::default() };
        assert_eq!(decoder.readings(), &before);
    }

    #[test]
    fn a_frame_of_a_period_that_was_given_up_is_late_once_and_no_duplicate() {
        let mut decoder = PdoDecoder::new(&rig("plain"));
        let status = Frame::new(0x185, &[0x37, 0x16, 1, 0, 0, 0, 100, 0]);
        decoder.begin();
        decoder.give_up();
        assert!(decoder.take_owed(0x185) && !decoder.take_owed(0x185));
        decoder.give_up();
        decoder.begin();
        assert_eq!(decoder.decode(&status), Ok(Decoded::Expected), "late, or this one's: nobody knows yet");
        assert_eq!(decoder.decode(&status), Ok(Decoded::Expected), "this one's");
        assert_eq!(decoder.decode(&status), Ok(Decoded::Duplicate));
    }
}
