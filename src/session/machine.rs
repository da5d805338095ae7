//! The state machine of a session: stepped once a sample; its output depends on its inputs only.

use std::sync::Arc;

use super::event::{Event, Source};
use super::io::{Input, Output, Reading, Status, TransitionDetail, TransitionRecord};
use super::motion::{MotionDeviation, RampVelocity};
use super::phase::Phase;
use super::progress::Progress;
use super::rng_streams;
use super::settings::Settings;
use super::smoothing::FeedbackFilter;
use super::torque_gate::TorqueGate;
use super::transitions::{Effect, Guard, Transition};
use crate::protocol::{PlannedRigTrial, RigMotion, Sweep};
use crate::rig::{
    Channel, Command, Cue, Direction, Fault, LimitMonitor, Motor, Punctuality, RigTrialStage, Sample,
    Upcoming, UpcomingRigTrial,
};

/// EMG of an effort, fraction of the nominal MVC, below which the electrode is taken to be off.
const SILENT_EFFORT_MVC: f64 = 1e-3;

/// State machine of a session.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    settings: Arc<Settings>,
    progress: Progress,
    phase: Phase,
    limit_monitor: LimitMonitor,
    feedback: FeedbackFilter,
    /// Steps so far.
    sample: u64,
    /// Samples since the phase was entered.
    in_phase: u64,
    /// Samples since the motor was last home.
    at_home: u64,
    /// Samples since the trial began.
    in_trial: u64,
    /// Samples since the onset.
    since_onset: u64,
    gate: TorqueGate,
    /// How punctual the periods of the trial were, lost periods since the onset.
    punctuality: Option<Punctuality>,
    /// Velocity of the ramp.
    ramp_velocity: RampVelocity,
    /// Delay drawn for this trial, samples.
    delay: u64,
    /// The last commanded angle, rad.
    target_rad: f64,
    /// Sum of the torque while the offset is measured.
    offset_sum_nm: f64,
    /// Highest values of the effort under way: torque, FCR, ECR.
    peaks: [f64; 3],
    /// After a fault, the time that a return to the start position takes from where the motor was. The rig, which goes there
    /// by itself when it is armed, stays there.
    homing: Option<Sweep>,
}

impl Machine {
    /// A session that has not begun.
    pub fn new(settings: Arc<Settings>) -> Self {
        let progress = Progress::new(&settings);
        Self::with_progress(settings, progress)
    }

    /// A session that resumes from `progress`; it waits for the operator's start.
    pub fn with_progress(settings: Arc<Settings>, progress: Progress) -> Self {
        Self {
            progress,
            phase: Phase::Ready,
            limit_monitor: LimitMonitor::new((&settings.limits).into(), settings.sample_rate_hz),
            feedback: FeedbackFilter::new(settings.display_cutoff_hz, settings.sample_rate_hz),
            gate: TorqueGate::new(settings.gate.clone(), settings.gate_samples),
            settings,
            sample: 0,
            in_phase: 0,
            at_home: 0,
            in_trial: 0,
            since_onset: 0,
            punctuality: None,
            ramp_velocity: RampVelocity::default(),
            delay: 0,
            target_rad: 0.0,
            offset_sum_nm: 0.0,
            peaks: [0.0; 3],
            homing: None,
        }
    }

    /// Phase of the session.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Progress of the session.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Settings of the session.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Whether the session waits until the operator has mounted the load of the next rig trial, or seated the subject.
    pub fn awaits_mounting(&self) -> bool {
        self.phase == Phase::RigSetup && !self.progress.holds(Guard::LoadMounted)
    }

    /// Time since the phase began, s.
    pub fn in_phase_s(&self) -> f64 {
        self.in_phase as f64 / self.settings.sample_rate_hz
    }

    /// Samples since the session was started or resumed.
    pub fn sample(&self) -> u64 {
        self.sample
    }

    /// Filtered signals that the subject sees.
    pub fn feedback(&self) -> &FeedbackFilter {
        &self.feedback
    }

