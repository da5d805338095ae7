//! The list of a study's units: which sessions there are, who each belongs to, and the seed of each.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::error::{Problem, StudyError};
use super::population::{Population, subject_id};
use super::study_file::{Measured, Persons, StudyFile, VirtualPersons};
use crate::dataset::PROGRAM;
use crate::fit::Weighting;
use crate::protocol::ValidProtocol;
use crate::random::Stream;
use crate::rig::virtual_wrist::{Person, RigFile, Setup};

/// A study that can be done.
#[derive(Debug, Clone)]
pub struct Study {
    /// What it is called.
    pub name: String,
    /// Seed of every random draw.
    pub seed: u64,
    /// How residuals are weighed.
    pub weighting: Weighting,
    /// What is wrong with the persons as listed; said once, before the work begins.
    pub problems: Vec<Problem>,
    source: Source,
    units_per_part: u32,
    digest: String,
}

#[derive(Debug, Clone)]
enum Source {
    Virtual(Box<VirtualSource>),
    Measured(Vec<MeasuredUnit>),
}

/// What it takes to run a virtual session.
#[derive(Debug, Clone)]
struct VirtualSource {
    population: Population,
    protocol: ValidProtocol,
    setup: Setup,
    persons: u32,
    sessions: u32,
}

#[derive(Debug, Clone)]
struct MeasuredUnit {
    folder: PathBuf,
    subject: String,
    session: u32,
    /// Not for the tables: another protocol, or the person comes twice.
    apart: bool,
}

/// One session of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit<'a> {
    /// Its place in the list, from 0.
    pub index: u64,
    /// Whose it is.
    pub subject: String,
    /// Which session of that person, from 1.
    pub session: u32,
    /// How it comes about.
    pub what: What<'a>,
}

/// How a unit comes about.
#[derive(Debug, Clone, PartialEq)]
pub enum What<'a> {
    /// It is run on the virtual wrist.
    Virtual {
        /// The protocol.
        protocol: &'a ValidProtocol,
        /// The rig.
        setup: &'a Setup,
        /// The person as they are in this session.
        person: Box<Person>,
        /// Seed of the session's own draws.
        seed: u64,
        /// The row of a counterbalanced order, from 1.
        order_number: u32,
    },
    /// It was measured.
    Measured(&'a Path),
}

impl Study {
    /// Reads a study and everything that it names.
    pub fn open(file: &Path, seed: u64) -> Result<Self, StudyError> {
        let (study, text) = StudyFile::read(file)?;
        Self::new(&study, &text, file.parent().unwrap_or(Path::new("")), seed)
    }

    /// The study of a file that was read from `folder`; `text` is what the file says.
    pub fn new(study: &StudyFile, text: &str, folder: &Path, seed: u64) -> Result<Self, StudyError> {
        // All that the results depend on; whoever goes on with a study must mean the same one.
        let mut digest = Sha256::new()
            .chain_update(PROGRAM)
            .chain_update([0])
            .chain_update(seed.to_le_bytes())
            .chain_update(text);
        let (source, problems) = match &study.persons {
            Persons::Virtual(persons) => (virtual_source(persons, folder, &mut digest)?, Vec::new()),
            Persons::Measured(persons) => {
                let (units, problems) = measured_units(persons, folder)?;
                for unit in &units {
                    digest.update(format!("{}\0{}\0{}\n", unit.subject, unit.session, unit.apart));
                }
                (Source::Measured(units), problems)
            }
        };
        Ok(Self {
            name: study.name.clone(),
            seed,
            weighting: study.weighting,
            problems,
            source,
            units_per_part: study.units_per_part,
            digest: digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
        })
    }

    /// How many sessions there are.
    pub fn units(&self) -> u64 {
        match &self.source {
            Source::Virtual(source) => u64::from(source.persons) * u64::from(source.sessions),
            Source::Measured(units) => units.len() as u64,
        }
    }

    /// How many parts they make.
    pub fn parts(&self) -> u64 {
        self.units().div_ceil(u64::from(self.units_per_part))
    }

    /// The units of a part.
    pub fn units_of(&self, part: u64) -> std::ops::Range<u64> {
        let size = u64::from(self.units_per_part);
        (part * size).min(self.units())..((part + 1) * size).min(self.units())
    }

    /// What tells this study, its seed and this version of the program from any other.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The unit at `index`; the sessions of a person come one after the other.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn unit(&self, index: u64) -> Unit<'_> {
        assert!(index < self.units(), "the study has {} units", self.units());
        match &self.source {
            Source::Virtual(source) => {
                let sessions = u64::from(source.sessions);
                let (number, session) = ((index / sessions) as u32 + 1, (index % sessions) as u32 + 1);
                let name = format!("study/session/{number}/{session}");
                let what = What::Virtual {
                    protocol: &source.protocol,
                    setup: &source.setup,
                    person: Box::new(source.population.person(self.seed, number, session)),
                    // As short as a seed that is typed: such a session can be run by hand.
                    seed: Stream::new(self.seed, &name).bits() >> 32,
                    order_number: index as u32 + 1,
                };
                Unit { index, subject: subject_id(number), session, what }
            }
            Source::Measured(units) => {
                let unit = &units[index as usize];
                let (subject, session) = (unit.subject.clone(), unit.session);
                Unit { index, subject, session, what: What::Measured(&unit.folder) }
            }
        }
    }

    /// Whose sessions are for study.csv alone, in rising order.
    pub fn apart(&self) -> Vec<(String, u32)> {
        let Source::Measured(units) = &self.source else { return Vec::new() };
        let mut apart: Vec<(String, u32)> =
            units.iter().filter(|unit| unit.apart).map(|unit| (unit.subject.clone(), unit.session)).collect();
        apart.sort();
        apart
    }

    /// The virtual persons are changed; what else there is stays as it is.
    pub fn map_population(&mut self, change: impl FnOnce(&mut Population)) {
        if let Source::Virtual(source) = &mut self.source {
            change(&mut source.population);
        }
    }

    /// The same study with so many virtual persons and sessions of each.
    pub fn resized(mut self, persons: u32, sessions: u32) -> Self {
        if let Source::Virtual(source) = &mut self.source {
            (source.persons, source.sessions) = (persons, sessions);
        }
        self
    }

    /// The protocol of a study of virtual persons.
    pub fn protocol(&self) -> Option<&ValidProtocol> {
        match &self.source {
            Source::Virtual(source) => Some(&source.protocol),
            Source::Measured(_) => None,
        }
    }
}

