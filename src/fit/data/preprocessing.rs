//! Preprocessing of a session (section 2.4 of the paper): the torque is filtered, the means before the ramp are subtracted, the
//! window is cut, and the noise is estimated.

use super::bearing_friction::FrictionLaw;
use super::covariates::{number_conditions, set_covariates};
use super::further_channels::{samples_of, unscaled};
use super::hold_noise::{angle_error, noise_stride};
use super::observations::{EmgGaps, ExcludedTrial, Observations, TrialObservation, mean};
use super::onset_samples::{RampBegin, ramp_begins};
use super::rig_constants::RigConstants;
use crate::dataset::{Session, Status, Trial};
use crate::files::limits;
use crate::protocol::Protocol;
use crate::signal::{FilterError, FilterSpec, Restoration, Section, filter};
use crate::wrist::mechanisms::Covariates;
use crate::wrist::{self, Smoothing};

/// Settings of the preprocessing: the analysis window and the low-pass filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreprocessingSettings {
    /// Length of the analysis window after the onset, s.
    pub window_s: f64,
    /// Low-pass filter of measured and predicted torque; not applied if the rig filtered the record already.
    pub filter: FilterSpec,
}

/// Time after the onset in which no reflex changes the torque yet, s (section 2.4 of the paper).
pub const REFLEX_FREE_S: f64 = 0.040;

impl Default for PreprocessingSettings {
    /// The paper's settings: a window of 40 ms and a third-order filter of 50 Hz.
    fn default() -> Self {
        Self { window_s: REFLEX_FREE_S, filter: FilterSpec::PAPER }
    }
}

impl PreprocessingSettings {
    /// The window and the filter of a protocol.
    pub fn of(protocol: &Protocol) -> Self {
        Self { window_s: protocol.window_s, filter: protocol.signal.filter }
    }
}

/// The simulation starts this long before the onset, s: the difference formula of the speed needs samples on both sides.
const LEAD_S: f64 = 0.004;

/// Angle kept before and after the simulated time, s, for mechanisms that delay the angle.
const MARGIN_S: f64 = 0.020;

/// Samples over which a restored signal spreads one sample, at most.
const NOISE_REACH: usize = 1000;

/// Smallest number of samples in a window to which six parameters can be fitted.
const MIN_SAMPLES: usize = 12;

impl Observations {
    /// Prepares the trials of `session` whose status is ok.
    ///
    /// # Errors
    /// If no trial can be fitted, the window has too few samples, or the filter is not possible at this sample rate.
    pub fn new(session: &Session, settings: PreprocessingSettings) -> Result<Self, PreprocessingError> {
        Self::of_rig(session, settings, RigConstants::stated(session.lever))
    }

    /// As [`Observations::new`], where `constants` are those of the rig. A filter that the rig applied before it recorded is taken out of both
    /// channels, and takes the place of the one in `settings`.
    ///
    /// # Errors
    /// As [`Observations::new`], or if the nonlinearity of the torque channel cannot be taken out of the records.
    pub fn of_rig(
        session: &Session,
        settings: PreprocessingSettings,
        constants: RigConstants,
    ) -> Result<Self, PreprocessingError> {
        let Some(recorded) = session.recorded_filter else {
            if settings.filter.zero_phase() {
                return Err(PreprocessingError::ZeroPhase);
            }
            let sections = settings.filter.sections(session.sample_rate_hz)?;
            return Self::of_records(session, settings, sections, constants);
        };
        let settings = PreprocessingSettings { filter: recorded, ..settings };
        match Restoration::of(recorded, session.sample_rate_hz)? {
            Some(restoration) => {
                let sections = recorded.sections(session.sample_rate_hz)?;
                let mut own =
                    Self::of_records(&restored(session, &restoration), settings, sections, constants)?;
                let moving_rad = own.moving_angle_noise_rad(&restoration.of_one_sample(NOISE_REACH));
                own.angle_noise_rad = own.angle_noise_rad.max(moving_rad);
                own.angle_step_rad = 0.0;
                Ok(own)
            }
            None => Self::of_records(session, settings, Vec::new(), constants),
        }
    }

