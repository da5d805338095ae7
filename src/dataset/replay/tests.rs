//! Sessions whose motion was not as asked, and sessions on a rig that must know its start position.

use std::fs;
use std::sync::Arc;

use super::*;
use crate::dataset::recorder::tests::{Starter, protocol};
use crate::dataset::{BackgroundRecorder, Disk, JOURNAL, NewSession, Resumable, load};
use crate::protocol::Limits;
use crate::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use crate::rig::{Armed, ArmingConsent, Command, Fault, Motor, Origin, Punctuality, Rig, Sample};
use crate::schedule;
use crate::session::{Event, Machine, Phase, Settings, Status, TransitionRecord, Unpaced, run_control_loop};

/// Six pauses of 160 h in a journal of 4 kB took 25 s: every sample of them was stepped through.
#[test]
fn a_pause_of_days_takes_no_time() {
    const DAYS: u64 = 160 * 3600 * 2500;
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("s");
    crate::dataset::recorder::tests::run(&folder, Disk::default()).unwrap();
    let mut entries = crate::dataset::resume::tests::journal_of(&folder);
    let event = |sample, from, event, to| {
        JournalEntry::Transition(TransitionRecord { sample, from, event, to, detail: None })
    };
    // The rest before the first trial begins with the session's first sample, and anew after a pause.
    let mut pauses = Vec::new();
    for pause in 0..6 {
        let began = 1 + pause * (DAYS + 1);
        pauses.push(event(began, Phase::Rest, Event::Pause, Phase::Paused));
        pauses.push(event(began + DAYS, Phase::Paused, Event::Resume, Phase::Rest));
    }
    let shift = 6 * (DAYS + 1);
    for entry in &mut entries[2..] {
        if let JournalEntry::Transition(transition) = entry {
            transition.sample += shift;
        }
    }
    entries.splice(2..2, pauses);
    crate::dataset::resume::tests::rewrite_journal(&folder, &entries);
    let begun = std::time::Instant::now();
    let found = replay(&folder).unwrap();
    assert!(begun.elapsed() < std::time::Duration::from_secs(20), "{:?}", begun.elapsed());
    // Where the rest ends is not what this test is about; all pauses were passed before it.
    assert!(found.events >= 13, "{found:?}");
    assert!(found.steps >= 6 * DAYS, "{found:?}");
}

/// A virtual wrist on a rig with a clock. In the first movement of the session it loses periods, or is too slow.
struct Clocked<R> {
    rig: R,
    samples: u64,
    first_motion: Option<u64>,
    /// Periods lost at the 60th sample of the first movement.
    lost_periods: u64,
    /// The angle measured in the first movement, as a fraction of the real one.
    measured_fraction: f64,
}

impl<R> Clocked<R> {
    fn new(rig: R, lost_periods: u64, measured_fraction: f64) -> Self {
        Self { rig, samples: 0, first_motion: None, lost_periods, measured_fraction }
    }

    fn with<S>(self, rig: S) -> Clocked<S> {
        let Self { samples, first_motion, lost_periods, measured_fraction, .. } = self;
        Clocked { rig, samples, first_motion, lost_periods, measured_fraction }
    }

    /// Samples since the first movement began.
    fn in_motion(&self) -> Option<u64> {
        self.first_motion.map(|began| self.samples - began)
    }
}

impl<R: Rig> Rig for Clocked<R> {
    type Armed = Clocked<R::Armed>;

    fn arm(mut self, consent: ArmingConsent, limits: &Limits) -> Result<Self::Armed, (Self, Fault)> {
        let state = Clocked { rig: (), ..Clocked::new((), self.lost_periods, self.measured_fraction) };
        match self.rig.arm(consent, limits) {
            Ok(rig) => Ok(state.with(rig)),
            Err((rig, fault)) => {
                self.rig = rig;
                Err((self, fault))
            }
        }
    }
}

