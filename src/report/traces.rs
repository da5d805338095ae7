//! Traces of a trial for its figure: recorded and fitted.

use rayon::prelude::*;

use super::emg::{TrialEmg, find_onsets, trial_emg};
use super::fitted::{Fitted, FittedTrial};
use crate::attach::AttachedEmg;
use crate::dataset::{FurtherChannel, Record, Session, Status};
use crate::fit::{ExcludedTrial, Model, Observations, PreprocessingSettings, RigConstants, TrialObservation};
use crate::protocol::ValidProtocol;
use crate::signal::{FilterSpec, filter};
use crate::wrist::{
    self, ScaledChannel, SimulatedTorque, SimulationSettings, TraceSample, runge_kutta_steps, simulate,
    steps_per_sample,
};

/// The measured and fitted traces of a trial. Torques and angles are changes from the hold, turned so that the
/// ramp is positive, as in section 2.4 of the paper.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Its number.
    pub number: u32,
    /// Label of its condition.
    pub label: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Repetition index, from 1.
    pub repetition: u32,
    /// The whole record, thinned: time from the onset in s, motor angle in rad, filtered torque in N m, both as recorded.
    pub whole: Vec<(f64, f64, f64)>,
    /// Around the window: time from the onset in s, change of the motor angle in rad, of the filtered torque in N m.
    pub near: Vec<(f64, f64, f64)>,
    /// Time and fitted torque, filtered, from the onset on; empty without a fit.
    pub fitted_nm: Vec<(f64, f64)>,
    /// The further channels of the session.
    pub further: Vec<FurtherTrace>,
    /// The states of the fitted wrist from the onset on; empty without a fit.
    pub instants: Vec<TraceSample>,
    /// Measured minus fitted torque in the window, N m; empty without a fit.
    pub residual_nm: Vec<f64>,
    /// The fit of the trial.
    pub fit: Option<FittedTrial>,
    /// Its EMG, where it was measured.
    pub emg: Option<TrialEmg>,
}

/// A further channel in the window, as a change from the hold.
#[derive(Debug, Clone)]
pub struct FurtherTrace {
    /// The channel.
    pub channel: FurtherChannel,
    /// Time from the onset in s, and the filtered measurement in the channel's unit.
    pub measured: Vec<(f64, f64)>,
    /// The same of the fitted wrist; empty without a fit.
    pub fitted: Vec<(f64, f64)>,
}

/// Number of points of the whole record that are drawn.
const WHOLE_POINTS: usize = 360;

/// Part of the record that is drawn before and after the onset, s.
const WHOLE_S: (f64, f64) = (0.6, 0.5);

/// The traces of all trials that can be analysed, by condition and repetition; and the trials that cannot, with the reasons.
pub fn traces(
    session: &Session,
    fitted: Option<&Fitted>,
    protocol: Option<&ValidProtocol>,
    attached: Option<&AttachedEmg>,
    missing: &mut Vec<String>,
) -> (Vec<Trace>, Vec<ExcludedTrial>) {
    let view = match (fitted, protocol) {
        (Some(fitted), _) => PreprocessingSettings {
            window_s: fitted.settings.window_s,
            filter: fitted.settings.filter.unwrap_or(FilterSpec::PAPER),
        },
        (None, Some(protocol)) => PreprocessingSettings::of(protocol),
        (None, None) => PreprocessingSettings::default(),
    };
    let constants = fitted.and_then(|fitted| fitted.settings.rig_constants);
    let constants = constants.unwrap_or_else(|| RigConstants::stated(session.lever));
    let prepared = match Observations::of_rig(session, view, constants) {
        Ok(prepared) => prepared,
        Err(error) => {
            missing.push(format!("No trial can be drawn: {error}."));
            return Default::default();
        }
    };
    for left in &prepared.excluded_trials {
        missing.push(format!("Trial {} is not drawn: {}.", left.trial, left.reason));
    }
    let fitted_model = fitted.and_then(|fitted| Some((fitted, fitted.model()?)));
    let fit = fitted_model.as_ref().map(|(fitted, model)| (*fitted, model));
    let mut traces: Vec<Trace> =
        prepared.trials.par_iter().map(|trial| one(session, &prepared, trial, fitted, fit)).collect();
    if let Some(attached) = attached {
        for (trace, trial) in traces.iter_mut().zip(&prepared.trials) {
            trace.emg = emg_of_attachment(attached, trial);
        }
    }
    find_onsets(&mut traces.iter_mut().filter_map(|trace| trace.emg.as_mut()).collect::<Vec<_>>());
    let bare = traces.iter().filter(|trace| trace.instants.is_empty()).count();
    if fitted.is_some() && bare > 0 {
        missing.push(format!(
            "{bare} of {} trials are drawn without fitted torque: fit.json does not hold all their parameters.",
            traces.len()
        ));
    }
    (traces, prepared.excluded_trials)
}

