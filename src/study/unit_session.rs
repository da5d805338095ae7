//! One session of a study: simulated or read, then fitted. The result depends on the unit alone.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;

use super::error::UnitError;
use super::plan::{Study, Unit, UnitSource};
use super::study_file::StudyFit;
use crate::consistency;
use crate::dataset::{self, Disk, Manifest, MemoryRecorder, NewSession, Session};
use crate::fit::{
    DESCRIBING_VAF, Fit, Model, Observations, PreprocessingSettings, SessionFit, TrialEstimate, best_vaf,
    estimates_without_profiles, session_estimates,
};
use crate::rig::Fault;
use crate::rig::virtual_wrist::{LOAD_CHANGE_S, Person, Setup, VirtualWrist};
use crate::schedule;
use crate::session::{Event, Machine, Operator, Phase, Settings, StepConsumer, Unpaced, run_control_loop};

/// Where a simulated session is stored.
#[derive(Debug, Clone, Copy)]
pub enum SessionStorage<'a> {
    /// In memory, until it is fitted.
    Memory,
    /// In a new session folder inside this folder.
    Folder(&'a Path),
}

/// Estimates of the trials of a session.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitEstimates {
    /// The trials.
    pub trials: Vec<TrialEstimate>,
    /// The fit that they are from: the session has no model of its own where it is not the one that the study asks for.
    pub fit: StudyFit,
}

/// Simulates or reads the session of a unit and fits it.
pub fn fit_unit(study: &Study, unit: &Unit, storage: SessionStorage) -> Result<UnitEstimates, UnitError> {
    let (session, settings) = read_or_simulate(study, unit, storage)?;
    fit_session(study, &session, settings)
}

/// The same for the first repetitions alone, with each number of `repetitions`: as if the session had had no more.
pub(super) fn fit_repetitions(
    study: &Study,
    unit: &Unit,
    repetitions: &[u32],
) -> Result<Vec<UnitEstimates>, UnitError> {
    let (session, settings) = read_or_simulate(study, unit, SessionStorage::Memory)?;
    let fit = |most: &u32| {
        let mut part = session.clone();
        part.trials.retain(|trial| trial.repetition <= *most);
        fit_session(study, &part, settings)
    };
    repetitions.iter().map(fit).collect()
}

fn read_or_simulate(
    study: &Study,
    unit: &Unit,
    storage: SessionStorage,
) -> Result<(Session, PreprocessingSettings), UnitError> {
    match &unit.source {
        UnitSource::Virtual { protocol, .. } => {
            let session = simulate_unit(unit, storage)?.expect("the unit is virtual");
            Ok((session, PreprocessingSettings::of(protocol)))
        }
        UnitSource::Measured(folder) => {
            let session = dataset::load(folder)?;
            let protocol = dataset::protocol_of_session(folder, &session)?;
            let view = protocol.as_deref().map(PreprocessingSettings::of).unwrap_or_default();
            consistency::check(&session, &study.accept)?;
            Ok((session, view))
        }
    }
}

fn fit_session(
    study: &Study,
    session: &Session,
    settings: PreprocessingSettings,
) -> Result<UnitEstimates, UnitError> {
    let prepared = Observations::new(session, settings)?;
    let independent = Fit::new(&prepared, &Model::paper(), study.weighting);
    if study.fit == StudyFit::Session
        && let Ok(of_session) = SessionFit::new(&prepared, &independent)
    {
        return described(session_estimates(&prepared, &of_session).0, StudyFit::Session);
    }
    described(estimates_without_profiles(&prepared, &independent), StudyFit::Independent)
}

/// The estimates of a session, unless the model describes none of its trials.
fn described(trials: Vec<TrialEstimate>, fit: StudyFit) -> Result<UnitEstimates, UnitError> {
    let best_vaf = best_vaf(&trials);
    if best_vaf < DESCRIBING_VAF {
        return Err(UnitError::NotDescribed { best_vaf });
    }
    Ok(UnitEstimates { trials, fit })
}

/// Simulates the session of a virtual unit; `None` for a measured one.
pub fn simulate_unit(unit: &Unit, storage: SessionStorage) -> Result<Option<Session>, UnitError> {
    let UnitSource::Virtual { protocol, setup, person, seed, order_number } = &unit.source else {
        return Ok(None);
    };
    let order = schedule::draw(protocol, *seed, Some(*order_number))?;
    let settings = Arc::new(Settings::new(protocol, *seed, &order)?);
    let mut machine = Machine::new(settings.clone());
    let wrist = VirtualWrist::new((**person).clone(), (*setup).clone(), *seed, settings.sample_rate_hz);
    match storage {
        SessionStorage::Memory => {
            let mut recorder = MemoryRecorder::new(settings);
            let Ok(()) = run_to_the_end::<Infallible>(wrist, &mut machine, &mut recorder)?;
            Ok(Some(recorder.session(machine.progress(), &unit.subject, setup.lever)))
        }
        SessionStorage::Folder(folder) => {
            let path = folder.join(format!("{}-{}", unit.subject, unit.session));
            let rig = rig_json(setup, person);
            let new = NewSession {
                protocol,
                order: &order,
                seed: *seed,
                subject: &unit.subject,
                lever: setup.lever,
                rig: &rig,
                calibration: None,
                about: &Default::default(),
                subject_fields: &Default::default(),
                signals: &setup.recorded_signals(protocol.signal.sample_rate_hz),
                motion_delay_samples: 0,
            };
            let mut recorder = new.create(&path, Disk::synchronised_at_the_end())?;
            run_to_the_end(wrist, &mut machine, &mut recorder)??;
            recorder.settle()?;
            Manifest::take(&path, true)?.write(&Disk::default(), &path)?;
            Ok(Some(dataset::load(&path)?))
        }
    }
}

/// The description of the rig that `ramphold run` stores in session.json.
fn rig_json(setup: &Setup, person: &Person) -> serde_json::Value {
    use crate::rig::virtual_wrist::RigFile;
    serde_json::json!({ "rig": RigFile::Virtual(setup.clone()), "person": person })
}

fn run_to_the_end<E>(
    wrist: VirtualWrist,
    machine: &mut Machine,
    recorder: &mut impl StepConsumer<Error = E>,
) -> Result<Result<(), E>, UnitError> {
    let mut operator = Unattended::default();
    let ended = run_control_loop(wrist, machine, &mut operator, &mut Unpaced, recorder);
    if let Err(error) = ended {
        return Ok(Err(error));
    }
    if machine.phase() == Phase::Finished {
        return Ok(Ok(()));
    }
    if let Some(failing) = machine.progress().every_trial_fails(0) {
        return Err(failing.into());
    }
    Err(UnitError::Ended { left: machine.progress().queue().len(), fault: operator.fault })
}

/// Operator who starts the session and aborts it at the first fault: a fault of the virtual rig would occur again.
#[derive(Debug, Default)]
struct Unattended {
    fault: Option<Fault>,
}

impl Operator for Unattended {
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        if machine.progress().every_trial_fails(0).is_some() {
            return Some(Event::Abort);
        }
        // A virtual rig mounts its loads by itself, in some time.
        (machine.awaits_mounting() && machine.in_phase_s() >= LOAD_CHANGE_S).then_some(Event::Resume)
    }

    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if machine.phase() == Phase::Ready && self.fault.is_none() { Event::Start } else { Event::Abort }
    }

    fn command_refused(&mut self, _: Event, _: Phase) {}

    fn arming_failed(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    fn fault_occurred(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    // A virtual wrist has none.
    fn power_not_confirmed(&mut self) {}
}
