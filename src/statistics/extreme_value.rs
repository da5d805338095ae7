//! Tail of the largest of many statistics, from simulated maxima.

/// Smallest p-value that [`gumbel_tail`] returns, in units of the inverse number of maxima: the fitted distribution is not trusted
/// further out in its tail. Assumed.
const SMALLEST_TAIL: f64 = 0.05;

/// Probability of a maximum at least as large as `value`: the Gumbel distribution with mean and variance of the `simulated` maxima.
///
/// The result is at least 0.05 / n for n simulated maxima. It is NaN where `value` or one of the maxima is: nothing is known then.
pub fn gumbel_tail(simulated: &[f64], value: f64) -> f64 {
    if value.is_nan() || simulated.iter().any(|own| own.is_nan()) {
        return f64::NAN;
    }
    let count = simulated.len() as f64;
    let mean = simulated.iter().sum::<f64>() / count;
    let variance = simulated.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (count - 1.0);
    const EULER: f64 = 0.577_215_664_901_532_9;
    let scale = libm::sqrt(6.0 * variance) / std::f64::consts::PI;
    if scale == 0.0 {
        return if value > mean { SMALLEST_TAIL / count } else { 1.0 };
    }
    let reduced = (value - (mean - EULER * scale)) / scale;
    (-libm::expm1(-libm::exp(-reduced))).max(SMALLEST_TAIL / count).min(1.0)
}