    /// Processes one sample. At most one transition is made: a fault takes precedence over the operator's command, and the
    /// command over all other events.
    pub fn step(&mut self, input: &Input) -> Output {
        self.count();
        if let Some(punctuality) = input.punctuality.filter(|_| self.phase.in_trial()) {
            self.punctuality.get_or_insert_default().add(punctuality);
        }
        let mut refused = None;
        let mut transition = None;
        match self.measured(&input.reading) {
            Err(fault) => {
                refused = input.operator;
                transition = self.fire(Event::Fault, Some(TransitionDetail::Fault(fault)));
            }
            Ok(sample) => {
                if let Some(command) = input.operator.filter(|command| command.source() == Source::Operator) {
                    transition = self.execute(command, sample);
                    refused = if transition.is_none() { Some(command) } else { None };
                }
                if let (None, Some(sample)) = (&transition, sample) {
                    transition = self
                        .due_event(&sample, input.on_disk)
                        .and_then(|(event, detail)| self.fire(event, detail));
                }
            }
        }
        self.sample += 1;
        let motor = self.motor();
        let target_rad = self.target_rad;
        if let Motor::Follow { angle_rad } = motor {
            self.target_rad = angle_rad;
        }
        Output {
            command: Command { motor, cue: self.cue() },
            target_rad,
            phase: self.phase,
            transition,
            refused,
            record: self.progress.record_target(self.phase),
            gate_fraction: self.gate.fraction(),
        }
    }

    /// Whether the session only waits for the operator, and the step since `before` changed nothing but the counts of samples:
    /// every further step with the same input does the same.
    pub fn only_waits_since(&self, before: &Self) -> bool {
        let mut waited = before.clone();
        waited.pass(1);
        // Of a sample that is given again and again, it only counts how often.
        waited.limit_monitor.clone_from(&self.limit_monitor);
        (self.phase == Phase::Paused || self.awaits_mounting()) && waited == *self
    }

    /// Counts samples that change nothing else, see [`Machine::only_waits_since`].
    pub fn pass(&mut self, samples: u64) {
        for count in [
            &mut self.sample,
            &mut self.in_phase,
            &mut self.at_home,
            &mut self.in_trial,
            &mut self.since_onset,
        ] {
            *count += samples;
        }
        self.limit_monitor.skip(samples);
    }

    fn count(&mut self) {
        self.in_phase += 1;
        self.at_home += 1;
        self.in_trial += 1;
        self.since_onset += 1;
    }

    /// The sample, if there is one; a fault, if the rig has one or the sample breaks a limit.
    fn measured(&mut self, reading: &Reading) -> Result<Option<Sample>, Fault> {
        match *reading {
            Reading::Sample(sample) => {
                self.limit_monitor.check_sample(&sample)?;
                self.feedback.update(&sample);
                self.measure_ramp(&sample);
                Ok(Some(sample))
            }
            Reading::Fault(fault) => Err(fault),
            Reading::Disarmed if self.phase.is_armed() => Err(Fault::NoSample),
            Reading::Disarmed => Ok(None),
        }
    }

    /// Takes the sample for the velocity of the ramp, at the time at which the motor carries out what was asked.
    fn measure_ramp(&mut self, sample: &Sample) {
        let movement = match (self.phase, self.progress.current_rig_trial()) {
            (Phase::Ramp | Phase::RampHold, _) => self.progress.current().map(|trial| trial.planned.movement),
            (Phase::RigMotion, Some(trial)) => match trial.planned.motion {
                RigMotion::Ramp { movement, .. } => Some(movement),
                RigMotion::Still { .. } | RigMotion::Multisine(_) => None,
            },
            _ => None,
        };
        let Some(movement) = movement else { return };
        let samples = self.since_onset as f64 - self.settings.motion_delay_samples as f64;
        let rate_hz = self.settings.sample_rate_hz;
        self.ramp_velocity.add(movement.ramp(), rate_hz, samples / rate_hz, sample.theta_m_rad);
    }

    /// Why the motion of a motor in the ramp was not as asked, if it was not.
    fn motion_deviation(&self) -> Option<MotionDeviation> {
        match self.punctuality {
            Some(Punctuality { lost_periods, .. }) if lost_periods > 0 => {
                Some(MotionDeviation::LostPeriods { lost_periods })
            }
            Some(_) => self.ramp_velocity.deviation(self.settings.velocity_tolerance),
            // A rig without a clock is a simulation; what its servo does to the ramp is what it is there to show.
            None => None,
        }
    }

    fn execute(&mut self, command: Event, sample: Option<Sample>) -> Option<TransitionRecord> {
        // The control loop arms the rig; a sample shows that the rig is armed.
        if command == Event::Start {
            sample?;
        }
        let mut detail = None;
        if command == Event::Rearm {
            let angle_rad = sample?.theta_m_rad;
            self.plan_homing(angle_rad);
            detail = Some(TransitionDetail::Rearmed { angle_rad });
        }
        self.fire(command, detail)
    }

