//! Order statistics.

/// Upper median of `values`; `None` of nothing.
pub fn upper_median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::upper_median;

    #[test]
    fn the_upper_median_is_the_middle_value_or_the_higher_of_two() {
        assert_eq!(upper_median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(upper_median([4.0, 1.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(upper_median([]), None);
    }
}
