//! Simulation of one batch of trials, one trial per lane of a vector.

use super::further_channel::FurtherValues;
use super::linear_response::LINEAR_PARAMETERS;
use super::mechanics::Kinematics;
use super::mechanisms::{ChannelErrors, Covariates};
use super::motion::{self, gather};
use super::simulation::{SimulatedTorque, SimulationSettings, TrialInput};
use crate::number::{Lanes, Number, Plain};
use crate::signal::SectionState;

/// A batch of trials, one per lane, and the part of the derivatives that one pass computes.
pub(super) struct Batch<'a> {
    /// The settings of the simulation.
    pub settings: &'a SimulationSettings<'a>,
    /// The trials, at most one per lane.
    pub trials: &'a [&'a TrialInput],
    /// The parameter vectors of the trials, one after the other.
    pub parameters: &'a [f64],
    /// Index of the first trial in the response.
    pub first: usize,
    /// Range in [`SimulationSettings::derivatives`] that this pass computes.
    pub wanted: std::ops::Range<usize>,
}

/// Index of the number's derivative that belongs to each wanted derivative.
pub(super) type Slots = [usize; MAX_DERIVATIVES];

/// Largest number of derivatives that one pass computes.
pub(super) const MAX_DERIVATIVES: usize = 9;

/// Largest number of lanes of a vector.
pub(super) const MAX_LANES: usize = 16;

/// Largest number of sections: a filter of order 8, and the low-pass of a torque channel.
const MAX_SECTIONS: usize = 5;

impl Batch<'_> {
    /// Where numbers have `linear` derivatives of the linear part by the first parameters, these are in their own order, and the other
    /// wanted ones follow; otherwise all are in the order in which they are wanted.
    pub fn slots(&self, linear: usize) -> Slots {
        let mut slots = [0; MAX_DERIVATIVES];
        let mut next = if linear == LINEAR_PARAMETERS { LINEAR_PARAMETERS } else { 0 };
        for (slot, wanted) in slots.iter_mut().zip(&self.settings.derivatives[self.wanted.clone()]) {
            if linear == LINEAR_PARAMETERS && *wanted < LINEAR_PARAMETERS {
                *slot = *wanted;
            } else {
                *slot = next;
                next += 1;
            }
        }
        slots
    }

    /// Number of derivatives that a number needs for those of this pass, where the linear part has its own.
    pub fn slots_in_use(&self) -> usize {
        let slots = self.slots(LINEAR_PARAMETERS);
        slots[..self.wanted.len()].iter().map(|slot| slot + 1).max().unwrap_or(0)
    }

    /// In the base model, derivative number i belongs to parameter number i.
    pub fn own_slots(&self) -> Slots {
        let mut slots = [0; MAX_DERIVATIVES];
        for (slot, wanted) in slots.iter_mut().zip(&self.settings.derivatives[self.wanted.clone()]) {
            *slot = *wanted;
        }
        slots
    }
}

/// Where the values of a simulation go.
pub(super) trait SampleOutput<T: Number> {
    /// Takes a value and its derivatives for the row `row` of every trial of the batch.
    fn store(&mut self, batch: &Batch, slots: &Slots, row: usize, value: T);
}

impl<T: Number> SampleOutput<T> for SimulatedTorque {
    #[inline(always)]
    fn store(&mut self, batch: &Batch, slots: &Slots, row: usize, value: T) {
        let (rows, wanted) = (batch.settings.rows(), batch.settings.derivatives.len());
        let mut lane = 0;
        while lane < batch.trials.len() {
            self.torque_nm[(batch.first + lane) * rows + row] = value.plain().lane(lane);
            lane += 1;
        }
        let mut slope = 0;
        while slope < batch.wanted.len() {
            let values = value.derivative(slots[slope]);
            let mut lane = 0;
            while lane < batch.trials.len() {
                let row = (batch.first + lane) * rows + row;
                self.slopes[row * wanted + batch.wanted.start + slope] = values.lane(lane);
                lane += 1;
            }
            slope += 1;
        }
    }
}

/// The parameters of the trials, one trial per lane; a wanted parameter has its derivative at the index in `slots`.
#[inline(always)]
pub(super) fn seeded<P: Plain, T: Number<Plain = P>>(batch: &Batch, slots: &Slots) -> Vec<T> {
    let count = batch.settings.parameter_count();
    let mut seeded = Vec::with_capacity(count);
    let mut parameter = 0;
    while parameter < count {
        let mut values = [0.0; MAX_LANES];
        let mut lane = 0;
        while lane < P::LANES {
            values[lane] = batch.parameters[lane.min(batch.trials.len() - 1) * count + parameter];
            lane += 1;
        }
        let mut index = usize::MAX;
        for (place, wanted) in batch.settings.derivatives[batch.wanted.clone()].iter().enumerate() {
            if *wanted == parameter {
                index = slots[place];
            }
        }
        seeded.push(T::variable(P::load(&values), index));
        parameter += 1;
    }
    seeded
}

