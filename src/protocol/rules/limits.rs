//! Rules on limits: no trajectory may exceed a limit, and each ramp must last as long as the analysed window.

use super::context::Rules;
use crate::protocol::Sweep;
use crate::protocol::units::significant;

/// Inertia that a ramp has to carry, kg m2: lever and hand, at the upper end of what the wrist is assumed to have.
const INERTIA_KG_M2: f64 = 0.0016 + 0.005;

/// Short range stiffness at a torque, N m/rad: 15 at 0.9 N m and 23 at 2.1 N m (paper, 3.3).
fn short_range_stiffness(torque_nm: f64) -> f64 {
    15.0 + (23.0 - 15.0) / (2.1 - 0.9) * (torque_nm.abs() - 0.9)
}

pub(super) fn check(rules: &mut Rules) {
    angles_enclose_the_start(rules);
    for (path, velocity_rad_s) in rules.numbers("velocities_rad_s") {
        speed(rules, &path, velocity_rad_s);
        acceleration(rules, &path, velocity_rad_s);
        angle(rules, &path, velocity_rad_s);
        amplitude_lasts_for_the_window(rules, &path, velocity_rad_s);
    }
    if let Some(velocity_rad_s) = rules.number("ramp.return_velocity_rad_s") {
        speed(rules, "ramp.return_velocity_rad_s", velocity_rad_s);
        acceleration(rules, "ramp.return_velocity_rad_s", velocity_rad_s);
        return_fits_the_amplitude(rules, velocity_rad_s);
    }
    for (path, torque_nm) in rules.numbers("torques_nm") {
        torque(rules, &path, torque_nm);
    }
}

fn angles_enclose_the_start(rules: &mut Rules) {
    if let [(low_path, low), (high_path, high)] = &rules.numbers("limits.angle_rad")[..] {
        let advice = "write the lowest angle first, then the highest, from the start position".to_owned();
        if *low > 0.0 {
            rules.add(low_path, "0 or less: every movement starts at 0".to_owned(), advice.clone());
        }
        if *high < 0.0 {
            rules.add(high_path, "0 or more: every movement starts at 0".to_owned(), advice);
        }
    }
}

fn speed(rules: &mut Rules, path: &str, velocity_rad_s: f64) {
    let Some(limit) = rules.number("limits.speed_rad_s") else { return };
    if velocity_rad_s.abs() > limit {
        let expected = format!("at most {limit} rad/s, which is limits.speed_rad_s");
        rules.add(path, expected, "lower it; raise the limit only if motor and wrist allow it".to_owned());
    }
}

fn acceleration(rules: &mut Rules, path: &str, velocity_rad_s: f64) {
    let (Some(limit), Some(rise_time_s)) =
        (rules.number("limits.acceleration_rad_s2"), rules.number("ramp.rise_time_s"))
    else {
        return;
    };
    // Of any distance: the peak depends on speed and rise time alone.
    let Ok(sweep) = Sweep::new(f64::INFINITY, velocity_rad_s, rise_time_s) else { return };
    let peak = sweep.peak_acceleration_rad_s2();
    if peak > limit {
        let (slower, longer) = (velocity_rad_s.abs() * limit / peak, rise_time_s * peak / limit);
        let expected = format!(
            "an acceleration of at most {limit} rad/s2 (limits.acceleration_rad_s2); rising to this speed in \
             {rise_time_s} s takes {} rad/s2",
            significant(peak)
        );
        let advice = format!(
            "at most {} rad/s, or ramp.rise_time_s of at least {} s",
            significant(slower),
            significant(longer)
        );
        rules.add(path, expected, advice);
    }
}

