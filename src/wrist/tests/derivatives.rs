//! The sensitivities against num-dual and against difference formulas of high order.

use std::ops::{Add, Div, Mul, Neg, Sub};

use num_dual::{Dual64, DualNum};

use super::*;
use crate::number::{Lanes, Number, Plain};
use crate::signal::SectionState;
use crate::wrist::batch::{Batch, extended};
use crate::wrist::integrate::HermiteSegment;
use crate::wrist::propagator::{MovingWrist, Propagator, part_of_sample};

/// num-dual's number behind the model's trait, with num-dual's own elementary functions.
#[derive(Clone, Copy)]
struct Oracle(Dual64);

macro_rules! operator {
    ($type:ident, $trait:ident, $method:ident) => {
        impl $trait for $type {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
operator!(Oracle, Add, add);
operator!(Oracle, Sub, sub);
operator!(Oracle, Mul, mul);
operator!(Oracle, Div, div);

impl Neg for Oracle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Number for Oracle {
    type Plain = f64;
    fn lift(value: f64) -> Self {
        Self(Dual64::from(value))
    }
    fn variable(value: f64, index: usize) -> Self {
        Self(Dual64::new(value, if index == 0 { 1.0 } else { 0.0 }))
    }
    fn derivative(self, _: usize) -> f64 {
        self.0.eps
    }
    fn plain(self) -> f64 {
        self.0.re
    }
    fn times(self, factor: f64) -> Self {
        Self(self.0 * factor)
    }
    fn chain(self, value: f64, slope: f64) -> Self {
        Self(Dual64::new(value, self.0.eps * slope))
    }
    fn exp(self) -> Self {
        Self(self.0.exp())
    }
    fn softplus(self) -> Self {
        let zero = Self::lift(0.0);
        let larger = if self.0.re > 0.0 { self } else { zero };
        Self(larger.0 + (-(if self.0.re > 0.0 { self.0 } else { -self.0 })).exp().ln_1p())
    }
    fn logistic(self) -> Self {
        Self((Dual64::from(1.0) + (-self.0).exp()).recip())
    }
    fn tanh(self) -> Self {
        Self(self.0.tanh())
    }
    fn positive_part(self) -> Self {
        if self.0.re > 0.0 { self } else { Self::lift(0.0) }
    }
}

/// num-dual's number in place of a number without derivatives, so that the exact steps, which know their derivatives, can be run
/// without that knowledge.
#[derive(Debug, Clone, Copy)]
struct Dual(Dual64);
operator!(Dual, Add, add);
operator!(Dual, Sub, sub);
operator!(Dual, Mul, mul);
operator!(Dual, Div, div);

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Lanes for Dual {
    const LANES: usize = 1;
    fn splat(value: f64) -> Self {
        Self(Dual64::from(value))
    }
    fn load(values: &[f64]) -> Self {
        Self::splat(values[0])
    }
    fn lane(self, _: usize) -> f64 {
        self.0.re
    }
    fn max(self, other: Self) -> Self {
        if self.0.re > other.0.re { self } else { other }
    }
    fn min(self, other: Self) -> Self {
        if self.0.re < other.0.re { self } else { other }
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    fn any_positive(self) -> bool {
        self.0.re > 0.0
    }
    fn where_positive(self, yes: Self, no: Self) -> Self {
        if self.0.re > 0.0 { yes } else { no }
    }
    fn times_power_of_two(self, _: Self) -> Self {
        unreachable!("num-dual has an exponential of its own")
    }
}

impl Number for Dual {
    type Plain = Self;
    fn lift(value: Self) -> Self {
        value
    }
    fn plain(self) -> Self {
        self
    }
    fn times(self, factor: Self) -> Self {
        self * factor
    }
    fn chain(self, value: Self, _: Self) -> Self {
        value
    }
}

impl Plain for Dual {
    fn softplus_and_slope(self) -> (Self, Self) {
        let own = Oracle(self.0);
        (Self(own.softplus().0), Self(own.logistic().0))
    }
}

/// Every model of one mechanism or free law, and the base model.
fn models() -> Vec<Vec<MechanismKind>> {
    std::iter::once(Vec::new()).chain(CATALOGUE.iter().chain(FREE_LAWS).map(|kind| vec![*kind])).collect()
}

fn parameters_of(kinds: &[MechanismKind]) -> Vec<f64> {
    let mut parameters = kinds.first().map_or(PERSON.to_vec(), |kind| with(*kind));
    for (place, parameter) in kinds.iter().flat_map(|kind| kind.parameters()).enumerate() {
        if !parameter.fitted {
            continue;
        }
        // Off the value that has no effect, and off the corners of what is not smooth.
        let off = 0.013 * (parameter.high - parameter.low).min(parameter.typical.abs().max(1e-3));
        parameters[6 + place] += off;
    }
    parameters
}

/// The estimated parameters of a model: names and places.
fn estimated(kinds: &[MechanismKind]) -> Vec<(String, usize)> {
    let base = super::super::BASE_PARAMETERS.iter().map(|name| ((*name).to_string(), true));
    let added = kinds
        .iter()
        .flat_map(|kind| kind.parameters().iter().map(|p| (format!("{}.{}", kind.id(), p.name), p.fitted)));
    let all = base.chain(added).enumerate();
    all.filter(|(_, (_, fitted))| *fitted).map(|(place, (name, _))| (name, place)).collect()
}

fn column(response: &SimulatedTorque, columns: usize, index: usize) -> Vec<f64> {
    response.slopes.iter().skip(index).step_by(columns).copied().collect()
}

/// Greatest difference relative to the greatest value.
fn relative(a: &[f64], b: &[f64]) -> f64 {
    let scale = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if scale == 0.0 {
        return a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    }
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale
}

/// Calls `error` with the mechanisms, their parameters, the place of each estimated one and our derivative by it, and asserts
/// that what it says is below the tolerance for these mechanisms.
fn each_derivative(
    tolerance: impl Fn(&[MechanismKind]) -> f64,
    error: impl Fn(&[MechanismKind], &[f64], usize, &[f64]) -> f64,
) {
    let (sections, trial) = (sections(), ramp(2.6));
    for kinds in models() {
        let parameters = parameters_of(&kinds);
        let estimated = estimated(&kinds);
        let wanted: Vec<usize> = estimated.iter().map(|(_, place)| *place).collect();
        let ours = run(&settings(&kinds, &sections, &wanted), &trial, &parameters);
        for (index, (name, place)) in estimated.iter().enumerate() {
            let error = error(&kinds, &parameters, *place, &column(&ours, wanted.len(), index));
            assert!(error < tolerance(&kinds), "{name}: {error:e}");
        }
    }
}

#[test]
fn derivatives_agree_with_num_dual_for_every_parameter_of_every_mechanism() {
    let (sections, trial) = (sections(), ramp(2.6));
    each_derivative(
        |_| 1e-8,
        |kinds, parameters, place, ours| {
            if kinds.is_empty() {
                return relative(
                    ours,
                    &by_dual_propagator::<4>(Some(LEVER), &trial, &sections, parameters, place),
                );
            }
            let one = [place];
            let settings = settings(kinds, &sections, &one);
            let batch = Batch { settings: &settings, trials: &[&trial], parameters, first: 0, wanted: 0..1 };
            let mut oracle = SimulatedTorque { torque_nm: vec![0.0; SAMPLES], slopes: vec![0.0; SAMPLES] };
            extended::<f64, Oracle>(&batch, &mut oracle);
            relative(ours, &oracle.slopes)
        },
    );
}

/// The derivative of the filtered torque by parameter number `place`, with num-dual's numbers on the way of the exact steps.
fn by_dual_propagator<const STATES: usize>(
    lever: Option<Lever>,
    trial: &TrialInput,
    sections: &[Section],
    parameters: &[f64],
    place: usize,
) -> Vec<f64> {
    let request = settings(&[], &[], &[]);
    let seed = |index: usize| Dual(Dual64::new(parameters[index], f64::from(index == place)));
    let parameters = std::array::from_fn(seed);
    let step_s = PERIOD_S / request.substeps as f64;
    let propagator = Propagator::<Dual, STATES, 0, 0>::new(lever, &parameters, step_s);
    let mut wrist = MovingWrist::at_rest();
    let mut memories = vec![SectionState::<Dual>::silent(); sections.len()];
    let mut slopes = Vec::new();
    let constant =
        |knot: Kinematics<f64>| Kinematics { theta: Dual::splat(knot.theta), omega: Dual::splat(knot.omega) };
    for knots in trial.motion[trial.onset - LEAD..=trial.onset + SAMPLES].windows(2) {
        let segment = HermiteSegment::new(constant(knots[0]), constant(knots[1]), PERIOD_S);
        let mut torque = propagator.torque(&wrist, &segment).value;
        for (section, memory) in sections.iter().zip(&mut memories) {
            torque = section.step(memory, torque);
        }
        slopes.push(torque.0.eps);
        for step in 0..request.substeps {
            propagator.step(&mut wrist, &part_of_sample(&segment, step, request.substeps));
        }
    }
    slopes.split_off(LEAD)
}

#[test]
fn derivatives_at_a_rigid_lever_agree_with_num_dual() {
    let (sections, trial) = (sections(), ramp(2.6));
    let wanted = [0, 1, 2, 3, 4, 5];
    let settings = SimulationSettings { lever: None, ..settings(&[], &sections, &wanted) };
    let ours = run(&settings, &trial, &PERSON);
    for place in wanted {
        let oracle = by_dual_propagator::<2>(None, &trial, &sections, &PERSON, place);
        let error = relative(&column(&ours, wanted.len(), place), &oracle);
        assert!(error < 1e-8, "parameter {place}: {error:e}");
    }
}

#[test]
fn derivatives_agree_with_eighth_order_differences_for_every_parameter_of_every_mechanism() {
    let (sections, trial) = (sections(), ramp(2.6));
    // The third derivative of a spline jumps at its knots, which limits a difference formula of high order.
    let tolerance =
        |kinds: &[MechanismKind]| if kinds.iter().any(|kind| kind.is_free_law()) { 1e-5 } else { 1e-8 };
    each_derivative(tolerance, |kinds, parameters, place, ours| {
        let torque = |by: f64| {
            let mut moved = parameters.to_vec();
            moved[place] += by;
            run(&settings(kinds, &sections, &[]), &trial, &moved).torque_nm
        };
        // Large steps suffer from the curvature, small ones from rounding; corners that a mechanism has ask for small ones.
        [2e-2, 1e-2, 5e-3, 2e-3, 5e-4, 1e-4]
            .map(|step| relative(ours, &difference(&torque, step * parameters[place].abs().max(1e-4))))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    });
}

/// The central difference of eighth order.
fn difference(torque: &dyn Fn(f64) -> Vec<f64>, step: f64) -> Vec<f64> {
    let weights = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let mut slope = vec![0.0; SAMPLES];
    for (index, weight) in weights.iter().enumerate() {
        let by = (index + 1) as f64 * step;
        let (up, down) = (torque(by), torque(-by));
        for (slope, (up, down)) in slope.iter_mut().zip(up.iter().zip(&down)) {
            *slope += weight * (up - down) / step;
        }
    }
    slope
}