    /// Event from the time, the movement or the subject at this sample, if there is one.
    fn due_event(&mut self, sample: &Sample, on_disk: bool) -> Option<(Event, Option<TransitionDetail>)> {
        match self.phase {
            // Only if its load is mounted, see the table.
            Phase::RigSetup => {
                (self.in_phase >= self.settings.rig_rest_samples).then_some((Event::RestOver, None))
            }
            Phase::RigSettle => self.onset(self.settings.rig_settle_samples.max(1), on_disk),
            Phase::RigMotion => self.follow_rig_motion().map(|event| (event, None)),
            Phase::Offset => self.measure_offset(sample),
            Phase::MvcEffort => self.measure_effort(),
            Phase::MvcRest => {
                let rest_s = self.settings.mvc.as_ref().map_or(0.0, |mvc| mvc.rest_s);
                (self.in_phase >= self.settings.samples(rest_s)).then_some((Event::RestOver, None))
            }
            Phase::Rest => (self.in_phase >= self.settings.rest_samples).then_some((Event::RestOver, None)),
            Phase::Hold | Phase::Delay if self.antagonist_is_unknown() => {
                let fault = Fault::NotMeasured { channel: Channel::EmgEcr };
                Some((Event::Fault, Some(TransitionDetail::Fault(fault))))
            }
            Phase::Hold => self.watch_gate().map(|event| (event, None)),
            Phase::Delay => self.watch_delay(on_disk),
            Phase::Ramp | Phase::RampHold | Phase::Return => {
                self.follow_movement().map(|event| (event, None))
            }
            Phase::Homing => {
                let duration_s = self.homing.as_ref().map_or(0.0, Sweep::duration_s);
                (self.seconds(self.in_phase) >= duration_s).then_some((Event::Home, None))
            }
            Phase::Ready | Phase::Paused | Phase::Faulted | Phase::Finished | Phase::Aborted => None,
        }
    }

    fn measure_offset(&mut self, sample: &Sample) -> Option<(Event, Option<TransitionDetail>)> {
        self.offset_sum_nm += sample.torque_l_nm;
        let done = self.in_phase >= self.settings.offset_samples.unwrap_or(0);
        done.then(|| {
            (
                Event::OffsetMeasured,
                Some(TransitionDetail::OffsetNm(self.offset_sum_nm / self.in_phase as f64)),
            )
        })
    }

    fn measure_effort(&mut self) -> Option<(Event, Option<TransitionDetail>)> {
        if self.feedback.torque_nm.abs() > self.peaks[0].abs() {
            self.peaks[0] = self.feedback.torque_nm;
        }
        // A muscle that is not measured stays silent.
        self.peaks[1] = self.peaks[1].max(self.feedback.fcr_mvc.unwrap_or(0.0));
        self.peaks[2] = self.peaks[2].max(self.feedback.ecr_mvc.unwrap_or(0.0));
        let duration_s = self.settings.mvc.as_ref().map_or(0.0, |mvc| mvc.duration_s);
        if self.in_phase < self.settings.samples(duration_s) {
            return None;
        }
        let [peak_torque_nm, peak_fcr, peak_ecr] = self.peaks;
        let (agonist, channel) = match self.progress.effort_direction() {
            Direction::Flexion => (peak_fcr, Channel::EmgFcr),
            Direction::Extension => (peak_ecr, Channel::EmgEcr),
        };
        if agonist < SILENT_EFFORT_MVC {
            return Some((Event::Fault, Some(TransitionDetail::Fault(Fault::SilentEffort { channel }))));
        }
        Some((Event::EffortOver, Some(TransitionDetail::Effort { peak_torque_nm, peak_fcr, peak_ecr })))
    }

    /// Whether the torque gate opens, or the trial is rejected before it does.
    fn watch_gate(&mut self) -> Option<Event> {
        let in_band = self.is_in_band();
        self.gate.add(in_band);
        if self.gate.is_counting() && self.antagonist_is_active() {
            Some(Event::AntagonistActive)
        } else if self.gate.is_open() {
            Some(Event::GateOpened)
        } else if self.in_phase >= self.settings.timeout_samples {
            Some(Event::GateTimedOut)
        } else {
            None
        }
    }