    /// Prepares records that the rig did not filter; `sections` are those of the filter of `settings`, or none if nothing is to be filtered.
    fn of_records(
        session: &Session,
        settings: PreprocessingSettings,
        sections: Vec<Section>,
        constants: RigConstants,
    ) -> Result<Self, PreprocessingError> {
        let period_s = 1.0 / session.sample_rate_hz;
        if !(settings.window_s > 0.0 && settings.window_s <= limits::MAX_WINDOW_S) {
            return Err(PreprocessingError::Window { window_s: settings.window_s });
        }
        let samples = libm::round(settings.window_s / period_s) as usize;
        if samples < MIN_SAMPLES {
            return Err(PreprocessingError::WindowTooShort { window_s: settings.window_s, samples });
        }
        let further = unscaled(session.further_channels());
        let mut observations = Self {
            lever: constants.lever,
            constants,
            friction_law: FrictionLaw::default(),
            prediction_sections: constants.prediction_sections(&sections, period_s),
            filter: (!sections.is_empty()).then_some(settings.filter),
            period_s,
            samples,
            lead_samples: libm::ceil(LEAD_S / period_s) as usize,
            sections,
            trials: Vec::new(),
            excluded_trials: Vec::new(),
            emg_gaps: EmgGaps::default(),
            stride: noise_stride(session.sample_rate_hz, settings.filter, samples),
            angle_noise_rad: 0.0,
            angle_step_rad: 0.0,
            angle_smoothings: vec![(1.0, Smoothing::ONE_RECORD)],
            further_step: vec![0.0; further.len()],
            further,
            noise_index: Vec::new(),
            noise_covariances: Vec::new(),
            noise_source: None,
        };
        let usable: Vec<_> = session.trials.iter().filter(|trial| trial.status == Status::Ok).collect();
        let torques = usable.iter().flat_map(|trial| &trial.record.torque_l_nm);
        if let Some(torque_nm) = torques.copied().find(|torque| !constants.is_invertible_at(*torque)) {
            let per_nm2 = constants.torque_nonlinearity_per_nm2;
            return Err(PreprocessingError::Nonlinearity { per_nm2, torque_nm });
        }
        for (trial, begin) in usable.iter().zip(ramp_begins(&usable, period_s, samples)) {
            match observations.observe(trial, begin) {
                Ok(observation) => observations.trials.push(observation),
                Err(reason) => {
                    observations.excluded_trials.push(ExcludedTrial { trial: trial.number, reason });
                }
            }
        }
        if observations.trials.is_empty() {
            return Err(PreprocessingError::NoTrial {
                of: session.trials.len(),
                excluded_trials: observations.excluded_trials,
            });
        }
        let (noise_rad, step_rad) = angle_error(&usable);
        observations.angle_noise_rad = noise_rad / constants.angle_gain;
        observations.angle_step_rad = step_rad / constants.angle_gain;
        observations.scale_further_channels(&usable);
        number_conditions(&mut observations.trials);
        observations.emg_gaps = set_covariates(&mut observations.trials, &usable, period_s);
        // By condition rather than by run order, so that an interrupted session fits to the last bit like one that was not.
        observations.trials.sort_by_key(|trial| (trial.condition, trial.repetition, trial.number));
        observations.estimate_noise();
        Ok(observations)
    }

