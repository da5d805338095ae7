//! What the model of a session does to studies, to sessions of few conditions, and to two persons in one folder.
//!
//! ```text
//! cargo run --release --example session_model -- study STUDY.json SUBJECTS SEED
//! cargo run --release --example session_model -- few PROTOCOL.json SESSIONS SEED
//! cargo run --release --example session_model -- persons PROTOCOL.json SESSIONS SEED STIFFNESS_RATIO LATER_PART
//! ```
//!
//! Each prints one line of JSON. `scripts/session-model` makes the page of them.

mod few_conditions;
mod studies;
mod two_persons;

use std::error::Error;
use std::path::Path;

use ramphold::dataset::Session;
use ramphold::fit::{Fit, Model, Observations, PreprocessingSettings, Weighting};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::virtual_wrist::{Person, Setup};
use ramphold::study::{SessionStorage, Unit, UnitSource, simulate_unit};

/// An error that a thread may return.
type Failed = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failed> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["study", study, subjects, seed] => {
            studies::count(Path::new(study), subjects.parse()?, seed.parse()?)?
        }
        ["few", protocol, sessions, seed] => {
            few_conditions::count(&ValidProtocol::read(Path::new(protocol))?, sessions.parse()?, seed.parse()?)?
        }
        ["persons", protocol, sessions, seed, ratio, part] => {
            let protocol = ValidProtocol::read(Path::new(protocol))?;
            two_persons::count(&protocol, sessions.parse()?, seed.parse()?, ratio.parse()?, part.parse()?)?
        }
        _ => return Err("study STUDY SUBJECTS SEED, few PROTOCOL SESSIONS SEED, or persons PROTOCOL SESSIONS SEED RATIO PART?".into()),
    };
    println!("{result}");
    Ok(())
}

/// A session of a virtual person.
fn simulate(protocol: &ValidProtocol, person: &Person, seed: u64) -> Result<Session, Failed> {
    let setup = Setup::default();
    let person = Box::new(person.clone());
    let source = UnitSource::Virtual { protocol, setup: &setup, person, seed, order_number: 1 };
    let unit = Unit { index: 0, subject: format!("V{seed}"), session: 1, is_excluded: false, source };
    Ok(simulate_unit(&unit, SessionStorage::Memory)?.ok_or("the unit is virtual")?)
}

/// A session with the filter and the window of its protocol, and the fit of each trial on its own.
fn fit_independently(protocol: &ValidProtocol, session: &Session) -> Result<(Observations, Fit), Failed> {
    let settings = PreprocessingSettings::of(protocol);
    let observations = Observations::new(session, settings)?;
    let fit = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
    Ok((observations, fit))
}
