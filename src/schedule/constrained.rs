//! Random orders without long runs of one torque or one velocity; every order that satisfies the constraint is equally likely.
//!
//! Shuffling until the constraint holds would be uniform, but for short runs it takes too long: of the paper's 36 trials,
//! one shuffle in 10^11 has no two equal neighbours. So candidates come from two better proposals in turn, each of which
//! proposes every valid order with the same probability:
//!
//! 1. A uniform sequence of torques without long runs ([`RunLimited`]), then for each torque its velocities in random
//!    order (and the same with the roles exchanged, if there are fewer velocities than torques). Every order whose
//!    torques keep the rule comes out with the same probability, 1 / (sequences x arrangements); taken if its
//!    velocities keep the rule too.
//! 2. A uniform sequence of torques and an independent one of velocities, both without long runs. Every pair has the
//!    same probability; taken if each torque meets each velocity as often as there are repetitions.
//!
//! What is taken from either is uniform over the valid orders, so the first that is taken is as well.

use std::collections::HashMap;

use crate::random::Stream;

use super::error::DrawError;

/// Number of draws from both proposals before the constraint is given up; with 36 trials they take a few seconds.
const DRAWS: u32 = 300_000;

/// Largest number of states for which sequences are drawn exactly; above it, memory would be too large and plain
/// shuffles are drawn instead.
const MOST_STATES: f64 = 200_000.0;

/// Which trials to order, and how.
pub(super) struct ConstrainedDesign {
    pub velocities: usize,
    pub torques: usize,
    pub repetitions: usize,
    pub max_run: u32,
}

/// Draws an order; a condition's index counts its torques within its velocity.
pub(super) fn draw(design: &ConstrainedDesign, stream: &mut Stream) -> Result<Vec<usize>, DrawError> {
    let ConstrainedDesign { velocities, torques, repetitions, max_run } = *design;
    let mut of_torque = RunLimited::new(torques, velocities * repetitions, max_run);
    let mut of_velocity = RunLimited::new(velocities, torques * repetitions, max_run);
    for _ in 0..DRAWS {
        let torque = of_torque.sample(stream);
        let velocity = of_velocity.sample(stream);
        let (Some(torque), Some(velocity)) = (torque, velocity) else { continue };

        let first = if torques <= velocities {
            Labels {
                velocity: dealt(&torque, torques, velocities, repetitions, stream),
                torque: torque.clone(),
            }
        } else {
            Labels {
                torque: dealt(&velocity, velocities, torques, repetitions, stream),
                velocity: velocity.clone(),
            }
        };
        let second = Labels { velocity, torque };
        for labels in [first, second] {
            if labels.are_valid(design) {
                return Ok(labels.conditions(torques));
            }
        }
    }
    Err(DrawError::RunsTooShort { max_run, trials: velocities * torques * repetitions, draws: DRAWS })
}

/// Velocity and torque of each trial, as indices.
struct Labels {
    velocity: Vec<usize>,
    torque: Vec<usize>,
}

impl Labels {
    fn conditions(&self, torques: usize) -> Vec<usize> {
        self.velocity.iter().zip(&self.torque).map(|(velocity, torque)| velocity * torques + torque).collect()
    }

    fn are_valid(&self, design: &ConstrainedDesign) -> bool {
        let mut counts = vec![0; design.velocities * design.torques];
        for condition in self.conditions(design.torques) {
            counts[condition] += 1;
        }
        counts.iter().all(|count| *count == design.repetitions)
            && longest_run(&self.torque) <= design.max_run as usize
            && longest_run(&self.velocity) <= design.max_run as usize
    }
}

/// Deals to the places of each label its share of the other kind, in random order.
fn dealt(
    labels: &[usize],
    kinds: usize,
    other_kinds: usize,
    repetitions: usize,
    stream: &mut Stream,
) -> Vec<usize> {
    let mut hands: Vec<Vec<usize>> = (0..kinds)
        .map(|_| {
            let mut hand: Vec<usize> = (0..repetitions).flat_map(|_| 0..other_kinds).collect();
            stream.shuffle(&mut hand);
            hand
        })
        .collect();
    labels.iter().filter_map(|label| hands[*label].pop()).collect()
}

fn longest_run(labels: &[usize]) -> usize {
    labels.chunk_by(|a, b| a == b).map(<[usize]>::len).max().unwrap_or(0)
}

/// Uniform sequences of `labels` labels, `each` of every one, with at most `max_run` of one in a row.
///
/// The labels are drawn one after the other. A shuffle would take a label with a probability in proportion to how many
/// of it are left; given that the sequence must turn out valid, this is weighted with the chance that a shuffle of what
/// is left then stays valid, [`RunLimited::chance`]. The product of these conditional probabilities is that of a
/// shuffle given that it is valid: uniform.
struct RunLimited {
    labels: usize,
    each: usize,
    max_run: u32,
    /// `None` if there are too many states to keep: then sequences are shuffled and may be invalid.
    chances: Option<HashMap<RemainingLabels, f64>>,
}

/// The trials still to place: the chance of success depends on nothing else, as the labels are exchangeable.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct RemainingLabels {
    /// How many are left of the label placed last, and how many of it stand in a row.
    last: usize,
    run: u32,
    /// How many are left of the others, sorted.
    others: Vec<usize>,
}

