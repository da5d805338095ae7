//! The joint fit of all constants to all rig trials: Gauss-Newton steps with damping, products renewed between them.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::constants::{
    CUBIC_PLACE, DAMPING_GROWTH_PLACE, DELAY_PLACE, FIRST_KNOWN, FRICTION_PLACE, FittedConstants, LAG_PLACE,
    PRESLIDING_PLACE, PRESLIDING_TRAVEL_PLACE, REPORTED, RigCoordinates, SERVO_PLACE,
};
use super::error::CalibrateError;
use super::linear_algebra::{cholesky_factor, solve_lower, solve_lower_columns};
use super::moments::{
    MomentChannel, MomentLabel, Needed, OfTorqueChannel, TrialMoments, TrialResidual, residual,
    torque_channel_derivative,
};
use super::prepared_trial::{ChannelNoise, PreparedTrial};

/// Times that the products are renewed at the constants found.
const RENEWALS: usize = 3;
/// Steps of the search between two renewals.
const STEPS: usize = 30;
/// Step of the finite differences, as a part of what engineering allows. It is so small because a combination of constants that no trial
/// tells must come out as one, however many samples there are.
const DIFFERENCE: f64 = 1e-7;
/// Largest step, in standard errors, at which a search has ended.
const ENDED: f64 = 1e-2;
/// Largest step, in standard errors, after which another one is taken by the same slopes.
const SHORT: f64 = 1.0;

/// The trials of a fit and what is known of their noise.
#[derive(Clone)]
pub struct RigFitInput<'a> {
    /// The trials.
    pub trials: &'a [PreparedTrial],
    /// The coordinates.
    pub coordinates: RigCoordinates,
    /// What is known of them before.
    pub prior: RigPrior,
    /// The noise at rest.
    pub noise: &'a ChannelNoise,
    /// Standard deviation of a trial's mean torque, N m.
    pub mean_sd_nm: f64,
    /// Speed that the factor of the friction's speed refers to, rad/s.
    pub friction_speed_rad_s: f64,
    /// Standard deviation of a moment of the torque beside that of the noise at rest.
    pub torque_scale: f64,
    /// Standard deviation of a moment of the servo beside that of the noise at rest.
    pub servo_scale: f64,
}

/// What is known of the coordinates before the trials are seen.
#[derive(Debug, Clone)]
pub struct RigPrior {
    /// Their means.
    pub mean: DVector<f64>,
    /// Inverse of their covariance.
    pub precision: DMatrix<f64>,
}

impl RigPrior {
    /// Square of a point's distance from the mean, in standard deviations.
    pub fn misfit(&self, point: &DVector<f64>) -> f64 {
        let from_mean = point - &self.mean;
        from_mean.dot(&(&self.precision * &from_mean))
    }

    /// What engineering allows about the start of the coordinates, and the stated values of the loads.
    pub fn of_engineering(coordinates: &RigCoordinates) -> Self {
        let precision = coordinates.prior_sd.iter().map(|sd| 1.0 / (sd * sd));
        let precision = DVector::from_iterator(coordinates.count(), precision);
        Self { mean: DVector::zeros(coordinates.count()), precision: DMatrix::from_diagonal(&precision) }
    }
}

/// The equations of one trial at a point, in units in which its noise is independent with variance one.
pub struct RigTrialEquations {
    /// Labels of the moments.
    pub labels: Vec<MomentLabel>,
    /// Residual of each, in standard deviations; not made independent.
    pub standardised: DVector<f64>,
    /// Residual, independent.
    pub residual: DVector<f64>,
    /// Derivative of the residual.
    pub jacobian: DMatrix<f64>,
    /// Covariance of the residual under the noise without the encoder's steps, in the same units.
    pub noise_covariance: DMatrix<f64>,
    /// Residual that each position of the encoder's steps would make.
    pub step_errors: Vec<DVector<f64>>,
    /// Inverse of the noise's Cholesky factor, from moments to independent values.
    pub deviations: DVector<f64>,
    /// Cholesky factor of the noise of the moments.
    pub factor: DMatrix<f64>,
}

