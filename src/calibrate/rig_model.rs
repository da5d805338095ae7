//! The model of the rig without a person (Eq. 5 of the paper, and the two channels), at the frequencies of a record.
//!
//! The linear part is exact at each frequency, and follows the recorded angle. The friction of the bearing, the growth of the lever's
//! damping and the cubic part of the torque are small. They are computed in time, along the motion that follows from the target: a
//! function that is not linear would turn the errors of the encoder into a torque.

use rustfft::num_complex::Complex64;

use super::constants::{AtHandle, FittedConstants};
use super::fourier::Fourier;
use crate::wrist::built_up_friction;

/// Number of times that the torques without a linear law are computed along the solution that contains them.
const NONLINEAR_PASSES: usize = 2;

/// A motion of the motor as the rig's channels have it.
#[derive(Clone, Copy)]
pub struct HandleMotion<'a> {
    /// Recorded angle relative to the start position.
    pub recorded: &'a [Complex64],
    /// The recorded angle that follows from the target, without the errors of the encoder.
    pub expected: &'a [Complex64],
}

/// The recorded torque, as Fourier coefficients, without the offset. `friction_speed_rad_s` is the speed that the factor of the
/// friction's speed refers to.
pub fn recorded_torque(
    constants: &FittedConstants,
    handle: AtHandle,
    motion: HandleMotion<'_>,
    fourier: &Fourier,
    friction_speed_rad_s: f64,
) -> Vec<Complex64> {
    let places = motion.recorded.len();
    let nonlinear = nonlinear_torques(constants, handle, motion.expected, fourier, friction_speed_rad_s);
    let torque_along = |angle: &[Complex64]| -> Vec<Complex64> {
        let mut torque: Vec<Complex64> = (0..places)
            .map(|place| {
                let [lever, whole, load] = impedances(constants, handle, fourier.omega(place));
                let angle = angle[place] / constants.angle_gain;
                let [friction, damper] = nonlinear[place];
                if handle.is_clamped {
                    lever * angle + damper
                } else {
                    (lever * (load * angle + friction) + load * damper) / whole
                }
            })
            .collect();
        torque[0] += handle.torque_nm;
        torque
    };
    let mut torque = torque_along(motion.recorded);
    if constants.torque_nonlinearity_per_nm2 != 0.0 {
        let expected = fourier.to_time(&torque_along(motion.expected));
        let cube: Vec<f64> = expected.iter().map(|torque| torque * torque * torque).collect();
        for (value, cube) in torque.iter_mut().zip(fourier.of_time(&cube)) {
            *value += constants.torque_nonlinearity_per_nm2 * cube;
        }
    }
    for (place, value) in torque.iter_mut().enumerate() {
        *value *= torque_channel(constants, fourier.omega(place));
    }
    torque
}

/// The torques that do not follow from the motion by a linear law: friction of the bearing, and what the lever's damper has beyond
/// proportion to the speed of its deflection. Computed once more along the motion of the handle with them.
fn nonlinear_torques(
    constants: &FittedConstants,
    handle: AtHandle,
    motion: &[Complex64],
    fourier: &Fourier,
    friction_speed_rad_s: f64,
) -> Vec<[Complex64; 2]> {
    let mut torques = vec![[Complex64::ZERO; 2]; motion.len()];
    let friction_nm = if handle.is_clamped { 0.0 } else { constants.bearing_friction_nm };
    let growth = constants.lever.damping_nm_s_per_rad * constants.damping_growth_s_per_rad;
    let is_still = motion.iter().all(|value| *value == Complex64::ZERO);
    if is_still || (friction_nm == 0.0 && growth == 0.0) {
        return torques;
    }
    let full_at_rad_s = friction_speed_rad_s * constants.friction_speed_factor;
    for _ in 0..NONLINEAR_PASSES {
        let speeds: Vec<[Complex64; 2]> = torques
            .iter()
            .enumerate()
            .map(|(place, [friction, damper])| {
                let s = Complex64::new(0.0, fourier.omega(place));
                let angle = motion[place] / constants.angle_gain;
                let [lever, whole, _] = impedances(constants, handle, fourier.omega(place));
                let of_handle = if handle.is_clamped {
                    Complex64::ZERO
                } else {
                    (lever * angle + damper - friction) / whole
                };
                [s * of_handle, s * (angle - of_handle)]
            })
            .collect();
        let mut presliding = Presliding::new(constants, fourier.time_step_s());
        let law = |[of_handle, of_lever]: [f64; 2]| {
            let friction = presliding.friction(of_handle, libm::tanh(of_handle / full_at_rad_s));
            [friction_nm * friction, growth * of_lever.abs() * of_lever]
        };
        torques = fourier.of_time_pairs(fourier.to_time_pairs(&speeds).into_iter().map(law));
    }
    torques
}

/// A bearing that gives before it slides, along a motion that begins at rest; see [`built_up_friction`].
struct Presliding {
    /// Part of the friction that is of this kind.
    part: f64,
    travel_rad: f64,
    step_s: f64,
    speed_rad_s: f64,
    /// How far it has built up: -1 to 1.
    built_up: f64,
}

impl Presliding {
    fn new(constants: &FittedConstants, step_s: f64) -> Self {
        let (part, travel_rad) = (constants.presliding_part, constants.presliding_rad);
        Self { part, travel_rad, step_s, speed_rad_s: 0.0, built_up: 0.0 }
    }

