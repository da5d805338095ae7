//! The step of the encoder behind a recorded angle.

/// Size of the encoder's step: the smallest difference between two samples in a row that is not zero. Of an angle without steps it is
/// next to nothing, and so is the error that follows from it.
pub fn smallest_step<'a>(angles: impl Iterator<Item = &'a [f64]>) -> f64 {
    let largest = |values: &[f64]| values.iter().fold(0.0, |far: f64, value| far.max(value.abs()));
    let mut smallest = f64::INFINITY;
    for angle in angles {
        // Differences of rounding are no steps.
        let rounding = 4.0 * f64::EPSILON * largest(angle);
        for pair in angle.windows(2) {
            let step = (pair[1] - pair[0]).abs();
            if step > rounding {
                smallest = smallest.min(step);
            }
        }
    }
    if smallest.is_finite() { smallest } else { 0.0 }
}