/// A fit.
pub struct RigFit {
    /// The coordinates found.
    pub point: DVector<f64>,
    /// The equations there, trial by trial.
    pub equations: Vec<RigTrialEquations>,
}

impl RigFit {
    /// Information of the trials on the coordinates: the normal equations without what is known beforehand.
    pub fn information(&self) -> DMatrix<f64> {
        let size = self.point.len();
        self.equations
            .iter()
            .fold(DMatrix::zeros(size, size), |sum, own| sum + own.jacobian.transpose() * &own.jacobian)
    }
}

/// A coordinate as all but its own statement have it.
pub struct ReleasedFit {
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub se: f64,
    /// Decrease of the cost without the statement; if the statement is right, chi-square with one degree of freedom.
    pub gain: f64,
}

/// Where a search ended.
struct SearchEnd {
    point: DVector<f64>,
    /// Standard errors of the coordinates.
    se: DVector<f64>,
    cost: f64,
}

/// A point of a search.
struct SearchPoint {
    point: DVector<f64>,
    /// Independent residuals there, trial by trial.
    residuals: Vec<DVector<f64>>,
    cost: f64,
    /// Part by which the diagonal of the normal equations is raised in the next step.
    damping: f64,
}

/// Slopes of the residuals at a point of a search.
struct SearchSlopes {
    jacobians: Vec<DMatrix<f64>>,
    /// Matrix of the normal equations, with what is known beforehand.
    normal: DMatrix<f64>,
    is_free: fn(usize) -> bool,
}

/// Products and whitening of one trial.
struct Whitened {
    moments: TrialMoments,
    labels: Vec<MomentLabel>,
    factor: DMatrix<f64>,
}

