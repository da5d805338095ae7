//! A disk that fails at any of its operations.

use std::io::ErrorKind;
use std::sync::Arc;

use super::*;
use crate::dataset::{DatasetError, NewSession, Status, load};
use crate::protocol::{BlockMotion, Protocol, RigTrialBlock, ValidProtocol};
use crate::rig::Fault;
use crate::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use crate::schedule;
use crate::session::{Event, Machine, Operator, Phase, Settings, Unpaced, run_control_loop};

/// Two short trials, nothing before them.
pub fn protocol() -> ValidProtocol {
    let text = include_str!("../../../protocols/quick.json");
    let mut protocol: Protocol = Protocol::clone(&Protocol::parse(text, "quick.json").unwrap());
    protocol.velocities_rad_s = vec![3.25];
    protocol.torques_nm = vec![2.1];
    protocol.rest_s = 0.1;
    protocol.before = Default::default();
    protocol.validate().unwrap()
}

/// Those trials after four rig trials with three loads.
pub fn protocol_with_rig_trials() -> ValidProtocol {
    let mut protocol = Protocol::clone(&protocol());
    let motion =
        BlockMotion::Multisine { amplitude_rad: 0.005, lowest_hz: 2.0, highest_hz: 40.0, duration_s: 0.5 };
    protocol.rig_trials = vec![
        RigTrialBlock::EmptyHandle { motion, repetitions: 2 },
        RigTrialBlock::KnownWeight {
            mass_kg: 1.0,
            arm_m: 0.1,
            relative_error: 0.002,
            duration_s: 0.5,
            repetitions: 1,
        },
    ];
    protocol.validate().unwrap()
}

pub struct Starter;

impl Operator for Starter {
    fn poll_command(&mut self, machine: &Machine) -> Option<Event> {
        machine.awaits_mounting().then_some(Event::Resume)
    }
    fn wait_for_command(&mut self, _: &Machine) -> Event {
        Event::Start
    }
    fn command_refused(&mut self, word: Event, phase: Phase) {
        panic!("{word:?} refused in {phase:?}");
    }
    fn arming_failed(&mut self, fault: Fault) {
        panic!("{fault}");
    }
    fn fault_occurred(&mut self, fault: Fault) {
        panic!("{fault}");
    }
    fn power_not_confirmed(&mut self) {
        panic!("a virtual wrist has no power");
    }
}

/// Runs the session in `folder`; the number of operations that the disk was asked for.
pub fn run(folder: &Path, disk: Disk) -> Result<u64, RecordError> {
    run_protocol(&protocol(), folder, disk)
}

/// As [`run`], of another protocol.
pub fn run_protocol(protocol: &ValidProtocol, folder: &Path, disk: Disk) -> Result<u64, RecordError> {
    let order = schedule::draw(protocol, 1, None).unwrap();
    let settings = Settings::new(protocol, 1, &order).unwrap();
    let mut recorder = NewSession {
        protocol,
        order: &order,
        seed: 1,
        subject: "V00",
        lever: Setup::default().lever,
        rig: &serde_json::Value::Null,
        calibration: None,
        about: &Default::default(),
        subject_fields: &Default::default(),
        signals: &Default::default(),
        motion_delay_samples: 0,
    }
    .create(folder, disk)?;
    let wrist = VirtualWrist::new(Person::default(), Setup::default(), 1, settings.sample_rate_hz);
    let mut machine = Machine::new(Arc::new(settings));
    run_control_loop(wrist, &mut machine, &mut Starter, &mut Unpaced, &mut recorder)?;
    assert_eq!(machine.phase(), Phase::Finished);
    Ok(recorder.disk.operations())
}

#[test]
fn whichever_operation_fails_the_session_stops_and_what_was_finished_is_loadable() {
    let folder = tempfile::tempdir().unwrap();
    let operations = run(&folder.path().join("whole"), Disk::default()).unwrap();
    assert!(operations > 80, "{operations} operations");
    let mut seen = Vec::new();
    for operation in 0..operations {
        let kind = [ErrorKind::StorageFull, ErrorKind::Other][operation as usize % 2];
        let path = folder.path().join(format!("failing-{operation}"));
        let error = run(&path, Disk::failing_from(operation, kind)).unwrap_err();
        let RecordError::Unwritable { source, .. } = error else { panic!("{error}") };
        assert_eq!(source.kind(), kind);
        match load(&path) {
            Ok(session) => {
                assert!(session.trials.iter().all(|trial| trial.status == Status::Ok));
                seen.push(session.trials.len());
            }
            Err(DatasetError::Missing { .. }) => {
                assert!(seen.is_empty(), "the folder is a session from then on")
            }
            Err(error) => panic!("operation {operation}: {error}"),
        }
    }
    assert!(seen.is_sorted(), "{seen:?}");
    seen.dedup();
    assert_eq!(seen, [0, 1, 2]);
}

#[test]
fn nothing_happens_before_the_journal_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s");
    run(&path, Disk::default()).unwrap();
    let journal = std::fs::read_to_string(path.join(crate::dataset::JOURNAL)).unwrap();
    let events: Vec<&str> =
        journal.lines().filter_map(|line| line.split("\"event\":\"").nth(1)?.split('"').next()).collect();
    let trial = ["rest_over", "gate_opened", "onset", "ramp_over", "hold_over", "home"];
    assert_eq!(events, [&["start"][..], &trial, &trial].concat());
    for line in journal.lines() {
        let (length, rest) = line.split_at(8);
        assert_eq!(usize::from_str_radix(length, 16).unwrap(), rest.len() - 18, "{line}");
    }
}