impl RunLimited {
    fn new(labels: usize, each: usize, max_run: u32) -> Self {
        // Multisets of the numbers left, times the label placed last and the length of its run.
        let multisets: f64 = (1..=labels).map(|i| (each + i) as f64 / i as f64).product();
        let states = multisets * labels as f64 * f64::from(max_run.min(each as u32));
        let chances = (states <= MOST_STATES).then(HashMap::new);
        Self { labels, each, max_run, chances }
    }

    /// A sequence, or `None` if there is none.
    fn sample(&mut self, stream: &mut Stream) -> Option<Vec<usize>> {
        let Some(mut chances) = self.chances.take() else {
            let mut sequence: Vec<usize> = (0..self.each).flat_map(|_| 0..self.labels).collect();
            stream.shuffle(&mut sequence);
            return Some(sequence);
        };
        let sequence = self.sample_exactly(&mut chances, stream);
        self.chances = Some(chances);
        sequence
    }

    fn sample_exactly(
        &self,
        chances: &mut HashMap<RemainingLabels, f64>,
        stream: &mut Stream,
    ) -> Option<Vec<usize>> {
        let mut left = vec![self.each; self.labels];
        let mut sequence: Vec<usize> = Vec::with_capacity(self.labels * self.each);
        let mut run = 0;
        for _ in 0..self.labels * self.each {
            let last = sequence.last().copied();
            let weights: Vec<f64> = (0..self.labels)
                .map(|label| {
                    let next_run = if last == Some(label) { run + 1 } else { 1 };
                    self.weight(&left, label, next_run, chances)
                })
                .collect();
            let label = pick(&weights, stream.uniform())?;
            run = if last == Some(label) { run + 1 } else { 1 };
            left[label] -= 1;
            sequence.push(label);
        }
        Some(sequence)
    }

    /// How many of a label are left, times the chance of success if one of them is placed.
    fn weight(
        &self,
        left: &[usize],
        label: usize,
        run: u32,
        chances: &mut HashMap<RemainingLabels, f64>,
    ) -> f64 {
        if left[label] == 0 || run > self.max_run {
            return 0.0;
        }
        let mut others: Vec<usize> =
            left.iter().enumerate().filter(|(other, _)| *other != label).map(|(_, count)| *count).collect();
        others.sort_unstable();
        left[label] as f64 * self.chance(RemainingLabels { last: left[label] - 1, run, others }, chances)
    }

    /// The chance that a shuffle of the remaining trials keeps the rule.
    fn chance(&self, state: RemainingLabels, chances: &mut HashMap<RemainingLabels, f64>) -> f64 {
        let total = state.last + state.others.iter().sum::<usize>();
        if total == 0 {
            return 1.0;
        }
        if let Some(chance) = chances.get(&state) {
            return *chance;
        }
        let mut left = state.others.clone();
        left.push(state.last);
        let last = left.len() - 1;
        let mut sum = self.weight(&left, last, state.run + 1, chances);
        for other in 0..last {
            sum += self.weight(&left, other, 1, chances);
        }
        let chance = sum / total as f64;
        chances.insert(state, chance);
        chance
    }
}

/// An index with a probability in proportion to its weight; `None` if all are zero.
fn pick(weights: &[f64], uniform: f64) -> Option<usize> {
    let mut rest = uniform * weights.iter().sum::<f64>();
    let possible = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
    let mut picked = None;
    for (index, weight) in possible {
        picked = Some(index);
        if rest < *weight {
            break;
        }
        rest -= weight;
    }
    picked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_design_can_do_without_any_neighbours_alike() {
        let design = ConstrainedDesign { velocities: 4, torques: 3, repetitions: 3, max_run: 1 };
        let order = draw(&design, &mut Stream::new(1, "order")).unwrap();
        let torques: Vec<usize> = order.iter().map(|condition| condition % 3).collect();
        let velocities: Vec<usize> = order.iter().map(|condition| condition / 3).collect();
        assert_eq!((longest_run(&torques), longest_run(&velocities)), (1, 1));
    }

    #[test]
    fn sequences_are_drawn_with_the_chance_of_a_shuffle_to_be_valid() {
        // aabb: 6 shuffles, of which abab and baba have no neighbours alike, and abba and baab besides have runs of 2.
        let limited = |max_run| RunLimited::new(2, 2, max_run);
        let start = RemainingLabels { last: 0, run: 0, others: vec![2, 2] };
        for (max_run, expected) in [(1, 2.0 / 6.0), (2, 1.0)] {
            let chance = limited(max_run).chance(start.clone(), &mut HashMap::new());
            assert!((chance - expected).abs() < 1e-15, "runs of {max_run}: {chance}");
        }
    }

    #[test]
    fn an_impossible_rule_is_an_error() {
        // After (v1, t1) only (v2, t2) differs in both, and after that only (v1, t1) again.
        let design = ConstrainedDesign { velocities: 2, torques: 2, repetitions: 1, max_run: 1 };
        let error = draw(&design, &mut Stream::new(1, "order")).unwrap_err();
        assert_eq!(error, DrawError::RunsTooShort { max_run: 1, trials: 4, draws: DRAWS });
    }
}