    fn watch_delay(&mut self, on_disk: bool) -> Option<(Event, Option<TransitionDetail>)> {
        if !self.is_in_band() {
            return Some((Event::LeftBand, None));
        }
        if self.antagonist_is_active() {
            return Some((Event::AntagonistActive, None));
        }
        self.onset(self.delay.max(1), on_disk)
    }

    /// The beginning of a motion, once the phase has lasted `shortest` samples and the disk is done.
    fn onset(&self, shortest: u64, on_disk: bool) -> Option<(Event, Option<TransitionDetail>)> {
        (self.in_phase >= shortest && on_disk).then(|| {
            let waited_samples = self.in_phase - shortest;
            let trial_sample = self.in_trial + self.settings.motion_delay_samples;
            (Event::Onset, Some(TransitionDetail::Onset { trial_sample, waited_samples }))
        })
    }

    fn is_in_band(&self) -> bool {
        let Some(trial) = self.progress.current() else { return false };
        self.gate.contains(self.shown_nm(), trial.planned.torque_nm)
    }

    fn antagonist_is_active(&self) -> bool {
        self.feedback.ecr_mvc.is_some_and(|ecr_mvc| self.gate.antagonist_is_active(ecr_mvc))
    }

    /// Whether the gate depends on the antagonist's EMG, which is not measured.
    fn antagonist_is_unknown(&self) -> bool {
        self.gate.needs_antagonist() && self.feedback.ecr_mvc.is_none()
    }

    fn shown_nm(&self) -> f64 {
        self.feedback.torque_nm - self.progress.offset_nm()
    }

    fn follow_movement(&self) -> Option<Event> {
        let movement = &self.progress.attempts().last()?.planned.movement;
        let t_s = self.seconds(self.since_onset);
        let (event, due_s) = match self.phase {
            Phase::Ramp => (Event::RampOver, movement.ramp().duration_s()),
            Phase::RampHold if t_s < movement.start_of_return_s() => return None,
            Phase::RampHold if self.motion_deviation().is_some() => return Some(Event::MotionDeviated),
            Phase::RampHold => return Some(Event::HoldOver),
            _ => (Event::Home, movement.duration_s()),
        };
        (t_s >= due_s).then_some(event)
    }

    fn follow_rig_motion(&self) -> Option<Event> {
        let motion = &self.progress.current_rig_trial()?.planned.motion;
        let samples = self.since_onset.saturating_sub(self.settings.motion_delay_samples);
        (self.seconds(samples) >= motion.duration_s())
            .then(|| if self.motion_deviation().is_some() { Event::MotionDeviated } else { Event::Home })
    }

    fn plan_homing(&mut self, from_rad: f64) {
        let (speed, rise_s) = (self.settings.return_velocity_rad_s.abs(), self.settings.rise_time_s);
        // Over a short distance the motor does not reach full speed.
        let speed = speed.min(0.99 * from_rad.abs() / rise_s);
        self.homing = Sweep::new(from_rad.abs(), -from_rad.signum() * speed, rise_s).ok();
    }

    /// Makes the transition for an event, if the table has one.
    fn fire(&mut self, event: Event, detail: Option<TransitionDetail>) -> Option<TransitionRecord> {
        let line = self.progress.line(self.phase, event)?;
        let transition = TransitionRecord {
            sample: self.sample,
            from: line.from,
            event,
            to: line.to,
            detail: self.detail(line, detail),
        };
        let had_unit = self.progress.emg_factors().is_some();
        self.progress.apply(&transition);
        if let (false, Some(factors)) = (had_unit, self.progress.emg_factors()) {
            self.feedback.rescale_emg(factors);
        }
        if line.to != line.from {
            self.enter(line);
        }
        Some(transition)
    }

    /// Numbers that the journal keeps with a transition.
    fn detail(&self, line: &Transition, detail: Option<TransitionDetail>) -> Option<TransitionDetail> {
        let (number, samples) = (self.progress.last_number(), self.in_trial);
        let punctuality = self.punctuality;
        let deviation = self.motion_deviation().filter(|_| line.event == Event::MotionDeviated);
        let ended =
            |status| Some(TransitionDetail::Ended { number, status, samples, deviation, punctuality });
        match (line.effect, detail) {
            (Effect::Begin, _) => {
                let rig_trial = self.progress.rig_queue().next().filter(|_| self.progress.rig_trials_due());
                let (practice, position) = match (rig_trial, self.progress.queue().next()) {
                    (Some(planned), _) => (false, planned.position),
                    (None, planned) => planned.map(|planned| (planned.key.practice, planned.key.position))?,
                };
                let number = self.progress.next_number();
                Some(TransitionDetail::Began { number, practice, position, rest_samples: self.at_home })
            }
            (Effect::Ok, _) => ended(Status::Ok),
            (Effect::Reject, _) => ended(Status::Rejected),
            (Effect::Abort, Some(TransitionDetail::Fault(fault))) => {
                Some(TransitionDetail::FaultInTrial { fault, number, samples, punctuality })
            }
            (Effect::Abort | Effect::LeaveOut, _) => ended(Status::Aborted),
            (Effect::TakeBack, _) => Some(TransitionDetail::TakenBack { number }),
            (_, detail) => detail,
        }
    }

