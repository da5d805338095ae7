//! Probabilities of hypotheses that exclude each other.

/// Probabilities that add up to one, from the logarithms of weights; and the logarithm of the sum of the weights. However small or large
/// the weights are, they neither vanish nor overflow.
pub fn probabilities(log_weights: &[f64]) -> (Vec<f64>, f64) {
    let most = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut relative: Vec<f64> = log_weights.iter().map(|own| libm::exp(own - most)).collect();
    let sum: f64 = relative.iter().sum();
    relative.iter_mut().for_each(|own| *own /= sum);
    (relative, most + libm::log(sum))
}

#[cfg(test)]
mod tests {
    use super::probabilities;

    #[test]
    fn weights_beyond_the_range_of_numbers_have_the_same_probabilities_as_small_ones() {
        for base in [0.0, -3000.0, 3000.0] {
            let (found, log_sum) = probabilities(&[base, base + 3.0f64.ln(), f64::NEG_INFINITY]);
            assert!((found[0] - 0.25).abs() < 1e-12 && (found[1] - 0.75).abs() < 1e-12, "{found:?}");
            assert_eq!(found[2], 0.0);
            assert!((log_sum - base - 4.0f64.ln()).abs() < 1e-12, "{log_sum}");
        }
    }
}
