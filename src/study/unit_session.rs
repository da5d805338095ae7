//! One unit: a session that is run, or read, and fitted. What comes out depends on the unit alone.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;

use super::error::UnitError;
use super::plan::{Study, Unit, What};
use crate::dataset::{self, Disk, Manifest, MemoryRecorder, NewSession, Session};
use crate::fit::{
    Fit, Model, Observations, PreprocessingSettings, TrialEstimate, estimates_without_profiles,
};
use crate::protocol::ValidProtocol;
use crate::rig::Fault;
use crate::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use crate::schedule;
use crate::session::{AsFastAsItGoes, Event, Machine, Operator, Phase, Recorder, Settings, conduct};

/// Whether a virtual session leaves a folder behind.
#[derive(Debug, Clone, Copy)]
pub enum Kept<'a> {
    /// It is gone once it is fitted.
    No,
    /// It is kept in a new folder in this one.
    In(&'a Path),
}

/// Runs or reads a unit and fits it.
pub fn fit(study: &Study, unit: &Unit, kept: Kept) -> Result<Vec<TrialEstimate>, UnitError> {
    let (session, view) = match &unit.what {
        What::Virtual { protocol, .. } => (simulate(unit, kept)?, view(protocol)),
        What::Measured(folder) => {
            let file = folder.join("protocol.json");
            let view = if file.exists() {
                view(&ValidProtocol::read(&file)?)
            } else {
                PreprocessingSettings::default()
            };
            (Some(dataset::load(folder)?), view)
        }
    };
    let Some(session) = session else { return Ok(Vec::new()) };
    let prepared = Observations::new(&session, view)?;
    let fit = Fit::new(&prepared, &Model::paper(), study.weighting);
    Ok(estimates_without_profiles(&prepared, &fit))
}

pub(super) fn view(protocol: &ValidProtocol) -> PreprocessingSettings {
    PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter }
}

/// The session of a virtual unit; `None` of a measured one.
pub fn simulate(unit: &Unit, kept: Kept) -> Result<Option<Session>, UnitError> {
    let What::Virtual { protocol, setup, person, seed, order_number } = &unit.what else { return Ok(None) };
    let order = schedule::draw(protocol, *seed, Some(*order_number))?;
    let settings = Arc::new(Settings::new(protocol, *seed, &order)?);
    let mut machine = Machine::new(settings.clone());
    let wrist = VirtualWrist::new((**person).clone(), (*setup).clone(), *seed, settings.sample_rate_hz);
    match kept {
        Kept::No => {
            let mut recorder = MemoryRecorder::new(settings);
            let Ok(()) = run_to_the_end::<Infallible>(wrist, &mut machine, &mut recorder)?;
            Ok(Some(recorder.session(&unit.subject, setup.lever)))
        }
        Kept::In(folder) => {
            let path = folder.join(format!("{}-{}", unit.subject, unit.session));
            let rig = rig_json(setup, person);
            let new = NewSession {
                protocol,
                order: &order,
                seed: *seed,
                subject: &unit.subject,
                lever: setup.lever,
                rig: &rig,
                motion_delay_samples: 0,
            };
            let mut recorder = new.create(&path, Disk::default())?;
            run_to_the_end(wrist, &mut machine, &mut recorder)??;
            Manifest::take(&path, true)?.write(&Disk::default(), &path)?;
            Ok(Some(dataset::load(&path)?))
        }
    }
}

/// As `ramphold run` keeps them.
fn rig_json(setup: &Setup, person: &Person) -> serde_json::Value {
    use crate::rig::virtual_wrist::RigFile;
    serde_json::json!({ "rig": RigFile::Virtual(setup.clone()), "person": person })
}

fn run_to_the_end<E>(
    wrist: VirtualWrist,
    machine: &mut Machine,
    recorder: &mut impl Recorder<Error = E>,
) -> Result<Result<(), E>, UnitError> {
    let mut operator = Unattended::default();
    let ended = conduct(wrist, machine, &mut operator, &mut AsFastAsItGoes, recorder);
    if let Err(error) = ended {
        return Ok(Err(error));
    }
    if machine.phase() == Phase::Finished {
        return Ok(Ok(()));
    }
    Err(UnitError::Ended { left: machine.progress().queue().len(), fault: operator.fault })
}

/// Starts the session, and ends it at the first fault: a virtual one has its cause in the files.
#[derive(Debug, Default)]
struct Unattended {
    fault: Option<Fault>,
}

impl Operator for Unattended {
    fn heard(&mut self, _: &Machine) -> Option<Event> {
        None
    }

    fn asked(&mut self, machine: &Machine) -> Event {
        if machine.phase() == Phase::Ready && self.fault.is_none() { Event::Start } else { Event::Abort }
    }

    fn refused(&mut self, _: Event, _: Phase) {}

    fn not_armed(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    fn faulted(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }
}
