//! The states that a mechanism has in the torque channel, from step to step.

use super::batch::MAX_LANES;
use super::linear_response::{FORCE, TAYLOR_WEIGHTS, TERMS};
use super::mechanisms::MAX_CHANNEL_STATES;
use super::past_values::PastValues;
use crate::number::{Lanes, Number};

/// Greatest norm of the rates times the length of a part of a step. The terms that the series leaves out are below 1e-8 of the sum.
const LONGEST_PART: f64 = 2.0;

/// Most parts of a step.
const MOST_PARTS: f64 = 4096.0;

/// Rates of the states for a unit of each state, by its index, and for a unit of torque, by the index after these.
pub(super) type RatesByCause<T> = [[T; MAX_CHANNEL_STATES]; MAX_CHANNEL_STATES + 1];

/// States x' = A x + b u of the torque u, over steps of one length. The torque over a step is the cubic through its values at the ends of
/// this step and the two before; for such a torque the states are exact.
///
/// Fast states divide a step into equal parts; each lane has a number of its own.
#[derive(Debug, Clone)]
pub(super) struct ChannelStates<T: Number> {
    count: usize,
    /// From a state, by column, to the state a part later, by row.
    transition: [[T; MAX_CHANNEL_STATES]; MAX_CHANNEL_STATES],
    /// From the coefficients of the torque over a part.
    input: [[T; FORCE]; MAX_CHANNEL_STATES],
    /// Length of a part, as a fraction of the step.
    part: T::Plain,
    /// Parts of a step, in each lane and in the lane that has most.
    parts: T::Plain,
    most_parts: usize,
    torque: PastValues<T>,
    state: [T; MAX_CHANNEL_STATES],
}

impl<T: Number> ChannelStates<T> {
    /// Of `count` states. `causes` holds their rates (1/s) for a unit of each state, and after these for a unit of torque, 1 N m.
    #[inline(always)]
    pub fn new(count: usize, step_s: f64, mut causes: RatesByCause<T>) -> Self {
        let zero = T::constant(0.0);
        let rest = [zero; MAX_CHANNEL_STATES];
        let mut parts = [1.0; MAX_LANES];
        let mut most_parts = 1;
        let mut lane = 0;
        while lane < T::Plain::LANES {
            let mut norm: f64 = 0.0;
            let mut row = 0;
            while row < count {
                let mut sum = 0.0;
                let mut column = 0;
                while column < count {
                    sum += causes[column][row].plain().lane(lane).abs();
                    column += 1;
                }
                norm = norm.max(sum);
                row += 1;
            }
            parts[lane] = libm::ceil(norm * step_s / LONGEST_PART).clamp(1.0, MOST_PARTS);
            most_parts = most_parts.max(parts[lane] as usize);
            lane += 1;
        }
        let parts = T::Plain::load(&parts);
        let part = T::Plain::splat(1.0) / parts;
        let length_s = T::Plain::splat(step_s) * part;
        let mut column = 0;
        while column <= count {
            let mut row = 0;
            while row < count {
                causes[column][row] = causes[column][row].times(length_s);
                row += 1;
            }
            column += 1;
        }
        let mut states = Self {
            count,
            transition: [rest; MAX_CHANNEL_STATES],
            input: [[zero; FORCE]; MAX_CHANNEL_STATES],
            part,
            parts,
            most_parts,
            torque: PastValues::zero(),
            state: rest,
        };
        states.fill(&causes);
        states
    }

    /// Sums the series of the solution, as for the [`LinearResponse`](super::linear_response::LinearResponse).
    #[inline(always)]
    fn fill(&mut self, causes: &RatesByCause<T>) {
        let count = self.count;
        let mut cause = 0;
        while cause <= count {
            let mut power = [T::constant(0.0); MAX_CHANNEL_STATES];
            if cause < count {
                power[cause] = T::constant(1.0);
            } else {
                power = causes[count];
            }
            let mut term = 0;
            while term < TERMS {
                let mut next = [T::constant(0.0); MAX_CHANNEL_STATES];
                let mut row = 0;
                while row < count {
                    if cause < count {
                        self.transition[row][cause] =
                            self.transition[row][cause].add_scaled(power[row], TAYLOR_WEIGHTS[term]);
                    } else {
                        let mut degree = 0;
                        let mut factorial = 1.0;
                        while degree < FORCE {
                            let weight = factorial * TAYLOR_WEIGHTS[term + degree + 1];
                            self.input[row][degree] = self.input[row][degree].add_scaled(power[row], weight);
                            degree += 1;
                            factorial *= degree as f64;
                        }
                    }
                    let mut column = 0;
                    while column < count {
                        next[row] = next[row] + causes[column][row] * power[column];
                        column += 1;
                    }
                    row += 1;
                }
                power = next;
                term += 1;
            }
            cause += 1;
        }
    }