    fn enter(&mut self, line: &Transition) {
        self.phase = line.to;
        self.in_phase = 0;
        match line.to {
            Phase::Offset => {
                self.offset_sum_nm = 0.0;
                self.feedback.restart();
            }
            Phase::MvcEffort => {
                self.peaks = [0.0; 3];
                self.feedback.restart();
            }
            Phase::Hold | Phase::RigSettle => {
                self.in_trial = 0;
                self.punctuality = None;
                self.gate.restart();
                self.feedback.restart();
            }
            Phase::Delay => self.delay = self.draw_delay(),
            Phase::Ramp | Phase::RigMotion => {
                self.since_onset = 0;
                self.ramp_velocity = RampVelocity::default();
                if let Some(punctuality) = &mut self.punctuality {
                    punctuality.lost_periods = 0;
                }
            }
            Phase::Faulted => {
                // The motor may be anywhere when the rig is armed again.
                self.limit_monitor.restart();
                self.feedback.restart();
            }
            _ => {}
        }
        if line.event == Event::Home {
            self.at_home = 0;
        }
    }

    fn draw_delay(&self) -> u64 {
        let Some(trial) = self.progress.current() else { return 0 };
        let key = trial.planned.key;
        let names = [u64::from(key.practice), u64::from(key.position), u64::from(key.rejections)];
        let [shortest, longest] = self.settings.delay_samples;
        shortest
            + rng_streams::stream(self.settings.seed, "delay", &names)
                .below(longest.saturating_sub(shortest) + 1)
    }

    fn motor(&self) -> Motor {
        let angle_rad = match self.phase {
            Phase::Ready | Phase::Faulted | Phase::Finished | Phase::Aborted => return Motor::Safe,
            Phase::Ramp | Phase::RampHold | Phase::Return => {
                self.progress.attempts().last().map_or(0.0, |attempt| {
                    attempt.planned.movement.at(self.seconds(self.since_onset + 1)).angle_rad
                })
            }
            Phase::RigMotion => self
                .progress
                .current_rig_trial()
                .map_or(0.0, |trial| trial.planned.motion.at(self.seconds(self.since_onset + 1)).angle_rad),
            _ => 0.0,
        };
        Motor::Follow { angle_rad }
    }

    fn cue(&self) -> Cue {
        let under_way = self.progress.current_rig_trial().map(|trial| trial.planned);
        let rig_trial = match self.phase {
            Phase::RigSetup => self.progress.rig_queue().next().copied().zip(Some(RigTrialStage::Mounting)),
            Phase::RigSettle => under_way.zip(Some(RigTrialStage::Settling)),
            Phase::RigMotion => under_way.zip(Some(RigTrialStage::Moving)),
            _ => None,
        };
        if let Some((PlannedRigTrial { position, rejections, load, .. }, stage)) = rig_trial {
            return Cue::RigTrial(UpcomingRigTrial { position, rejections, load, stage });
        }
        match (self.phase, self.progress.current()) {
            (Phase::Offset, _) => Cue::Relax,
            (Phase::MvcEffort, _) => Cue::Effort(self.progress.effort_direction()),
            (Phase::Hold | Phase::Delay, Some(trial)) => Cue::Target {
                target_nm: trial.planned.torque_nm,
                shown_nm: self.shown_nm(),
                trial: Upcoming {
                    key: trial.planned.key,
                    velocity_rad_s: trial.planned.velocity_rad_s,
                    progress: trial.planned.progress,
                    rest_s: self.seconds(trial.rest_samples),
                },
            },
            (Phase::Ramp | Phase::RampHold, _) => Cue::Moving,
            _ => Cue::Rest,
        }
    }

    fn seconds(&self, samples: u64) -> f64 {
        samples as f64 / self.settings.sample_rate_hz
    }
}
