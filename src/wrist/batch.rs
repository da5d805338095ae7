//! Simulation of one batch of trials, one trial per lane of a vector.

use super::further_channel::FurtherValues;
use super::history::History;
use super::integrate::{CorrectedInput, HermiteSegment, Integrator, MotorInput, RecordedInput};
use super::mechanics::{AddedDynamics, Kinematics, Mechanics, NoAddedDynamics};
use super::mechanisms::{ActiveMechanisms, ChannelErrors, Covariates, MechanismKind};
use super::motion::{corrected_motion, gather};
use super::plant::{BASE_PARAMETERS, Plant};
use super::simulation::{SimulatedTorque, SimulationSettings, TrialInput};
use super::sparse_coefficient::DerivativeStructure;
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
    let is_base = batch.settings.kinds.is_empty() && batch.settings.further.is_empty();
    match (is_base, batch.wanted.len()) {
        (true, 0) => base::<P, P>(batch, response),
        (true, _) => base::<P, Jet<P, 6>>(batch, response),
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

#[inline(always)]
fn base<P: Plain, T: Number<Plain = P>>(batch: &Batch, response: &mut SimulatedTorque) {
    let slots = batch.own_slots();
    let parameters = seeded::<P, T>(batch, &slots);
    let mechanics = Mechanics::separate(Plant::base(batch.settings.lever, &parameters));
    let mut run = Run::<T>::new(batch, slots);
    let mut from = recorded::<P>(batch, 0);
    while run.sample < run.samples {
        let to = recorded::<P>(batch, run.sample + 1);
        run.step(
            batch,
            response,
            &mechanics,
            &NoAddedDynamics,
            &RecordedInput(HermiteSegment::new(from, to, batch.settings.period_s)),
            Channels::Torque,
        );
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
        let mut run = Run::<T>::new(batch, slots);
        while run.sample < run.samples {
            let added_dynamics = ActiveMechanisms {
                kinds: settings.kinds,
                parameters: added,
                trial: &trial,
                history: &history,
            };
            let segment = HermiteSegment::new(motion[run.sample], motion[run.sample + 1], settings.period_s);
            run.step(batch, response, &mechanics, &added_dynamics, &CorrectedInput(segment), runs[number]);
            if has_states {
                let (added, rates) = run.integrator.sampled();
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

/// The state of a run: where the wrist is, and what the filter has_states.
struct Run<T> {
    slots: Slots,
    samples: usize,
    sample: usize,
    start_s: f64,
    integrator: Integrator<T>,
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
    fn new(batch: &Batch, slots: Slots) -> Self {
        let settings = batch.settings;
        Self {
            slots,
            samples: settings.lead_samples + settings.samples,
            sample: 0,
            start_s: -(settings.lead_samples as f64) * settings.period_s,
            integrator: Integrator::at_rest(),
            torque: ChannelRun::new(),
            further: vec![ChannelRun::new(); settings.further.len()],
        }
    }

    /// Stores the values of the present sample and integrates to the next.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn step<C: DerivativeStructure<T>, X: AddedDynamics<T>, D: MotorInput<T>>(
        &mut self,
        batch: &Batch,
        response: &mut SimulatedTorque,
        mechanics: &Mechanics<T, C>,
        added_dynamics: &X,
        input: &D,
        channels: Channels,
    ) {
        let settings = batch.settings;
        let time_s = self.start_s + self.sample as f64 * settings.period_s;
        let zero = T::constant(0.0);
        let mut values = FurtherValues { theta_l: zero, alpha_l: zero, torque_h: zero, theta_j: zero };
        let observed = (channels != Channels::Torque).then_some(&mut values);
        let torque = self.integrator.advance_observed(
            mechanics,
            added_dynamics,
            input,
            time_s,
            settings.period_s,
            settings.substeps,
            observed,
        );
        if channels != Channels::Further {
            let torque = self.torque.step(settings, self.sample, torque);
            if self.sample >= settings.lead_samples {
                store(batch, &self.slots, response, self.sample - settings.lead_samples, torque);
            }
        }
        if channels != Channels::Torque {
            let mut place = 0;
            while place < settings.further.len() {
                let scaled = values.of(settings.further[place].channel);
                let scaled = scaled.scale(settings.further[place].nm_per_unit);
                let value = self.further[place].step(settings, self.sample, scaled);
                if self.sample >= settings.lead_samples {
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
