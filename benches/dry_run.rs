//! How much faster than real time the paper's whole session runs on the virtual wrist, on one core: the session and the
//! wrist alone, and with everything written to disk.
//!
//! `cargo bench --bench dry_run` prints one line of JSON. `on_core` is the time that the core spent on it, which other work on
//! the machine does not lengthen; `null` where the system does not say.

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
    Event, Machine, Operator, Phase, Progress, Settings, Step, StepConsumer, Unpaced, run_control_loop,
};

struct Starter;

impl Operator for Starter {
    fn poll_command(&mut self, _: &Machine) -> Option<Event> {
        None
    }
    fn wait_for_command(&mut self, _: &Machine) -> Event {
        Event::Start
    }
    fn command_refused(&mut self, _: Event, _: Phase) {}
    fn arming_failed(&mut self, _: Fault) {}
    fn fault_occurred(&mut self, _: Fault) {}
    fn power_not_confirmed(&mut self) {}
}

/// Consumer that keeps nothing.
struct Discard;

impl StepConsumer for Discard {
    type Error = Infallible;
    fn consume(&mut self, _: &Step, _: &Progress) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Time that this thread was on a core, s.
fn on_core_s() -> Option<f64> {
    let spent = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    spent.split_whitespace().next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
}

/// A stopwatch of both kinds.
struct Watch(Instant, Option<f64>);

impl Watch {
    fn start() -> Self {
        Self(Instant::now(), on_core_s())
    }

    /// Seconds by the clock and on the core.
    fn stop(&self) -> [f64; 2] {
        let on_core = on_core_s().zip(self.1).map_or(f64::NAN, |(now, then)| now - then);
        [self.0.elapsed().as_secs_f64(), on_core]
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
    let mut alone_s = [f64::INFINITY; 2];
    let mut kept_s = [f64::INFINITY; 2];
    for _ in 0..5 {
        let mut machine = Machine::new(settings.clone());
        let watch = Watch::start();
        let Ok(_) = run_control_loop(wrist(), &mut machine, &mut Starter, &mut Unpaced, &mut Discard);
        alone_s = least(alone_s, watch.stop());
        simulated_s = machine.sample() as f64 / rate;

        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut machine = Machine::new(settings.clone());
        let watch = Watch::start();
        let session = NewSession {
            calibration: None,
            protocol: &protocol,
            order: &order,
            seed: 1,
            subject: "V00",
            lever: Setup::default().lever,
            rig: &serde_json::Value::Null,
            about: &Default::default(),
            subject_fields: &Default::default(),
            signals: &Default::default(),
            motion_delay_samples: 0,
        };
        let mut recorder = session
            .create(&folder.path().join("s"), Disk::synchronised_at_the_end())
            .expect("it can be written");
        run_control_loop(wrist(), &mut machine, &mut Starter, &mut Unpaced, &mut recorder)
            .expect("it can be kept");
        recorder.settle().expect("it can be kept");
        kept_s = least(kept_s, watch.stop());
    }
    let figures = |[clock, on_core]: [f64; 2]| {
        let times = |seconds: f64| (simulated_s / seconds).round();
        serde_json::json!({
            "clock_s": clock, "clock_times_real_time": times(clock),
            "on_core_s": on_core, "on_core_times_real_time": times(on_core),
        })
    };
    println!(
        "{}",
        serde_json::json!({ "simulated_s": simulated_s, "alone": figures(alone_s), "kept": figures(kept_s) })
    );
}

fn least(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].min(b[1])]
}
