//! How many floating-point operations a simulation asks for: the model run over numbers that count.

use std::cell::Cell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use ramphold::number::{Lanes, Number, Plain};
use ramphold::wrist::{SimulatedTorque, VectorWidth, simulate_over};

use crate::problem::Problem;

thread_local! {
    static DONE: Cell<u64> = const { Cell::new(0) };
}

/// A number that counts what is done with it: each addition, multiplication, division or change of sign is one.
#[derive(Debug, Clone, Copy)]
struct Counting(f64);

fn counted(value: f64) -> Counting {
    DONE.set(DONE.get() + 1);
    Counting(value)
}

macro_rules! operator {
    ($trait:ident, $method:ident, $sign:tt) => {
        impl $trait for Counting {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                counted(self.0 $sign other.0)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Neg for Counting {
    type Output = Self;
    fn neg(self) -> Self {
        counted(-self.0)
    }
}

impl Number for Counting {
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
    fn chain(self, value: Self, _slope: Self) -> Self {
        value
    }
}

impl Plain for Counting {}

impl Lanes for Counting {
    const LANES: usize = 1;
    fn splat(value: f64) -> Self {
        Self(value)
    }
    fn load(values: &[f64]) -> Self {
        Self(values[0])
    }
    fn lane(self, _: usize) -> f64 {
        self.0
    }
    fn max(self, other: Self) -> Self {
        Self(Lanes::max(self.0, other.0))
    }
    fn min(self, other: Self) -> Self {
        Self(Lanes::min(self.0, other.0))
    }
    /// A multiplication and an addition.
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        counted(0.0);
        counted(self.0.mul_add(factor.0, addend.0))
    }
    fn any_positive(self) -> bool {
        self.0 > 0.0
    }
    fn where_positive(self, yes: Self, no: Self) -> Self {
        if self.0 > 0.0 { yes } else { no }
    }
    fn times_power_of_two(self, shifted: Self) -> Self {
        Self(self.0.times_power_of_two(shifted.0))
    }
}

/// Operations of one simulation, and of one with six sensitivities.
pub fn of_a_simulation(problem: &Problem) -> (u64, u64) {
    (count(problem, &[]), count(problem, &[0, 1, 2, 3, 4, 5]))
}

/// What a trial of the base model does, from its first sample to its last.
fn count(problem: &Problem, wanted: &[usize]) -> u64 {
    DONE.set(0);
    simulate_over::<Counting>(
        &problem.request(VectorWidth::One, wanted),
        &[&problem.prepared.trials[0].input],
        &problem.start_parameters()[0],
        &mut SimulatedTorque::default(),
    );
    DONE.get()
}
