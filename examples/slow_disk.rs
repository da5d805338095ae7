//! How late the periods of a session begin at true speed, on a disk as it is and on one that takes 50 ms for everything;
//! with the writer on a thread of its own as the program has it, and without.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use ramphold::dataset::{BackgroundRecorder, Disk, NewSession};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::Fault;
use ramphold::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use ramphold::schedule;
use ramphold::session::{Event, Machine, Operator, Phase, RealTime, Settings, run_control_loop};

struct Starter;

impl Operator for Starter {
    fn poll_command(&mut self, _: &Machine) -> Option<Event> {
        None
    }
    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if machine.phase() == Phase::Ready { Event::Start } else { Event::Abort }
    }
    fn command_refused(&mut self, _: Event, _: Phase) {}
    fn arming_failed(&mut self, fault: Fault) {
        eprintln!("{fault}");
    }
    fn fault_occurred(&mut self, fault: Fault) {
        eprintln!("{fault}");
    }
    fn power_not_confirmed(&mut self) {}
}

fn protocol() -> Result<ValidProtocol, Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/quick.json");
    let mut protocol = (*ValidProtocol::read(&path)?).clone();
    protocol.velocities_rad_s = vec![3.25];
    protocol.before = Default::default();
    Ok(protocol.validate()?)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let protocol = protocol()?;
    let order = schedule::draw(&protocol, 1, None)?;
    let settings = Arc::new(Settings::new(&protocol, 1, &order)?);
    for (disk_takes, behind_ring) in [(0, true), (50, true), (50, false)] {
        let folder = tempfile::tempdir()?;
        let session = NewSession {
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
        };
        let disk = Disk::slow(Duration::from_millis(disk_takes));
        let mut recorder = session.create(&folder.path().join("s"), disk)?;
        let rate = settings.sample_rate_hz;
        let wrist = VirtualWrist::new(Person::default(), Setup::default(), 1, rate);
        let (mut machine, mut clock) = (Machine::new(settings.clone()), RealTime::new(rate));
        if behind_ring {
            let mut recorder = BackgroundRecorder::start(recorder, machine.progress().clone());
            run_control_loop(wrist, &mut machine, &mut Starter, &mut clock, &mut recorder)?;
            recorder.finish()?;
        } else {
            run_control_loop(wrist, &mut machine, &mut Starter, &mut clock, &mut recorder)?;
        }
        let where_written = if behind_ring { "behind the ring" } else { "in the loop" };
        println!("each operation of the disk takes {disk_takes} ms longer, written {where_written}:");
        print!("{}", clock.lateness());
    }
    Ok(())
}
