//! Grouping of measured speeds and torques into the conditions that were meant.

/// Values that differ by less than this part of the larger one are of one group.
const SAME: f64 = 0.12;

/// Values that differ by less than this are of one group, whatever their size.
const SAME_ABSOLUTE: f64 = 0.05;

/// Two levels are told apart where the gap between them is this many times wider than each of them. Two pairs of values that only scatter
/// look like two levels in 1.5 % of cases: 2 / ((1 + r) (2 + r)), if the gaps have an exponential distribution. More values do so less often.
const CLEAR: f64 = 10.0;

/// The group of each value: the median of the values that lie next to each other without a gap, with two digits.
///
/// Values that pass for one group, but form several with gaps far wider than any of them, are those several: levels that a protocol chose
/// close together.
pub fn grouped(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut groups = vec![0.0; values.len()];
    let is_next = |a: &usize, b: &usize| {
        let (low, high) = (values[*a], values[*b]);
        high - low < SAME_ABSOLUTE.max(SAME * high.abs().max(low.abs()))
    };
    for group in order.chunk_by(is_next).flat_map(|group| levels(group, values)) {
        let middle = rounded(values[group[group.len() / 2]]);
        group.iter().for_each(|index| groups[*index] = middle);
    }
    groups
}

/// The levels of a group whose places are in the order of their values: parts of several values each, all far narrower than every gap between
/// them. One level if there are no such parts.
fn levels<'a>(group: &'a [usize], values: &[f64]) -> Vec<&'a [usize]> {
    let gap = |pair: &[usize]| values[pair[1]] - values[pair[0]];
    let mut gaps: Vec<f64> = group.windows(2).map(gap).filter(|own| *own > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    // The number of levels is where the gaps, by size, make their largest step.
    let step = gaps.windows(2).map(|pair| pair[1] / pair[0]).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((place, _)) = step else { return vec![group] };
    let least = gaps[place + 1];
    let parts: Vec<&[usize]> = group.chunk_by(|a, b| values[*b] - values[*a] < least).collect();
    let width = |part: &[usize]| values[part[part.len() - 1]] - values[part[0]];
    let are_levels = parts.iter().all(|part| part.len() > 1 && CLEAR * width(part) < least);
    if are_levels { parts } else { vec![group] }
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
        // Scattered values without levels.
        assert_eq!(grouped(&[1.00, 1.03, 1.05, 1.09, 1.10, 1.13]), [1.1; 6]);
        assert_eq!(repetitions(&[(1.3, 0.9), (3.3, 0.9), (1.3, 0.9)]), [1, 1, 2]);
    }

    /// Five velocities within a sixth of each other became one condition of 2.4 rad/s.
    #[test]
    fn levels_that_a_protocol_chose_close_together_are_conditions_of_their_own() {
        let speeds = [2.001, 2.198, 2.402, 2.703, 2.998, 2.004, 2.202, 2.397, 2.697, 3.003];
        let levels = [2.0, 2.2, 2.4, 2.7, 3.0, 2.0, 2.2, 2.4, 2.7, 3.0];
        assert_eq!(grouped(&speeds), levels);
        // Two levels of torque that a person holds are not told from one.
        assert_eq!(grouped(&[0.90, 0.93, 0.98, 1.00]), [0.98; 4]);
    }
}
