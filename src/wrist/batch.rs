//! Simulation of one batch of trials, one trial per lane of a vector.

use super::further_channel::FurtherValues;
use super::history::History;
use super::integrate::{HermiteSegment, Integrator};
use super::mechanics::{Kinematics, Mechanics};
use super::mechanisms::{ActiveMechanisms, ChannelErrors, Covariates, MechanismKind};
use super::motion::{corrected_motion, gather};
use super::plant::{BASE_PARAMETERS, Plant};
use super::propagator::{MovingWrist, Propagator, part_of_sample};
use super::simulation::{SimulatedTorque, SimulationSettings, TrialInput};
use crate::number::{Jet, Lanes, Number, Plain};
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
type Slots = [usize; MAX_DERIVATIVES];

impl Batch<'_> {
    /// In the base model, derivative number i belongs to parameter number i.
    fn own_slots(&self) -> Slots {
        let mut slots = self.slots_in_order();
        for (slot, wanted) in slots.iter_mut().zip(&self.settings.derivatives[self.wanted.clone()]) {
            *slot = *wanted;
        }
        slots
    }

    /// With mechanisms, the wanted derivatives take the indices from 0 on, in order.
    fn slots_in_order(&self) -> Slots {
        std::array::from_fn(|place| place)
    }
}

/// Largest number of derivatives that one pass computes.
pub(super) const MAX_DERIVATIVES: usize = 9;

/// Largest number of lanes of a vector.
const MAX_LANES: usize = 16;

/// Largest number of sections: a filter of order 8, and the low-pass of a torque channel.
const MAX_SECTIONS: usize = 5;

/// Simulates the batch with the smallest number type that has the derivatives of this pass.
#[inline(always)]
pub(super) fn run<P: Plain>(batch: &Batch, response: &mut SimulatedTorque) {
    match (batch.settings.kinds.is_empty(), batch.wanted.len()) {
        (true, 0) => base::<P, 0, 0>(batch, response),
        (true, _) => base::<P, 4, 6>(batch, response),
        (false, 0) => extended::<P, P>(batch, response),
        // Most mechanisms have one parameter that is estimated.
        (false, ..=7) => extended::<P, Jet<P, 7>>(batch, response),
        (false, _) => extended::<P, Jet<P, 9>>(batch, response),
    }
}

/// The parameters of the trials, one trial per lane; a wanted parameter has its derivative at the index in `slots`.
#[inline(always)]
fn seeded<P: Plain, T: Number<Plain = P>>(batch: &Batch, slots: &Slots) -> Vec<T> {
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

/// The base model, with `ALL` derivatives of which `LINEAR` are by parameters of its linear part.
#[inline(always)]
fn base<P: Plain, const LINEAR: usize, const ALL: usize>(batch: &Batch, response: &mut SimulatedTorque) {
    match batch.settings.lever {
        None => propagated::<P, 2, LINEAR, ALL>(batch, response),
        Some(_) => propagated::<P, 4, LINEAR, ALL>(batch, response),
    }
}

#[inline(always)]
fn propagated<P: Plain, const STATES: usize, const LINEAR: usize, const ALL: usize>(
    batch: &Batch,
    response: &mut SimulatedTorque,
) {
    let settings = batch.settings;
    let slots = batch.own_slots();
    let mut parameters = [P::splat(0.0); BASE_PARAMETERS.len()];
    parameters.copy_from_slice(&seeded::<P, P>(batch, &slots));
    let step_s = settings.period_s / settings.substeps as f64;
    let propagator = Propagator::<P, STATES, LINEAR, ALL>::new(settings.lever, &parameters, step_s);
    let mut wrist = MovingWrist::<P, STATES, ALL>::at_rest();
    let has_further = !settings.further.is_empty();
    let channels = if has_further { Channels::All } else { Channels::Torque };
    let mut run = Run::<Jet<P, ALL>>::new(batch, slots, channels);
    let mut from = recorded::<P>(batch, 0);
    while run.sample < run.samples {
        let to = recorded::<P>(batch, run.sample + 1);
        let segment = HermiteSegment::new(from, to, settings.period_s);
        let torque = propagator.torque(&wrist, &segment);
        if has_further {
            let further = propagator.further_values(&wrist, &segment, torque);
            run.store(batch, response, torque, Some(&further));
        } else {
            run.store(batch, response, torque, None);
        }
        let mut step = 0;
        while step < settings.substeps {
            propagator.step(&mut wrist, &part_of_sample(&segment, step, settings.substeps));
            step += 1;
        }
        from = to;
    }
}

#[inline(always)]
pub(super) fn extended<P: Plain, T: Number<Plain = P>>(batch: &Batch, response: &mut SimulatedTorque) {
    let settings = batch.settings;
    let slots = batch.slots_in_order();
    let parameters = seeded::<P, T>(batch, &slots);
    let trial = covariates::<P>(batch);
    let start_s = -(settings.lead_samples as f64) * settings.period_s;
    let states: usize = settings.kinds.iter().map(|kind| kind.state_count()).sum();
    let mut history = History::new(start_s, settings.period_s, states);
    let mut plant = Plant::base(settings.lever, &parameters);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let active =
        ActiveMechanisms { kinds: settings.kinds, parameters: added, trial: &trial, history: &history };
    active.alter_plant(&mut plant);
    let mut channels = active.channels();
    let mechanics = Mechanics::new(plant);
    // A late torque is predicted from a late motion. The further channels are not late, so they need a run of their own.
    let is_skewed = settings.kinds.iter().any(|kind| matches!(kind, MechanismKind::ChannelSkew));
    let runs: &[Channels] = match (settings.further.is_empty(), is_skewed) {
        (true, _) => &[Channels::Torque],
        (false, false) => &[Channels::All],
        (false, true) => &[Channels::Torque, Channels::Further],
    };
    let has_states = states > 0;
    let mut number = 0;
    while number < runs.len() {
        if runs[number] == Channels::Further {
            channels.torque_delay_s = T::constant(0.0);
            history = History::new(start_s, settings.period_s, states);
        }
        let motion = motion::<P, T>(batch, &channels);
        let mut integrator = Integrator::at_rest();
        let mut values = FurtherValues::at_rest();
        let mut run = Run::<T>::new(batch, slots, runs[number]);
        while run.sample < run.samples {
            let added_dynamics = ActiveMechanisms {
                kinds: settings.kinds,
                parameters: added,
                trial: &trial,
                history: &history,
            };
            let segment = HermiteSegment::new(motion[run.sample], motion[run.sample + 1], settings.period_s);
            let has_further = runs[number] != Channels::Torque;
            let torque = integrator.advance_observed(
                &mechanics,
                &added_dynamics,
                &segment,
                start_s + run.sample as f64 * settings.period_s,
                settings.period_s,
                settings.substeps,
                has_further.then_some(&mut values),
            );
            run.store(batch, response, torque, has_further.then_some(&values));
            if has_states {
                let (added, rates) = integrator.sampled();
                history.push(added, rates);
            }
        }
        number += 1;
    }
}

/// Which channels a run stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channels {
    /// The torque in the lever.
    Torque,
    /// The further channels.
    Further,
    /// Both.
    All,
}

