//! The observations of a session: what the model is driven by, what it must predict, and the noise of both.

use std::sync::Arc;

use super::bearing_friction::{FrictionEffect, FrictionLaw};
use super::motion_errors::MotionErrors;
use super::rig_constants::{RigConstants, TorqueRescaling};
use crate::signal::{FilterSpec, NoiseCovariance, Section};
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{
    self, Kinematics, Lever, ScaledChannel, SimulationSettings, Smoothing, VectorWidth, delayed_motion,
};

/// Torque and angle before the ramp are means over this time, s.
const LEVEL_S: f64 = 0.010;

/// Data from which the noise of the torque was estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseSource {
    /// The holds before the ramps, which contain noise alone.
    Holds,
    /// The differences between the repetitions of a condition, which contain noise and the true variation from trial to trial. A
    /// standard error from this source says how far another repetition may lie from this one.
    Repetitions,
    /// The differences between the residuals of repetitions after a fit, which contain noise less the part that the parameters of
    /// the trials absorbed.
    Residuals,
}

/// The observations of a session after preprocessing.
#[derive(Debug, Clone)]
pub struct Observations {
    /// The lever between motor and hand; `None` for a rigid lever.
    pub lever: Option<Lever>,
    /// Sample period, s.
    pub period_s: f64,
    /// Number of samples in the analysis window, which begins at the onset.
    pub samples: usize,
    /// Number of samples before the onset at which the simulation of the base model starts.
    pub lead_samples: usize,
    /// The constants of the rig by which the records became angle and torque.
    pub constants: RigConstants,
    /// The law by which the friction of the bearing is taken out.
    pub friction_law: FrictionLaw,
    /// The low-pass that measured and predicted torque pass: that of the rig, if it filtered before recording; `None` if there is none.
    pub filter: Option<FilterSpec>,
    /// Its sections.
    pub sections: Vec<Section>,
    /// Sections that predicted torque passes: the same, after the low-pass of the torque channel if it has one.
    pub prediction_sections: Vec<Section>,
    /// The trials that can be fitted, ordered by condition, repetition and number.
    pub trials: Vec<TrialObservation>,
    /// The trials that cannot be fitted.
    pub excluded_trials: Vec<ExcludedTrial>,
    /// Trials of the session without an EMG channel that others have.
    pub emg_gaps: EmgGaps,
    /// Noise covariances refer to every `stride`th sample of the window; the filtered noise is smooth in between.
    pub stride: usize,
    /// Standard deviation of the error of the recorded angle, rad; at least that of the encoder's quantisation.
    pub angle_noise_rad: f64,
    /// Step of the encoder, rad, if quantisation dominates the error of the angle; otherwise zero.
    pub angle_step_rad: f64,
    /// Smoothings applied to the angle, each with the share of the variance of an angle error that passes it.
    pub angle_smoothings: Vec<(f64, Smoothing)>,
    /// The channels besides the torque that the session has, with their scale.
    pub further: Vec<ScaledChannel>,
    /// For each further channel, the step of its encoder in its unit, if quantisation dominates its error; otherwise zero.
    pub further_step: Vec<f64>,
    /// For each trial, the index of its noise in `noise_covariances`; `None` if no noise could be estimated.
    pub noise_index: Vec<Option<usize>>,
    /// Estimated covariances of the noise of all channels on [`Observations::noise_samples`]: one per torque level, or one for all.
    pub noise_covariances: Vec<NoiseCovariance>,
    /// Data from which the covariances were estimated; `None` if there are no covariances.
    pub noise_source: Option<NoiseSource>,
}

/// Trials that lack an EMG channel which other trials of the session have: then it tells nothing of any of them, for a trial without it is
/// not one without activity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EmgGaps {
    /// Number of trials without flexor EMG; zero if none has it.
    pub without_flexor: usize,
    /// Number of trials without extensor EMG; zero if none has it.
    pub without_extensor: usize,
    /// Number of trials.
    pub of: usize,
}

/// A trial that is excluded from the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcludedTrial {
    /// Number of the trial in the session.
    pub trial: u32,
    /// Reason of the exclusion, as text for a reader.
    pub reason: String,
}

