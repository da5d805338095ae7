//! Trials with mechanisms, from step to step.
//!
//! A step is one of [`Propagator`], for the plant as mechanisms have altered it. What they add to the torques is, over a step, a polynomial
//! through its values at the ends of the last steps: first ahead, then up to a first guess of the state at the end (the methods of Adams in
//! the form predict, evaluate, correct, evaluate; with the linear part solved exactly: Hochbruck and Ostermann 2010, Exponential integrators,
//! section 2.5). Added states go the same way.

use super::batch::{Batch, Channels, Run, SampleOutput, corrected_motion, covariates, recorded, seeded};
use super::history::History;
use super::integrate::HermiteSegment;
use super::linear_response::FORCE;
use super::mechanics::{AddedDynamics, Context, Kinematics, State, Torques};
use super::mechanisms::{ActiveMechanisms, MAX_ADDED_STATES, MechanismKind, Place};
use super::past_values::{PastValues, mean};
use super::plant::{BASE_PARAMETERS, Plant};
use super::propagator::{Angles, MotorAtSample, MovingWrist, Propagator, part_of_sample};
use super::torque_channel::TorqueChannel;
use super::yield_loss::{AlteredYield, Loss, YieldLoss};
use crate::number::{Jet, Number, Plain};

/// Number of states: angle and speed of handle and joint. At a rigid lever the handle's stay zero.
const WRIST_STATES: usize = 4;

/// Index of the joint's angle.
const JOINT: usize = 2;

/// The torques that mechanisms add, N m.
#[derive(Debug, Clone, Copy)]
struct AddedTorques<T> {
    joint: T,
    interface: T,
    lever: T,
}

impl<T: Number> AddedTorques<T> {
    /// The torque that they make on the joint.
    #[inline(always)]
    fn on_joint(&self) -> T {
        self.interface - self.joint
    }

    /// The torque that they make on the handle.
    #[inline(always)]
    fn on_handle(&self) -> T {
        self.lever - self.interface
    }
}

/// What mechanisms add to a wrist that moves.
#[derive(Clone)]
struct Additions<T> {
    /// The torques now.
    torques: AddedTorques<T>,
    /// The torques that they make on the joint and on the handle.
    on_joint: PastValues<T>,
    on_handle: PastValues<T>,
    /// The added states, now and at the start of the step, and their rates per step.
    states: [T; MAX_ADDED_STATES],
    before: [T; MAX_ADDED_STATES],
    rates: [PastValues<T>; MAX_ADDED_STATES],
    /// The rates at a guess, 1/s times the unit of each state.
    guessed_rates: [T; MAX_ADDED_STATES],
}

impl<T: Number> Additions<T> {
    /// Nothing.
    #[inline(always)]
    fn none() -> Self {
        let zero = T::constant(0.0);
        Self {
            torques: AddedTorques { joint: zero, interface: zero, lever: zero },
            on_joint: PastValues::zero(),
            on_handle: PastValues::zero(),
            states: [zero; MAX_ADDED_STATES],
            before: [zero; MAX_ADDED_STATES],
            rates: [PastValues::zero(); MAX_ADDED_STATES],
            guessed_rates: [zero; MAX_ADDED_STATES],
        }
    }

    /// As if the torques had always been what they are, with the `states` added states at zero.
    #[inline(always)]
    fn settle(&mut self, states: usize) {
        self.on_joint.settle();
        self.on_handle.settle();
        let mut slot = 0;
        while slot < states {
            self.states[slot] = T::constant(0.0);
            self.rates[slot].settle();
            slot += 1;
        }
    }
}

/// The motor's motion between two samples.
enum MotorSegment<P, const ALL: usize> {
    /// As it was recorded, which depends on no parameter.
    Recorded(HermiteSegment<P>),
    /// Where a mechanism alters it.
    Corrected(HermiteSegment<Jet<P, ALL>>),
}

impl<P: Plain, const ALL: usize> MotorSegment<P, ALL> {
    /// Angle and speed at the fraction `u` of the way.
    #[inline(always)]
    fn at(&self, u: f64) -> Kinematics<Jet<P, ALL>> {
        match self {
            Self::Recorded(segment) => segment.at(u).lift(),
            Self::Corrected(segment) => segment.at(u),
        }
    }