impl RigFitInput<'_> {
    /// Fits anew, near a fit, once for each of `places`, where all that is known before of the coordinate there has this precision. The weights
    /// are those of the fit, so that the costs of both can be compared (the distance test of Newey and West 1987).
    ///
    /// # Errors
    /// As [`RigFitInput::fit`].
    pub fn released(
        &self,
        fit: &RigFit,
        places: impl Iterator<Item = usize>,
        precision: f64,
    ) -> Result<Vec<ReleasedFit>, CalibrateError> {
        let whitened = self.whitened(&fit.point)?;
        let values = fit.equations.iter().map(|own| own.residual.len()).sum::<usize>() as f64;
        // The products are those of the fit, its own search stopped before they were: both fits are searched to their ends.
        let stated = self.search(&whitened, fit.point.clone(), |_| true);
        let released = |place: usize| {
            let mut prior = self.prior.clone();
            prior.precision[(place, place)] = precision;
            let without = Self { coordinates: self.coordinates.clone(), prior, ..*self };
            let end = without.search(&whitened, stated.point.clone(), |_| true);
            let mut again = end.point.clone();
            again[place] = stated.point[place];
            let again = self.search(&whitened, again, |_| true);
            // What the model leaves beyond the noise counts as noise.
            let excess = (end.cost / values).max(1.0);
            ReleasedFit {
                value: end.point[place],
                se: end.se[place],
                gain: (stated.cost.min(again.cost) - end.cost) / excess,
            }
        };
        Ok(places.map(released).collect())
    }

    /// Fits all coordinates from a point.
    ///
    /// # Errors
    /// If the moments of a trial have no covariance at a point that is reached.
    pub fn fit(&self, from: &DVector<f64>) -> Result<RigFit, CalibrateError> {
        self.fit_some(from, |_| true)
    }

    /// Fits the coordinates of the servo from a point; the others stay where they are.
    ///
    /// # Errors
    /// As [`RigFitInput::fit`].
    pub fn fit_servo(&self, from: &DVector<f64>) -> Result<RigFit, CalibrateError> {
        self.fit_some(from, is_of_servo)
    }

    fn fit_some(&self, from: &DVector<f64>, is_free: fn(usize) -> bool) -> Result<RigFit, CalibrateError> {
        let mut point = from.clone();
        let mut whitened = self.whitened(&point)?;
        for _ in 0..RENEWALS {
            let end = self.search(&whitened, point.clone(), is_free);
            let moved = (&end.point - &point).component_div(&end.se).amax();
            point = end.point;
            whitened = self.whitened(&point)?;
            if moved < 0.1 {
                break;
            }
        }
        let equations = self.equations(&whitened, &point);
        Ok(RigFit { point, equations })
    }

    /// A point that is no fit, with its equations.
    ///
    /// # Errors
    /// As [`RigFitInput::fit`].
    pub fn at(&self, point: DVector<f64>) -> Result<RigFit, CalibrateError> {
        let equations = self.equations(&self.whitened(&point)?, &point);
        Ok(RigFit { point, equations })
    }

    /// The products of a trial at some constants.
    pub fn moments(&self, trial: &PreparedTrial, constants: &FittedConstants) -> TrialMoments {
        let range = |place: usize| {
            self.coordinates.scales[place].value(1.0) - self.coordinates.scales[place].value(0.0)
        };
        let [friction, cubic, growth] = [FRICTION_PLACE, CUBIC_PLACE, DAMPING_GROWTH_PLACE].map(range);
        let presliding = if self.coordinates.has_presliding { range(PRESLIDING_PLACE) } else { 0.0 };
        let small_terms = [friction, cubic, growth, presliding];
        let handle = self.coordinates.at_handle(constants, trial.load);
        TrialMoments::new(trial, constants, handle, self.noise, self.friction_speed_rad_s, small_terms)
    }

    fn whitened(&self, point: &DVector<f64>) -> Result<Vec<Whitened>, CalibrateError> {
        let constants = self.coordinates.constants(point.as_slice());
        self.trials
            .par_iter()
            .map(|trial| {
                let moments = self.moments(trial, &constants);
                let labels = moments.labels();
                let covariance = self.grown(moments.covariance(trial, self.noise), &labels);
                let factor = cholesky_factor(&covariance)
                    .ok_or(CalibrateError::NoCovariance("the noise of a trial's moments"))?;
                Ok(Whitened { moments, labels, factor })
            })
            .collect()
    }

    /// A covariance of moments with what is beside the noise at rest. It is noise of one channel alone: what an error of the angle makes
    /// in both channels at once stays as it is.
    fn grown(&self, mut covariance: DMatrix<f64>, labels: &[MomentLabel]) -> DMatrix<f64> {
        let variance = |channel: MomentChannel| match channel {
            MomentChannel::Mean => 1.0,
            MomentChannel::Torque => self.torque_scale * self.torque_scale,
            MomentChannel::Servo => self.servo_scale * self.servo_scale,
        };
        for (row, own) in labels.iter().enumerate() {
            for (column, _) in labels.iter().enumerate().filter(|(_, other)| other.channel == own.channel) {
                covariance[(row, column)] *= variance(own.channel);
            }
        }
        covariance
    }

    /// Residual of the trial in a place.
    pub fn residual(
        &self,
        place: usize,
        moments: &TrialMoments,
        constants: &FittedConstants,
        needed: Needed,
    ) -> TrialResidual {
        let trial = &self.trials[place];
        let handle = self.coordinates.at_handle(constants, trial.load);
        residual(trial, moments, constants, handle, self.friction_speed_rad_s, needed)
    }

    /// Independent residuals, trial by trial.
    fn residuals(&self, whitened: &[Whitened], point: &DVector<f64>) -> Vec<DVector<f64>> {
        let constants = self.coordinates.constants(point.as_slice());
        let places = whitened.par_iter().enumerate();
        places
            .map(|(place, own)| {
                let residual = self.residual(place, &own.moments, &constants, Needed::Both);
                solve_lower(&own.factor, &own.moments.of(&residual, self.mean_sd_nm))
            })
            .collect()
    }

    /// Independent residuals and their derivatives, trial by trial.
    fn linearised(
        &self,
        whitened: &[Whitened],
        point: &DVector<f64>,
        is_free: fn(usize) -> bool,
    ) -> Vec<(DVector<f64>, DMatrix<f64>)> {
        let constants = self.coordinates.constants(point.as_slice());
        (0..self.trials.len())
            .into_par_iter()
            .map(|place| {
                let own = &whitened[place];
                let base = self.residual(place, &own.moments, &constants, Needed::Both);
                let at = own.moments.of(&base, self.mean_sd_nm);
                let mut jacobian = DMatrix::zeros(at.len(), self.coordinates.count());
                for column in 0..self.coordinates.count() {
                    if !is_free(column) || !self.matters(column, place) {
                        continue;
                    }
                    let derivative = if let Some(of) = of_torque_channel(column) {
                        let derivative =
                            torque_channel_derivative(&self.trials[place], &base, &constants, of);
                        own.moments.of(&derivative, self.mean_sd_nm) * self.coordinates.scales[column].range()
                    } else {
                        let mut moved = point.clone();
                        moved[column] += DIFFERENCE;
                        let moved = self.coordinates.constants(moved.as_slice());
                        let is_of_servo = is_of_servo(column);
                        let needed = if is_of_servo { Needed::Servo } else { Needed::Torque };
                        let moved = self.residual(place, &own.moments, &moved, needed);
                        let mut change = own.moments.of(&moved, self.mean_sd_nm);
                        for (row, label) in own.labels.iter().enumerate() {
                            // The other residual was not computed: it does not change.
                            change[row] = if (label.channel == MomentChannel::Servo) == is_of_servo {
                                (change[row] - at[row]) / DIFFERENCE
                            } else {
                                0.0
                            };
                        }
                        change
                    };
                    jacobian.set_column(column, &derivative);
                }
                (solve_lower(&own.factor, &at), solve_lower_columns(&own.factor, &jacobian))
            })
            .collect()
    }

    /// Whether a coordinate can matter to a trial.
    fn matters(&self, column: usize, place: usize) -> bool {
        if [PRESLIDING_PLACE, PRESLIDING_TRAVEL_PLACE].contains(&column) {
            return self.coordinates.has_presliding;
        }
        match column.checked_sub(RigCoordinates::first_load()) {
            None => true,
            Some(load) => self.trials[place].load.without_sign() == self.coordinates.loads[load],
        }
    }

    /// Searches the point of the smallest cost with fixed products.
    fn search(&self, whitened: &[Whitened], start: DVector<f64>, is_free: fn(usize) -> bool) -> SearchEnd {
        let residuals = self.residuals(whitened, &start);
        let cost = self.cost(&residuals, &start);
        let mut at = SearchPoint { point: start, residuals, cost, damping: 1e-3 };
        let mut se = DVector::from_element(at.point.len(), 1.0);
        for _ in 0..STEPS {
            let slopes = self.slopes(whitened, &at.point, is_free);
            if let Some(inverse) = slopes.normal.clone().cholesky().map(|factor| factor.inverse()) {
                se = inverse.diagonal().map(libm::sqrt);
            }
            match self.step_down(whitened, &mut at, &slopes, &se) {
                // Slopes cost ten times what residuals do, and change little within a short step: they serve for another one.
                Some(step) if step >= ENDED => {
                    if step < SHORT {
                        self.step_down(whitened, &mut at, &slopes, &se);
                    }
                }
                _ => break,
            }
        }
        SearchEnd { point: at.point, se, cost: at.cost }
    }

    fn cost(&self, residuals: &[DVector<f64>], point: &DVector<f64>) -> f64 {
        residuals.iter().map(DVector::norm_squared).sum::<f64>() + self.prior.misfit(point)
    }

    fn slopes(
        &self,
        whitened: &[Whitened],
        point: &DVector<f64>,
        is_free: fn(usize) -> bool,
    ) -> SearchSlopes {
        let jacobians: Vec<DMatrix<f64>> =
            self.linearised(whitened, point, is_free).into_iter().map(|own| own.1).collect();
        let mut normal = self.prior.precision.clone();
        for jacobian in &jacobians {
            normal += jacobian.transpose() * jacobian;
        }
        for place in (0..point.len()).filter(|place| !is_free(*place)) {
            normal.fill_row(place, 0.0);
            normal.fill_column(place, 0.0);
            normal[(place, place)] = 1.0;
        }
        SearchSlopes { jacobians, normal, is_free }
    }

    /// Goes to a point of a smaller cost. The length of the step, in standard errors; `None` if there is none.
    fn step_down(
        &self,
        whitened: &[Whitened],
        at: &mut SearchPoint,
        slopes: &SearchSlopes,
        se: &DVector<f64>,
    ) -> Option<f64> {
        let mut gradient = &self.prior.precision * (&at.point - &self.prior.mean);
        for (residual, jacobian) in at.residuals.iter().zip(&slopes.jacobians) {
            gradient += jacobian.transpose() * residual;
        }
        for place in (0..gradient.len()).filter(|place| !(slopes.is_free)(*place)) {
            // Neither the trials nor what is known before move it.
            gradient[place] = 0.0;
        }
        while at.damping < 1e12 {
            let mut damped = slopes.normal.clone();
            for place in 0..gradient.len() {
                damped[(place, place)] *= 1.0 + at.damping;
            }
            let Some(factor) = damped.cholesky() else {
                at.damping *= 10.0;
                continue;
            };
            let change = -factor.solve(&gradient);
            let step = change.component_div(se).amax();
            let point = &at.point + &change;
            let residuals = self.residuals(whitened, &point);
            let cost = self.cost(&residuals, &point);
            if cost <= at.cost {
                let damping = (at.damping / 10.0).max(1e-12);
                *at = SearchPoint { point, residuals, cost, damping };
                return Some(step);
            }
            // At the optimum rounding decides which of two points is the better one.
            if step < ENDED {
                return None;
            }
            at.damping *= 10.0;
        }
        None
    }

    fn equations(&self, whitened: &[Whitened], point: &DVector<f64>) -> Vec<RigTrialEquations> {
        let constants = self.coordinates.constants(point.as_slice());
        let linearised = self.linearised(whitened, point, |_| true);
        let parts = whitened.par_iter().zip(linearised).enumerate();
        parts
            .map(|(place, (own, (residual, jacobian)))| {
                let trial = &self.trials[place];
                let residual_there = self.residual(place, &own.moments, &constants, Needed::Both);
                let moments = own.moments.of(&residual_there, self.mean_sd_nm);
                let deviations = DVector::from_fn(moments.len(), |row, _| own.factor.row(row).norm());
                let noise = self.grown(own.moments.covariance_without_steps(trial, self.noise), &own.labels);
                let half = solve_lower_columns(&own.factor, &noise);
                RigTrialEquations {
                    labels: own.labels.clone(),
                    standardised: moments.component_div(&deviations),
                    residual,
                    jacobian,
                    noise_covariance: solve_lower_columns(&own.factor, &half.transpose()),
                    step_errors: own
                        .moments
                        .of_steps()
                        .iter()
                        .map(|error| solve_lower(&own.factor, error))
                        .collect(),
                    deviations,
                    factor: own.factor.clone(),
                }
            })
            .collect()
    }
}

/// Which constant of the torque channel a coordinate is.
fn of_torque_channel(column: usize) -> Option<OfTorqueChannel> {
    match column {
        3 => Some(OfTorqueChannel::Gain),
        4 => Some(OfTorqueChannel::Offset),
        DELAY_PLACE => Some(OfTorqueChannel::Delay),
        LAG_PLACE => Some(OfTorqueChannel::Lag),
        _ => None,
    }
}

/// Whether a coordinate is one of the servo.
fn is_of_servo(column: usize) -> bool {
    column == SERVO_PLACE || (REPORTED..=FIRST_KNOWN + 1).contains(&column)
}
