//! The motor's motion from the recorded angle: smoothing, velocity, and correction of errors of the angle channel.

use super::interpolation::hermite;
use super::mechanics::Kinematics;
use super::mechanisms::ChannelErrors;
use crate::number::{Lanes, Number};

/// How a recorded angle is smoothed by local cubics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothing {
    /// Half-width of the stretch that a cubic is fitted to, s.
    pub half_s: f64,
    /// Whether the residual is smoothed as well and added (Tukey's twicing), which preserves changes as short as the stretch.
    pub twice: bool,
}

impl Smoothing {
    /// For a single record: it removes the steps of an encoder and preserves the rise of a ramp.
    pub const ONE_RECORD: Self = Self { half_s: 0.0012, twice: false };

    /// Number of samples on either side that a smoothed sample depends on.
    pub fn reach(self, period_s: f64) -> usize {
        let half = (libm::round(self.half_s / period_s) as usize).max(2);
        if self.twice { 2 * half } else { half }
    }

    /// Smoothed angle and velocity at every sample.
    ///
    /// # Panics
    /// If there are fewer than five samples.
    pub fn motion(self, theta_rad: &[f64], period_s: f64) -> Vec<Kinematics<f64>> {
        let mut result = cubics(theta_rad, period_s, self.half_s);
        if self.twice {
            let left: Vec<f64> =
                theta_rad.iter().zip(&result).map(|(theta, knot)| theta - knot.theta).collect();
            for (knot, more) in result.iter_mut().zip(cubics(&left, period_s, self.half_s)) {
                *knot = Kinematics { theta: knot.theta + more.theta, omega: knot.omega + more.omega };
            }
        }
        result
    }
}

/// Angle and velocity at every sample of a single record.
///
/// # Panics
/// If there are fewer than five samples.
pub fn motor_motion(theta_rad: &[f64], period_s: f64) -> Vec<Kinematics<f64>> {
    Smoothing::ONE_RECORD.motion(theta_rad, period_s)
}

/// Angle and velocity of the cubic spline through angles whose motor rests at the first of them; at the last one its acceleration is zero.
pub fn through(theta_rad: &[f64], period_s: f64) -> Vec<Kinematics<f64>> {
    let count = theta_rad.len();
    // The slopes, times the period, of a spline: each with four times its weight between its neighbours (Thomas's algorithm).
    let mut above = vec![0.0; count];
    let mut slopes = vec![0.0; count];
    for sample in 1..count {
        let last = sample + 1 == count;
        let (own, right) = match last {
            true => (2.0, 3.0 * (theta_rad[sample] - theta_rad[sample - 1])),
            false => (4.0, 3.0 * (theta_rad[sample + 1] - theta_rad[sample - 1])),
        };
        let pivot = own - above[sample - 1];
        above[sample] = 1.0 / pivot;
        slopes[sample] = (right - slopes[sample - 1]) / pivot;
    }
    for sample in (0..count.saturating_sub(1)).rev() {
        slopes[sample] -= above[sample] * slopes[sample + 1];
    }
    let knot = |(theta, slope): (&f64, &f64)| Kinematics { theta: *theta, omega: slope / period_s };
    theta_rad.iter().zip(&slopes).map(knot).collect()
}

/// Value and slope of the cubic fitted to the samples around each sample (Savitzky and Golay 1964), with a shorter stretch
/// near the ends.
fn cubics(theta_rad: &[f64], period_s: f64, half_s: f64) -> Vec<Kinematics<f64>> {
    let count = theta_rad.len();
    assert!(count >= 5, "speed needs at least five samples");
    let widest = (libm::round(half_s / period_s) as usize).clamp(2, (count - 1) / 2);
    let at = |sample: usize| {
        let half = widest.min(sample).min(count - 1 - sample);
        if half < 2 {
            let (before, after) = (sample.saturating_sub(1), (sample + 1).min(count - 1));
            let omega = (theta_rad[after] - theta_rad[before]) / ((after - before) as f64 * period_s);
            return Kinematics { theta: theta_rad[sample], omega };
        }
        cubic_at(&theta_rad[sample - half..=sample + half], period_s)
    };
    (0..count).map(at).collect()
}

/// Value and slope in the middle of the cubic fitted to an odd number of samples. Around the middle the even powers determine
/// the value and the odd powers the slope.
fn cubic_at(around: &[f64], period_s: f64) -> Kinematics<f64> {
    let half = (around.len() / 2) as i32;
    let (mut s2, mut s4, mut s6) = (0.0, 0.0, 0.0);
    let (mut t0, mut t1, mut t2, mut t3) = (0.0, 0.0, 0.0, 0.0);
    for (theta, step) in around.iter().zip(-half..=half) {
        let x = f64::from(step);
        let square = x * x;
        s2 += square;
        s4 += square * square;
        s6 += square * square * square;
        t0 += theta;
        t1 += theta * x;
        t2 += theta * square;
        t3 += theta * square * x;
    }
    let s0 = around.len() as f64;
    Kinematics {
        theta: (s4 * t0 - s2 * t2) / (s0 * s4 - s2 * s2),
        omega: (s6 * t1 - s4 * t3) / (s2 * s6 - s4 * s4) / period_s,
    }
}

