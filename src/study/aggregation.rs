//! From the parts to `study.csv`, and from that to what the tables are made of: one person in memory at a time.

use std::collections::BTreeMap;
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::error::{Problem, StudyError};
use super::part::{Part, header};
use super::plan::Study;
use super::table_reader::{Cells, PersonRows, Rows};
use super::tables::Layout;
use crate::fit::QUANTITIES;
use crate::statistics::{Moments, Sample};

/// So many problems are told one by one; all are counted.
const TOLD: usize = 100;

/// What all persons together come to.
#[derive(Debug, Clone)]
pub struct Gathered {
    /// The cells.
    pub layout: Layout,
    /// By quantity: whether anybody has a value of it at all.
    pub measured: [bool; QUANTITIES.len()],
    /// Persons with any rows.
    pub persons: u64,
    /// Sessions of the person with most.
    pub sessions: u32,
    /// By quantity: persons with all cells.
    pub complete: Vec<Moments>,
    /// By quantity and cell: whoever has a value there.
    pub cells: Vec<Vec<Sample>>,
    /// By quantity: each person's means in their sessions, of those who have all cells in all sessions.
    pub by_session: Vec<Moments>,
    /// What keeps persons out of tables; at most the first hundred.
    pub problems: Vec<Problem>,
    /// How many problems there are.
    pub problem_count: u64,
}

/// Writes `study.csv` in `folder` from the parts there; gives what failed.
pub fn assemble(study: &Study, folder: &Path) -> Result<Vec<Problem>, StudyError> {
    let path = folder.join("study.csv");
    let partial = path.with_added_extension("new");
    let mut failed = Vec::new();
    let file = File::create(&partial).map_err(StudyError::at(&partial))?;
    let mut out = BufWriter::new(file);
    let put = |out: &mut BufWriter<File>, text: &str| {
        out.write_all(text.as_bytes()).map_err(StudyError::at(&partial))
    };
    put(&mut out, &header())?;
    for number in 0..study.parts() {
        let contents = Part::of(folder, number).read(study)?;
        put(&mut out, &contents.rows)?;
        failed.extend(contents.failed.into_iter().take(TOLD.saturating_sub(failed.len())));
    }
    out.flush().map_err(StudyError::at(&partial))?;
    std::fs::rename(&partial, &path).map_err(StudyError::at(&path))?;
    Ok(failed)
}

/// Who wrote a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// This program, person by person.
    Assembled,
    /// Somebody, perhaps with a person's rows in two places.
    Foreign,
}

/// Reads a table twice: for its conditions, then for its values. `apart` says whose rows, from which session, are not for the
/// tables; `problems` are those known already.
pub fn gather(
    table: &Path,
    origin: Origin,
    apart: impl Fn(&str, u32) -> bool,
    problems: Vec<Problem>,
) -> Result<Gathered, StudyError> {
    let kept = |person: &mut PersonRows| {
        let subject = person.subject.clone();
        person.rows.retain(|row| !apart(&subject, row.session));
        !person.rows.is_empty()
    };
    let mut designs: BTreeMap<Vec<(u64, u64)>, u64> = BTreeMap::new();
    let mut sessions = 0;
    let mut measured = [false; QUANTITIES.len()];
    for person in Rows::open(table)? {
        let mut person = person?;
        if !kept(&mut person) {
            continue;
        }
        let bits = |row: &super::table_reader::Row| (row.condition.0.to_bits(), row.condition.1.to_bits());
        let mut own: Vec<_> = person.rows.iter().map(bits).collect();
        own.sort_unstable();
        own.dedup();
        sessions = person.rows.iter().map(|row| row.session).max().unwrap_or(1).max(sessions);
        *designs.entry(own).or_default() += 1;
        for (quantity, measured) in measured.iter_mut().enumerate() {
            *measured |= person.rows.iter().any(|row| row.values[quantity].is_some());
        }
    }
    // The design that most persons have, and of those the largest.
    let most = designs.into_iter().max_by_key(|(conditions, persons)| (*persons, conditions.len()));
    let conditions = most.map_or(Vec::new(), |(conditions, _)| conditions);
    let layout = Layout::of(conditions.into_iter().map(|(v, t)| (f64::from_bits(v), f64::from_bits(t))));
    let mut gathered = Gathered::new(layout, sessions, problems, measured);
    let mut seen = HashSet::new();
    for person in Rows::open(table)? {
        let mut person = person?;
        if !kept(&mut person) {
            continue;
        }
        if origin == Origin::Foreign && !seen.insert(person.subject.clone()) {
            let place = format!("{}, line {}", table.display(), person.line);
            gathered.tell(Problem::Twice { subject: person.subject, place });
            continue;
        }
        gathered.add(&person);
    }
    let persons = gathered.complete.iter().map(Moments::count).max().unwrap_or(0);
    if persons < 2 {
        gathered.tell(Problem::TooFew { persons });
    }
    Ok(gathered)
}