    /// Cuts, filters and levels the record of one trial; the error is the reason why the trial cannot be fitted.
    fn observe(&self, trial: &Trial, begin: Option<RampBegin>) -> Result<TrialObservation, String> {
        let record = &trial.record;
        let Some(RampBegin { sample: onset, stated_late }) = begin else {
            return Err("no movement of the motor stands out of the noise: no onset found".into());
        };
        let count = record.theta_m_rad.len();
        let level = self.level_samples();
        let before = level.max(self.lead_samples + 2);
        if onset < before {
            return Err(format!(
                "only {:.1} ms before the onset: at least {:.1} ms are needed",
                onset as f64 * self.period_s * 1e3,
                before as f64 * self.period_s * 1e3
            ));
        }
        if onset + self.samples > count {
            return Err(format!(
                "the record ends {:.1} ms after the onset, within the window of {:.1} ms",
                (count - 1 - onset) as f64 * self.period_s * 1e3,
                self.samples as f64 * self.period_s * 1e3
            ));
        }
        let true_nm: Vec<f64> =
            record.torque_l_nm.iter().map(|recorded| self.constants.true_torque_nm(*recorded)).collect();
        let torque = filter(&self.sections, &true_nm);
        let cubes: Vec<f64> = true_nm.iter().map(|nm| nm * nm * nm).collect();
        let cubed = filter(&self.sections, &cubes);
        let cubed_0_nm3 = mean(&cubed[onset + 1 - level..=onset]);
        let theta_m_rad: Vec<f64> =
            record.theta_m_rad.iter().map(|recorded| recorded / self.constants.angle_gain).collect();
        let theta_0_rad = mean(&theta_m_rad[onset + 1 - level..=onset]);
        let torque_0_nm = mean(&torque[onset + 1 - level..=onset]);
        let direction = if trial.velocity_rad_s < 0.0 { -1.0 } else { 1.0 };
        let mut measured_nm: Vec<f64> =
            torque[onset..onset + self.samples].iter().map(|t| direction * (t - torque_0_nm)).collect();
        if measured_nm.iter().all(|t| t.abs() < 1e-9) {
            return Err("the torque does not change in the window: nothing can be estimated from it".into());
        }
        let mut channels = vec![torque];
        for further in &self.further {
            let values = filter(&self.sections, samples_of(record, further.channel));
            if values.len() != count {
                return Err(format!("it has no {}, which other trials have", further.channel.column()));
            }
            let level_before = mean(&values[onset + 1 - level..=onset]);
            let window = &values[onset..onset + self.samples];
            if window.iter().all(|value| *value == level_before) {
                return Err(format!("{} does not change in the window", further.channel.column()));
            }
            measured_nm.extend(window.iter().map(|value| direction * (value - level_before)));
            channels.push(values);
        }
        let hold: Vec<&[f64]> = channels.iter().map(|channel| &channel[..=onset]).collect();
        let margin = libm::ceil(MARGIN_S / self.period_s) as usize;
        let first = onset.saturating_sub(self.lead_samples + margin);
        let last = (onset + self.samples + margin).min(count - 1);
        let angle_rad: Vec<f64> =
            theta_m_rad[first..=last].iter().map(|x| direction * (x - theta_0_rad)).collect();
        let load_nm = true_nm[first..=last].iter().map(|nm| direction * (nm - torque_0_nm)).collect();
        if angle_rad.iter().all(|x| x.abs() < 1e-9) {
            return Err("the motor angle does not change in the window".into());
        }
        let motion = self.as_torque_sees(wrist::motor_motion(&angle_rad, self.period_s));
        let mut observation = TrialObservation {
            number: trial.number,
            condition: 0,
            label: trial.condition.clone(),
            repetition: trial.repetition,
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            direction,
            onset_s: record.start_s + onset as f64 * self.period_s,
            stated_late_s: stated_late as f64 * self.period_s,
            theta_0_rad,
            torque_0_nm,
            input: wrist::TrialInput { motion, onset: onset - first, covariates: Covariates::default() },
            angle_rad,
            load_nm,
            cubed_nm3: cubed[onset..onset + self.samples]
                .iter()
                .map(|own| direction * (own - cubed_0_nm3))
                .collect(),
            cubed_0_nm3,
            measured_nm,
            friction: None,
            motion_errors: None,
            hold_stretches: self.hold_stretches(&hold),
        };
        self.take_friction(&mut observation);
        Ok(observation)
    }
}

/// The session with angle and torque as they were before the filter of the rig.
fn restored(session: &Session, restoration: &Restoration) -> Session {
    let mut session = session.clone();
    for trial in &mut session.trials {
        let record = &mut trial.record;
        for channel in [&mut record.theta_m_rad, &mut record.torque_l_nm] {
            *channel = restoration.restored(channel);
        }
    }
    session
}

/// Reason why a session cannot be fitted at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PreprocessingError {
    /// The filter is not possible at this sample rate.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// A zero-phase filter would carry torque from after the window into the window.
    #[error(
        "a zero-phase filter carries torque from after the window (stretch reflexes) back into it; \
         use \"zero_phase\": false"
    )]
    ZeroPhase,
    /// A window that is no time, or longer than any.
    #[error(
        "a window of {window_s} s cannot be analysed; expected more than 0 and at most {} s",
        limits::MAX_WINDOW_S
    )]
    Window {
        /// Length of the window, s.
        window_s: f64,
    },
    /// The nonlinearity of the torque channel is no small correction.
    #[error(
        "the torque channel's nonlinearity of {per_nm2} 1/(N m)^2 changes the recorded torque of {torque_nm} N m by more than a third: it \
         was not measured up to that torque; calibrate with a larger weight"
    )]
    Nonlinearity {
        /// The nonlinearity, 1/(N m)^2.
        per_nm2: f64,
        /// The recorded torque, N m.
        torque_nm: f64,
    },
    /// The window has too few samples for six parameters.
    #[error("a window of {window_s} s holds {samples} samples here; at least {MIN_SAMPLES} are needed")]
    WindowTooShort {
        /// Length of the window, s.
        window_s: f64,
        /// Number of samples in the window.
        samples: usize,
    },
    /// No trial of the session can be fitted.
    #[error("no usable trial among {of}: {}", first_reason(excluded_trials))]
    NoTrial {
        /// Number of trials in the session.
        of: usize,
        /// The excluded trials with the reasons.
        excluded_trials: Vec<ExcludedTrial>,
    },
}

fn first_reason(excluded: &[ExcludedTrial]) -> String {
    match excluded.first() {
        None => "none has the status ok".into(),
        Some(first) => format!("trial {}: {}", first.trial, first.reason),
    }
}
