//! What of a trial's residual the fit sees: its products with the motion that the target alone predicts.
//!
//! The recorded angle is wrong by the encoder's steps, and these errors go through the stiff lever into the torque that the model
//! predicts. Least squares over such a residual would be biased. The target is free of these errors: products of the residual with
//! motions computed from the target (instruments) have the mean zero if the model is right, whatever the encoder does.

use nalgebra::{DMatrix, DVector};
use rustfft::num_complex::Complex64;

use super::constants::{AtHandle, FittedConstants};
use super::encoder::step_error_rad;
use super::fourier::Fourier;
use super::prepared_trial::{ChannelNoise, PreparedTrial};
use super::rig_model::{
    HandleMotion, loaded_servo_response, recorded_torque, servo_response, servo_yield, torque_channel,
    torque_response,
};
use crate::protocol::RigLoad;

/// Bands in an octave of frequency; each has two products, in phase and in quadrature.
const BANDS_PER_OCTAVE: f64 = 2.0;

/// Index of the first small term's moment; bands have indices nearer to zero.
const FIRST_SMALL_TERM: i32 = 1000;

/// What a moment belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MomentChannel {
    /// Mean of the recorded torque.
    Mean,
    /// Torque that follows from the motion.
    Torque,
    /// HandleMotion that follows from the target.
    Servo,
}

/// Which product of a trial's residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MomentLabel {
    /// What it belongs to.
    pub channel: MomentChannel,
    /// Which one: a band and phase, or a small term of the model.
    pub index: i32,
}

/// One product: its weights over the coefficients.
struct Instrument {
    label: MomentLabel,
    /// Place of the first weight.
    from: usize,
    weights: Vec<Complex64>,
}

impl Instrument {
    /// Weight of a coefficient between the first and the last.
    fn at(&self, place: usize) -> Complex64 {
        self.weights[place - self.from]
    }

    fn places(&self) -> std::ops::Range<usize> {
        self.from..self.from + self.weights.len()
    }

    fn product(&self, residual: &[Complex64]) -> f64 {
        self.weights
            .iter()
            .zip(&residual[self.from..])
            .map(|(weight, value)| (weight.conj() * value).re)
            .sum()
    }
}

/// The products of one trial.
pub struct TrialMoments {
    instruments: Vec<Instrument>,
    /// Whether the mean is used, as the last moment.
    has_mean: bool,
    /// Errors of the recorded angle along the motion that follows from the target, for each position of the encoder's steps.
    angle_errors: Vec<Vec<Complex64>>,
    at: TrialResponses,
}

/// What a residual and its noise depend on beside the record, at some constants.
struct TrialResponses {
    /// Response of the recorded torque to the recorded angle.
    response: Vec<Complex64>,
    /// Response of the recorded angle to the recorded torque, through the servo that yields.
    back_response: Vec<Complex64>,
    /// Torque in the lever as its record shows it.
    lever_torque: Vec<Complex64>,
    /// The recorded angle that follows from the target. What is not linear is computed along it, so that the servo's constants change the
    /// servo's residual alone.
    expected: Vec<Complex64>,
}

impl TrialResponses {
    fn new(trial: &PreparedTrial, constants: &FittedConstants, handle: AtHandle) -> Self {
        let fourier = &trial.fourier;
        let places = 0..fourier.coefficients;
        let channel = |place: usize| torque_channel(constants, fourier.omega(place));
        let back = |place: usize| servo_yield(constants, fourier.omega(place)) / channel(place);
        let response = |place: usize| torque_response(constants, handle, fourier.omega(place));
        Self {
            response: places.clone().map(response).collect(),
            back_response: places.clone().map(back).collect(),
            lever_torque: places.map(|place| trial.torque[place] / channel(place)).collect(),
            expected: expected_motion(trial, constants, handle),
        }
    }
}

/// Residual of a trial, as Fourier coefficients.
pub struct TrialResidual {
    /// Recorded less predicted torque; the first one is the mean.
    pub torque: Option<Vec<Complex64>>,
    /// Recorded angle less that which follows from the target.
    pub servo: Option<Vec<Complex64>>,
}

/// Which residuals are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needed {
    /// Both.
    Both,
    /// That of the torque.
    Torque,
    /// That of the servo.
    Servo,
}