    /// The states now.
    #[inline(always)]
    pub fn state(&self) -> &[T] {
        &self.state[..self.count]
    }

    /// Goes on to the end of the next step, where the torque is `torque`.
    #[inline(always)]
    pub fn advance(&mut self, torque: T) {
        let [a, b, c, d] = self.torque.until(torque);
        self.torque.push(torque);
        let (one, zero) = (T::Plain::splat(1.0), T::Plain::splat(0.0));
        let (by_2, by_3) = (T::Plain::splat(2.0), T::Plain::splat(3.0));
        let length = self.part;
        let mut number = 0;
        while number < self.most_parts {
            // The torque as a polynomial in the fraction of this part.
            let number_of_part = T::Plain::splat(number as f64);
            let x = number_of_part * length;
            let of_part = [
                a + b.times(x) + c.times(x * x) + d.times(x * x * x),
                (b + c.times(by_2 * x) + d.times(by_3 * x * x)).times(length),
                (c + d.times(by_3 * x)).times(length * length),
                d.times(length * length * length),
            ];
            // A lane with fewer parts is at the end of the step already.
            let moves = (self.parts - number_of_part).where_positive(one, zero);
            let mut next = self.state;
            let mut row = 0;
            while row < self.count {
                let mut sum = T::constant(0.0);
                let mut column = 0;
                while column < self.count {
                    sum = sum + self.transition[row][column] * self.state[column];
                    column += 1;
                }
                let mut degree = 0;
                while degree < FORCE {
                    sum = sum + self.input[row][degree] * of_part[degree];
                    degree += 1;
                }
                next[row] = sum.times(moves) + self.state[row].times(one - moves);
                row += 1;
            }
            self.state = next;
            number += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A low-pass of first order and one of second, of which the slower has one part and the faster many.
    #[test]
    fn states_follow_a_cubic_torque_exactly() {
        let step_s = 4e-4;
        let torque = |t: f64| 0.3 - 40.0 * t + 9e4 * t * t - 3e7 * t * t * t;
        for (rate, quality) in [(300.0, None), (300.0, Some(0.6)), (2e4, None), (2e4, Some(0.577))] {
            // y + y'/w + q y''/w2 = u.
            let q = quality.map_or(0.0, |quality| quality * quality);
            let (mut of_output, mut of_slope, mut of_torque) = ([0.0; 4], [0.0; 4], [0.0; 4]);
            match quality {
                None => (of_output[0], of_torque[0]) = (-rate, rate),
                Some(_) => {
                    of_slope[0] = rate;
                    (of_output[1], of_slope[1], of_torque[1]) = (-rate / q, -rate / q, rate / q);
                }
            }
            let causes = [of_output, of_slope, of_torque, [0.0; 4], [0.0; 4]];
            let mut states = ChannelStates::<f64>::new(2, step_s, causes);
            // A response that has settled is the torque less its slopes.
            let settled = |t: f64| {
                let (first, second, third) = (-40.0 + 1.8e5 * t - 9e7 * t * t, 1.8e5 - 1.8e8 * t, -1.8e8);
                torque(t) - first / rate + (1.0 - q) * second / (rate * rate)
                    - (1.0 - 2.0 * q) * third / (rate * rate * rate)
            };
            let start = -400.0 * step_s;
            for step in 0..400 {
                states.advance(torque(start + f64::from(step + 1) * step_s));
            }
            let error = states.state()[0] - settled(0.0);
            assert!(error.abs() < 1e-8 * settled(0.0).abs(), "{rate} 1/s, {quality:?}: {error:e}");
        }
    }
}