    /// The motor at the start.
    #[inline(always)]
    fn start(&self) -> MotorAtSample<Jet<P, ALL>> {
        match self {
            Self::Recorded(segment) => MotorAtSample {
                angle: Jet::lift(segment.coefficients()[0]),
                acceleration: Jet::lift(segment.acceleration_at_start()),
            },
            Self::Corrected(segment) => MotorAtSample {
                angle: segment.coefficients()[0],
                acceleration: segment.acceleration_at_start(),
            },
        }
    }
}

/// The model of the trials of a batch, and what it needs from step to step.
struct ExtendedWrist<'a, P: Plain, const LINEAR: usize, const ALL: usize> {
    propagator: Propagator<P, AlteredYield<P, ALL>, WRIST_STATES, LINEAR, ALL>,
    plant: &'a Plant<Jet<P, ALL>>,
    step_s: f64,
    /// Whether mechanisms add torques at all, and whether these act on the handle.
    adds_torque: bool,
    acts_on_handle: bool,
    /// Number of added states, those of the torque channel included; 0 without added torques.
    states: usize,
}

impl<P: Plain, const LINEAR: usize, const ALL: usize> ExtendedWrist<'_, P, LINEAR, ALL> {
    /// The torque in the lever, N m.
    #[inline(always)]
    fn lever_torque(
        &self,
        state: &Angles<P, WRIST_STATES, ALL>,
        motor: Kinematics<Jet<P, ALL>>,
        added: &AddedTorques<Jet<P, ALL>>,
    ) -> Jet<P, ALL> {
        // At a rigid lever the torque between handle and hand is measured.
        let own = if self.plant.lever.is_none() { added.interface } else { added.lever };
        self.propagator.torque(state, motor) + own
    }

    /// Moves the wrist by step number `step` of `steps` through the motor's motion `motor`. The step ends `end_s` after the onset.
    #[inline(always)]
    fn step(
        &self,
        active: &ActiveMechanisms<Jet<P, ALL>>,
        wrist: &mut MovingWrist<P, WRIST_STATES, ALL>,
        added: &mut Additions<Jet<P, ALL>>,
        (motor, step, steps): (&MotorSegment<P, ALL>, usize, usize),
        end_s: f64,
    ) {
        let zero = Jet::constant(0.0);
        let mut coasted = self.propagator.coasted(&wrist.state);
        match motor {
            MotorSegment::Recorded(segment) => {
                self.propagator.push_recorded_motor(&mut coasted, &part_of_sample(segment, step, steps));
            }
            MotorSegment::Corrected(segment) => {
                self.propagator.push_motor(&mut coasted, &part_of_sample(segment, step, steps));
            }
        }
        let mut guess = coasted;
        // Whether the yield takes anything away, at the start or at the end.
        let mut yields = !wrist.is_silent;
        if self.adds_torque {
            let mut on_joint = added.on_joint.ahead();
            if yields {
                on_joint[0] = on_joint[0] + wrist.loss.torque;
                on_joint[1] = on_joint[1] + wrist.loss.rate;
            }
            // What acts on the joint alone asks for the state of the joint alone.
            let first_row = if self.acts_on_handle { 0 } else { JOINT };
            self.propagator.push_joint(&mut guess, &on_joint, first_row, FORCE - 1);
        } else if yields {
            let on_joint = [wrist.loss.torque, wrist.loss.rate, zero, zero];
            self.propagator.push_joint(&mut guess, &on_joint, JOINT, 2);
        }
        if self.acts_on_handle {
            self.propagator.push_handle(&mut guess, &added.on_handle.ahead());
        }
        yields |= self.propagator.yield_loss.is_near(guess[JOINT].value);
        if !yields && !self.adds_torque {
            wrist.state = guess;
            return;
        }
        let mut slot = 0;
        while slot < self.states {
            added.before[slot] = added.states[slot];
            added.states[slot] = added.before[slot] + mean(&added.rates[slot].ahead());
            slot += 1;
        }
        // First at the guess, then at the state that follows from it. One loop, so that the compiled code holds the mechanisms once.
        let mut is_corrected = false;
        loop {
            let mut loss = Loss::none();
            if yields {
                loss = self.propagator.yield_loss.at(guess[JOINT], guess[JOINT + 1]);
            }
            if self.adds_torque {
                let mut handle = Kinematics { theta: guess[0], omega: guess[1].scale(1.0 / self.step_s) };
                if self.plant.lever.is_none() {
                    handle = motor.at((step + 1) as f64 / steps as f64);
                }
                self.add_torques(active, &guess, added, handle, end_s);
            }
            if is_corrected {
                wrist.loss = loss;
                break;
            }
            guess = coasted;
            let mut force = [zero; FORCE];
            if yields {
                force = wrist.loss.until(&loss);
            }
            if self.adds_torque {
                let own = added.on_joint.until(added.torques.on_joint());
                let mut power = 0;
                while power < FORCE {
                    force[power] = force[power] + own[power];
                    power += 1;
                }
            }
            self.propagator.push_joint(&mut guess, &force, 0, FORCE);
            if self.acts_on_handle {
                self.propagator.push_handle(&mut guess, &added.on_handle.until(added.torques.on_handle()));
            }
            let mut slot = 0;
            while slot < self.states {
                let rate = added.guessed_rates[slot].scale(self.step_s);
                added.states[slot] = added.before[slot] + mean(&added.rates[slot].until(rate));
                slot += 1;
            }
            is_corrected = true;
        }
        if self.adds_torque {
            added.on_joint.push(added.torques.on_joint());
        }
        if self.acts_on_handle {
            added.on_handle.push(added.torques.on_handle());
        }
        let mut slot = 0;
        while slot < self.states {
            let rate = added.guessed_rates[slot].scale(self.step_s);
            added.rates[slot].push(rate);
            slot += 1;
        }
        wrist.state = guess;
        wrist.is_silent = !self.propagator.yield_loss.is_near(guess[JOINT].value);
    }

    /// What the mechanisms add at the state `angles` with the handle at `handle`, and the rates of their states.
    #[inline(always)]
    fn add_torques(
        &self,
        active: &ActiveMechanisms<Jet<P, ALL>>,
        angles: &Angles<P, WRIST_STATES, ALL>,
        added: &mut Additions<Jet<P, ALL>>,
        handle: Kinematics<Jet<P, ALL>>,
        time_s: f64,
    ) {
        let zero = Jet::constant(0.0);
        let (theta_j, omega_j) = (angles[JOINT], angles[JOINT + 1].scale(1.0 / self.step_s));
        let state = State { theta_l: handle.theta, omega_l: handle.omega, theta_j, omega_j };
        let beyond = self.propagator.yield_loss.beyond(theta_j);
        let mut torques = Torques { lever: zero, interface: zero, joint: zero, beyond, measured: zero };
        let context = Context { plant: self.plant, state: &state, handle, time_s };
        active.add_torques(&context, &added.states, &mut torques, &mut added.guessed_rates);
        added.torques =
            AddedTorques { joint: torques.joint, interface: torques.interface, lever: torques.lever };
    }
}