impl<A: Armed> Armed for Clocked<A> {
    type Disarmed = Clocked<A::Disarmed>;

    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        self.samples += 1;
        if matches!(command.motor, Motor::Follow { angle_rad } if angle_rad != 0.0) {
            self.first_motion.get_or_insert(self.samples);
        }
        let mut sample = self.rig.exchange(command)?;
        if self.in_motion().is_some_and(|samples| samples < 1500) {
            sample.theta_m_rad *= self.measured_fraction;
        }
        Ok(sample)
    }

    fn take_punctuality(&mut self) -> Option<Punctuality> {
        let lost_periods = if self.in_motion() == Some(60) { self.lost_periods } else { 0 };
        let longest_gap_us = if lost_periods > 0 { 60_000 } else { 430 };
        Some(Punctuality { lost_periods, longest_gap_us, latest_us: 31 })
    }

    fn origin(&self) -> Option<Origin> {
        Some(Origin::SetHere)
    }

    fn rescale_emg(&mut self, factors: [f64; 2]) {
        self.rig.rescale_emg(factors);
    }

    fn disarm(self) -> Self::Disarmed {
        let state = Clocked { rig: (), ..Clocked::new((), self.lost_periods, self.measured_fraction) };
        state.with(self.rig.disarm())
    }
}

/// The folder of a session on such a rig, written as a session with a motor is.
fn session(lost_periods: u64, measured_fraction: f64) -> (tempfile::TempDir, std::path::PathBuf) {
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path().join("s");
    let protocol = protocol();
    let order = schedule::draw(&protocol, 1, None).unwrap();
    let settings = Settings::new(&protocol, 1, &order).unwrap();
    let recorder = NewSession {
        protocol: &protocol,
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
    .create(&folder, Disk::default())
    .unwrap();
    let wrist = VirtualWrist::new(Person::default(), Setup::default(), 1, settings.sample_rate_hz);
    let mut machine = Machine::new(Arc::new(settings));
    let mut recorder = BackgroundRecorder::start_waiting(recorder, machine.progress().clone());
    let rig = Clocked::new(wrist, lost_periods, measured_fraction);
    run_control_loop(rig, &mut machine, &mut Starter, &mut Unpaced, &mut recorder).unwrap();
    recorder.finish().unwrap();
    (temporary, folder)
}

fn journal(folder: &Path) -> String {
    fs::read_to_string(folder.join(JOURNAL)).unwrap()
}

#[test]
fn a_session_whose_ramp_lost_periods_replays_without_a_difference() {
    let (_temporary, folder) = session(30, 1.0);
    let trials = load(&folder).unwrap().trials;
    let statuses: Vec<_> = trials.iter().map(|trial| trial.status).collect();
    assert_eq!(statuses, [Status::Rejected, Status::Ok, Status::Ok]);
    assert_eq!(trials[0].extra["reason"], "motion_deviated");
    assert_eq!(trials[0].extra["lost_periods"], "30");
    assert_eq!(
        (trials[0].extra["longest_gap_us"].as_str(), trials[1].extra["longest_gap_us"].as_str()),
        ("60000", "430")
    );
    assert!(
        journal(&folder).contains(r#""deviation":{"lost_periods":{"lost_periods":30}}"#),
        "{}",
        journal(&folder)
    );
    assert_eq!(replay(&folder).unwrap().difference, None);
}

#[test]
fn a_session_with_a_ramp_slower_than_asked_replays_without_a_difference() {
    let (_temporary, folder) = session(0, 0.8);
    let trials = load(&folder).unwrap().trials;
    assert_eq!((trials[0].status, trials[1].status), (Status::Rejected, Status::Ok));
    assert!(
        journal(&folder).contains(r#""deviation":{"velocity":{"measured_rad_s":2.6"#),
        "{}",
        journal(&folder)
    );
    assert_eq!(replay(&folder).unwrap().difference, None);
}

#[test]
fn a_record_that_says_that_a_slow_ramp_was_ok_differs_from_its_replay() {
    let (_temporary, folder) = session(0, 1.0);
    let path = folder.join("trials/trial-001.csv");
    let text = fs::read_to_string(&path).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    let header = lines.next().unwrap();
    let slower = lines.map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[1] = (0.8 * cells[1].parse::<f64>().unwrap()).to_string();
        cells.join(",") + "\n"
    });
    fs::write(&path, header + "\n" + &slower.collect::<String>()).unwrap();
    let difference = replay(&folder).unwrap().difference.unwrap();
    assert!(difference.replayed.contains("motion_deviated"), "{difference}");
}

#[test]
fn the_journal_says_how_the_start_position_was_known() {
    let (_temporary, folder) = session(0, 1.0);
    let text = journal(&folder);
    let origin = text.find(r#"{"record":"origin","sample":0,"origin":"set_here"}"#).expect("an origin");
    assert!(origin < text.find("\"onset\"").unwrap(), "it is on disk before the motor moves");
    assert!(Resumable::open(&folder, Disk::default()).unwrap().was_armed());
}
