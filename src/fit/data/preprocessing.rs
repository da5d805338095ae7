//! From a measured session to what the fit compares (section 2.4 of the paper): levels before the ramp subtracted, torque
//! filtered, the window cut; and the same done to the hold, which tells the noise.

use super::hold_noise::{NoiseSource, angle_noise, stride};
use crate::dataset::{Session, Status};
use crate::signal::{FilterSpec, NoiseCovariance, Section, filter, onset};
use crate::wrist::mechanisms::{Covariates, MechanismKind};
use crate::wrist::{self, Lever, SimulationSettings, Smoothing, VectorWidth};

/// How the analysis pilot_points at a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreprocessingSettings {
    /// The analysed time after the onset, s.
    pub window_s: f64,
    /// The low-pass that measured and predicted torque go through, unless the rig filtered already.
    pub filter: FilterSpec,
}

impl Default for PreprocessingSettings {
    /// The paper's: 40 ms, 50 Hz, third order.
    fn default() -> Self {
        Self { window_s: 0.040, filter: FilterSpec::PAPER }
    }
}

/// Torque and angle before the ramp are means over this time, s.
const LEVEL_S: f64 = 0.010;

/// The simulation starts this long before the onset, s: room for the speed's difference formula.
const LEAD_S: f64 = 0.004;

/// Angle before and after the simulated time that is kept for mechanisms that shift it, s.
const MARGIN_S: f64 = 0.020;

/// A session ready to be fitted.
#[derive(Debug, Clone)]
pub struct Observations {
    /// The lever; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// Time between samples, s.
    pub period_s: f64,
    /// Samples in the window.
    pub samples: usize,
    /// Samples before the onset at which the simulation starts.
    pub lead_samples: usize,
    /// What the predicted torque goes through; empty if the rig filtered angle and torque alike before recording.
    pub sections: Vec<Section>,
    /// The trials that can be fitted.
    pub trials: Vec<TrialObservation>,
    /// What could not be used, and why.
    pub excluded_trials: Vec<ExcludedTrial>,
    /// NoiseCovariance is measured on every `stride`th sample of the window: the filter leaves nothing in between.
    pub stride: usize,
    /// Standard deviation of the recorded angle's error, rad: measured in the holds, at least that of its steps.
    pub angle_noise_rad: f64,
    /// Step of the encoder that the holds stand still in, rad; zero where the recorded angle is never still.
    pub angle_step_rad: f64,
    /// How the angle was smoothed: each way with its share of the variance of an error.
    pub angle_smoothings: Vec<(f64, Smoothing)>,
    /// NoiseCovariance by trial: index into [`Observations::noise_covariances`]; `None` where the hold is too short to measure any.
    pub noise_index: Vec<Option<usize>>,
    /// The noise_covariances measured.
    pub noise_covariances: Vec<NoiseCovariance>,
    /// What they were measured in; `None` where there are none.
    pub noise_source: Option<NoiseSource>,
}

/// A trial that is not fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcludedTrial {
    /// Its number.
    pub trial: u32,
    /// Why, for a person.
    pub reason: String,
}

/// A trial ready to be fitted.
#[derive(Debug, Clone)]
pub struct TrialObservation {
    /// Its number in the session.
    pub number: u32,
    /// Index of its condition in order of first appearance by velocity and torque, or by label.
    pub condition: usize,
    /// Its label, where the session has labels.
    pub label: Option<String>,
    /// Which repetition.
    pub repetition: u32,
    /// Ramp velocity as the session states it, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque as the session states it, N m.
    pub torque_nm: f64,
    /// +1, or -1 where the ramp turns the other way and the model is mirrored.
    pub direction: f64,
    /// Onset, s on the record's time axis.
    pub onset_s: f64,
    /// The onset was found rather than given.
    pub onset_found: bool,
    /// Motor angle before the ramp, rad.
    pub theta_0_rad: f64,
    /// Torque before the ramp, N m.
    pub torque_0_nm: f64,
    /// The recorded angle less that before the ramp, rad, mirrored where the model is; as long as the motion in `input`.
    pub angle_rad: Vec<f64>,
    /// What the model needs.
    pub input: wrist::TrialInput,
    /// The filtered torque of the window less the level before, N m, mirrored where the model is.
    pub measured_nm: Vec<f64>,
    /// Stretches of the hold, each treated as the window is.
    pub hold_stretches: Vec<Vec<f64>>,
}