fn angle(rules: &mut Rules, path: &str, velocity_rad_s: f64) {
    let Some(amplitude_rad) = rules.number("ramp.amplitude_rad") else { return };
    let end_rad = amplitude_rad * velocity_rad_s.signum();
    let limit = if end_rad < 0.0 { "limits.angle_rad[0]" } else { "limits.angle_rad[1]" };
    let Some(limit_rad) = rules.number(limit) else { return };
    if end_rad.abs() > limit_rad.abs() {
        let expected =
            format!("a ramp that ends within {limit_rad} rad ({limit}); this one ends at {end_rad} rad");
        let advice = format!("lower ramp.amplitude_rad to {}", limit_rad.abs());
        rules.add(path, expected, advice);
    }
}

fn amplitude_lasts_for_the_window(rules: &mut Rules, path: &str, velocity_rad_s: f64) {
    let (Some(amplitude_rad), Some(rise_time_s), Some(window_s)) =
        (rules.number("ramp.amplitude_rad"), rules.number("ramp.rise_time_s"), rules.number("window_s"))
    else {
        return;
    };
    let speed_rad_s = velocity_rad_s.abs();
    let needed_s = window_s.max(rise_time_s);
    let lasts_s = amplitude_rad / speed_rad_s;
    if lasts_s < needed_s {
        let expected = format!(
            "a ramp that still runs at full speed after {needed_s} s, at the end of the window; over \
             {amplitude_rad} rad this one slows down after {} s",
            significant(lasts_s)
        );
        let advice = format!(
            "ramp.amplitude_rad of at least {}, or at most {} rad/s, or a shorter window_s",
            significant(speed_rad_s * needed_s),
            significant(amplitude_rad / needed_s)
        );
        rules.add(path, expected, advice);
    }
}

fn return_fits_the_amplitude(rules: &mut Rules, velocity_rad_s: f64) {
    let (Some(amplitude_rad), Some(rise_time_s)) =
        (rules.number("ramp.amplitude_rad"), rules.number("ramp.rise_time_s"))
    else {
        return;
    };
    if let Err(too_short) = Sweep::new(amplitude_rad, velocity_rad_s, rise_time_s) {
        let slower = amplitude_rad / rise_time_s;
        let advice = format!("at most {} rad/s", significant(slower));
        rules.add("ramp.return_velocity_rad_s", too_short.to_string(), advice);
    }
}

/// The torque that a ramp must be expected to reach: the target, the inertia of lever and hand, and a muscle that
/// stays as stiff as it is at first, which no real one does.
fn torque(rules: &mut Rules, path: &str, torque_nm: f64) {
    let (Some(limit), Some(amplitude_rad), Some(rise_time_s)) = (
        rules.number("limits.torque_nm"),
        rules.number("ramp.amplitude_rad"),
        rules.number("ramp.rise_time_s"),
    ) else {
        return;
    };
    let stiffness = short_range_stiffness(torque_nm).max(0.0);
    let peak = |velocity_rad_s: f64| {
        let sweep = Sweep::new(amplitude_rad, velocity_rad_s, rise_time_s).ok()?;
        let step_s = sweep.duration_s() / 1000.0;
        let torques = (0..=1000).map(|step| {
            let motion = sweep.at(f64::from(step) * step_s);
            torque_nm + INERTIA_KG_M2 * motion.acceleration_rad_s2 + stiffness * motion.angle_rad
        });
        torques.map(f64::abs).max_by(f64::total_cmp)
    };
    let velocities = rules.numbers("velocities_rad_s").into_iter().map(|(_, velocity)| velocity);
    let worst = velocities.filter_map(|v| Some((v, peak(v)?))).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((velocity_rad_s, peak_nm)) = worst.filter(|(_, peak_nm)| *peak_nm > limit) {
        let expected = format!(
            "a trial that stays below {limit} N m (limits.torque_nm); at {velocity_rad_s} rad/s up to {} N m must be \
             expected",
            significant(peak_nm)
        );
        let advice = "lower it, or ramp.amplitude_rad, or the velocity; raise the limit only if motor and wrist \
                      allow it";
        rules.add(path, expected, advice.to_owned());
    }
}
