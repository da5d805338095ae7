//! Fourth-order Runge-Kutta through the motor's motion between two samples.

use super::mechanics::{AddedDynamics, Kinematics, Mechanics, State, Torques};
use super::mechanisms::MAX_ADDED_STATES;
use super::plant::Plant;
use crate::number::Number;

/// The motor's motion between two samples: the cubic through angle and speed at both samples (Hermite).
#[derive(Debug, Clone, Copy)]
pub struct HermiteSegment<T> {
    start: Kinematics<T>,
    /// Coefficients of the square and the cube of the fraction of the way.
    square: T,
    cube: T,
    period_s: f64,
}

impl<T: Number> HermiteSegment<T> {
    /// The segment from one sample to the next, `period_s` later.
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

    /// The angle as a polynomial in the fraction of the period, rad.
    #[inline(always)]
    pub(super) fn coefficients(&self) -> [T; 4] {
        [self.start.theta, self.start.omega.scale(self.period_s), self.square, self.cube]
    }

    /// Angle and speed at the fraction `u` (0 to 1) of the period.
    #[inline(always)]
    pub fn at(&self, u: f64) -> Kinematics<T> {
        let Kinematics { theta, omega } = self.start;
        let angle = theta.add_scaled(omega, self.period_s * u).add_scaled(self.square, u * u);
        let speed = omega.add_scaled(self.square, 2.0 * u / self.period_s);
        Kinematics {
            theta: angle.add_scaled(self.cube, u * u * u),
            omega: speed.add_scaled(self.cube, 3.0 * u * u / self.period_s),
        }
    }

    /// Angular acceleration at the start of the segment, rad/s2.
    #[inline(always)]
    pub(super) fn acceleration_at_start(&self) -> T {
        self.square.scale(2.0 / (self.period_s * self.period_s))
    }

    /// Angular acceleration at the end of the segment, rad/s2.
    #[inline(always)]
    pub fn acceleration_at_end(&self) -> T {
        (self.square.scale(2.0) + self.cube.scale(6.0)).scale(1.0 / (self.period_s * self.period_s))
    }
}

/// The classical Runge-Kutta scheme: time of each stage as a fraction of the step, and its weight.
const STAGES: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];

/// The state of the base model and the states that mechanisms add.
#[derive(Debug, Clone, Copy)]
struct ExtendedState<T> {
    base: State<T>,
    added: [T; MAX_ADDED_STATES],
}

/// The state of a wrist, integrated from sample to sample.
///
/// With derivatives a state takes kilobytes. The working copies of the scheme are therefore kept between samples, when
/// `begin` and `at` equal the state; added states that are not in use are not copied.
#[derive(Debug, Clone)]
pub struct Integrator<T> {
    state: ExtendedState<T>,
    /// The added states at the last sample, and their rates.
    sampled: [[T; MAX_ADDED_STATES]; 2],
    begin: ExtendedState<T>,
    at: ExtendedState<T>,
    rates: ExtendedState<T>,
}

impl<T: Number> Integrator<T> {
    /// A wrist at rest.
    #[inline(always)]
    pub fn at_rest() -> Self {
        let added = [T::constant(0.0); MAX_ADDED_STATES];
        let rest = ExtendedState { base: State::rest(), added };
        Self { state: rest, sampled: [added; 2], begin: rest, at: rest, rates: rest }
    }

    /// The present angles and speeds.
    pub fn state(&self) -> &State<T> {
        &self.state.base
    }

    /// The added states at the sample before the last call of [`Integrator::advance`], and their rates.
    #[inline(always)]
    pub fn sampled(&self) -> (&[T], &[T]) {
        (&self.sampled[0], &self.sampled[1])
    }

    /// The torques at the present state, with the motor at `motor`, `time_s` after the onset; and the rates of the state.
    pub fn torques<X: AddedDynamics<T>>(
        &self,
        mechanics: &Mechanics<T>,
        added_dynamics: &X,
        motor: Kinematics<T>,
        time_s: f64,
    ) -> (Torques<T>, State<T>) {
        let (mut rates, mut added_rates) = (State::rest(), [T::constant(0.0); MAX_ADDED_STATES]);
        let ExtendedState { base, added } = &self.state;
        let torques =
            mechanics.rates(added_dynamics, base, added, motor, time_s, &mut rates, &mut added_rates);
        (torques, rates)
    }

