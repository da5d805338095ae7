//! Errors of the angle that trials have in common: the angle at rest between two steps of the encoder, which nobody sees before the motor
//! moves; what smoothing takes out of the motion; and the error of the mean motion of each velocity. Behind a coarse encoder the motions of a
//! velocity have errors of their own in the place of all three. Beside them the errors of the rig's measured constants, which all trials
//! share as well.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::rig_knowledge::{FRICTION_LAWS, RigKnowledge};
use crate::diagnose::predicted_torque::{torques, whitened_change};
use crate::fit::{Fit, Observations, RigConstants, common_input_error_covariance};
use crate::statistics::{group_indices, upper_median};
use crate::wrist::Kinematics;

/// Times after the onset at which the motor starts to leave the encoder step in which it rested, and has left it, s.
const LEAVES_ENCODER_STEP_S: (f64, f64) = (0.001, 0.004);

/// Standard deviation of what smoothing the motion has changed, in the first terms of its series (see [`MovedSessions::changes`]), each of
/// which has the coefficient 1.
const SMOOTHING_SD: f64 = 1.0;

/// A direction of the mean motion's error is left out if it moves the mean residual of a velocity by less than this, in standard errors; so
/// is a drift of a measured constant that moves the predictions of the whole session by less.
pub(super) const SMALLEST_SHIFT: f64 = 0.7;

/// Unknown errors of the angle that trials share.
#[derive(Debug, Clone)]
pub struct AngleErrors {
    /// For each trial, change of its whitened prediction by each error.
    pub columns: Vec<DMatrix<f64>>,
    /// Variance of each error.
    pub variances: DVector<f64>,
    /// The trials that share each error of the place of rest. These errors come first, then those of smoothing, of the rig's
    /// constants, and of motions between the steps of an encoder.
    at_rest: Vec<Vec<usize>>,
    /// The errors of such motions that count.
    in_steps: Vec<ErrorInSteps>,
    moved: Arc<MovedSessions>,
}

/// An error that the motions of one velocity share, behind a coarse encoder.
#[derive(Debug, Clone)]
struct ErrorInSteps {
    /// The trials of the velocity.
    trials: Vec<usize>,
    /// Number of the error.
    place: usize,
}

/// The session with other motions, which do not depend on the model.
#[derive(Debug)]
struct MovedSessions {
    /// The angle at rest wrong by one encoder step, if it has steps.
    at_rest: Option<Observations>,
    /// Smoothed once more, and twice more, if the motions are smoothed ones.
    smoothed: Option<[Observations; 2]>,
    /// With each error of the rig's constants, and each deviation of a measured friction's law.
    rig: Vec<Observations>,
}

/// What the motions of [`MovedSessions`] change.
struct Changes {
    at_rest: Option<Vec<DVector<f64>>>,
    smoothing: Vec<Vec<DVector<f64>>>,
    rig: Vec<Vec<DVector<f64>>>,
}

impl MovedSessions {
    fn of(observations: &Observations, rig: &RigKnowledge) -> Self {
        let is_smoothed = observations.trials.iter().all(|trial| trial.motion_errors.is_none());
        let smoothed = is_smoothed.then(|| {
            let once = observations.smoothed_again();
            let twice = once.smoothed_again();
            [once, twice]
        });
        let at_rest =
            (is_smoothed && observations.angle_step_rad > 0.0).then(|| rounded_at_rest(observations));
        let laws = FRICTION_LAWS.iter().filter(|_| observations.constants.bearing_friction_nm != 0.0);
        let rig = rig
            .errors
            .iter()
            .map(|constants| with_other_constants(observations, constants))
            .chain(laws.map(|law| without_holds(observations.with_friction_law(*law))))
            .collect();
        Self { at_rest, smoothed, rig }
    }

    /// Changes of the whitened predictions of `fit`.
    ///
    /// With S for smoothing, A = 1 - S and the smoothed motion y, the motion was y + A y + A^2 y + ...: `smoothing` is of its first two
    /// terms, of which the effect is taken to be linear.
    fn changes(&self, observations: &Observations, fit: &Fit) -> Changes {
        let from = torques(observations, &fit.kinds, &fit.parameters);
        let change = |moved: &Observations| {
            let to = torques(moved, &fit.kinds, &fit.parameters);
            whitened_change(observations, fit, &from, &to)
        };
        let smoothing = self.smoothed.iter().flat_map(|smoothed| {
            let [first, both] = smoothed.each_ref().map(change);
            let second = first.iter().zip(&both).map(|(first, both)| first * 2.0 - both).collect();
            [first, second]
        });
        Changes {
            at_rest: self.at_rest.as_ref().map(change),
            smoothing: smoothing.collect(),
            rig: self
                .rig
                .iter()
                .map(|moved| change_against_record(observations, moved, fit, &from))
                .collect(),
        }
    }
}

/// The session with other constants of the rig; without its holds, of which no prediction is made.
pub(super) fn with_other_constants(observations: &Observations, constants: &RigConstants) -> Observations {
    without_holds(observations.with_constants(*constants))
}

