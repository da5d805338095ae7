//! A friction that gives before it slides.

/// How far such a friction has built up, -1 to 1, after a way in one direction on which it started at `built_up` (Dahl 1976, with the exponent
/// 1): dz/dx = (sign of the speed - z) / travel. Exact.
pub fn built_up_friction(built_up: f64, way_rad: f64, travel_rad: f64) -> f64 {
    let towards = way_rad.signum();
    towards + (built_up - towards) * libm::exp(-way_rad.abs() / travel_rad)
}