impl Observations {
    /// Prepares the trials of `session` whose status is ok.
    ///
    /// # Errors
    /// If no trial is left, or the filter cannot be made at this sampling rate.
    pub fn new(session: &Session, view: PreprocessingSettings) -> Result<Self, PreprocessingError> {
        let period_s = 1.0 / session.sample_rate_hz;
        let sections = match session.recorded_filter {
            Some(_) => Vec::new(),
            None => view.filter.sections(session.sample_rate_hz)?,
        };
        let both_ways = session.recorded_filter.is_none() && view.filter.zero_phase();
        if both_ways {
            return Err(PreprocessingError::ZeroPhase);
        }
        let samples = libm::round(view.window_s / period_s) as usize;
        if samples < FEWEST_SAMPLES {
            return Err(PreprocessingError::WindowTooShort { window_s: view.window_s, samples });
        }
        let mut observations = Self {
            lever: session.lever,
            period_s,
            samples,
            lead_samples: libm::ceil(LEAD_S / period_s) as usize,
            sections,
            trials: Vec::new(),
            excluded_trials: Vec::new(),
            stride: stride(session, view, samples),
            angle_noise_rad: 0.0,
            angle_step_rad: 0.0,
            angle_smoothings: vec![(1.0, Smoothing::ONE_RECORD)],
            noise_index: Vec::new(),
            noise_covariances: Vec::new(),
            noise_source: None,
        };
        let usable: Vec<_> = session.trials.iter().filter(|trial| trial.status == Status::Ok).collect();
        for trial in &usable {
            match observations.trial(trial) {
                Ok(ready) => observations.trials.push(ready),
                Err(reason) => {
                    observations.excluded_trials.push(ExcludedTrial { trial: trial.number, reason })
                }
            }
        }
        if observations.trials.is_empty() {
            return Err(PreprocessingError::NoTrial {
                of: session.trials.len(),
                excluded_trials: observations.excluded_trials,
            });
        }
        (observations.angle_noise_rad, observations.angle_step_rad) = angle_noise(&usable);
        observations.number_conditions();
        observations.fill_covariates(&usable);
        // By condition rather than by run order, so that an interrupted session fits to the last bit like one that was not.
        observations.trials.sort_by_key(|trial| (trial.condition, trial.repetition, trial.number));
        observations.measure_noise();
        Ok(observations)
    }
}

/// Fewest samples in a window that six parameters can be fitted to.
const FEWEST_SAMPLES: usize = 12;

/// Longest hold that is looked at, s: the gate guarantees this much.
pub(in crate::fit) const HOLD_S: f64 = 0.5;

impl Observations {
    /// The same preparation for some of the trials.
    pub fn subset(&self, trials: &[usize]) -> Self {
        Self {
            lever: self.lever,
            period_s: self.period_s,
            samples: self.samples,
            lead_samples: self.lead_samples,
            sections: self.sections.clone(),
            trials: trials.iter().map(|trial| self.trials[*trial].clone()).collect(),
            excluded_trials: Vec::new(),
            stride: self.stride,
            angle_noise_rad: self.angle_noise_rad,
            angle_step_rad: self.angle_step_rad,
            angle_smoothings: self.angle_smoothings.clone(),
            noise_index: trials.iter().map(|trial| self.noise_index[*trial]).collect(),
            noise_covariances: self.noise_covariances.clone(),
            noise_source: self.noise_source,
        }
    }

    /// How far the motor goes in a trial's window, rad.
    pub fn peak_angle_rad(&self, trial: usize) -> f64 {
        let input = &self.trials[trial].input;
        input.motion[input.onset..input.onset + self.samples]
            .iter()
            .map(|knot| knot.theta)
            .fold(1e-6, f64::max)
    }