/// Which channels a run stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channels {
    /// The torque in the lever.
    Torque,
    /// The further channels.
    Further,
    /// Both.
    All,
}

/// What becomes of the values of each sample: they are filtered, levelled and stored.
pub(super) struct Run<T> {
    slots: Slots,
    pub samples: usize,
    pub sample: usize,
    channels: Channels,
    torque: ChannelRun<T>,
    /// One for each further channel.
    further: Vec<ChannelRun<T>>,
}

/// The mean of a channel before the ramp, and what its filter has stored.
#[derive(Clone, Copy)]
struct ChannelRun<T> {
    level: T,
    filter: [SectionState<T>; MAX_SECTIONS],
}

impl<T: Number> ChannelRun<T> {
    #[inline(always)]
    fn new() -> Self {
        Self { level: T::constant(0.0), filter: [SectionState::silent(); MAX_SECTIONS] }
    }

    /// Filters the channel's value at a sample, and adds it to the mean before the ramp; returns it filtered, without that mean.
    #[inline(always)]
    fn step(&mut self, settings: &SimulationSettings, sample: usize, value: T) -> T {
        let mut value = value;
        let mut section = 0;
        while section < settings.filter.len() {
            value = settings.filter[section].step(&mut self.filter[section], value);
            section += 1;
        }
        if sample <= settings.lead_samples && sample + settings.baseline_samples > settings.lead_samples {
            self.level = self.level + value.scale(1.0 / settings.baseline_samples as f64);
        }
        value - self.level
    }
}

impl<T: Number> Run<T> {
    #[inline(always)]
    pub fn new(batch: &Batch, slots: Slots, channels: Channels) -> Self {
        Self {
            slots,
            samples: batch.settings.lead_samples + batch.settings.samples,
            sample: 0,
            channels,
            torque: ChannelRun::new(),
            further: vec![ChannelRun::new(); batch.settings.further.len()],
        }
    }

    /// Stores the torque in the lever (N m) and the further channels at the present sample, as far as this run does, and goes on to
    /// the next.
    #[inline(always)]
    pub fn store(
        &mut self,
        batch: &Batch,
        output: &mut impl SampleOutput<T>,
        torque: T,
        further: Option<&FurtherValues<T>>,
    ) {
        let settings = batch.settings;
        let is_stored = self.sample >= settings.lead_samples;
        if self.channels != Channels::Further {
            let torque = self.torque.step(settings, self.sample, torque);
            if is_stored {
                output.store(batch, &self.slots, self.sample - settings.lead_samples, torque);
            }
        }
        if let Some(values) = further {
            let mut place = 0;
            while place < settings.further.len() {
                let scaled = values.of(settings.further[place].channel);
                let scaled = scaled.scale(settings.further[place].nm_per_unit);
                let value = self.further[place].step(settings, self.sample, scaled);
                if is_stored {
                    let row = settings.samples * (1 + place) + self.sample - settings.lead_samples;
                    output.store(batch, &self.slots, row, value);
                }
                place += 1;
            }
        }
        self.sample += 1;
    }
}

/// The recorded motion of every trial, `sample` samples after the start of the simulation.
#[inline(always)]
pub(super) fn recorded<P: Plain>(batch: &Batch, sample: usize) -> Kinematics<P> {
    let mut lanes = [Kinematics::default(); MAX_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        let trial = batch.trials[lane.min(batch.trials.len() - 1)];
        // The integration beyond the last sample repeats the last motion; its result is not used.
        let index =
            (trial.onset + sample).saturating_sub(batch.settings.lead_samples).min(trial.motion.len() - 1);
        lanes[lane] = trial.motion[index];
        lane += 1;
    }
    gather(&lanes)
}

/// The motor's motion from the start of the simulation on: the record, corrected for the errors of its channel.
#[inline(always)]
pub(super) fn corrected_motion<P: Plain, T: Number<Plain = P>>(
    batch: &Batch,
    channels: &ChannelErrors<T>,
) -> Vec<Kinematics<T>> {
    let settings = batch.settings;
    let count = settings.lead_samples + settings.samples + 1;
    let mut records: [&[Kinematics<f64>]; MAX_LANES] = [&[]; MAX_LANES];
    let mut starts = [0.0; MAX_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        let trial = batch.trials[lane.min(batch.trials.len() - 1)];
        records[lane] = &trial.motion;
        starts[lane] = trial.onset as f64 - settings.lead_samples as f64;
        lane += 1;
    }
    motion::corrected(&records, &starts, count, channels, settings.period_s)
}

/// What is known of every trial.
#[inline(always)]
pub(super) fn covariates<P: Plain>(batch: &Batch) -> Covariates<P> {
    let mut lanes = [Covariates::default(); MAX_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        lanes[lane] = batch.trials[lane.min(batch.trials.len() - 1)].covariates;
        lane += 1;
    }
    Covariates::gather(&lanes)
}