/// The observation of one trial.
#[derive(Debug, Clone)]
pub struct TrialObservation {
    /// Number of the trial in the session.
    pub number: u32,
    /// Index of the condition; conditions are ordered by velocity, torque and label.
    pub condition: usize,
    /// Label of the condition, if the session has labels.
    pub label: Option<String>,
    /// Repetition index, from 1.
    pub repetition: u32,
    /// Ramp velocity that the session states, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque that the session states, N m.
    pub torque_nm: f64,
    /// 1, or -1 if the ramp turns in the negative direction; angle and torque are multiplied by this sign.
    pub direction: f64,
    /// Onset of the ramp on the time axis of the record, s.
    pub onset_s: f64,
    /// By how much the onset that the session states is after that, or before it if negative, s; 0 if none is stated.
    pub stated_late_s: f64,
    /// Mean motor angle before the ramp, rad.
    pub theta_0_rad: f64,
    /// Mean torque before the ramp, N m.
    pub torque_0_nm: f64,
    /// Recorded angle less `theta_0_rad`, times `direction`, rad; as long as the motion in `input`.
    pub angle_rad: Vec<f64>,
    /// Recorded torque less `torque_0_nm`, unfiltered, times `direction`, N m, at the samples of `angle_rad`: the load of the motor.
    pub load_nm: Vec<f64>,
    /// Motor motion and covariates that drive the model.
    pub input: wrist::TrialInput,
    /// What is not known of the motion, where it is that between the steps of an encoder.
    pub motion_errors: Option<Arc<MotionErrors>>,
    /// Filtered torque in the window less `torque_0_nm`, times `direction`, N m; one value per sample of the window. The further channels
    /// follow, treated alike and scaled to N m.
    pub measured_nm: Vec<f64>,
    /// The friction of the bearing that was taken out of `measured_nm` and `input`; `None` without one.
    pub friction: Option<FrictionEffect>,
    /// Filtered cube of the torque in the window, less that before the ramp, times `direction`, (N m)^3: the change of `measured_nm` by a
    /// cubic torque channel.
    pub cubed_nm3: Vec<f64>,
    /// Mean filtered cube of the torque before the ramp, (N m)^3.
    pub cubed_0_nm3: f64,
    /// Stretches of the hold, all channels, each processed like the window and read at [`Observations::noise_samples`], N m.
    pub hold_stretches: Vec<Vec<f64>>,
}

impl Observations {
    /// The observations of `trials`, given by index; noise covariances and settings stay.
    pub fn subset(&self, trials: &[usize]) -> Self {
        Self {
            lever: self.lever,
            period_s: self.period_s,
            samples: self.samples,
            lead_samples: self.lead_samples,
            constants: self.constants,
            friction_law: self.friction_law,
            filter: self.filter,
            sections: self.sections.clone(),
            prediction_sections: self.prediction_sections.clone(),
            trials: trials.iter().map(|trial| self.trials[*trial].clone()).collect(),
            excluded_trials: Vec::new(),
            emg_gaps: self.emg_gaps,
            stride: self.stride,
            angle_noise_rad: self.angle_noise_rad,
            angle_step_rad: self.angle_step_rad,
            angle_smoothings: self.angle_smoothings.clone(),
            further: self.further.clone(),
            further_step: self.further_step.clone(),
            noise_index: trials.iter().map(|trial| self.noise_index[*trial]).collect(),
            noise_covariances: self.noise_covariances.clone(),
            noise_source: self.noise_source,
        }
    }

    /// The same session where another law of the bearing's friction is taken out.
    pub fn with_friction_law(&self, law: FrictionLaw) -> Self {
        Self { friction_law: law, ..self.clone() }.with_constants(self.constants)
    }

    /// The same session with other constants of the rig. The noise keeps its estimate, so that fits of both weigh alike.
    ///
    /// Exact for the gains and the lever. A nonlinearity, which acts before the filter, is changed to first order.
    pub fn with_constants(&self, constants: RigConstants) -> Self {
        let before = self.constants;
        let (by_angle, delay_s) =
            (before.angle_gain / constants.angle_gain, constants.torque_delay_s - before.torque_delay_s);
        let TorqueRescaling { scale: by_torque, shift_nm, cubic_per_nm2: cubic } =
            before.rescaled_to(&constants);
        let mut changed = self.clone();
        changed.angle_noise_rad *= by_angle;
        changed.angle_step_rad *= by_angle;
        changed.lever = constants.lever;
        changed.prediction_sections = constants.prediction_sections(&self.sections, self.period_s);
        changed.constants = constants;
        let mut trials = std::mem::take(&mut changed.trials);
        for trial in &mut trials {
            if let Some(friction) = trial.friction.take() {
                friction.put_back(&mut trial.measured_nm, &mut trial.input.motion);
            }
            for (nm, cubed) in trial.measured_nm.iter_mut().zip(&mut trial.cubed_nm3) {
                *nm = by_torque * *nm + cubic * *cubed;
                *cubed *= by_torque * by_torque * by_torque;
            }
            trial.torque_0_nm = by_torque * trial.torque_0_nm + shift_nm + cubic * trial.cubed_0_nm3;
            trial.cubed_0_nm3 *= by_torque * by_torque * by_torque;
            trial.input.covariates.torque_before_nm = trial.direction * trial.torque_0_nm;
            trial.theta_0_rad *= by_angle;
            trial.angle_rad.iter_mut().for_each(|angle| *angle *= by_angle);
            trial.load_nm.iter_mut().for_each(|load| *load *= by_torque);
            for knot in &mut trial.input.motion {
                *knot = Kinematics { theta: knot.theta * by_angle, omega: knot.omega * by_angle };
            }
            if delay_s != 0.0 {
                trial.input.motion = delayed_motion(&trial.input.motion, delay_s, self.period_s);
            }
            changed.take_friction(trial);
        }
        changed.trials = trials;
        changed
    }