fn one(
    session: &Session,
    prepared: &Observations,
    trial: &TrialObservation,
    fitted: Option<&Fitted>,
    fit: Option<(&Fitted, &Model)>,
) -> Trace {
    let mut trace = recorded(session, prepared, trial);
    let Some(fitted) = fitted else { return trace };
    trace.fit = fitted.trials.iter().find(|fit| fit.trial == trial.number).cloned();
    let Some((fitted, model)) = fit else { return trace };
    let Some(parameters) = trace.fit.as_ref().and_then(|own| fitted.parameters(model, own)) else {
        return trace;
    };
    let kinds = model.kinds();
    let substeps = runge_kutta_steps(prepared.lever, &kinds, &trial.input, &parameters, prepared.period_s);
    let samples = trial.input.motion.len() - trial.input.onset;
    let request = SimulationSettings { samples, ..prepared.request(&kinds, substeps) };
    trace.instants = wrist::trace(&request, &trial.input, &parameters);
    let steps = steps_per_sample(prepared.lever, &kinds, &trial.input, &parameters, prepared.period_s);
    let request = SimulationSettings { substeps: steps, ..request };
    let mut response = SimulatedTorque::default();
    simulate(&request, &[&trial.input], &parameters, &mut response);
    let times = (0..).map(|sample| f64::from(sample) * prepared.period_s);
    trace.fitted_nm = times.clone().zip(response.torque_nm[..samples].iter().copied()).collect();
    for (place, own) in trace.further.iter_mut().enumerate() {
        let unit = prepared.further[place].nm_per_unit;
        let values = response.torque_nm[(1 + place) * samples..].iter().map(|value| value / unit);
        own.fitted = times.clone().zip(values.take(prepared.samples)).collect();
    }
    trace.residual_nm = prepared
        .torque_of(&trial.measured_nm)
        .iter()
        .zip(&trace.fitted_nm)
        .map(|(measured, (_, fitted))| measured - fitted)
        .collect();
    trace
}

/// The EMG of a trial from another device, which has a rate of its own; `None` if the trial is not in it.
fn emg_of_attachment(attached: &AttachedEmg, trial: &TrialObservation) -> Option<TrialEmg> {
    let own = attached.trials.get(&trial.number)?;
    let onset = libm::round((trial.onset_s - own.start_s) * attached.rate_hz);
    let [emg_fcr_mvc, emg_ecr_mvc] = own.mvc.clone();
    let record = Record { emg_fcr_mvc, emg_ecr_mvc, ..Record::default() };
    trial_emg(&record, onset.max(0.0) as usize, trial.velocity_rad_s, 1.0 / attached.rate_hz)
}

fn recorded(session: &Session, prepared: &Observations, trial: &TrialObservation) -> Trace {
    let mut trace = Trace {
        number: trial.number,
        label: trial.label.clone(),
        velocity_rad_s: trial.velocity_rad_s,
        torque_nm: trial.torque_nm,
        repetition: trial.repetition,
        ..Trace::default()
    };
    let of_session = |own: &&crate::dataset::Trial| own.number == trial.number && own.status == Status::Ok;
    let Some(own) = session.trials.iter().find(of_session) else { return trace };
    let record = &own.record;
    let constants = &prepared.constants;
    let true_nm: Vec<f64> = record.torque_l_nm.iter().map(|own| constants.true_torque_nm(*own)).collect();
    let torque = filter(&prepared.sections, &true_nm);
    let angle: Vec<f64> = record.theta_m_rad.iter().map(|own| own / constants.angle_gain).collect();
    let onset = libm::round((trial.onset_s - record.start_s) / prepared.period_s);
    let time_s = |sample: usize| (sample as f64 - onset) * prepared.period_s;
    let between = |from_s: f64, to_s: f64| {
        let first = (onset + from_s / prepared.period_s).max(0.0) as usize;
        let last = (onset + to_s / prepared.period_s).max(0.0) as usize;
        first..(last + 1).min(torque.len())
    };
    trace.emg = trial_emg(record, onset.max(0.0) as usize, trial.velocity_rad_s, prepared.period_s);
    let whole = between(-WHOLE_S.0, WHOLE_S.1);
    let stride = whole.len().div_ceil(WHOLE_POINTS).max(1);
    trace.whole = whole.step_by(stride).map(|i| (time_s(i), angle[i], torque[i])).collect();
    let window_s = prepared.samples as f64 * prepared.period_s;
    let change = |i: usize| {
        let angle = trial.direction * (angle[i] - trial.theta_0_rad);
        (time_s(i), angle, trial.direction * (torque[i] - trial.torque_0_nm))
    };
    let in_window = |(place, further): (usize, &ScaledChannel)| {
        let values = prepared.further_of(place, &trial.measured_nm).iter();
        let times = (0..).map(|sample| f64::from(sample) * prepared.period_s);
        let measured = times.zip(values.map(|value| value / further.nm_per_unit)).collect();
        FurtherTrace { channel: further.channel, measured, fitted: Vec::new() }
    };
    trace.further = prepared.further.iter().enumerate().map(in_window).collect();
    trace.near = between(-0.25 * window_s, 1.3 * window_s).map(change).collect();
    trace
}