    /// Friction at the next point in time beside its full value, where a friction that follows from the speed is `of_speed`. Exact for a
    /// way that is straight between two points.
    fn friction(&mut self, speed_rad_s: f64, of_speed: f64) -> f64 {
        if self.part == 0.0 {
            return of_speed;
        }
        let way_rad = 0.5 * (self.speed_rad_s + speed_rad_s) * self.step_s;
        self.speed_rad_s = speed_rad_s;
        self.built_up = built_up_friction(self.built_up, way_rad, self.travel_rad);
        of_speed + self.part * (self.built_up - of_speed)
    }
}

/// Of the lever (k_l + b_l s), of lever, handle and load together, and of handle and load.
fn impedances(constants: &FittedConstants, handle: AtHandle, omega: f64) -> [Complex64; 3] {
    let s = Complex64::new(0.0, omega);
    let own = &constants.lever;
    let lever = own.stiffness_nm_per_rad + own.damping_nm_s_per_rad * s;
    let load = (own.inertia_kg_m2 + handle.inertia_kg_m2) * s * s + handle.stiffness_nm_per_rad;
    [lever, lever + load, load]
}

/// Response of the torque channel: gain, delay and low-pass.
pub fn torque_channel(constants: &FittedConstants, omega: f64) -> Complex64 {
    let delay = Complex64::new(0.0, -omega * constants.torque_delay_s).exp();
    constants.torque_gain * delay / Complex64::new(1.0, omega * constants.torque_lag_s)
}

/// Response of the torque in the lever to a small change of the recorded angle.
pub fn lever_response(constants: &FittedConstants, handle: AtHandle, omega: f64) -> Complex64 {
    let [lever, whole, load] = impedances(constants, handle, omega);
    let torque = if handle.is_clamped { lever } else { lever * load / whole };
    torque / constants.angle_gain
}

/// Response of the recorded torque to a small change of the recorded angle.
pub fn torque_response(constants: &FittedConstants, handle: AtHandle, omega: f64) -> Complex64 {
    lever_response(constants, handle, omega) * torque_channel(constants, omega)
}

/// Response of the recorded angle to the target without a torque in the lever. Between two targets the drive may hold the last one, or go
/// there in a straight line, or know the whole way: powers 1, 2 and 0 of the response of a hold.
pub fn servo_response(constants: &FittedConstants, omega: f64, sample_rate_hz: f64) -> Complex64 {
    let half = 0.5 * omega / sample_rate_hz;
    let hold = if half == 0.0 { 1.0 } else { libm::pow(libm::sin(half) / half, constants.servo_hold) };
    let delay = Complex64::new(0.0, -omega * constants.servo_delay_s).exp();
    let braking = 2.0 * constants.servo_damping * omega * constants.servo_period_s;
    let speed = Complex64::new(1.0, constants.servo_speed_command * braking);
    hold * constants.servo_gain * delay * speed * second_order(constants, omega)
}

/// Response of the recorded angle to the torque in the lever, which turns the motor back, rad/(N m).
pub fn servo_yield(constants: &FittedConstants, omega: f64) -> Complex64 {
    let delay = Complex64::new(0.0, -omega * constants.servo_compliance_delay_s).exp();
    -constants.servo_compliance_rad_per_nm * delay * second_order(constants, omega)
}

/// Response of the recorded angle to the target with the load at the handle.
pub fn loaded_servo_response(
    constants: &FittedConstants,
    handle: AtHandle,
    omega: f64,
    sample_rate_hz: f64,
) -> Complex64 {
    let back = servo_yield(constants, omega) * lever_response(constants, handle, omega);
    servo_response(constants, omega, sample_rate_hz) / (1.0 - back)
}

/// Response of the servo's inertia, damping and stiffness, 1 at rest.
fn second_order(constants: &FittedConstants, omega: f64) -> Complex64 {
    let of_frequency = omega * constants.servo_period_s;
    1.0 / Complex64::new(1.0 - of_frequency * of_frequency, 2.0 * constants.servo_damping * of_frequency)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::constants::RigCoordinates;

    /// A bearing of which all gives, moved by `way_rad` at a steady speed in `points` points.
    fn moved(bearing: &mut Presliding, way_rad: f64, points: usize) -> f64 {
        let speed_rad_s = way_rad / (points as f64 * bearing.step_s);
        bearing.speed_rad_s = speed_rad_s;
        (0..points).fold(0.0, |_, _| bearing.friction(speed_rad_s, 1.0))
    }

    #[test]
    fn a_bearing_that_gives_follows_the_travel_whatever_the_speed() {
        let mut coordinates = RigCoordinates::new(None, 1.0, Vec::new());
        coordinates.has_presliding = true;
        let all = FittedConstants {
            presliding_part: 1.0,
            presliding_rad: 1e-3,
            ..coordinates.constants(&vec![0.0; coordinates.count()])
        };
        for points in [3, 1000] {
            let mut bearing = Presliding::new(&all, 1e-3);
            let there = moved(&mut bearing, 1e-3, points);
            assert!((there - (1.0 - libm::exp(-1.0))).abs() < 1e-12, "{points}: {there}");
            assert!((moved(&mut bearing, 0.1, points) - 1.0).abs() < 1e-12);
            let back = moved(&mut bearing, -1e-3, points);
            assert!((back - (2.0 * libm::exp(-1.0) - 1.0)).abs() < 1e-12, "{points}: {back}");
        }
        // A half of it follows the speed.
        let mut half = Presliding::new(&FittedConstants { presliding_part: 0.5, ..all }, 1e-3);
        assert_eq!(half.friction(0.0, 1.0), 0.5);
    }
}
