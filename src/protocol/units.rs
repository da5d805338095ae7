//! Numbers that are right in another unit: velocities in degrees, times in milliseconds.

use std::f64::consts::PI;

/// Ending of a field's name, its unit, the unit it is mistaken for, and how much one of those is.
const CONFUSIONS: [(&str, &str, &str, f64); 10] = [
    ("_rad_s2", "rad/s2", "deg/s2", PI / 180.0),
    ("_rad_s", "rad/s", "deg/s", PI / 180.0),
    ("_rad", "rad", "degrees", PI / 180.0),
    ("_nm", "N m", "mN m", 1e-3),
    ("_nm", "N m", "N cm", 1e-2),
    ("_s", "s", "ms", 1e-3),
    ("_hz", "Hz", "kHz", 1e3),
    ("_fraction", "as a fraction", "percent", 1e-2),
    ("_mvc", "of MVC", "percent", 1e-2),
    ("_s", "s", "min", 60.0),
];

/// What a number out of its range looks like: the other unit in which it would be in range, and of several the one
/// that brings it nearest to 1, where the quantities of a wrist are.
pub(super) fn mistaken_unit(path: &str, value: f64, in_range: impl Fn(f64) -> bool) -> Option<String> {
    let field = path.rsplit('.').next().unwrap_or(path).split('[').next().unwrap_or(path);
    let quantity = CONFUSIONS.iter().find(|(ending, ..)| field.ends_with(ending))?.0;
    let candidates =
        CONFUSIONS.iter().filter(|(ending, .., factor)| *ending == quantity && in_range(value * factor));
    let from_one = |factor: f64| libm::log10((value * factor).abs()).abs();
    let (_, unit, other, factor) = candidates.min_by(|a, b| from_one(a.3).total_cmp(&from_one(b.3)))?;
    Some(format!("this looks like {other}: {value} {other} is {} {unit}", significant(value * factor)))
}

/// A number from this size on is written with an exponent, for people.
const LARGEST_WRITTEN_OUT: f64 = 1e9;

/// Four significant digits, for people.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if value.abs() >= LARGEST_WRITTEN_OUT {
        return format!("{value:.3e}");
    }
    let decimals = (3 - libm::log10(value.abs()).floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A duration in s as minutes and seconds: `2 min 05 s`.
pub fn minutes(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    format!("{} min {:02} s", seconds / 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_nobody_could_read_is_written_with_an_exponent() {
        assert_eq!([1.5e160, -2e9, 123_456_789.0].map(significant), ["1.500e160", "-2.000e9", "123456789"]);
    }

    #[test]
    fn a_velocity_in_degrees_and_a_torque_in_millinewton_metres_are_recognised() {
        let below_20 = |value: f64| value.abs() <= 20.0;
        let velocity = mistaken_unit("velocities_rad_s[2]", 130.0, below_20);
        assert_eq!(velocity.as_deref(), Some("this looks like deg/s: 130 deg/s is 2.269 rad/s"));
        let torque = mistaken_unit("order.trials[0].torque_nm", 900.0, below_20);
        assert_eq!(torque.as_deref(), Some("this looks like mN m: 900 mN m is 0.9 N m"));
        let torque = mistaken_unit("torques_nm[0]", 90.0, below_20);
        assert_eq!(torque.as_deref(), Some("this looks like N cm: 90 N cm is 0.9 N m"));
    }

    #[test]
    fn a_number_that_fits_no_other_unit_looks_like_nothing() {
        assert_eq!(mistaken_unit("velocities_rad_s[2]", 1e9, |value| value <= 20.0), None);
        assert_eq!(mistaken_unit("repetitions", 1e9, |_| true), None);
    }

    #[test]
    fn numbers_for_people_have_four_digits() {
        assert_eq!(significant(255.254_403_1), "255.3");
        assert_eq!(significant(0.043_076_923), "0.04308");
        assert_eq!(significant(12_345.6), "12346");
        assert_eq!(significant(-2.0), "-2");
    }
}