/// The motion that a torque record belongs to which is late by `delay_s`: at every sample that of `delay_s` before.
///
/// # Panics
/// If there are fewer than four samples.
pub fn delayed_motion(motion: &[Kinematics<f64>], delay_s: f64, period_s: f64) -> Vec<Kinematics<f64>> {
    let channels = ChannelErrors { torque_delay_s: delay_s, ..ChannelErrors::none() };
    corrected::<f64>(&[motion; 16], &[0.0; 16], motion.len(), &channels, period_s)
}

/// The motor's motion behind records with errors of the channel: removes the gain and the
/// nonlinearity, shifts the time, and simulates the servo that
/// follows a recorded command. `records` holds one record per lane, `starts` the index at which the result begins.
#[inline(always)]
pub(super) fn corrected<T: Number>(
    records: &[&[Kinematics<f64>]; 16],
    starts: &[f64; 16],
    count: usize,
    channels: &ChannelErrors<T>,
    period_s: f64,
) -> Vec<Kinematics<T>> {
    let mut motion = Vec::with_capacity(count);
    let shift = channels.torque_delay_s.scale(1.0 / period_s);
    let mut sample = 0;
    while sample < count {
        let recorded = at_shifted(records, starts, sample, shift, channels.angle_gain, period_s);
        motion.push(channels.straightened(recorded));
        sample += 1;
    }
    if let Some(bandwidth) = channels.following_hz {
        motion = servo_response(&motion, bandwidth, period_s);
    }
    motion
}

/// The recorded motion `shift` samples before `sample`, divided by `gain`.
///
/// The torque is late by the shift, so the torque at a sample belongs to the angle a shift earlier; the mechanics do not
/// depend on time, so shifting the angle shifts the predicted torque.
#[inline(always)]
fn at_shifted<T: Number>(
    records: &[&[Kinematics<f64>]; 16],
    starts: &[f64; 16],
    sample: usize,
    shift: T,
    gain: T,
    period_s: f64,
) -> Kinematics<T> {
    let mut around = [[Kinematics::default(); 16]; 4];
    let mut whole = [0.0; 16];
    let mut lane = 0;
    while lane < T::Plain::LANES {
        let record = records[lane];
        let unshifted = starts[lane] + sample as f64;
        // Before the record the motor stands where its beginning shows it.
        let place = (unshifted - shift.plain().lane(lane)).max(1.0);
        let index = (libm::floor(place) as usize).min(record.len() - 3);
        for (knot, own) in around.iter_mut().zip(&record[index - 1..]) {
            knot[lane] = *own;
        }
        whole[lane] = place + shift.plain().lane(lane) - index as f64;
        lane += 1;
    }
    let u = T::lift(T::Plain::load(&whole)) - shift;
    let [before, start, end, after] = around.map(|knots| gather::<T>(&knots));
    let theta = hermite(u, start.theta, end.theta, start.omega.scale(period_s), end.omega.scale(period_s));
    // The velocity is interpolated itself: the slope of the angle would amplify the encoder's steps that remain in it.
    let change = |from: Kinematics<T>, to: Kinematics<T>| (to.omega - from.omega).scale(0.5);
    let omega = hermite(u, start.omega, end.omega, change(before, end), change(start, after));
    Kinematics { theta: theta / gain, omega: omega / gain }
}

/// The motion of every trial at one sample, one trial per lane.
#[inline(always)]
pub(super) fn gather<T: Number>(lanes: &[Kinematics<f64>; 16]) -> Kinematics<T> {
    let (mut theta, mut omega) = ([0.0; 16], [0.0; 16]);
    let mut lane = 0;
    while lane < T::Plain::LANES {
        theta[lane] = lanes[lane].theta;
        omega[lane] = lanes[lane].omega;
        lane += 1;
    }
    Kinematics { theta: T::lift(T::Plain::load(&theta)), omega: T::lift(T::Plain::load(&omega)) }
}

/// Response of a servo with two equal real poles at `bandwidth_hz` to a command. It is exact for a command that is linear between
/// samples.
#[inline(always)]
pub fn servo_response<T: Number>(
    command: &[Kinematics<T>],
    bandwidth_hz: T,
    period_s: f64,
) -> Vec<Kinematics<T>> {
    let rate = bandwidth_hz.scale(std::f64::consts::TAU);
    let one = T::constant(1.0);
    let x = rate.scale(period_s);
    let keep = (-x).exp();
    // y' = rate (u - y) with u straight from u0 to u1: y1 = keep y0 + early u0 + late u1
    let mean = (one - keep) / x;
    let (early, late) = (mean - keep, one - mean);
    let mut response = Vec::with_capacity(command.len());
    let (mut first, mut second) = (command[0].theta, command[0].theta);
    let mut sample = 0;
    while sample < command.len() {
        if sample > 0 {
            let previous = first;
            first = keep * first + early * command[sample - 1].theta + late * command[sample].theta;
            second = keep * second + early * previous + late * first;
        }
        response.push(Kinematics { theta: second, omega: rate * (first - second) });
        sample += 1;
    }
    response
}
