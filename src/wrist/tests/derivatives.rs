//! The sensitivities against num-dual and against difference formulas of high order.

use std::ops::{Add, Div, Mul, Neg, Sub};

use num_dual::{Dual64, DualNum};

use super::*;
use crate::number::{Jet, Lanes, Number, Plain};
use crate::wrist::base_trials::base;
use crate::wrist::batch::{Batch, SampleOutput, Slots};
use crate::wrist::extended::extended;
use crate::wrist::mechanisms::DataRequirement;

/// num-dual's number in place of a number without derivatives, so that a simulation, which knows its derivatives, can be run without that
/// knowledge. Elementary functions are num-dual's own.
#[derive(Debug, Clone, Copy)]
struct Dual(Dual64);

thread_local! {
    /// The value of the parameter by which [`Dual`] differentiates. No other number that is loaded has the same.
    static VARIABLE: std::cell::Cell<f64> = const { std::cell::Cell::new(f64::NAN) };
}

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
        let slope = f64::from(VARIABLE.get() == values[0]);
        Self(Dual64::new(values[0], slope))
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
    fn positive_part(self) -> Self {
        if self.0.re > 0.0 { self } else { Self::splat(0.0) }
    }
}

impl Plain for Dual {
    fn exponential(self) -> Self {
        Self(self.0.exp())
    }
    fn softplus_and_slope(self) -> (Self, Self) {
        let positive = self.positive_part();
        let minus_size = if self.0.re > 0.0 { -self.0 } else { self.0 };
        let logistic = (Dual64::from(1.0) + (-self.0).exp()).recip();
        (Self(positive.0 + minus_size.exp().ln_1p()), Self(logistic))
    }
}

/// The derivatives by num-dual.
struct DualSlopes(Vec<f64>);

impl SampleOutput<Jet<Dual, 0>> for DualSlopes {
    fn store(&mut self, _: &Batch, _: &Slots, row: usize, value: Jet<Dual, 0>) {
        assert_eq!(row, self.0.len(), "row by row");
        self.0.push(value.value.0.eps);
    }
}

/// The derivative of the filtered torque by parameter number `place`, by num-dual.
fn by_num_dual<const STATES: usize>(
    settings: &SimulationSettings,
    trial: &TrialInput,
    parameters: &[f64],
    place: usize,
) -> Vec<f64> {
    let settings = SimulationSettings { derivatives: &[], ..*settings };
    let batch = Batch { settings: &settings, trials: &[trial], parameters, first: 0, wanted: 0..0 };
    let mut slopes = DualSlopes(Vec::new());
    VARIABLE.set(parameters[place]);
    match settings.kinds {
        [] => base::<Dual, STATES, 0, 0>(&batch, &mut slopes),
        _ => extended::<Dual, 0, 0>(&batch, &mut slopes),
    }
    VARIABLE.set(f64::NAN);
    slopes.0
}

/// Every model of one mechanism or free law, and the base model.
fn models() -> Vec<Vec<MechanismKind>> {
    std::iter::once(Vec::new()).chain(CATALOGUE.iter().chain(FREE_LAWS).map(|kind| vec![*kind])).collect()
}

fn parameters_of(kinds: &[MechanismKind]) -> Vec<f64> {
    let mut parameters = kinds.first().map_or(PERSON.to_vec(), |kind| with(*kind));
    // Off what mechanisms have for constants, as num-dual knows its variable by the value.
    parameters[..6].iter_mut().for_each(|own| *own *= 1.01);
    for (place, parameter) in kinds.iter().flat_map(|kind| kind.parameters()).enumerate() {
        if !parameter.fitted {
            continue;
        }
        // Off the value that has no effect, and off the corners of what is not smooth.
        // A different one for each, for the same reason.
        let share = 0.013 * (1.0 + 0.01 * place as f64);
        let off = share * (parameter.high - parameter.low).min(parameter.typical.abs().max(1e-3));
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
            let settings = settings(kinds, &sections, &[]);
            relative(ours, &by_num_dual::<4>(&settings, &trial, parameters, place))
        },
    );
}

#[test]
fn derivatives_at_a_rigid_lever_agree_with_num_dual() {
    let (sections, trial) = (sections(), ramp(2.6));
    let of_a_rigid_lever = |kind: &MechanismKind| !kind.needs().contains(&DataRequirement::Lever);
    for kinds in models().into_iter().filter(|kinds| kinds.iter().all(of_a_rigid_lever)) {
        let parameters = parameters_of(&kinds);
        let wanted: Vec<usize> = estimated(&kinds).iter().map(|(_, place)| *place).collect();
        let settings = SimulationSettings { lever: None, ..settings(&kinds, &sections, &wanted) };
        let ours = run(&settings, &trial, &parameters);
        for (index, place) in wanted.iter().enumerate() {
            let oracle = by_num_dual::<2>(&settings, &trial, &parameters, *place);
            let error = relative(&column(&ours, wanted.len(), index), &oracle);
            assert!(error < 1e-8, "{kinds:?}, parameter {place}: {error:e}");
        }
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