/// The recorded angle that follows from the target.
fn expected_motion(trial: &PreparedTrial, constants: &FittedConstants, handle: AtHandle) -> Vec<Complex64> {
    let fourier = &trial.fourier;
    if !trial.moves() {
        return vec![Complex64::ZERO; fourier.coefficients];
    }
    let response = |place: usize| {
        loaded_servo_response(constants, handle, fourier.omega(place), fourier.sample_rate_hz())
    };
    trial.target.iter().enumerate().map(|(place, target)| response(place) * target).collect()
}

/// Residual of a trial at some constants. `moments` has the torque that turns the motor back, and the motion that follows from the target.
pub fn residual(
    trial: &PreparedTrial,
    moments: &TrialMoments,
    constants: &FittedConstants,
    handle: AtHandle,
    friction_speed_rad_s: f64,
    needed: Needed,
) -> TrialResidual {
    let torque = (needed != Needed::Servo).then(|| {
        let motion = HandleMotion { recorded: &trial.angle, expected: &moments.at.expected };
        let predicted = recorded_torque(constants, handle, motion, &trial.fourier, friction_speed_rad_s);
        let mut left: Vec<Complex64> =
            trial.torque.iter().zip(predicted).map(|(own, model)| own - model).collect();
        left[0] -= constants.torque_offset_nm;
        left
    });
    let servo = (needed != Needed::Torque && trial.moves()).then(|| {
        let fourier = &trial.fourier;
        let left = |(place, angle): (usize, &Complex64)| {
            let omega = fourier.omega(place);
            angle
                - servo_response(constants, omega, fourier.sample_rate_hz()) * trial.target[place]
                - servo_yield(constants, omega) * moments.at.lever_torque[place]
        };
        trial.angle.iter().enumerate().map(left).collect()
    });
    TrialResidual { torque, servo }
}

/// A constant of the torque channel, whose effect follows from the predicted torque without a new prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OfTorqueChannel {
    /// Its gain.
    Gain,
    /// Its offset.
    Offset,
    /// Its delay.
    Delay,
    /// Its low-pass.
    Lag,
}

/// Derivative of a residual with a constant of the torque channel; with the logarithm of the gain.
pub fn torque_channel_derivative(
    trial: &PreparedTrial,
    at: &TrialResidual,
    constants: &FittedConstants,
    of: OfTorqueChannel,
) -> TrialResidual {
    let left = at.torque.as_deref().unwrap_or_default();
    let derivative = (0..left.len()).map(|place| {
        let offset = if place == 0 { constants.torque_offset_nm } else { 0.0 };
        let predicted = trial.torque[place] - left[place] - offset;
        let s = Complex64::new(0.0, trial.fourier.omega(place));
        match of {
            OfTorqueChannel::Gain => -predicted,
            OfTorqueChannel::Offset => Complex64::new(if place == 0 { -1.0 } else { 0.0 }, 0.0),
            OfTorqueChannel::Delay => s * predicted,
            OfTorqueChannel::Lag => s * predicted / (1.0 + s * constants.torque_lag_s),
        }
    });
    TrialResidual { torque: Some(derivative.collect()), servo: None }
}

impl TrialMoments {
    /// The products of a trial at some constants. `small_terms` are changes of friction, of the cubic part, of the growth of the
    /// lever's damping and of the part of the friction that gives before it slides, whose effects become products of their own.
    pub fn new(
        trial: &PreparedTrial,
        constants: &FittedConstants,
        handle: AtHandle,
        noise: &ChannelNoise,
        friction_speed_rad_s: f64,
        small_terms: [f64; 4],
    ) -> Self {
        let fourier = &trial.fourier;
        let count = fourier.coefficients;
        let at = TrialResponses::new(trial, constants, handle);
        let mut own = Self {
            instruments: Vec::new(),
            has_mean: has_mean(trial.load),
            angle_errors: vec![vec![Complex64::ZERO; count]; noise.step_positions.len()],
            at,
        };
        if !trial.moves() {
            return own;
        }
        let expected = own.at.expected.clone();
        if noise.step_rad > 0.0 {
            own.angle_errors = angle_errors(&expected, fourier, noise);
        }
        let torque_variance = own.torque_variance(trial, noise);
        let servo_variance: Vec<f64> = (0..count)
            .map(|place| trial.variance(noise.step_power + noise.angle.at(fourier.frequency_hz(place))))
            .collect();
        let motion = HandleMotion { recorded: &expected, expected: &expected };
        let predict = |constants: &FittedConstants| {
            recorded_torque(constants, handle, motion, fourier, friction_speed_rad_s)
        };
        let torque = predict(constants);
        own.add_bands(trial, MomentChannel::Torque, &torque, &torque_variance);
        let [friction, cubic, growth, presliding] = small_terms;
        let changed = [
            FittedConstants {
                bearing_friction_nm: constants.bearing_friction_nm + friction,
                ..constants.clone()
            },
            FittedConstants {
                torque_nonlinearity_per_nm2: constants.torque_nonlinearity_per_nm2 + cubic,
                ..constants.clone()
            },
            FittedConstants {
                damping_growth_s_per_rad: constants.damping_growth_s_per_rad + growth,
                ..constants.clone()
            },
            FittedConstants { presliding_part: constants.presliding_part + presliding, ..constants.clone() },
        ];
        for (place, changed) in changed.iter().enumerate() {
            let effect: Vec<Complex64> =
                predict(changed).iter().zip(&torque).map(|(with, without)| with - without).collect();
            let index = FIRST_SMALL_TERM + place as i32;
            own.add(MomentChannel::Torque, index, &effect, &torque_variance, 1..count);
        }
        own.add_bands(trial, MomentChannel::Servo, &expected, &servo_variance);
        own
    }