fn without_holds(mut changed: Observations) -> Observations {
    changed.trials.iter_mut().for_each(|trial| trial.hold_stretches = Vec::new());
    changed
}

/// Change of the whitened predictions of `fit` where the constants of the rig are those of `moved`, less that of the whitened records: the
/// constants turn both.
///
/// The record is that which the model predicts. In the measured one the constants turn the noise as well: a larger gain would be taken
/// for less noise, and be the more probable the more values there are.
pub(super) fn change_against_record(
    observations: &Observations,
    moved: &Observations,
    fit: &Fit,
    from: &[Vec<f64>],
) -> Vec<DVector<f64>> {
    let mut to = torques(moved, &fit.kinds, &fit.parameters);
    let rescaling = observations.constants.rescaled_to(&moved.constants);
    for (trial, there) in to.iter_mut().enumerate() {
        let own = &observations.trials[trial];
        let level_nm = own.direction * own.torque_0_nm;
        let changed_record = observations.torque_of(&moved.trials[trial].measured_nm);
        let values = changed_record.iter().zip(observations.torque_of(&own.measured_nm)).zip(&from[trial]);
        for (nm, ((changed, measured), predicted)) in there.iter_mut().zip(values) {
            let of_noise = rescaling.change_of_noise(level_nm + measured) * (measured - predicted);
            *nm -= changed - measured - of_noise;
        }
    }
    whitened_change(observations, fit, from, &to)
}

impl AngleErrors {
    /// The errors of a session about the model of `fit`.
    ///
    /// The place of rest is equally likely anywhere within a step, in common to all trials that return to it; the mean motion of a
    /// velocity adds what its number of trials leaves. The mean motion's error during the ramp has the covariance that the fit's weights
    /// have, once for all trials of a velocity.
    pub fn of(observations: &Observations, fit: &Fit, rig: &RigKnowledge) -> Self {
        let trials = observations.trials.len();
        let velocities: Vec<Vec<usize>> =
            group_indices(trials, |trial| observations.trials[trial].velocity_rad_s.to_bits())
                .into_values()
                .collect();
        let values =
            |trial: usize| fit.objective.whitened_count(observations.noise_index[trial], observations.rows());
        // Each error: its variance, the trials that share it, and each trial's change.
        let mut errors: Vec<(f64, Vec<usize>, Vec<DVector<f64>>)> = Vec::new();
        let mut at_rest = Vec::new();
        let moved = MovedSessions::of(observations, rig);
        let changes = moved.changes(observations, fit);
        if let Some(changes) = changes.at_rest {
            // The variance of a uniform distribution of width one.
            let variance = 1.0 / 12.0;
            at_rest.push((0..trials).collect());
            errors.push((variance, (0..trials).collect(), changes.clone()));
            for own in &velocities {
                at_rest.push(own.clone());
                errors.push((variance / own.len() as f64, own.clone(), changes.clone()));
            }
        }
        for changes in changes.smoothing {
            errors.push((SMOOTHING_SD * SMOOTHING_SD, (0..trials).collect(), changes));
        }
        for changes in changes.rig {
            errors.push((1.0, (0..trials).collect(), changes));
        }
        let mut in_steps = Vec::new();
        for own in &velocities {
            let errors_of_first = observations.trials[own[0]].motion_errors.as_ref();
            for place in 0..errors_of_first.map_or(0, |errors| errors.shared.len()) {
                let error = ErrorInSteps { trials: own.clone(), place };
                let changes = error.changes(observations, fit);
                let shift: f64 = changes.iter().map(DVector::norm_squared).sum();
                if shift > SMALLEST_SHIFT * SMALLEST_SHIFT {
                    let mut of_all = vec![DVector::zeros(0); trials];
                    own.iter().zip(changes).for_each(|(trial, change)| of_all[*trial] = change);
                    errors.push((1.0, own.clone(), of_all));
                    in_steps.push(error);
                }
            }
        }
        for direction in mean_motion_errors(observations, fit) {
            let changes: Vec<DVector<f64>> = (0..trials)
                .map(|trial| fit.objective.whiten(observations.noise_index[trial], &direction))
                .collect();
            for own in &velocities {
                let shift: f64 = own.iter().map(|trial| changes[*trial].norm_squared()).sum();
                if shift > SMALLEST_SHIFT * SMALLEST_SHIFT {
                    errors.push((1.0, own.clone(), changes.clone()));
                }
            }
        }
        let column = |trial: usize| {
            let mut own = DMatrix::zeros(values(trial), errors.len());
            for (place, (_, shared_by, changes)) in errors.iter().enumerate() {
                if shared_by.contains(&trial) {
                    own.set_column(place, &changes[trial]);
                }
            }
            own
        };
        let variances = DVector::from_iterator(errors.len(), errors.iter().map(|(variance, ..)| *variance));
        Self {
            columns: (0..trials).map(column).collect(),
            variances,
            at_rest,
            in_steps,
            moved: Arc::new(moved),
        }
    }

