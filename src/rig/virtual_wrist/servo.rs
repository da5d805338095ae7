//! The motor under position control: a stiff spring to the commanded angle, with finite bandwidth.

use super::setup::Setup;
use crate::wrist::Kinematics;

/// A motor of inertia J held to its reference by stiffness K and damping D:
/// `J e'' = -K e - D e' - T_l`, where e is the motor's angle less the reference.
///
/// The reference passes the commands as a drive interpolates set-points: its speed goes straight from the mean speed of the last
/// period to that of this one, so that it lies half a period behind. With a speed that jumps from period to period the motor's speed
/// would be lowest at every sample, which the samples of the angle do not show. The torque is constant within a period. The step is
/// exact under these assumptions, so any servo is stable at any rate.
#[derive(Debug, Clone)]
pub struct Servo {
    /// The exact transition of (e + lag, e') over a period.
    transition: [[f64; 2]; 2],
    compliance: f64,
    /// Square of the natural angular frequency, 1/s2.
    natural_squared: f64,
    sample_rate_hz: f64,
    /// The last command.
    command_rad: f64,
    /// Angle and speed of the reference.
    reference: Kinematics<f64>,
    angle_rad: f64,
    speed_rad_s: f64,
}

impl Servo {
    /// A servo at rest at the start position.
    pub fn new(setup: &Setup, sample_rate_hz: f64) -> Self {
        let natural = std::f64::consts::TAU * setup.servo_bandwidth_hz;
        let damping = setup.servo_damping_ratio;
        Self {
            transition: oscillator(natural, damping, 1.0 / sample_rate_hz),
            compliance: 1.0 / setup.servo_stiffness_nm_per_rad,
            natural_squared: natural * natural,
            sample_rate_hz,
            command_rad: 0.0,
            reference: Kinematics { theta: 0.0, omega: 0.0 },
            angle_rad: 0.0,
            speed_rad_s: 0.0,
        }
    }

    /// Puts the motor at rest at its commanded angle, without torque.
    pub fn settle(&mut self) {
        self.reference = Kinematics { theta: self.command_rad, omega: 0.0 };
        (self.angle_rad, self.speed_rad_s) = (self.command_rad, 0.0);
    }

    /// Moves the motor for one period, to the command `command_rad` and against the torque in the lever.
    #[inline]
    pub fn step(&mut self, command_rad: f64, lever_torque_nm: f64) {
        let from = self.reference;
        let speed = (command_rad - self.command_rad) * self.sample_rate_hz;
        let to =
            Kinematics { theta: from.theta + 0.5 * (from.omega + speed) / self.sample_rate_hz, omega: speed };
        // Where the motor lags behind an accelerated reference without oscillating.
        let lag = lever_torque_nm * self.compliance
            + (to.omega - from.omega) * self.sample_rate_hz / self.natural_squared;
        let error = self.angle_rad - from.theta + lag;
        let error_speed = self.speed_rad_s - from.omega;
        let [[a, b], [c, d]] = self.transition;
        self.command_rad = command_rad;
        self.reference = to;
        self.angle_rad = to.theta - lag + a * error + b * error_speed;
        self.speed_rad_s = to.omega + c * error + d * error_speed;
    }

    /// Angle and angular velocity of the motor.
    pub fn motion(&self) -> Kinematics<f64> {
        Kinematics { theta: self.angle_rad, omega: self.speed_rad_s }
    }

    /// The last commanded angle, rad.
    pub fn command_rad(&self) -> f64 {
        self.command_rad
    }
}

/// The transition over `t` of `x'' = -w^2 x - 2 z w x'`, as a matrix on (x, x').
fn oscillator(w: f64, z: f64, t: f64) -> [[f64; 2]; 2] {
    let decay = libm::exp(-z * w * t);
    let discriminant = 1.0 - z * z;
    // cosine-like and sine-like solutions, with the limit at critical damping
    let (cosine, sine) = if discriminant > 1e-9 {
        let wd = w * libm::sqrt(discriminant);
        (libm::cos(wd * t), libm::sin(wd * t) / wd)
    } else if discriminant < -1e-9 {
        let wd = w * libm::sqrt(-discriminant);
        (libm::cosh(wd * t), libm::sinh(wd * t) / wd)
    } else {
        (1.0, t)
    };
    [
        [decay * (cosine + z * w * sine), decay * sine],
        [-decay * w * w * sine, decay * (cosine - z * w * sine)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servo() -> Servo {
        Servo::new(&Setup::default(), 2500.0)
    }

    #[test]
    fn a_steady_torque_bends_it_by_its_stiffness() {
        let mut servo = servo();
        (0..2500).for_each(|_| servo.step(0.0, 2.0));
        assert!((servo.motion().theta + 0.002).abs() < 1e-12);
        assert!(servo.motion().omega.abs() < 1e-9);
    }

    #[test]
    fn it_follows_a_ramp_half_a_period_late_once_it_has_settled() {
        let mut servo = servo();
        (1..=2500).for_each(|sample| servo.step(f64::from(sample) * 1e-3, 0.0));
        assert!((servo.motion().theta - 2.5 + 0.5e-3).abs() < 1e-9, "{}", servo.motion().theta);
        assert!((servo.motion().omega - 2.5).abs() < 1e-9);
    }

    #[test]
    fn its_step_is_the_solution_of_its_equation() {
        // Against many small steps of the differential equation itself, from an arbitrary state.
        for damping in [0.5, 1.0, 1.5] {
            let setup = Setup { servo_damping_ratio: damping, ..Setup::default() };
            let mut servo = Servo::new(&setup, 2500.0);
            servo.step(0.01, 0.0);
            servo.step(0.01, 0.0); // Now the reference rests.
            let w = std::f64::consts::TAU * setup.servo_bandwidth_hz;
            let (mut x, mut v) = (servo.motion().theta - 0.01, servo.motion().omega);
            servo.step(0.01, 0.0);
            let h = 0.0004 / 100_000.0;
            for _ in 0..100_000 {
                let a = |x: f64, v: f64| -w * w * x - 2.0 * damping * w * v;
                let (xm, vm) = (x + h / 2.0 * v, v + h / 2.0 * a(x, v));
                (x, v) = (x + h * vm, v + h * a(xm, vm));
            }
            assert!((servo.motion().theta - 0.01 - x).abs() < 1e-9);
            assert!((servo.motion().omega - v).abs() < 1e-6);
        }
    }
}
