//! How likely the trials are at different points, under products that are the same for all.
//!
//! A fit weights its products by their noise at its own point, and leaves out those that are below it. The sums of squares of two fits are
//! therefore sums over different numbers, in different units: the smaller one is not the better one.

use nalgebra::DVector;
use rayon::prelude::*;

use super::fit::RigFitInput;
use super::linear_algebra::{cholesky_factor, solve_lower};
use super::moments::{MomentChannel, MomentLabel, Needed, TrialMoments};
use crate::statistics::log_determinant_of_factor;

/// Channels whose noise has a scale of its own.
const CHANNELS: [MomentChannel; 3] = [MomentChannel::Torque, MomentChannel::Servo, MomentChannel::Mean];

/// The products with motions that no fit has a part in: those of the rig as stated, whose motor follows its target exactly.
pub struct CommonProducts {
    moments: Vec<TrialMoments>,
}

/// A trial at a point.
struct TrialDeviance {
    /// Sum of squares of independent products and their number, of each channel.
    squares: [(f64, f64); CHANNELS.len()],
    /// Logarithm of the determinant of the products' covariance.
    log_determinant: f64,
}

impl CommonProducts {
    /// The products of all trials.
    pub fn new(input: &RigFitInput<'_>) -> Self {
        let constants = input.coordinates.constants_with_ideal_servo(input.prior.mean.as_slice());
        Self { moments: input.trials.par_iter().map(|trial| input.moments(trial, &constants)).collect() }
    }

    /// Twice the negative logarithm of the likelihood of a point, less a constant that is the same for all points.
    ///
    /// The products are normal with the covariance that they have at this point. The noise of each channel may be larger than that at
    /// rest by a factor, which is the one of the largest likelihood; what the model leaves counts as noise.
    pub fn deviance(&mut self, input: &RigFitInput<'_>, point: &DVector<f64>) -> f64 {
        let trials: Vec<TrialDeviance> = self
            .moments
            .par_iter_mut()
            .enumerate()
            .map(|(place, moments)| Self::of_trial(input, moments, place, point))
            .collect();
        let of_channels = (0..CHANNELS.len()).map(|channel| {
            let squares: f64 = trials.iter().map(|own| own.squares[channel].0).sum();
            let count: f64 = trials.iter().map(|own| own.squares[channel].1).sum();
            let variance = if count > 0.0 { (squares / count).max(1.0) } else { 1.0 };
            count * libm::log(variance) + squares / variance
        });
        let determinants: f64 = trials.iter().map(|own| own.log_determinant).sum();
        of_channels.sum::<f64>() + determinants + input.prior.misfit(point)
    }

    fn of_trial(
        input: &RigFitInput<'_>,
        moments: &mut TrialMoments,
        place: usize,
        point: &DVector<f64>,
    ) -> TrialDeviance {
        let trial = &input.trials[place];
        let constants = input.coordinates.constants(point.as_slice());
        moments.move_to(trial, &constants, input.coordinates.at_handle(&constants, trial.load));
        let residual = input.residual(place, moments, &constants, Needed::Both);
        let Some(factor) = cholesky_factor(&moments.covariance(trial, input.noise)) else {
            // A point at which the products have no distribution is no likely one.
            return TrialDeviance { squares: CHANNELS.map(|_| (0.0, 0.0)), log_determinant: f64::INFINITY };
        };
        let independent = solve_lower(&factor, &moments.of(&residual, input.mean_sd_nm));
        let labels = moments.labels();
        let squares = CHANNELS.map(|channel| {
            let own =
                |(label, value): (&MomentLabel, &f64)| (label.channel == channel).then_some(value * value);
            let squares: Vec<f64> = labels.iter().zip(independent.iter()).filter_map(own).collect();
            (squares.iter().sum(), squares.len() as f64)
        });
        TrialDeviance { squares, log_determinant: log_determinant_of_factor(&factor) }
    }
}
