//! Fourth-order Runge-Kutta through the motor's motion between two samples.

use super::mechanisms::Extension;
use super::plant::{Kinematics, MEMORY, Mechanics, State};
use super::sparse_coefficient::DerivativeStructure;
use crate::number::{Number, Plain};

/// The motor's motion between two samples: the cubic through angle and speed at both.
#[derive(Debug, Clone, Copy)]
pub struct HermiteSegment<T> {
    start: Kinematics<T>,
    /// DerivativeStructure of the square and the cube of the fraction of the way.
    square: T,
    cube: T,
    period_s: f64,
}

impl<T: Number> HermiteSegment<T> {
    /// From one sample to the next, `period_s` later.
    #[inline(always)]
    pub fn new(from: Kinematics<T>, to: Kinematics<T>, period_s: f64) -> Self {
        let (from_slope, to_slope) = (from.omega.scale(period_s), to.omega.scale(period_s));
        let rise = to.theta - from.theta;
        Self {
            start: from,
            square: rise.scale(3.0) - from_slope.scale(2.0) - to_slope,
            cube: from_slope + to_slope - rise.scale(2.0),
            period_s,
        }
    }

    /// The motor at `u` (0 to 1) of the way.
    #[inline(always)]
    fn at(&self, u: f64) -> Kinematics<T> {
        let theta = self.start.theta
            + self.start.omega.scale(self.period_s * u)
            + self.square.scale(u * u)
            + self.cube.scale(u * u * u);
        let omega = self.start.omega
            + self.square.scale(2.0 * u / self.period_s)
            + self.cube.scale(3.0 * u * u / self.period_s);
        Kinematics { theta, omega }
    }
}

/// The motor's motion, with or without derivatives of its own.
pub trait MotorInput<T> {
    /// Angle and speed at `u` (0 to 1) of the way from one sample to the next.
    fn at(&self, u: f64) -> Kinematics<T>;
}

/// A motion that depends on parameters.
#[derive(Debug, Clone, Copy)]
pub struct CorrectedInput<T>(pub HermiteSegment<T>);

impl<T: Number> MotorInput<T> for CorrectedInput<T> {
    #[inline(always)]
    fn at(&self, u: f64) -> Kinematics<T> {
        self.0.at(u)
    }
}

/// A motion that is given.
#[derive(Debug, Clone, Copy)]
pub struct RecordedInput<P>(pub HermiteSegment<P>);

impl<P: Plain, T: Number<Plain = P>> MotorInput<T> for RecordedInput<P> {
    #[inline(always)]
    fn at(&self, u: f64) -> Kinematics<T> {
        self.0.at(u).lift()
    }
}

/// The classical Runge-Kutta scheme: where each stage looks, and what it weighs.
const STAGES: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];

/// A wrist on its way from sample to sample. With derivatives a state takes kilobytes: what the scheme needs besides is kept
/// rather than made anew each time, and added states that are not in use are left alone.
#[derive(Debug, Clone)]
pub struct Integrator<T> {
    /// Where it is.
    pub state: State<T>,
    /// The added states at the last sample, and their rates.
    pub memory: [[T; MEMORY]; 2],
    begin: State<T>,
    at: State<T>,
    rates: State<T>,
}

impl<T: Number> Integrator<T> {
    /// At rest.
    #[inline(always)]
    pub fn at_rest() -> Self {
        let rest = State::rest();
        Self { state: rest, memory: [rest.memory; 2], begin: rest, at: rest, rates: rest }
    }