    /// What to ask of a model with `kinds` for the window's torque, in so many integration steps a sample.
    ///
    /// Where something acts before the onset, the simulation starts so much earlier, and the level that was taken off the
    /// measured torque, which has a part of it, is taken off as well.
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
            filter: &self.sections,
            derivatives: &[],
            width: VectorWidth::fastest(),
        }
    }

    /// How many samples of filtered torque or raw angle make the level before the ramp.
    pub(in crate::fit) fn level_samples(&self) -> usize {
        (libm::round(LEVEL_S / self.period_s) as usize).max(2)
    }

    /// Cuts, filters and levels one trial, or says why it cannot be used.
    fn trial(&self, trial: &crate::dataset::Trial) -> Result<TrialObservation, String> {
        let record = &trial.record;
        let Some(at) = onset_sample(trial, self.period_s) else {
            return Err("no movement of the motor stands out of the noise: no onset found".into());
        };
        let onset_found = trial.onset_s.is_none();
        let count = record.theta_m_rad.len();
        let level = self.level_samples();
        let before = level.max(self.lead_samples + 2);
        if at < before {
            return Err(format!(
                "only {:.1} ms before the onset: at least {:.1} ms are needed",
                at as f64 * self.period_s * 1e3,
                before as f64 * self.period_s * 1e3
            ));
        }
        if at + self.samples > count {
            return Err(format!(
                "the record ends {:.1} ms after the onset, within the window of {:.1} ms",
                (count - 1 - at) as f64 * self.period_s * 1e3,
                self.samples as f64 * self.period_s * 1e3
            ));
        }
        let torque = filter(&self.sections, &record.torque_l_nm);
        let theta_0_rad = mean(&record.theta_m_rad[at + 1 - level..=at]);
        let torque_0_nm = mean(&torque[at + 1 - level..=at]);
        let direction = if trial.velocity_rad_s < 0.0 { -1.0 } else { 1.0 };
        let measured_nm: Vec<f64> =
            torque[at..at + self.samples].iter().map(|t| direction * (t - torque_0_nm)).collect();
        if measured_nm.iter().all(|t| t.abs() < 1e-9) {
            return Err("the torque does not change in the window: nothing can be estimated from it".into());
        }
        let margin = libm::ceil(MARGIN_S / self.period_s) as usize;
        let first = at.saturating_sub(self.lead_samples + margin);
        let last = (at + self.samples + margin).min(count - 1);
        let angle: Vec<f64> =
            record.theta_m_rad[first..=last].iter().map(|x| direction * (x - theta_0_rad)).collect();
        if angle.iter().all(|x| x.abs() < 1e-9) {
            return Err("the motor angle does not change in the window".into());
        }
        Ok(TrialObservation {
            number: trial.number,
            condition: 0,
            label: trial.condition.clone(),
            repetition: trial.repetition,
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            direction,
            onset_s: record.start_s + at as f64 * self.period_s,
            onset_found,
            theta_0_rad,
            torque_0_nm,
            input: wrist::TrialInput {
                motion: wrist::motor_motion(&angle, self.period_s),
                onset: at - first,
                covariates: Covariates::default(),
            },
            angle_rad: angle,
            measured_nm,
            hold_stretches: self.hold_stretches(&torque[..=at]),
        })
    }

    /// Conditions are numbered by velocity, then torque, then label.
    fn number_conditions(&mut self) {
        let key = |trial: &TrialObservation| match &trial.label {
            Some(label) => (0.0, 0.0, label.clone()),
            None => (trial.velocity_rad_s, trial.torque_nm, String::new()),
        };
        let mut keys: Vec<_> = self.trials.iter().map(key).collect();
        keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        keys.dedup();
        for trial in &mut self.trials {
            let own = key(trial);
            trial.condition = keys.iter().position(|other| *other == own).unwrap_or(0);
        }
    }

    /// What the trial mechanisms need to know: place in the session, rest, EMG in the hold.
    fn fill_covariates(&mut self, usable: &[&crate::dataset::Trial]) {
        let last = usable.len().max(2) as f64 - 1.0;
        let mut emg = Vec::new();
        for trial in &mut self.trials {
            let Some(place) = usable.iter().position(|source| source.number == trial.number) else {
                continue;
            };
            let source = usable[place];
            let hold_end = libm::round((trial.onset_s - source.record.start_s) / self.period_s) as usize;
            let longest = libm::round(HOLD_S / self.period_s) as usize;
            // Rectified: EMG swings about zero, whatever the muscle does. An envelope stays what it is.
            let in_hold = |channel: &Option<Vec<f64>>| {
                channel.as_ref().map_or(0.0, |channel| {
                    let hold = &channel[hold_end.saturating_sub(longest)..hold_end];
                    mean(&hold.iter().map(|emg| emg.abs()).collect::<Vec<_>>())
                })
            };
            emg.push((trial.torque_nm, in_hold(&source.record.emg_fcr_mvc)));
            trial.input.covariates = Covariates {
                velocity_rad_s: trial.velocity_rad_s.abs(),
                torque_before_nm: trial.direction * trial.torque_0_nm,
                progress: place as f64 / last,
                rest_s: source.extra.get("rest_s").and_then(|text| text.parse().ok()).unwrap_or(0.0),
                flexor_emg_excess_mvc: 0.0,
                extensor_emg_mvc: in_hold(&source.record.emg_ecr_mvc),
            };
        }
        for (trial, (torque, own)) in self.trials.iter_mut().zip(&emg) {
            let same: Vec<f64> = emg.iter().filter(|(t, _)| t == torque).map(|(_, level)| *level).collect();
            trial.input.covariates.flexor_emg_excess_mvc = own - mean(&same);
        }
    }
}

/// The sample at which a trial's ramp begins: as the session says, else as the movement shows.
pub fn onset_sample(trial: &crate::dataset::Trial, period_s: f64) -> Option<usize> {
    match trial.onset_s {
        Some(onset_s) => Some(libm::round((onset_s - trial.record.start_s) / period_s) as usize),
        None => onset(&trial.record.theta_m_rad),
    }
}

pub(in crate::fit) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// A session that cannot be analysed at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PreprocessingError {
    /// The filter cannot be made.
    #[error(transparent)]
    Filter(#[from] crate::signal::FilterError),
    /// The filter would bring in what happens after the window.
    #[error(
        "a zero-phase filter carries torque from after the window (stretch reflexes) back into it; \
         use \"zero_phase\": false"
    )]
    ZeroPhase,
    /// Too few samples for six parameters.
    #[error("a window of {window_s} s holds {samples} samples here; at least {FEWEST_SAMPLES} are needed")]
    WindowTooShort {
        /// The window asked for, s.
        window_s: f64,
        /// How many samples it holds.
        samples: usize,
    },
    /// No trial is left.
    #[error("no usable trial among {of}: {}", first_reasons(excluded_trials))]
    NoTrial {
        /// How many trials the session has.
        of: usize,
        /// Why each was left out.
        excluded_trials: Vec<ExcludedTrial>,
    },
}

fn first_reasons(left_out: &[ExcludedTrial]) -> String {
    match left_out.first() {
        None => "none has the status ok".into(),
        Some(first) => format!("trial {}: {}", first.trial, first.reason),
    }
}
