//! The torque that the yield takes away (Eq. 2), and how fast it changes.

use super::linear_response::FORCE;
use super::plant::{Plant, YIELD_SMOOTHNESS_PER_NM};
use crate::number::{Jet, Number, Plain};

/// Indices of the derivatives by k_dec and x_e in the base model.
const DECREMENT: usize = 4;
const LIMIT: usize = 5;

/// Below minus this, log(1 + exp(x)) and its slope count as zero. They are below 3e-9 there, less than 1e-10 N m.
const SILENT: f64 = 20.0;

/// The torque that the yield takes away at one time, N m, and its change per step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loss<P, const ALL: usize> {
    pub torque: Jet<P, ALL>,
    pub rate: Jet<P, ALL>,
}

impl<P: Plain, const ALL: usize> Loss<P, ALL> {
    /// Nothing is taken away.
    #[inline(always)]
    pub fn none() -> Self {
        Self { torque: Jet::constant(0.0), rate: Jet::constant(0.0) }
    }

    /// Over a step that ends at `end`: the cubic in its fraction with the values and slopes at both ends.
    #[inline(always)]
    pub fn until(&self, end: &Self) -> [Jet<P, ALL>; FORCE] {
        let Self { torque, rate } = *self;
        let rise = end.torque - torque;
        [torque, rate, rise.scale(3.0) - rate.scale(2.0) - end.rate, rate + end.rate - rise.scale(2.0)]
    }
}

/// How much the yield takes away at an angle and a speed of the joint.
pub(super) trait YieldLoss<P: Plain, const ALL: usize> {
    /// Whether it takes anything away at the joint angle `angle`, rad, in any lane.
    fn is_near(&self, angle: P) -> bool;

    /// What it takes away at this angle, rad, and speed, rad per step.
    fn at(&self, angle: Jet<P, ALL>, speed: Jet<P, ALL>) -> Loss<P, ALL>;
}

/// The yield of the base model, whose derivatives by k_dec and x_e are those by parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct BaseYield<P, const ALL: usize> {
    /// a_s k_dec, k_dec and x_e.
    slope: P,
    decrement: P,
    elastic_limit: P,
    /// log(1 + exp(-a_s k_dec x_e)): Eq. 2 as a change from the steady state.
    at_rest: Jet<P, ALL>,
}

impl<P: Plain, const ALL: usize> BaseYield<P, ALL> {
    /// `parameters` are the six of the base model.
    #[inline(always)]
    pub fn new(parameters: &[P]) -> Self {
        let decrement = Jet::<P, ALL>::variable(parameters[DECREMENT], DECREMENT);
        let limit = Jet::<P, ALL>::variable(parameters[LIMIT], LIMIT);
        let slope = decrement.scale(YIELD_SMOOTHNESS_PER_NM);
        Self {
            slope: slope.value,
            decrement: decrement.value,
            elastic_limit: limit.value,
            at_rest: (-(slope * limit)).softplus(),
        }
    }
}

impl<P: Plain, const ALL: usize> YieldLoss<P, ALL> for BaseYield<P, ALL> {
    #[inline(always)]
    fn is_near(&self, angle: P) -> bool {
        (self.slope * (angle - self.elastic_limit) + P::splat(SILENT)).any_positive()
    }

    #[inline(always)]
    fn at(&self, angle: Jet<P, ALL>, speed: Jet<P, ALL>) -> Loss<P, ALL> {
        let past = angle.value - self.elastic_limit;
        let beyond = angle
            .times(self.slope)
            .with_slope(DECREMENT, past * P::splat(YIELD_SMOOTHNESS_PER_NM))
            .with_slope(LIMIT, -self.slope);
        let beyond = Jet { value: self.slope * past, slope: beyond.slope };
        let is_near = beyond.value + P::splat(SILENT);
        let (one, zero) = (P::splat(1.0), P::splat(0.0));
        let counts = is_near.where_positive(one, zero);
        let (softplus, logistic) = P::softplus_and_slope(beyond.value);
        let value = beyond.chain(softplus, logistic);
        let torque = (value - self.at_rest).times(counts * P::splat(1.0 / YIELD_SMOOTHNESS_PER_NM));
        // d/dx of the torque is k_dec logistic(beyond) times the speed.
        let part = beyond.chain(logistic, logistic * (one - logistic));
        let stiffness = part.times(self.decrement).with_slope(DECREMENT, part.value);
        let rate = (stiffness * speed).times(counts);
        Loss { torque, rate }
    }
}

/// The yield of a plant as mechanisms may have altered it.
#[derive(Debug, Clone, Copy)]
pub(super) struct AlteredYield<P, const ALL: usize> {
    /// a_s k_dec, k_dec, x_e and 1 / a_s.
    slope: Jet<P, ALL>,
    decrement: Jet<P, ALL>,
    elastic_limit: Jet<P, ALL>,
    inverse_smoothness: Jet<P, ALL>,
    /// log(1 + exp(-a_s k_dec x_e)).
    at_rest: Jet<P, ALL>,
}

impl<P: Plain, const ALL: usize> AlteredYield<P, ALL> {
    #[inline(always)]
    pub fn new(plant: &Plant<Jet<P, ALL>>) -> Self {
        let slope = plant.smoothness * plant.stiffness_decrement;
        Self {
            slope,
            decrement: plant.stiffness_decrement,
            elastic_limit: plant.elastic_limit,
            inverse_smoothness: Jet::constant(1.0) / plant.smoothness,
            at_rest: (-(slope * plant.elastic_limit)).softplus(),
        }
    }

    /// a_s k_dec (theta_j - x_e), without unit.
    #[inline(always)]
    pub fn beyond(&self, angle: Jet<P, ALL>) -> Jet<P, ALL> {
        self.slope * (angle - self.elastic_limit)
    }
}

impl<P: Plain, const ALL: usize> YieldLoss<P, ALL> for AlteredYield<P, ALL> {
    #[inline(always)]
    fn is_near(&self, angle: P) -> bool {
        (self.slope.value * (angle - self.elastic_limit.value) + P::splat(SILENT)).any_positive()
    }

    #[inline(always)]
    fn at(&self, angle: Jet<P, ALL>, speed: Jet<P, ALL>) -> Loss<P, ALL> {
        let (one, zero) = (P::splat(1.0), P::splat(0.0));
        let beyond = self.beyond(angle);
        let counts = (beyond.value + P::splat(SILENT)).where_positive(one, zero);
        let (softplus, logistic) = P::softplus_and_slope(beyond.value);
        let torque = self.inverse_smoothness * (beyond.chain(softplus, logistic) - self.at_rest);
        let stiffness = self.decrement * beyond.chain(logistic, logistic * (one - logistic));
        Loss { torque: torque.times(counts), rate: (stiffness * speed).times(counts) }
    }
}
