//! The list of a study's units: its sessions, with the subject and the seed of each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::error::{StudyError, StudyIssue};
use super::population::{Population, subject_id};
use super::study_file::{MeasuredSessions, StudyFile, StudyFit, Subjects, VirtualSubjects};
use crate::consistency::SignalCheck;
use crate::dataset::{PROGRAM, session_folders, stored_protocol};
use crate::files::{Folder, limits};
use crate::fit::Weighting;
use crate::protocol::ValidProtocol;
use crate::random::Stream;
use crate::rig::virtual_wrist::{Person, RigFile, Setup};

/// A study with everything that its file names read and checked.
#[derive(Debug, Clone)]
pub struct Study {
    /// Name of the study.
    pub name: String,
    /// Seed of all random draws.
    pub seed: u64,
    /// Weighting of the residuals in the fits.
    pub weighting: Weighting,
    /// The fit whose values are tested.
    pub fit: StudyFit,
    /// Checks of the signals against the sessions' tables that may fail.
    pub accept: Vec<SignalCheck>,
    /// Issues with the list of subjects, found before any session is fitted.
    pub issues: Vec<StudyIssue>,
    source: StudySource,
    units_per_part: u32,
    digest: String,
}

#[derive(Debug, Clone)]
enum StudySource {
    Virtual(Box<VirtualSource>),
    Measured(Vec<MeasuredSession>),
}

/// What is needed to simulate a session of the study.
#[derive(Debug, Clone)]
struct VirtualSource {
    population: Population,
    protocol: ValidProtocol,
    setup: Setup,
    subjects: u32,
    sessions: u32,
}

#[derive(Debug, Clone)]
struct MeasuredSession {
    folder: PathBuf,
    subject: String,
    session: u32,
    /// Whether the session is kept out of the tables: another protocol, a subject that appears twice, or the records of another session.
    excluded: bool,
}

/// One session of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit<'a> {
    /// Index in the list, from 0.
    pub index: u64,
    /// The subject's identifier.
    pub subject: String,
    /// Number of the session of this subject, from 1.
    pub session: u32,
    /// Whether the session is in study.csv and in no other table.
    pub is_excluded: bool,
    /// Where the session comes from.
    pub source: UnitSource<'a>,
}

/// Where the session of a unit comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum UnitSource<'a> {
    /// It is simulated with the virtual wrist.
    Virtual {
        /// The protocol.
        protocol: &'a ValidProtocol,
        /// The virtual rig.
        setup: &'a Setup,
        /// The virtual subject in this session.
        person: Box<Person>,
        /// Seed of the session's random draws.
        seed: u64,
        /// Row of a counterbalanced order of conditions, from 1.
        order_number: u32,
    },
    /// It was measured, and is in this folder.
    Measured(&'a Path),
}

impl Study {
    /// Reads a study file and every file that it names.
    pub fn open(file: &Path, seed: u64) -> Result<Self, StudyError> {
        let (study, text) = StudyFile::read(file)?;
        Self::new(&study, &text, file.parent().unwrap_or(Path::new("")), seed)
    }

    /// The study of a file that was read from `folder`; `text` is the text of the file.
    pub fn new(study: &StudyFile, text: &str, folder: &Path, seed: u64) -> Result<Self, StudyError> {
        // Digest of everything that the results depend on: a study may be resumed only with the same input.
        let mut digest = Sha256::new()
            .chain_update(PROGRAM)
            .chain_update([0])
            .chain_update(seed.to_le_bytes())
            .chain_update(text);
        let (source, issues) = match &study.subjects {
            Subjects::Virtual(persons) => (virtual_source(persons, folder, &mut digest)?, Vec::new()),
            Subjects::Measured(persons) => {
                let (units, issues) = measured_units(persons, folder)?;
                for unit in &units {
                    digest.update(format!("{}\0{}\0{}\n", unit.subject, unit.session, unit.excluded));
                }
                (StudySource::Measured(units), issues)
            }
        };
        Ok(Self {
            name: study.name.clone(),
            seed,
            weighting: study.weighting,
            fit: study.fit,
            accept: match &study.subjects {
                Subjects::Virtual(_) => Vec::new(),
                Subjects::Measured(measured) => measured.accept.clone(),
            },
            issues,
            source,
            units_per_part: study.units_per_part,
            digest: digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
        })
    }

    /// Number of sessions.
    pub fn units(&self) -> u64 {
        match &self.source {
            StudySource::Virtual(source) => u64::from(source.subjects) * u64::from(source.sessions),
            StudySource::Measured(units) => units.len() as u64,
        }
    }

    /// Number of parts.
    pub fn parts(&self) -> u64 {
        self.units().div_ceil(u64::from(self.units_per_part))
    }

    /// Indices of the units of a part.
    pub fn units_of(&self, part: u64) -> std::ops::Range<u64> {
        let size = u64::from(self.units_per_part);
        (part * size).min(self.units())..((part + 1) * size).min(self.units())
    }

