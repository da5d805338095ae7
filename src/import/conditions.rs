//! Grouping of measured speeds and torques into the conditions that were meant.

/// Values that differ by less than this part of the larger one are of one group.
const SAME: f64 = 0.12;

/// Values that differ by less than this are of one group, whatever their size.
const SAME_ABSOLUTE: f64 = 0.05;

/// The group of each value: the median of the values that lie next to each other without a gap, with two digits.
pub fn grouped(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut groups = vec![0.0; values.len()];
    let is_next = |a: &usize, b: &usize| {
        let (low, high) = (values[*a], values[*b]);
        high - low < SAME_ABSOLUTE.max(SAME * high.abs().max(low.abs()))
    };
    for group in order.chunk_by(is_next) {
        let middle = rounded(values[group[group.len() / 2]]);
        group.iter().for_each(|index| groups[*index] = middle);
    }
    groups
}

/// Which repetition of its condition each trial is, from 1, in the order given.
pub fn repetitions(conditions: &[(f64, f64)]) -> Vec<u32> {
    let earlier =
        |index: usize| conditions[..index].iter().filter(|other| **other == conditions[index]).count();
    (0..conditions.len()).map(|index| earlier(index) as u32 + 1).collect()
}

/// A value with two digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let scale = libm::pow(10.0, 1.0 - libm::floor(libm::log10(value.abs())));
    libm::round(value * scale) / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_without_a_gap_are_one_condition() {
        let speeds = [1.31, 3.2, 1.29, 3.28, 1.33];
        assert_eq!(grouped(&speeds), [1.3, 3.3, 1.3, 3.3, 1.3]);
        assert_eq!(grouped(&[-0.01, 0.02, 0.9]), [0.02, 0.02, 0.9]);
        assert_eq!(repetitions(&[(1.3, 0.9), (3.3, 0.9), (1.3, 0.9)]), [1, 1, 2]);
    }
}