    /// Takes residuals and noise at other constants; the products stay.
    pub fn move_to(&mut self, trial: &PreparedTrial, constants: &FittedConstants, handle: AtHandle) {
        self.at = TrialResponses::new(trial, constants, handle);
    }

    /// Variance of each coefficient of the torque's residual: noise of the torque, and of the angle through the model.
    fn torque_variance(&self, trial: &PreparedTrial, noise: &ChannelNoise) -> Vec<f64> {
        let angle = |hz: f64| noise.step_power + noise.angle.at(hz);
        (0..self.at.response.len())
            .map(|place| {
                let hz = trial.fourier.frequency_hz(place);
                trial.variance(noise.torque.at(hz) + self.at.response[place].norm_sqr() * angle(hz))
            })
            .collect()
    }

    fn add_bands(
        &mut self,
        trial: &PreparedTrial,
        channel: MomentChannel,
        signal: &[Complex64],
        variance: &[f64],
    ) {
        let band = |place: usize| {
            libm::floor(BANDS_PER_OCTAVE * libm::log2(trial.fourier.frequency_hz(place))) as i32
        };
        let mut from = 1;
        while from < signal.len() {
            let index = band(from);
            let to = (from..signal.len()).find(|place| band(*place) != index).unwrap_or(signal.len());
            let quadrature: Vec<Complex64> = signal.iter().map(|value| Complex64::I * value).collect();
            self.add(channel, 2 * index, signal, variance, from..to);
            self.add(channel, 2 * index + 1, &quadrature, variance, from..to);
            from = to;
        }
    }

    /// Adds the product with `signal` over some coefficients, of variance one under the noise. A signal that is smaller than the noise
    /// tells nothing and is left out.
    fn add(
        &mut self,
        channel: MomentChannel,
        index: i32,
        signal: &[Complex64],
        variance: &[f64],
        places: std::ops::Range<usize>,
    ) {
        let energy: f64 = places.clone().map(|place| signal[place].norm_sqr() / variance[place]).sum();
        if !(energy >= 1.0 && energy.is_finite()) {
            return;
        }
        let scale = std::f64::consts::SQRT_2 / libm::sqrt(energy);
        let from = places.start;
        let weights = places.map(|place| scale * signal[place] / variance[place]).collect();
        self.instruments.push(Instrument { label: MomentLabel { channel, index }, from, weights });
    }

    /// Labels of the moments, in their order.
    pub fn labels(&self) -> Vec<MomentLabel> {
        let mean = self.has_mean.then_some(MomentLabel { channel: MomentChannel::Mean, index: 0 });
        self.instruments.iter().map(|own| own.label).chain(mean).collect()
    }

    /// The moments of a residual; those of a residual that was not asked for are zero. `mean_sd_nm` is the standard deviation of a
    /// trial's mean.
    pub fn of(&self, residual: &TrialResidual, mean_sd_nm: f64) -> DVector<f64> {
        let products = self.instruments.iter().map(|instrument| {
            let side = match instrument.label.channel {
                MomentChannel::Servo => &residual.servo,
                _ => &residual.torque,
            };
            side.as_ref().map_or(0.0, |side| instrument.product(side))
        });
        let mean =
            self.has_mean.then(|| residual.torque.as_ref().map_or(0.0, |side| side[0].re / mean_sd_nm));
        let moments: Vec<f64> = products.chain(mean).collect();
        DVector::from_vec(moments)
    }