    /// Integrates from one sample to the next in `substeps` equal steps; returns the measured torque at the first sample, N m.
    ///
    /// One loop runs over all evaluations, instead of a loop over stages within one over steps, so that the compiled code holds
    /// the model's equations once.
    ///
    /// # Panics
    /// If the added dynamics have more than [`MAX_ADDED_STATES`] states: a mechanism is switched on more than once.
    #[inline(always)]
    pub fn advance<X: AddedDynamics<T>>(
        &mut self,
        mechanics: &Mechanics<T>,
        added_dynamics: &X,
        input: &HermiteSegment<T>,
        start_s: f64,
        period_s: f64,
        substeps: usize,
    ) -> T {
        let Self { state, sampled: [first, first_rates], begin, at, rates } = self;
        let step = period_s / substeps as f64;
        let count = added_dynamics.state_count();
        assert!(
            count <= MAX_ADDED_STATES,
            "the mechanisms add too many states; each may be switched on once"
        );
        let mut measured = T::constant(0.0);
        let mut motor = input.at(0.0);
        let mut evaluation = 0;
        while evaluation < substeps * STAGES.len() {
            let (substep, stage) = (evaluation / STAGES.len(), evaluation % STAGES.len());
            let u = (substep as f64 + STAGES[stage].0) / substeps as f64;
            // The others are at the time of the evaluation before.
            if stage == 1 || stage == 3 {
                motor = input.at(u);
            }
            let torques = mechanics.rates(
                added_dynamics,
                &at.base,
                &at.added,
                motor,
                start_s + u * period_s,
                &mut rates.base,
                &mut rates.added,
            );
            if evaluation == 0 {
                measured = torques.measured;
                first[..count].copy_from_slice(&state.added[..count]);
                first_rates[..count].copy_from_slice(&rates.added[..count]);
            }
            state.add(rates, STAGES[stage].1 * step, count);
            if stage + 1 == STAGES.len() {
                begin.copy_from(state, count);
                at.copy_from(state, count);
            } else {
                at.set_to(begin, rates, STAGES[stage + 1].0 * step, count);
            }
            evaluation += 1;
        }
        measured
    }
}

impl<T: Number> ExtendedState<T> {
    /// Adds `step * rates`; of the added states to the first `count`.
    #[inline(always)]
    fn add(&mut self, rates: &Self, step: f64, count: usize) {
        let (own, by) = (&mut self.base, &rates.base);
        own.theta_l = own.theta_l.add_scaled(by.theta_l, step);
        own.omega_l = own.omega_l.add_scaled(by.omega_l, step);
        own.theta_j = own.theta_j.add_scaled(by.theta_j, step);
        own.omega_j = own.omega_j.add_scaled(by.omega_j, step);
        let mut slot = 0;
        while slot < count {
            self.added[slot] = self.added[slot].add_scaled(rates.added[slot], step);
            slot += 1;
        }
    }

    /// Becomes `from + step * rates`; of the added states the first `count`.
    #[inline(always)]
    fn set_to(&mut self, from: &Self, rates: &Self, step: f64, count: usize) {
        let (own, before, by) = (&mut self.base, &from.base, &rates.base);
        own.theta_l = before.theta_l.add_scaled(by.theta_l, step);
        own.omega_l = before.omega_l.add_scaled(by.omega_l, step);
        own.theta_j = before.theta_j.add_scaled(by.theta_j, step);
        own.omega_j = before.omega_j.add_scaled(by.omega_j, step);
        let mut slot = 0;
        while slot < count {
            self.added[slot] = from.added[slot].add_scaled(rates.added[slot], step);
            slot += 1;
        }
    }

    /// Copies `other`; of the added states the first `count`.
    #[inline(always)]
    fn copy_from(&mut self, other: &Self, count: usize) {
        let (own, from) = (&mut self.base, &other.base);
        own.theta_l = from.theta_l;
        own.omega_l = from.omega_l;
        own.theta_j = from.theta_j;
        own.omega_j = from.omega_j;
        let mut slot = 0;
        while slot < count {
            self.added[slot] = other.added[slot];
            slot += 1;
        }
    }
}

/// Number of Runge-Kutta steps per sample of a wrist of `plant`, as mechanisms may have altered it, none longer than `longest_step_s`, s,
/// which mechanisms may ask for. The error is below 1e-5 N m, below 2e-4 N m with a mechanism of a plausible size, and
/// below 1e-3 N m with a slack, which has corners.
///
/// The fastest modes are those of the interface damper between the two inertias and of the lever; the step is chosen so
/// that the sum of their rates times the step stays below [`LONGEST_STEP`], which the tests hold against a reference with
/// 256 steps over the whole range of parameters.
pub fn substeps(plant: &Plant<f64>, longest_step_s: f64, period_s: f64) -> usize {
    let joint = (plant.interface_damping + plant.joint_damping) / plant.joint_inertia;
    let swing = libm::sqrt((plant.interface_stiffness + plant.short_range_stiffness) / plant.joint_inertia);
    let fastest = match plant.lever {
        // At a rigid lever the torque is measured at the damper itself and shows the whole error of the joint's speed.
        None => (2.0 * joint).max(swing),
        Some(lever) => {
            let handle = (plant.interface_damping + lever.damping) / lever.inertia;
            let handle_swing = libm::sqrt((plant.interface_stiffness + lever.stiffness) / lever.inertia);
            (joint + handle).max(handle_swing).max(swing)
        }
    };
    let longest_s = (LONGEST_STEP / fastest).min(longest_step_s).min(LONGEST_STEP_S);
    let wanted = libm::ceil(period_s / longest_s);
    if wanted.is_finite() { (wanted as usize).clamp(FEWEST_SUBSTEPS, 64) } else { 64 }
}

/// Greatest product of the fastest rate and the integration step.
pub const LONGEST_STEP: f64 = 0.5;

/// Longest step, s: one of 0.4 ms leaves an error of 4e-5 N m of the paper's wrist and lever, one of 0.25 ms 6e-6.
const LONGEST_STEP_S: f64 = 2.5e-4;

/// The yield itself, which a_s makes sharp, needs two steps a sample at 2.5 kHz and the paper's fastest ramp.
const FEWEST_SUBSTEPS: usize = 2;