    /// SHA-256 that identifies the study, its seed and the version of the program.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The unit at `index`; the sessions of a subject follow each other.
    ///
    /// # Panics
    /// If `index` is not less than [`Study::units`].
    pub fn unit(&self, index: u64) -> Unit<'_> {
        assert!(index < self.units(), "the study has {} units", self.units());
        match &self.source {
            StudySource::Virtual(source) => {
                let sessions = u64::from(source.sessions);
                let (number, session) = ((index / sessions) as u32 + 1, (index % sessions) as u32 + 1);
                let name = format!("study/session/{number}/{session}");
                let source = UnitSource::Virtual {
                    protocol: &source.protocol,
                    setup: &source.setup,
                    person: Box::new(source.population.subject(self.seed, number, session)),
                    // 32 bits, short enough to type: the session can be run alone with `ramphold run --seed`.
                    seed: Stream::new(self.seed, &name).bits() >> 32,
                    order_number: index as u32 + 1,
                };
                Unit { index, subject: subject_id(number), session, is_excluded: false, source }
            }
            StudySource::Measured(units) => {
                let unit = &units[index as usize];
                let (subject, session, is_excluded) = (unit.subject.clone(), unit.session, unit.excluded);
                Unit { index, subject, session, is_excluded, source: UnitSource::Measured(&unit.folder) }
            }
        }
    }

    /// Changes the population of virtual subjects; a study of measured sessions stays as it is.
    pub fn change_population(&mut self, change: impl FnOnce(&mut Population)) {
        if let StudySource::Virtual(source) = &mut self.source {
            change(&mut source.population);
        }
    }

    /// The study with another number of virtual subjects and sessions of each.
    pub fn resized(mut self, subjects: u32, sessions: u32) -> Self {
        if let StudySource::Virtual(source) = &mut self.source {
            (source.subjects, source.sessions) = (subjects, sessions);
        }
        self
    }

    /// The protocol, if the subjects are virtual.
    pub fn protocol(&self) -> Option<&ValidProtocol> {
        match &self.source {
            StudySource::Virtual(source) => Some(&source.protocol),
            StudySource::Measured(_) => None,
        }
    }
}

fn virtual_source(
    persons: &VirtualSubjects,
    folder: &Path,
    digest: &mut Sha256,
) -> Result<StudySource, StudyError> {
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
    let (subjects, sessions) = (persons.count, persons.sessions);
    Ok(StudySource::Virtual(Box::new(VirtualSource { population, protocol, setup, subjects, sessions })))
}

/// The sessions in the folders. Those of a subject follow each other, in the order of the list.
fn measured_units(
    measured: &MeasuredSessions,
    folder: &Path,
) -> Result<(Vec<MeasuredSession>, Vec<StudyIssue>), StudyError> {
    let mut issues = Vec::new();
    let mut subjects: Vec<(String, Vec<PathBuf>)> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for session in
        session_folders(&measured.folders.iter().map(|given| folder.join(given)).collect::<Vec<_>>())?
    {
        let subject = subject_of(&session);
        let place = *places.entry(subject.clone()).or_insert_with(|| {
            subjects.push((subject, Vec::new()));
            subjects.len() - 1
        });
        subjects[place].1.push(session);
    }
    let mut units: Vec<MeasuredSession> = Vec::new();
    let mut reference: Option<(String, ValidProtocol)> = None;
    let mut records: BTreeMap<[u8; 32], String> = BTreeMap::new();
    let mut spellings: BTreeMap<String, String> = BTreeMap::new();
    for (subject, folders) in subjects {
        let other = spellings.insert(without_case_and_separators(&subject), subject.clone());
        let is_similar = other.is_some();
        issues.extend(other.map(|other| StudyIssue::SimilarSubject { subject: subject.clone(), other }));
        for (folder, session) in folders.into_iter().zip(1..) {
            let is_second = session > 1 && !measured.repeated;
            let mut excluded = is_second || is_similar;
            if is_second {
                let place = folder.display().to_string();
                issues.push(StudyIssue::DuplicateSubject { subject: subject.clone(), place });
            }
            if let Some(record) = first_record(&folder)
                && let Some(other) = records.insert(record, subject.clone())
            {
                let place = folder.display().to_string();
                issues.push(StudyIssue::CopiedSession { subject: subject.clone(), place, other });
                excluded = true;
            }
            let protocol = stored_protocol(&folder).ok().flatten();
            match (&reference, protocol) {
                (None, Some(protocol)) => reference = Some((subject.clone(), protocol)),
                (Some((first, expected)), Some(protocol)) => {
                    if let Some(field) = difference(expected, &protocol) {
                        let difference = format!("{field}, compared with {first}");
                        issues.push(StudyIssue::OtherProtocol { subject: subject.clone(), difference });
                        excluded = true;
                    }
                }
                (_, None) => {}
            }
            units.push(MeasuredSession { folder, subject: subject.clone(), session, excluded });
        }
    }
    Ok((units, issues))
}

/// An identifier without what is easily mistyped: `s 01 ` is `S_01`.
fn without_case_and_separators(subject: &str) -> String {
    subject.trim().to_lowercase().replace([' ', '_'], "-")
}

/// SHA-256 of the record of a session whose name comes first; `None` if there is none that can be read, which loading it will report.
fn first_record(session: &Path) -> Option<[u8; 32]> {
    let records = Folder::open(session).and_then(|folder| folder.folder("trials")).ok()?;
    let first = records.entries().ok()?.into_iter().map(|entry| entry.name).min()?;
    Some(Sha256::digest(records.read(first, limits::RECORD_BYTES).ok()?).into())
}

/// The subject's identifier in a session folder; the folder's path if it has none, which loading it will report.
fn subject_of(session: &Path) -> String {
    let text =
        Folder::open(session).and_then(|folder| folder.read_text("session.json", limits::SETTINGS_BYTES));
    let value: Value = serde_json::from_str(&text.unwrap_or_default()).unwrap_or_default();
    let own = value["subject"]["id"].as_str().map(str::to_owned);
    own.unwrap_or_else(|| session.display().to_string())
}

/// The first field in which two protocols differ so that their sessions do not belong in one table; the order may differ.
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