impl Gathered {
    fn new(
        layout: Layout,
        sessions: u32,
        problems: Vec<Problem>,
        measured: [bool; QUANTITIES.len()],
    ) -> Self {
        let cells = layout.conditions.len();
        Self {
            complete: vec![Moments::new(cells); QUANTITIES.len()],
            cells: vec![vec![Sample::default(); cells]; QUANTITIES.len()],
            by_session: vec![Moments::new(sessions as usize); QUANTITIES.len()],
            layout,
            measured,
            persons: 0,
            sessions,
            problem_count: problems.len() as u64,
            problems,
        }
    }

    fn tell(&mut self, problem: Problem) {
        self.problem_count += 1;
        if self.problems.len() < TOLD {
            self.problems.push(problem);
        }
    }

    fn add(&mut self, person: &PersonRows) {
        let cells = match Cells::of(person.rows.iter(), &self.layout.conditions) {
            Ok(cells) => cells,
            Err((velocity, torque)) => {
                let difference =
                    format!("it has {velocity} rad/s at {torque} N m, which most persons do not");
                return self.tell(Problem::OtherProtocol { subject: person.subject.clone(), difference });
            }
        };
        self.persons += 1;
        for (quantity, of_cells) in self.cells.iter_mut().enumerate() {
            for (cell, sample) in of_cells.iter_mut().enumerate() {
                if let Some(mean) = cells.mean(quantity, cell) {
                    sample.add(mean);
                }
            }
            if let Some(all) = cells.all(quantity) {
                self.complete[quantity].add(&all);
            }
        }
        self.tell_missing(&person.subject, &cells);
        if self.sessions > 1 {
            self.add_sessions(person);
        }
    }

    /// One message a person: of the quantity that lacks most.
    fn tell_missing(&mut self, subject: &str, cells: &Cells) {
        let of = self.layout.conditions.len();
        let missing = |quantity: usize| (0..of).filter(move |cell| cells.mean(quantity, *cell).is_none());
        let quantities = (0..QUANTITIES.len()).rev().filter(|quantity| self.measured[*quantity]);
        let Some(worst) = quantities.max_by_key(|quantity| missing(*quantity).count()) else { return };
        if let Some(first) = missing(worst).next() {
            let (velocity, torque) = self.layout.conditions[first];
            self.tell(Problem::Missing {
                subject: subject.to_owned(),
                quantity: QUANTITIES[worst],
                missing: missing(worst).count(),
                of,
                first: format!("{velocity} rad/s at {torque} N m"),
            });
        }
    }

    fn add_sessions(&mut self, person: &PersonRows) {
        let of_session = |session: u32| {
            let rows = person.rows.iter().filter(move |row| row.session == session);
            Cells::of(rows, &self.layout.conditions).ok()
        };
        let sessions: Option<Vec<Cells>> = (1..=self.sessions).map(of_session).collect();
        let Some(sessions) = sessions else { return };
        for (quantity, moments) in self.by_session.iter_mut().enumerate() {
            let mean =
                |cells: &Cells| cells.all(quantity).map(|all| all.iter().sum::<f64>() / all.len() as f64);
            if let Some(means) = sessions.iter().map(mean).collect::<Option<Vec<f64>>>() {
                moments.add(&means);
            }
        }
    }
}
