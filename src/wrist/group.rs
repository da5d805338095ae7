//! One group of trials, side by side in the lanes of a vector, through the model from start to end.

use super::coefficient::Coefficients;
use super::integrate::{Drive, Given, Glide, Varied, Walk};
use super::jet::Jet;
use super::mechanisms::{Channels, Covariates, Extension, Mechanisms, NoExtension, Past};
use super::motion::{gather, unrecord};
use super::number::{Number, Plain};
use super::plant::{BASE_PARAMETERS, Knot, Mechanics, Plant};
use super::simulate::{Request, Response, Trial};
use crate::signal::SectionState;

/// As many trials as there are lanes, and the slice of the derivatives that fits a jet.
pub(super) struct Job<'a> {
    /// What is asked.
    pub request: &'a Request<'a>,
    /// The trials, at most one a lane.
    pub trials: &'a [&'a Trial],
    /// Their parameters.
    pub parameters: &'a [f64],
    /// Index of the first trial in the response.
    pub first: usize,
    /// Which of the wanted derivatives this pass computes.
    pub wanted: std::ops::Range<usize>,
}

/// Which of a number's derivatives is the one wanted in each place.
type Slots = [usize; MOST_SLOPES];

impl Job<'_> {
    /// In the base model the derivative with respect to each parameter has a place of its own.
    fn own_slots(&self) -> Slots {
        let mut slots = self.slots_in_order();
        for (slot, wanted) in slots.iter_mut().zip(&self.request.wanted[self.wanted.clone()]) {
            *slot = *wanted;
        }
        slots
    }

    /// With mechanisms there are more parameters than places: those wanted have them, in order.
    fn slots_in_order(&self) -> Slots {
        std::array::from_fn(|place| place)
    }
}

/// Most derivatives that one pass computes.
pub(super) const MOST_SLOPES: usize = 9;

/// Most lanes of any vector.
const MOST_LANES: usize = 16;

/// Most sections of a filter (order 8, or an odd order below it).
const MOST_SECTIONS: usize = 4;

/// Runs the job over the number type that has room for its derivatives.
#[inline(always)]
pub(super) fn run<P: Plain>(job: &Job, response: &mut Response) {
    match (job.request.kinds.is_empty(), job.wanted.len()) {
        (true, 0) => base::<P, P>(job, response),
        (true, _) => base::<P, Jet<P, 6>>(job, response),
        (false, 0) => extended::<P, P>(job, response),
        // Most mechanisms have one parameter that is estimated.
        (false, ..=7) => extended::<P, Jet<P, 7>>(job, response),
        (false, _) => extended::<P, Jet<P, 9>>(job, response),
    }
}