    /// The same errors about another model: a torque that is recorded late, for example, shows them late.
    pub fn about(&self, observations: &Observations, fit: &Fit) -> Self {
        let mut errors = self.clone();
        let mut set = |place: usize, shared_by: &[usize], changes: &[DVector<f64>]| {
            for trial in shared_by {
                errors.columns[*trial].set_column(place, &changes[*trial]);
            }
        };
        let Changes { at_rest, smoothing, rig } = self.moved.changes(observations, fit);
        for (place, shared_by) in self.at_rest.iter().enumerate() {
            at_rest.iter().for_each(|changes| set(place, shared_by, changes));
        }
        let all: Vec<usize> = (0..self.columns.len()).collect();
        let of_session = smoothing.len() + rig.len();
        for (place, changes) in smoothing.iter().chain(&rig).enumerate() {
            set(self.at_rest.len() + place, &all, changes);
        }
        for (place, error) in self.in_steps.iter().enumerate() {
            for (trial, change) in error.trials.iter().zip(error.changes(observations, fit)) {
                errors.columns[*trial].set_column(self.at_rest.len() + of_session + place, &change);
            }
        }
        errors
    }
}

impl ErrorInSteps {
    /// Changes of the whitened predictions of `fit`, for each trial of the velocity.
    fn changes(&self, observations: &Observations, fit: &Fit) -> Vec<DVector<f64>> {
        let as_known = observations.subset(&self.trials);
        let mut moved = as_known.clone();
        for trial in &mut moved.trials {
            let Some(errors) = &trial.motion_errors else { continue };
            for (knot, by) in trial.input.motion.iter_mut().zip(&errors.shared[self.place]) {
                *knot = Kinematics { theta: knot.theta + by.theta, omega: knot.omega + by.omega };
            }
        }
        let parameters: Vec<Vec<f64>> =
            self.trials.iter().map(|trial| fit.parameters[*trial].clone()).collect();
        let [from, to] = [&as_known, &moved].map(|own| torques(own, &fit.kinds, &parameters));
        whitened_change(&moved, fit, &from, &to)
    }
}

/// Independent directions of the torque error that the mean motion's error causes, of unit variance, N m at every sample of the window.
fn mean_motion_errors(observations: &Observations, fit: &Fit) -> Vec<Vec<f64>> {
    let middle =
        |parameter: usize| upper_median(fit.parameters.iter().map(|own| own[parameter])).unwrap_or(f64::NAN);
    let covariance = common_input_error_covariance(observations, &std::array::from_fn(middle));
    let samples: Vec<usize> = observations.noise_samples().collect();
    let eigen = covariance.symmetric_eigen();
    let direction = |(place, value): (usize, &f64)| {
        let mut torque = vec![0.0; observations.rows()];
        for (sample, own) in samples.iter().zip(eigen.eigenvectors.column(place).iter()) {
            torque[*sample] = own * libm::sqrt(value.max(0.0));
        }
        torque
    };
    eigen.eigenvalues.iter().enumerate().map(direction).collect()
}

/// The session where the angle at rest is wrong by one encoder step.
fn rounded_at_rest(observations: &Observations) -> Observations {
    let mut shifted = observations.clone();
    for trial in &mut shifted.trials {
        let onset = trial.input.onset;
        for (sample, knot) in trial.input.motion.iter_mut().enumerate().skip(onset) {
            let time = (sample - onset) as f64 * observations.period_s;
            let (from, to) = LEAVES_ENCODER_STEP_S;
            let part = ((time - from) / (to - from)).clamp(0.0, 1.0);
            let phase = std::f64::consts::PI * part;
            let step = trial.direction * observations.angle_step_rad;
            knot.theta += step * 0.5 * (1.0 - libm::cos(phase));
            knot.omega += step * 0.5 * libm::sin(phase) * std::f64::consts::PI / (to - from);
        }
    }
    shifted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::RigQuantity;
    use crate::diagnose::test_session::{LEVER, measured_rig, session};
    use crate::fit::{Model, PreprocessingSettings, Weighting};
    use crate::wrist::mechanisms::MechanismKind;

    /// Number of errors that trials share, with a calibration of this friction.
    fn shared_errors(friction_nm: f64) -> usize {
        let session = session(MechanismKind::TorqueLag, |_| vec![2000.0, 1.0]);
        let rig = measured_rig(&[(RigQuantity::BearingFriction, friction_nm, 0.000_1)], None);
        let observations =
            Observations::of_rig(&session, PreprocessingSettings::default(), rig.constants).unwrap();
        let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
        let errors = AngleErrors::of(&observations, &fit, &rig);
        assert_eq!(rig.constants.lever, Some(LEVER));
        errors.variances.len()
    }

    #[test]
    fn a_measured_friction_may_follow_other_laws_than_a_constant_one() {
        // One more error is of its size.
        assert_eq!(shared_errors(0.005), shared_errors(0.0) + FRICTION_LAWS.len() + 1);
    }
}
