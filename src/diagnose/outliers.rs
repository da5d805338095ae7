//! Trials whose stiffness is not that of their repetitions.

use super::across::Stiffnesses;
use crate::random::Stream;

/// A trial that does not belong, with its deviation in standard deviations of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the trial.
    pub trial: usize,
    /// Its stiffness over that of its repetitions.
    pub ratio: f64,
}

/// Trials whose stiffness is further from their repetitions than the spread of all allows, and the probability of the
/// furthest where all trials belong.
///
/// Each is compared with the nearest of the others of its condition; the spread is the median of these distances, which a
/// few outliers do not move. What the largest is by chance is simulated with the same conditions and repetitions.
pub fn outliers(data: &Stiffnesses, seed: u64) -> (Vec<Outlier>, f64) {
    let distances = distances(data, &data.logarithms);
    let spread = median(distances.iter().map(|d| d.abs()).collect());
    if spread <= 0.0 {
        return (Vec::new(), 1.0);
    }
    let mut stream = Stream::new(seed, "outliers");
    let mut maxima: Vec<f64> = (0..1000)
        .map(|_| {
            let normals: Vec<f64> = data.trials.iter().map(|_| stream.normal()).collect();
            let own = self::distances(data, &normals);
            let spread = median(own.iter().map(|d| d.abs()).collect());
            own.iter().map(|d| d.abs()).fold(0.0, f64::max) / spread
        })
        .collect();
    maxima.sort_by(f64::total_cmp);
    let beyond = |ratio: f64| {
        (maxima.iter().filter(|m| **m >= ratio).count() as f64 + 1.0) / (maxima.len() as f64 + 1.0)
    };
    let mut found = Vec::new();
    let mut left = data.without(&[]);
    // One at a time: an outlier taken away no longer spoils the comparison of its repetitions.
    while let Some((place, ratio)) = furthest(&left, spread) {
        if beyond(ratio) > 0.01 || found.len() * 4 > data.trials.len() {
            break;
        }
        let distance = self::distances(&left, &left.logarithms)[place];
        found.push(Outlier { trial: left.trials[place], ratio: libm::exp(distance) });
        left = left.without(&[left.trials[place]]);
    }
    let first = distances.iter().map(|d| d.abs()).fold(0.0, f64::max) / spread;
    (found, beyond(first))
}

fn furthest(data: &Stiffnesses, spread: f64) -> Option<(usize, f64)> {
    let distances = distances(data, &data.logarithms);
    let by_size = |a: &usize, b: &usize| distances[*a].abs().total_cmp(&distances[*b].abs());
    (0..distances.len()).max_by(by_size).map(|place| (place, distances[place].abs() / spread))
}

/// Each value less the nearest of the others of its condition.
fn distances(data: &Stiffnesses, values: &[f64]) -> Vec<f64> {
    (0..values.len())
        .map(|place| {
            let others: Vec<f64> = (0..values.len())
                .filter(|other| *other != place && data.conditions[*other] == data.conditions[place])
                .map(|other| values[other])
                .collect();
            if others.is_empty() {
                return 0.0;
            }
            // The mean of two would let one outlier make its neighbours look like two more.
            let nearest = others
                .iter()
                .copied()
                .min_by(|a, b| (a - values[place]).abs().total_cmp(&(b - values[place]).abs()));
            values[place] - nearest.unwrap_or(values[place])
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    if values.is_empty() { 0.0 } else { values[values.len() / 2] }
}