/// The parameters of the lanes' trials; those wanted carry a derivative, in the place that `slots` says.
#[inline(always)]
fn seeded<P: Plain, T: Number<Plain = P>>(job: &Job, slots: &Slots) -> Vec<T> {
    let count = job.request.parameter_count();
    let mut seeded = Vec::with_capacity(count);
    let mut parameter = 0;
    while parameter < count {
        let mut values = [0.0; MOST_LANES];
        let mut lane = 0;
        while lane < P::LANES {
            values[lane] = job.parameters[lane.min(job.trials.len() - 1) * count + parameter];
            lane += 1;
        }
        let mut index = usize::MAX;
        for (place, wanted) in job.request.wanted[job.wanted.clone()].iter().enumerate() {
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
fn base<P: Plain, T: Number<Plain = P>>(job: &Job, response: &mut Response) {
    let slots = job.own_slots();
    let parameters = seeded::<P, T>(job, &slots);
    let mechanics = Mechanics::separate(Plant::base(job.request.lever, &parameters));
    let mut run = Run::<T>::new(job, slots);
    let mut from = recorded::<P>(job, 0);
    while run.sample < run.samples {
        let to = recorded::<P>(job, run.sample + 1);
        run.step(job, response, &mechanics, &NoExtension, &Given(Glide::new(from, to, job.request.period_s)));
        from = to;
    }
}

#[inline(always)]
pub(super) fn extended<P: Plain, T: Number<Plain = P>>(job: &Job, response: &mut Response) {
    let request = job.request;
    let slots = job.slots_in_order();
    let parameters = seeded::<P, T>(job, &slots);
    let trial = covariates::<P>(job);
    let start_s = -(request.lead as f64) * request.period_s;
    let mut past = Past::new(start_s, request.period_s);
    let mut plant = Plant::base(request.lever, &parameters);
    let added = &parameters[BASE_PARAMETERS.len()..];
    let switched_on = Mechanisms { kinds: request.kinds, parameters: added, trial: &trial, past: &past };
    switched_on.shape(&mut plant);
    let channels = switched_on.channels();
    let mechanics = Mechanics::new(plant);
    let motion = motion::<P, T>(job, &channels);
    let remembers = switched_on.memory() > 0;
    let mut run = Run::<T>::new(job, slots);
    while run.sample < run.samples {
        let extension = Mechanisms { kinds: request.kinds, parameters: added, trial: &trial, past: &past };
        let glide = Glide::new(motion[run.sample], motion[run.sample + 1], request.period_s);
        run.step(job, response, &mechanics, &extension, &Varied(glide));
        if remembers {
            past.push(run.walk.memory);
        }
    }
}

/// The state of a run: where the wrist is, and what the filter remembers.
struct Run<T> {
    slots: Slots,
    samples: usize,
    sample: usize,
    start_s: f64,
    walk: Walk<T>,
    level: T,
    filter: [SectionState<T>; MOST_SECTIONS],
}

impl<T: Number> Run<T> {
    #[inline(always)]
    fn new(job: &Job, slots: Slots) -> Self {
        let request = job.request;
        Self {
            slots,
            samples: request.lead + request.samples,
            sample: 0,
            start_s: -(request.lead as f64) * request.period_s,
            walk: Walk::at_rest(),
            level: T::constant(0.0),
            filter: [SectionState::silent(); MOST_SECTIONS],
        }
    }

    /// Records the present sample and moves to the next.
    #[inline(always)]
    fn step<C: Coefficients<T>, X: Extension<T>, D: Drive<T>>(
        &mut self,
        job: &Job,
        response: &mut Response,
        mechanics: &Mechanics<T, C>,
        extension: &X,
        drive: &D,
    ) {
        let request = job.request;
        let time_s = self.start_s + self.sample as f64 * request.period_s;
        let mut torque =
            self.walk.advance(mechanics, extension, drive, time_s, request.period_s, request.substeps);
        let mut section = 0;
        while section < request.filter.len() {
            torque = request.filter[section].step(&mut self.filter[section], torque);
            section += 1;
        }
        if self.sample <= request.lead && self.sample + request.level > request.lead {
            self.level = self.level + torque.scale(1.0 / request.level as f64);
        }
        if self.sample >= request.lead {
            store(job, &self.slots, response, self.sample - request.lead, torque - self.level);
        }
        self.sample += 1;
    }
}

/// Writes the lanes' torques, and what derivatives they carry, at `sample`.
#[inline(always)]
fn store<T: Number>(job: &Job, slots: &Slots, response: &mut Response, sample: usize, torque: T) {
    let (samples, wanted) = (job.request.samples, job.request.wanted.len());
    let mut lane = 0;
    while lane < job.trials.len() {
        response.torque_nm[(job.first + lane) * samples + sample] = torque.plain().lane(lane);
        lane += 1;
    }
    let mut slope = 0;
    while slope < job.wanted.len() {
        let values = torque.derivative(slots[slope]);
        let mut lane = 0;
        while lane < job.trials.len() {
            let row = (job.first + lane) * samples + sample;
            response.slopes[row * wanted + job.wanted.start + slope] = values.lane(lane);
            lane += 1;
        }
        slope += 1;
    }
}

/// The recorded motion of each lane, `sample` samples after the start of the simulation.
#[inline(always)]
fn recorded<P: Plain>(job: &Job, sample: usize) -> Knot<P> {
    let mut lanes = [Knot::default(); MOST_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        let trial = job.trials[lane.min(job.trials.len() - 1)];
        // The step after the last sample is taken in place: nothing looks at where it leads.
        let index = (trial.onset + sample).saturating_sub(job.request.lead).min(trial.motion.len() - 1);
        lanes[lane] = trial.motion[index];
        lane += 1;
    }
    gather(&lanes)
}

/// The motor's motion from the start of the simulation on, with what the channels did to the record undone.
#[inline(always)]
pub(super) fn motion<P: Plain, T: Number<Plain = P>>(job: &Job, channels: &Channels<T>) -> Vec<Knot<T>> {
    let request = job.request;
    let count = request.lead + request.samples + 1;
    if !request.kinds.iter().any(|kind| kind.alters_angle()) {
        let mut motion = Vec::with_capacity(count);
        let mut sample = 0;
        while sample < count {
            motion.push(recorded::<T::Plain>(job, sample).lift());
            sample += 1;
        }
        return motion;
    }
    let mut records: [&[Knot<f64>]; MOST_LANES] = [&[]; MOST_LANES];
    let mut starts = [0.0; MOST_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        let trial = job.trials[lane.min(job.trials.len() - 1)];
        records[lane] = &trial.motion;
        starts[lane] = trial.onset as f64 - request.lead as f64;
        lane += 1;
    }
    unrecord(&records, &starts, count, channels, request.period_s)
}

#[inline(always)]
fn covariates<P: Plain>(job: &Job) -> Covariates<P> {
    let mut lanes = [Covariates::default(); MOST_LANES];
    let mut lane = 0;
    while lane < P::LANES {
        lanes[lane] = job.trials[lane.min(job.trials.len() - 1)].covariates;
        lane += 1;
    }
    Covariates::gather(&lanes)
}
