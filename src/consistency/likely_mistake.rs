//! Mistakes of units that would explain the ratio of a measured to a stated value.

/// How near a ratio must be to that of a mistake, as a factor.
const NEARNESS: f64 = 1.25;

/// How near a step must be to a full turn, as a part of it: a ramp of 10 rad/s goes on by a fiftieth of a turn in 12 ms.
const TURN_NEARNESS: f64 = 0.02;

/// A ratio of measured to stated, and the mistake that gives it.
type Mistake = (f64, &'static str);

/// Mistakes that make a ramp look too fast or too slow.
const OF_SPEED: [Mistake; 9] = [
    (57.2958, "Is theta_m_rad in degrees?"),
    (
        1.0 / 57.2958,
        "Is velocity_rad_s in degrees a second, or was an angle in rad converted as if it were in degrees?",
    ),
    (0.001, "Is t_s in milliseconds, or velocity_rad_s in mrad/s?"),
    (0.0572958, "Is theta_m_rad in degrees and t_s in milliseconds?"),
    (1000.0, "Is theta_m_rad in milliradians?"),
    (1.0 / std::f64::consts::TAU, "Is theta_m_rad in revolutions?"),
    (std::f64::consts::TAU, "Is velocity_rad_s in revolutions a second?"),
    (1.0e6, "Is theta_m_rad in microradians?"),
    (0.104720, "Is velocity_rad_s in revolutions a minute?"),
];

/// Mistakes that make a torque look too large or too small.
const OF_TORQUE: [Mistake; 8] = [
    (100.0, "Is torque_l_nm in N cm?"),
    (0.01, "Is torque_nm in N cm, or in percent of something?"),
    (1000.0, "Is torque_l_nm in mN m?"),
    (0.001, "Is torque_nm in mN m?"),
    (10.1972, "Is torque_l_nm in kgf cm?"),
    (8.85075, "Is torque_l_nm in lbf in?"),
    (0.101972, "Is torque_l_nm in kgf m?"),
    (0.112985, "Is torque_nm in lbf in?"),
];

fn nearest(ratio: f64, mistakes: &[Mistake]) -> Option<String> {
    let distance = |mistake: &&Mistake| libm::log(ratio.abs() / mistake.0).abs();
    mistakes
        .iter()
        .filter(|mistake| distance(mistake) < libm::log(NEARNESS))
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .map(|(_, says)| (*says).to_owned())
}

/// The mistake of an angle that changes by `step_rad` from one sample to the next: an encoder that starts anew at the end of its turn.
pub fn of_step(step_rad: f64) -> Option<String> {
    let turns = [std::f64::consts::TAU, 360.0];
    let is_turn = |turn: &f64| (step_rad / turn - 1.0).abs() < TURN_NEARNESS;
    turns.iter().any(is_turn).then(|| {
        format!("theta_m_rad changes by {step_rad:.3} from one sample to the next: does it start anew at a full turn?")
    })
}

/// The mistake that makes a ramp `ratio` times as fast as stated.
pub fn of_speed(ratio: f64) -> Option<String> {
    nearest(ratio, &OF_SPEED)
}

/// The mistake that makes a torque `ratio` times as large as stated.
pub fn of_torque(ratio: f64) -> Option<String> {
    nearest(ratio, &OF_TORQUE)
}