    /// The moments that the errors of the recorded angle make, for each position of the encoder's steps.
    pub fn of_steps(&self) -> Vec<DVector<f64>> {
        self.angle_errors.iter().map(|error| self.of_angle_error(error)).collect()
    }

    fn of_angle_error(&self, error: &[Complex64]) -> DVector<f64> {
        let torque: Vec<Complex64> =
            error.iter().zip(&self.at.response).map(|(own, response)| -response * own).collect();
        let residual = TrialResidual { torque: Some(torque), servo: Some(error.to_vec()) };
        let mut moments = self.of(&residual, 1.0);
        if self.has_mean {
            // The mean torque of these loads does not depend on the angle.
            let last = moments.len() - 1;
            moments[last] = 0.0;
        }
        moments
    }

    /// Covariance of the moments under the noise of both channels and the errors of the encoder's steps.
    ///
    /// The errors are white where a motion passes many steps, and go with the motion where it passes few. Half of their variance is taken
    /// as white, and half as it is along the motion: the positions are fewer than the moments.
    pub fn covariance(&self, trial: &PreparedTrial, noise: &ChannelNoise) -> DMatrix<f64> {
        let mut covariance = self.covariance_with(trial, noise, 0.5 * noise.step_power);
        let errors = self.of_steps();
        for error in &errors {
            covariance.ger(0.5 / errors.len() as f64, error, error, 1.0);
        }
        covariance
    }

    /// Covariance of the moments under the noise of both channels, the steps of the encoder left out.
    pub fn covariance_without_steps(&self, trial: &PreparedTrial, noise: &ChannelNoise) -> DMatrix<f64> {
        self.covariance_with(trial, noise, 0.0)
    }

    fn covariance_with(&self, trial: &PreparedTrial, noise: &ChannelNoise, steps: f64) -> DMatrix<f64> {
        let count = self.at.response.len();
        let hz = |place: usize| trial.fourier.frequency_hz(place);
        let torque: Vec<f64> = (0..count).map(|place| trial.variance(noise.torque.at(hz(place)))).collect();
        let angle: Vec<f64> =
            (0..count).map(|place| trial.variance(steps + noise.angle.at(hz(place)))).collect();
        // Weights of each moment on the torque's noise and on the angle's.
        let size = self.instruments.len();
        let of_angle = |instrument: &Instrument, place: usize| match instrument.label.channel {
            MomentChannel::Servo => instrument.at(place),
            _ => -self.at.response[place].conj() * instrument.at(place),
        };
        let of_torque = |instrument: &Instrument, place: usize| match instrument.label.channel {
            MomentChannel::Servo => -self.at.back_response[place].conj() * instrument.at(place),
            _ => instrument.at(place),
        };
        let mut covariance =
            DMatrix::identity(size + usize::from(self.has_mean), size + usize::from(self.has_mean));
        for row in 0..size {
            for column in 0..=row {
                let (one, other) = (&self.instruments[row], &self.instruments[column]);
                let (first, second) = (one.places(), other.places());
                let sum: f64 = (first.start.max(second.start)..first.end.min(second.end))
                    .map(|place| {
                        let by_angle =
                            (of_angle(one, place).conj() * of_angle(other, place)).re * angle[place];
                        let by_torque =
                            (of_torque(one, place).conj() * of_torque(other, place)).re * torque[place];
                        by_angle + by_torque
                    })
                    .sum();
                covariance[(row, column)] = 0.5 * sum;
                covariance[(column, row)] = 0.5 * sum;
            }
        }
        covariance
    }
}

/// Errors of the recorded angle along a motion, for each position of the encoder's steps.
fn angle_errors(motion: &[Complex64], fourier: &Fourier, noise: &ChannelNoise) -> Vec<Vec<Complex64>> {
    let motion_rad = fourier.to_record(motion);
    let error = |position: &f64| step_error_rad(&motion_rad, noise.step_rad, *position);
    noise.step_positions.iter().map(|position| fourier.of_record(&error(position))).collect()
}

/// Whether the mean torque of a trial with this load tells the offset. Where the load's torque depends on the angle, the unknown place
/// of the start position within a step of the encoder makes an error of the mean.
fn has_mean(load: RigLoad) -> bool {
    match load {
        RigLoad::EmptyHandle | RigLoad::KnownWeight { .. } | RigLoad::KnownInertia { .. } => true,
        RigLoad::ClampedHandle | RigLoad::KnownSpring { .. } => false,
    }
}
