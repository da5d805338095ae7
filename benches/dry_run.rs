//! How much faster than real time the paper's whole session runs on the virtual wrist, on one core: the session and the
//! wrist alone, and with everything written to disk.
//!
//! `cargo bench --bench dry_run` prints one line of JSON.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use ramphold::dataset::{Disk, NewSession};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::Fault;
use ramphold::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use ramphold::schedule;
use ramphold::session::{
    AsFastAsItGoes, Event, Input, Machine, Operator, Output, Phase, Recorder, Settings, conduct,
};

struct Starter;

impl Operator for Starter {
    fn heard(&mut self, _: &Machine) -> Option<Event> {
        None
    }
    fn asked(&mut self, _: &Machine) -> Event {
        Event::Start
    }
    fn refused(&mut self, _: Event, _: Phase) {}
    fn not_armed(&mut self, _: Fault) {}
    fn faulted(&mut self, _: Fault) {}
}

struct Forgetful;

impl Recorder for Forgetful {
    type Error = Infallible;
    fn take(&mut self, _: &Input, _: &Output, _: &Machine) -> Result<(), Infallible> {
        Ok(())
    }
}

fn main() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/de-vlugt-2011.json");
    let protocol = ValidProtocol::read(&path).expect("the paper's protocol is valid");
    let order = schedule::draw(&protocol, 1, None).expect("it can be ordered");
    let settings = Arc::new(Settings::new(&protocol, 1, &order).expect("it can be run"));
    let rate = settings.sample_rate_hz;
    let wrist = || VirtualWrist::new(Person::default(), Setup::default(), 1, rate);

    let mut simulated_s = 0.0;
    let mut alone_s = f64::INFINITY;
    let mut kept_s = f64::INFINITY;
    for _ in 0..5 {
        let mut machine = Machine::new(settings.clone());
        let start = Instant::now();
        let Ok(_) = conduct(wrist(), &mut machine, &mut Starter, &mut AsFastAsItGoes, &mut Forgetful);
        alone_s = alone_s.min(start.elapsed().as_secs_f64());
        simulated_s = machine.sample() as f64 / rate;

        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut machine = Machine::new(settings.clone());
        let start = Instant::now();
        let session = NewSession {
            protocol: &protocol,
            order: &order,
            seed: 1,
            subject: "V00",
            lever: Setup::default().lever,
            rig: &serde_json::Value::Null,
        };
        let mut recorder =
            session.create(&folder.path().join("s"), Disk::default()).expect("it can be written");
        conduct(wrist(), &mut machine, &mut Starter, &mut AsFastAsItGoes, &mut recorder)
            .expect("it can be kept");
        kept_s = kept_s.min(start.elapsed().as_secs_f64());
    }
    println!(
        "{{\"simulated_s\": {simulated_s:.1}, \"alone_s\": {alone_s:.3}, \"alone_times_real_time\": {:.0}, \
         \"kept_s\": {kept_s:.3}, \"kept_times_real_time\": {:.0}}}",
        simulated_s / alone_s,
        simulated_s / kept_s
    );
}