    /// Moves from one sample to the next in `substeps` equal steps; returns the measured torque at the first sample.
    ///
    /// One loop over all evaluations, rather than one over steps around one over stages, keeps a single copy of the model's
    /// equations in the compiled code.
    #[inline(always)]
    pub fn advance<C: DerivativeStructure<T>, X: Extension<T>, D: MotorInput<T>>(
        &mut self,
        mechanics: &Mechanics<T, C>,
        extension: &X,
        input: &D,
        start_s: f64,
        period_s: f64,
        substeps: usize,
    ) -> T {
        let Self { state, memory: [first, first_rates], begin, at, rates } = self;
        let step = period_s / substeps as f64;
        let memory = extension.memory();
        let mut measured = T::constant(0.0);
        begin.copy_from(state, memory);
        at.copy_from(state, memory);
        let mut evaluation = 0;
        while evaluation < substeps * STAGES.len() {
            let (substep, stage) = (evaluation / STAGES.len(), evaluation % STAGES.len());
            let u = (substep as f64 + STAGES[stage].0) / substeps as f64;
            let torques = mechanics.rates(extension, at, input.at(u), start_s + u * period_s, rates);
            if evaluation == 0 {
                measured = torques.measured;
                first[..memory].copy_from_slice(&state.memory[..memory]);
                first_rates[..memory].copy_from_slice(&rates.memory[..memory]);
            }
            state.add(rates, STAGES[stage].1 * step, memory);
            if stage + 1 == STAGES.len() {
                begin.copy_from(state, memory);
                at.copy_from(state, memory);
            } else {
                at.copy_from(begin, memory);
                at.add(rates, STAGES[stage + 1].0 * step, memory);
            }
            evaluation += 1;
        }
        measured
    }
}

impl<T: Number> State<T> {
    /// Adds `step * rates`, of the added states to the first `memory`.
    #[inline(always)]
    fn add(&mut self, rates: &Self, step: f64, memory: usize) {
        self.theta_l = self.theta_l + rates.theta_l.scale(step);
        self.omega_l = self.omega_l + rates.omega_l.scale(step);
        self.theta_j = self.theta_j + rates.theta_j.scale(step);
        self.omega_j = self.omega_j + rates.omega_j.scale(step);
        let mut slot = 0;
        while slot < memory {
            self.memory[slot] = self.memory[slot] + rates.memory[slot].scale(step);
            slot += 1;
        }
    }

    /// Becomes `other`, of whose added states the first `memory` are in use: they are large, and mostly none is.
    #[inline(always)]
    fn copy_from(&mut self, other: &Self, memory: usize) {
        self.theta_l = other.theta_l;
        self.omega_l = other.omega_l;
        self.theta_j = other.theta_j;
        self.omega_j = other.omega_j;
        let mut slot = 0;
        while slot < memory {
            self.memory[slot] = other.memory[slot];
            slot += 1;
        }
    }
}

/// How many Runge-Kutta steps a sample needs for an error below 1e-5 N m.
///
/// The fastest modes are those of the interface damper between the two inertias and of the lever; the step is chosen so
/// that the sum of their rates times the step stays below [`LONGEST_STEP`], which the tests hold against a reference with
/// 256 steps over the whole range of parameters.
pub fn substeps(lever: Option<super::Lever>, parameters: &[f64], period_s: f64) -> usize {
    let (i_j, b_h, k_h, k_srs) = (parameters[0], parameters[1], parameters[2], parameters[3]);
    let joint = b_h / i_j;
    // At a rigid lever the torque is measured at the damper itself and shows the whole error of the joint's speed.
    let mut fastest = (2.0 * joint).max(libm::sqrt((k_h + k_srs) / i_j));
    if let Some(lever) = lever {
        let handle = (b_h + lever.damping_nm_s_per_rad) / lever.inertia_kg_m2;
        let swing = libm::sqrt((k_h + lever.stiffness_nm_per_rad) / lever.inertia_kg_m2);
        fastest = (joint + handle).max(swing).max(libm::sqrt((k_h + k_srs) / i_j));
    }
    let wanted = libm::ceil(fastest * period_s / LONGEST_STEP);
    if wanted.is_finite() { (wanted as usize).clamp(FEWEST_SUBSTEPS, 64) } else { 64 }
}

/// Greatest product of the fastest rate and the step.
pub const LONGEST_STEP: f64 = 0.5;

/// The yield itself, which a_s makes sharp, needs two steps a sample at 2.5 kHz and the paper's fastest ramp.
const FEWEST_SUBSTEPS: usize = 2;