fn virtual_source(
    persons: &VirtualPersons,
    folder: &Path,
    digest: &mut Sha256,
) -> Result<Source, StudyError> {
    let protocol = ValidProtocol::read(&folder.join(&persons.protocol))?;
    let average = match &persons.person {
        Some(file) => Person::read(&folder.join(file))?,
        None => Person::default(),
    };
    let rig = persons.rig.as_ref().map(|file| RigFile::read(&folder.join(file))).transpose()?;
    let RigFile::Virtual(setup) = rig.unwrap_or_default();
    digest.update(protocol.text());
    digest.update(serde_json::json!({ "person": average, "setup": setup }).to_string());
    let population =
        Population { average, spread: persons.spread, between_sessions: persons.between_sessions };
    let (persons, sessions) = (persons.count, persons.sessions);
    Ok(Source::Virtual(Box::new(VirtualSource { population, protocol, setup, persons, sessions })))
}

/// The sessions in the folders, those of a person together in the order in which they were listed.
fn measured_units(
    measured: &Measured,
    folder: &Path,
) -> Result<(Vec<MeasuredUnit>, Vec<Problem>), StudyError> {
    let mut problems = Vec::new();
    let mut persons: Vec<(String, Vec<PathBuf>)> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for session in sessions(measured, folder)? {
        let subject = subject_of(&session);
        let place = *places.entry(subject.clone()).or_insert_with(|| {
            persons.push((subject, Vec::new()));
            persons.len() - 1
        });
        persons[place].1.push(session);
    }
    let mut units: Vec<MeasuredUnit> = Vec::new();
    let mut reference: Option<(String, ValidProtocol)> = None;
    for (subject, folders) in persons {
        for (folder, session) in folders.into_iter().zip(1..) {
            let mut apart = session > 1 && !measured.repeated;
            if apart {
                let place = folder.display().to_string();
                problems.push(Problem::Twice { subject: subject.clone(), place });
            }
            let protocol = ValidProtocol::read(&folder.join("protocol.json")).ok();
            match (&reference, protocol) {
                (None, Some(protocol)) => reference = Some((subject.clone(), protocol)),
                (Some((first, expected)), Some(protocol)) => {
                    if let Some(what) = difference(expected, &protocol) {
                        let difference = format!("{what}, compared with {first}");
                        problems.push(Problem::OtherProtocol { subject: subject.clone(), difference });
                        apart = true;
                    }
                }
                (_, None) => {}
            }
            units.push(MeasuredUnit { folder, subject: subject.clone(), session, apart });
        }
    }
    Ok((units, problems))
}

/// The folders themselves where they hold a session, else the sessions in them, by name.
fn sessions(measured: &Measured, folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    let is_session = |folder: &Path| folder.join("session.json").exists();
    let mut found = Vec::new();
    for given in &measured.folders {
        let given = folder.join(given);
        let mut inside = Vec::new();
        if given.is_dir() && !is_session(&given) {
            for entry in fs::read_dir(&given).map_err(StudyError::at(&given))? {
                let path = entry.map_err(StudyError::at(&given))?.path();
                if is_session(&path) {
                    inside.push(path);
                }
            }
            inside.sort();
        }
        // Loading it says what is missing.
        if inside.is_empty() { found.push(given) } else { found.append(&mut inside) }
    }
    Ok(found)
}

/// Whose a session is; loading it says what is wrong if it does not say so.
fn subject_of(session: &Path) -> String {
    let text = fs::read_to_string(session.join("session.json")).unwrap_or_default();
    let value: Value = serde_json::from_str(&text).unwrap_or_default();
    let own = value["subject"]["id"].as_str().map(str::to_owned);
    own.unwrap_or_else(|| session.display().to_string())
}

/// What about two protocols keeps their sessions out of one table; the order of the trials does not.
fn difference(expected: &ValidProtocol, found: &ValidProtocol) -> Option<&'static str> {
    let same = [
        ("velocities_rad_s", expected.velocities_rad_s == found.velocities_rad_s),
        ("torques_nm", expected.torques_nm == found.torques_nm),
        ("ramp", expected.ramp == found.ramp),
        ("gate", expected.gate == found.gate),
        ("signal", expected.signal == found.signal),
        ("window_s", expected.window_s == found.window_s),
    ];
    same.into_iter().find(|(_, same)| !same).map(|(field, _)| field)
}
