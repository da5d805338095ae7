//! What a p-value says at most against the hypothesis that it tests.

/// Largest probability, after a test with this p-value, of what the test looks for, whose probability was `prior` before.
pub fn largest_posterior(prior: f64, p_value: f64) -> f64 {
    let odds = prior / (1.0 - prior) * largest_bayes_factor(p_value);
    odds / (1.0 + odds)
}

/// Largest Bayes factor against a hypothesis that its p-value allows, 1 / (-e p log p); 1 from p = 1/e on (Sellke, Bayarri and Berger
/// 2001).
fn largest_bayes_factor(p_value: f64) -> f64 {
    let p = p_value.clamp(f64::MIN_POSITIVE, (-1.0f64).exp());
    1.0 / (-std::f64::consts::E * p * libm::log(p))
}

#[cfg(test)]
mod tests {
    use super::{largest_bayes_factor, largest_posterior};

    #[test]
    fn the_bound_is_that_of_the_paper_and_never_favours_the_hypothesis() {
        // Table 1 of Sellke, Bayarri and Berger 2001, as 1 / B.
        for (p_value, bound) in [(0.1, 0.6259), (0.05, 0.4072), (0.01, 0.1252), (0.001, 0.0188)] {
            assert!((1.0 / largest_bayes_factor(p_value) - bound).abs() < 1e-4, "{p_value}");
        }
        for p_value in [0.4, 1.0] {
            assert!((largest_bayes_factor(p_value) - 1.0).abs() < 1e-12, "{p_value}");
        }
        assert!(largest_bayes_factor(0.0).is_finite());
        assert!((largest_posterior(0.1, 0.5) - 0.1).abs() < 1e-12, "nothing learnt");
    }
}
