//! The model of the rig without a person (Eq. 5 of the paper, and the two channels), at the frequencies of a record.
//!
//! The linear part is exact at each frequency. The friction of the bearing and the cubic part of the torque are small: they are
//! computed in time along the linear solution, and friction once more along the solution with friction.

use rustfft::num_complex::Complex64;

use super::constants::{AtHandle, RigConstants};
use super::fourier::Fourier;

/// Number of times that the friction is computed along the solution that contains it.
const FRICTION_PASSES: usize = 2;

/// The recorded torque, as Fourier coefficients, without the offset, for a recorded angle relative to the start position.
/// `friction_speed_rad_s` is the speed of the noise,
/// the least at which the friction may be at 76 % of its full value.
pub fn recorded_torque(
    constants: &RigConstants,
    handle: AtHandle,
    recorded_angle: &[Complex64],
    fourier: &Fourier,
    friction_speed_rad_s: f64,
) -> Vec<Complex64> {
    let angle: Vec<Complex64> = recorded_angle.iter().map(|value| value / constants.angle_gain).collect();
    let mut friction = vec![Complex64::ZERO; angle.len()];
    // At a speed below that of the noise, the noise would decide on the friction's direction.
    let friction_speed_rad_s = friction_speed_rad_s * libm::hypot(1.0, constants.friction_speed_factor);
    if !handle.is_clamped && constants.bearing_friction_nm != 0.0 {
        for _ in 0..FRICTION_PASSES {
            let speed: Vec<Complex64> = (0..angle.len())
                .map(|place| {
                    let s = Complex64::new(0.0, fourier.omega(place));
                    let [lever, whole, _] = impedances(constants, handle, s);
                    s * (lever * angle[place] - friction[place]) / whole
                })
                .collect();
            let torque: Vec<f64> = fourier
                .to_time(&speed)
                .iter()
                .map(|speed| constants.bearing_friction_nm * libm::tanh(speed / friction_speed_rad_s))
                .collect();
            friction = fourier.of_time(&torque);
        }
    }
    let mut torque: Vec<Complex64> = (0..angle.len())
        .map(|place| {
            let s = Complex64::new(0.0, fourier.omega(place));
            let [lever, whole, load] = impedances(constants, handle, s);
            if handle.is_clamped {
                lever * angle[place]
            } else {
                lever * (load * angle[place] + friction[place]) / whole
            }
        })
        .collect();
    torque[0] += handle.torque_nm;
    if constants.torque_nonlinearity_per_nm2 != 0.0 {
        let cube: Vec<f64> = fourier.to_time(&torque).iter().map(|torque| torque * torque * torque).collect();
        for (value, cube) in torque.iter_mut().zip(fourier.of_time(&cube)) {
            *value += constants.torque_nonlinearity_per_nm2 * cube;
        }
    }
    for (place, value) in torque.iter_mut().enumerate() {
        *value *= torque_channel(constants, fourier.omega(place));
    }
    torque
}

/// Of the lever (k_l + b_l s), of lever, handle and load together, and of handle and load.
fn impedances(constants: &RigConstants, handle: AtHandle, s: Complex64) -> [Complex64; 3] {
    let own = &constants.lever;
    let lever = own.stiffness_nm_per_rad + own.damping_nm_s_per_rad * s;
    let load = (own.inertia_kg_m2 + handle.inertia_kg_m2) * s * s + handle.stiffness_nm_per_rad;
    [lever, lever + load, load]
}

/// Response of the torque channel: gain, delay and low-pass.
fn torque_channel(constants: &RigConstants, omega: f64) -> Complex64 {
    let delay = Complex64::new(0.0, -omega * constants.torque_delay_s).exp();
    constants.torque_gain * delay / Complex64::new(1.0, omega * constants.torque_lag_s)
}

/// Response of the recorded torque to a small change of the recorded angle.
pub fn torque_response(constants: &RigConstants, handle: AtHandle, omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    let [lever, whole, load] = impedances(constants, handle, s);
    let torque = if handle.is_clamped { lever } else { lever * load / whole };
    torque * torque_channel(constants, omega) / constants.angle_gain
}

/// Response of the recorded angle to the target. Between two targets the drive may hold the last one, or go there in a straight line, or
/// know the whole way: powers 1, 2 and 0 of the response of a hold.
pub fn servo_response(constants: &RigConstants, omega: f64, sample_rate_hz: f64) -> Complex64 {
    let half = 0.5 * omega / sample_rate_hz;
    let hold = if half == 0.0 { 1.0 } else { libm::pow(libm::sin(half) / half, constants.servo_hold) };
    let (period_s, damping) = (constants.servo_period_s, constants.servo_damping);
    let delay = Complex64::new(0.0, -omega * constants.servo_delay_s).exp();
    let of_frequency = omega * period_s;
    hold * constants.servo_gain * delay
        / Complex64::new(1.0 - of_frequency * of_frequency, 2.0 * damping * of_frequency)
}