/// Simulates a batch with mechanisms, with `ALL` derivatives of which the first `LINEAR` are those of the plant's linear part.
#[inline(always)]
pub(super) fn extended<P: Plain, const LINEAR: usize, const ALL: usize>(
    batch: &Batch,
    output: &mut impl SampleOutput<Jet<P, ALL>>,
) {
    let settings = batch.settings;
    let kinds = settings.kinds;
    let slots = batch.slots(LINEAR);
    let parameters = seeded::<P, Jet<P, ALL>>(batch, &slots);
    let trial = covariates::<P>(batch);
    let start_s = -(settings.lead_samples as f64) * settings.period_s;
    let step_s = settings.period_s / settings.substeps as f64;
    let states: usize = kinds.iter().map(|kind| kind.state_count()).sum();
    assert!(states <= MAX_ADDED_STATES, "the mechanisms add too many states; each may be switched on once");
    let at = |is: fn(MechanismKind) -> bool| kinds.iter().any(|kind| is(*kind));
    let reads_past = at(MechanismKind::reads_past);
    let past_samples = if reads_past { settings.lead_samples + settings.samples } else { 0 };
    let mut history = History::new(start_s, settings.period_s, states).with_room(past_samples);
    let mut plant = Plant::base(settings.lever, &parameters);
    let added_parameters = &parameters[BASE_PARAMETERS.len()..];
    let active = ActiveMechanisms { kinds, parameters: added_parameters, trial: &trial, history: &history };
    active.alter_plant(&mut plant);
    let mut channels = active.channels();
    let model = ExtendedWrist::<P, LINEAR, ALL> {
        propagator: Propagator::new(&plant.with_derivatives(), AlteredYield::new(&plant), step_s),
        plant: &plant,
        step_s,
        adds_torque: at(MechanismKind::adds_torque),
        acts_on_handle: settings.lever.is_some()
            && at(|kind| kind.adds_torque() && kind.law_space().place != Place::Joint),
        states: if at(MechanismKind::adds_torque) { states } else { 0 },
    };
    // A late torque is predicted from a late motion. The further channels are not late, so they need a run of their own.
    let is_skewed = at(|kind| matches!(kind, MechanismKind::ChannelSkew));
    let runs: &[Channels] = match (settings.further.is_empty(), is_skewed) {
        (true, _) => &[Channels::Torque],
        (false, false) => &[Channels::All],
        (false, true) => &[Channels::Torque, Channels::Further],
    };
    let alters_angle = at(MechanismKind::alters_angle);
    let mut number = 0;
    while number < runs.len() {
        if runs[number] == Channels::Further {
            channels.torque_delay_s = Jet::constant(0.0);
            history = History::new(start_s, settings.period_s, states).with_room(past_samples);
        }
        let has_further = runs[number] != Channels::Torque;
        let mut corrected = Vec::new();
        if alters_angle {
            corrected = corrected_motion::<P, Jet<P, ALL>>(batch, &channels);
        }
        let mut channel = TorqueChannel::new(kinds, added_parameters, &trial, step_s);
        let mut wrist = MovingWrist::<P, WRIST_STATES, ALL>::at_rest();
        let mut added = Additions::none();
        let mut run = Run::<Jet<P, ALL>>::new(batch, slots, runs[number]);
        let mut from = recorded::<P>(batch, 0);
        // A mechanism may act already where the simulation begins: of one step before it, what is added at its end is kept.
        let mut is_before = model.adds_torque;
        while run.sample < run.samples {
            let to = recorded::<P>(batch, run.sample + 1);
            let motor = if is_before {
                let rest = Kinematics { theta: P::splat(0.0), omega: P::splat(0.0) };
                MotorSegment::Recorded(HermiteSegment::new(rest, rest, settings.period_s))
            } else if alters_angle {
                let (from, to) = (corrected[run.sample], corrected[run.sample + 1]);
                MotorSegment::Corrected(HermiteSegment::new(from, to, settings.period_s))
            } else {
                MotorSegment::Recorded(HermiteSegment::new(from, to, settings.period_s))
            };
            let time_s = start_s + run.sample as f64 * settings.period_s;
            let mut step = 0;
            while step < settings.substeps {
                let begin = step as f64 / settings.substeps as f64;
                let is_sample = step == 0 && !is_before;
                if is_sample || (channel.has_states() && !is_before) {
                    let lever_torque = model.lever_torque(&wrist.state, motor.at(begin), &added.torques);
                    let recorded = channel.recorded(lever_torque, time_s + begin * settings.period_s);
                    if is_sample && has_further {
                        let interface = added.torques.interface;
                        let propagator = &model.propagator;
                        let values =
                            propagator.further_values(&wrist.state, motor.start(), lever_torque, interface);
                        run.store(batch, output, recorded, Some(&values));
                    } else if is_sample {
                        run.store(batch, output, recorded, None);
                    }
                    if is_sample && reads_past {
                        history.push(&added.states, &added.guessed_rates);
                    }
                }
                let active = ActiveMechanisms {
                    kinds,
                    parameters: added_parameters,
                    trial: &trial,
                    history: &history,
                };
                let mut end_s = time_s + (step + 1) as f64 / settings.substeps as f64 * settings.period_s;
                if is_before {
                    end_s = start_s;
                }
                model.step(&active, &mut wrist, &mut added, (&motor, step, settings.substeps), end_s);
                if is_before {
                    is_before = false;
                    wrist = MovingWrist::at_rest();
                    added.settle(states);
                    break;
                }
                step += 1;
                if step == settings.substeps {
                    from = to;
                }
            }
        }
        number += 1;
    }
}