/// What becomes of the values of each sample: they are filtered, levelled and stored.
struct Run<T> {
    slots: Slots,
    samples: usize,
    sample: usize,
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
    fn new(batch: &Batch, slots: Slots, channels: Channels) -> Self {
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
    fn store(
        &mut self,
        batch: &Batch,
        response: &mut SimulatedTorque,
        torque: T,
        further: Option<&FurtherValues<T>>,
    ) {
        let settings = batch.settings;
        let is_stored = self.sample >= settings.lead_samples;
        if self.channels != Channels::Further {
            let torque = self.torque.step(settings, self.sample, torque);
            if is_stored {
                store(batch, &self.slots, response, self.sample - settings.lead_samples, torque);
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
                    store(batch, &self.slots, response, row, value);
                }
                place += 1;
            }
        }
        self.sample += 1;
    }
}

/// Stores a value and its derivatives in the row `sample` of every trial.
#[inline(always)]
fn store<T: Number>(batch: &Batch, slots: &Slots, response: &mut SimulatedTorque, sample: usize, torque: T) {
    let (samples, wanted) = (batch.settings.rows(), batch.settings.derivatives.len());
    let mut lane = 0;
    while lane < batch.trials.len() {
        response.torque_nm[(batch.first + lane) * samples + sample] = torque.plain().lane(lane);
        lane += 1;
    }
    let mut slope = 0;
    while slope < batch.wanted.len() {
        let values = torque.derivative(slots[slope]);
        let mut lane = 0;
        while lane < batch.trials.len() {
            let row = (batch.first + lane) * samples + sample;
            response.slopes[row * wanted + batch.wanted.start + slope] = values.lane(lane);
            lane += 1;
        }
        slope += 1;
    }
}

/// The recorded motion of every trial, `sample` samples after the start of the simulation.
#[inline(always)]
fn recorded<P: Plain>(batch: &Batch, sample: usize) -> Kinematics<P> {
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
pub(super) fn motion<P: Plain, T: Number<Plain = P>>(
    batch: &Batch,
    channels: &ChannelErrors<T>,
) -> Vec<Kinematics<T>> {
    let settings = batch.settings;
    let count = settings.lead_samples + settings.samples + 1;
    if !settings.kinds.iter().any(|kind| kind.alters_angle()) {
        let mut motion = Vec::with_capacity(count);
        let mut sample = 0;
        while sample < count {
            motion.push(recorded::<T::Plain>(batch, sample).lift());
            sample += 1;
        }
        return motion;
    }
    let mut records: [&[Kinematics<f64>]; MAX_LANES] = [&[]; MAX_LANES];
    let mut starts = [0.0; MAX_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        let trial = batch.trials[lane.min(batch.trials.len() - 1)];
        records[lane] = &trial.motion;
        starts[lane] = trial.onset as f64 - settings.lead_samples as f64;
        lane += 1;
    }
    corrected_motion(&records, &starts, count, channels, settings.period_s)
}

#[inline(always)]
fn covariates<P: Plain>(batch: &Batch) -> Covariates<P> {
    let mut lanes = [Covariates::default(); MAX_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        lanes[lane] = batch.trials[lane.min(batch.trials.len() - 1)].covariates;
        lane += 1;
    }
    Covariates::gather(&lanes)
}