    /// Takes the friction of the bearing out of a trial whose motion is as recorded; what had been taken out of its torque along another motion
    /// is put back first.
    pub(super) fn take_friction(&self, trial: &mut TrialObservation) {
        if let Some(before) = trial.friction.take() {
            before.put_into_torque(&mut trial.measured_nm);
        }
        let wrist::TrialInput { motion, onset, .. } = &mut trial.input;
        let window = (self.prediction_sections.as_slice(), self.period_s, self.samples);
        let friction = (&self.constants, &self.friction_law);
        trial.friction = FrictionEffect::along(friction, window, motion, *onset, trial.velocity_rad_s);
        if let Some(friction) = &trial.friction {
            friction.take_out(&mut trial.measured_nm, motion);
        }
    }

    /// The motion of the motor, as the torque record sees it, behind a smoothed angle.
    pub(in crate::fit) fn as_torque_sees(&self, motion: Vec<Kinematics<f64>>) -> Vec<Kinematics<f64>> {
        match self.constants.torque_delay_s {
            0.0 => motion,
            delay_s => delayed_motion(&motion, delay_s, self.period_s),
        }
    }

    /// Largest motor angle in the window of a trial, rad, relative to the angle before the ramp.
    pub fn peak_angle_rad(&self, trial: usize) -> f64 {
        let input = &self.trials[trial].input;
        input.motion[input.onset..input.onset + self.samples]
            .iter()
            .map(|knot| knot.theta)
            .fold(1e-6, f64::max)
    }

    /// Indices of the samples of the window to which noise covariances refer; the last sample of the window is among them.
    pub fn window_noise_samples(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.samples).rev().step_by(self.stride).collect::<Vec<_>>().into_iter().rev()
    }

    /// Indices of a trial's values to which noise covariances refer: those of the window, channel by channel.
    pub fn noise_samples(&self) -> impl Iterator<Item = usize> + use<> {
        let (samples, window) = (self.samples, self.window_noise_samples().collect::<Vec<_>>());
        (0..1 + self.further.len())
            .flat_map(move |channel| window.clone().into_iter().map(move |sample| channel * samples + sample))
    }

    /// Simulation of the window with the mechanisms `kinds` and `substeps` integration steps per sample.
    ///
    /// If a mechanism acts before the onset, the simulation starts earlier by as much, and the mean torque before the ramp is
    /// subtracted from the prediction as it was from the measurement.
    pub fn request<'a>(&'a self, kinds: &'a [MechanismKind], substeps: usize) -> SimulationSettings<'a> {
        let before_s = kinds.iter().map(|kind| kind.before_onset_s()).fold(0.0, f64::max);
        SimulationSettings {
            lever: self.lever,
            kinds,
            period_s: self.period_s,
            samples: self.samples,
            lead_samples: self.lead_samples + libm::ceil(before_s / self.period_s) as usize,
            baseline_samples: if before_s > 0.0 { self.level_samples() } else { 0 },
            substeps,
            filter: &self.prediction_sections,
            further: &self.further,
            derivatives: &[],
            width: VectorWidth::fastest(),
        }
    }

    /// Longest time by which onsets that the session states are after the motor has begun to move, s; 0 if none is.
    pub fn stated_onsets_late_s(&self) -> f64 {
        self.trials.iter().map(|trial| trial.stated_late_s).fold(0.0, f64::max)
    }

    /// Longest time by which onsets that the session states are so early that the motor has not followed, s; 0 if none is.
    pub fn stated_onsets_early_s(&self) -> f64 {
        self.trials.iter().map(|trial| -trial.stated_late_s).fold(0.0, f64::max)
    }

    /// Number of samples before the ramp over which filtered torque and angle are averaged.
    pub(super) fn level_samples(&self) -> usize {
        (libm::round(LEVEL_S / self.period_s) as usize).max(2)
    }
}

/// Mean of signals of the same length, sample by sample.
pub(super) fn mean_signal(signals: &[impl AsRef<[f64]>]) -> Vec<f64> {
    let count = signals.len() as f64;
    let mean_at = |sample: usize| signals.iter().map(|own| own.as_ref()[sample]).sum::<f64>() / count;
    (0..signals.first().map_or(0, |own| own.as_ref().len())).map(mean_at).collect()
}

/// Mean of `values`; 0 for an empty slice.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
