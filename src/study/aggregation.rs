//! Assembling `study.csv` from the parts, and its summary over subjects, with one subject in memory at a time.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io::{BufWriter, Write};
use std::path::Path;

use super::condition_grid::ConditionGrid;
use super::error::{StudyError, StudyIssue};
use super::part::{StudyPart, header};
use super::plan::Study;
use super::table_reader::{CellMeans, StudyRow, StudyTableReader, SubjectRows, TABLE_FILE};
use crate::files::Folder;
use crate::fit::QUANTITIES;
use crate::statistics::{MeanCovariance, MeanVariance};

/// Largest number of issues that are listed one by one; all are counted.
const LISTED_ISSUES: usize = 100;

/// Largest number of subjects whose own means are kept: as many curves as a figure can show.
const KEPT_INDIVIDUALS: u64 = 60;

/// Means of a subject in the cells of the design.
#[derive(Debug, Clone, PartialEq)]
pub struct SubjectMeans {
    /// The subject's identifier.
    pub subject: String,
    /// The means.
    pub cells: CellMeans,
}

/// Summary of all subjects, from which the tables are computed.
#[derive(Debug, Clone)]
pub struct StudySummary {
    /// The conditions of the study.
    pub grid: ConditionGrid,
    /// By quantity: whether any subject has a value of it.
    pub measured: [bool; QUANTITIES.len()],
    /// Number of subjects with usable rows.
    pub subjects: u64,
    /// Largest number of sessions of a subject.
    pub sessions: u32,
    /// Subject and number of the sessions that are in study.csv and in no other table, sorted.
    pub excluded: Vec<(String, u32)>,
    /// By quantity: means and covariance over the subjects who have all cells.
    pub complete: Vec<MeanCovariance>,
    /// By quantity and cell: mean and variance over the subjects who have a value there.
    pub cells: Vec<Vec<MeanVariance>>,
    /// By quantity: means and covariance of the session means, over the subjects who have all cells in all sessions.
    pub by_session: Vec<MeanCovariance>,
    /// Means of single subjects: of all, or of some that are spread evenly over the table.
    pub individuals: Vec<SubjectMeans>,
    /// Issues that keep subjects out of tables; at most the first hundred.
    pub issues: Vec<StudyIssue>,
    /// Number of all issues.
    pub issue_count: u64,
}

/// Writes `study.csv` in `folder` from the parts there. Returns the sessions that failed.
pub fn assemble_table(study: &Study, folder: &Path) -> Result<Vec<StudyIssue>, StudyError> {
    let path = folder.join(TABLE_FILE);
    let mut failed = Vec::new();
    let mut file = Folder::open(folder)
        .and_then(|folder| folder.begin_file(TABLE_FILE))
        .map_err(StudyError::at(&path))?;
    let mut out = BufWriter::new(file.file());
    let mut put = |text: &str| out.write_all(text.as_bytes()).map_err(StudyError::at(&path));
    put(&header())?;
    for number in 0..study.parts() {
        let contents = StudyPart::of(folder, number).read(study)?;
        put(&contents.rows)?;
        failed.extend(contents.failed.into_iter().take(LISTED_ISSUES.saturating_sub(failed.len())));
    }
    out.flush().map_err(StudyError::at(&path))?;
    drop(out);
    file.finish().map_err(StudyError::at(&path))?;
    Ok(failed)
}

/// Where a table comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableOrigin {
    /// Written by this program: the rows of a subject follow each other.
    ThisProgram,
    /// Written or edited elsewhere: the rows of a subject may be in several places.
    External,
}

/// Summarises a table, reading it twice: for its conditions, then for its values. `earlier` are sessions that are left out beside those
/// that the table itself excludes; `issues` are those known already.
pub fn summarise(
    table: &Path,
    origin: TableOrigin,
    earlier: &[(String, u32)],
    issues: Vec<StudyIssue>,
) -> Result<StudySummary, StudyError> {
    let is_left_out = |subject: &str, row: &StudyRow| {
        row.is_excluded || earlier.iter().any(|(own, session)| own == subject && *session == row.session)
    };
    let keep_included = |subject_rows: &mut SubjectRows| {
        let subject = subject_rows.subject.clone();
        subject_rows.rows.retain(|row| !is_left_out(&subject, row));
        !subject_rows.rows.is_empty()
    };
    let mut excluded = BTreeSet::new();
    let mut designs: BTreeMap<Vec<(u64, u64)>, u64> = BTreeMap::new();
    let mut sessions = 0;
    let mut measured = [false; QUANTITIES.len()];
    let (mut independent, mut has_session_fits) = (Vec::new(), false);
    for subject in StudyTableReader::open(table)? {
        let mut subject = subject?;
        let left_out = subject.rows.iter().filter(|row| is_left_out(&subject.subject, row));
        excluded.extend(left_out.map(|row| (subject.subject.clone(), row.session)));
        if !keep_included(&mut subject) {
            continue;
        }
        let bits = |row: &StudyRow| (row.condition.0.to_bits(), row.condition.1.to_bits());
        let mut own: Vec<_> = subject.rows.iter().map(bits).collect();
        own.sort_unstable();
        own.dedup();
        sessions = subject.rows.iter().map(|row| row.session).max().unwrap_or(1).max(sessions);
        *designs.entry(own).or_default() += 1;
        for row in &subject.rows {
            let own = (subject.subject.clone(), row.session);
            if !row.is_independent {
                has_session_fits = true;
            } else if independent.last() != Some(&own) {
                independent.push(own);
            }
        }
        for (quantity, measured) in measured.iter_mut().enumerate() {
            *measured |= subject.rows.iter().any(|row| row.values[quantity].is_some());
        }
    }
    // The set of conditions that most subjects have; of equally frequent sets the largest.
    let subjects: u64 = designs.values().sum();
    let commonest = designs.into_iter().max_by_key(|(conditions, subjects)| (*subjects, conditions.len()));
    let conditions = commonest.map_or(Vec::new(), |(conditions, _)| conditions);
    let grid = ConditionGrid::of(conditions.into_iter().map(|(v, t)| (f64::from_bits(v), f64::from_bits(t))));
    let mut summary = StudySummary::new(grid, sessions, issues, measured);
    summary.excluded = excluded.into_iter().collect();
    if origin == TableOrigin::External {
        for (subject, session) in summary.excluded.clone() {
            summary.report(StudyIssue::ExcludedInTable { subject, session });
        }
    }
    let stride = subjects.div_ceil(KEPT_INDIVIDUALS).max(1);
    // Values of both fits do not belong in one table.
    let left_out: HashSet<(String, u32)> =
        if has_session_fits { independent.into_iter().collect() } else { HashSet::new() };
    let mut sorted: Vec<_> = left_out.iter().cloned().collect();
    sorted.sort();
    for (subject, session) in sorted {
        summary.report(StudyIssue::NoSessionModel { subject, session });
    }
    let mut seen = HashSet::new();
    for subject in StudyTableReader::open(table)? {
        let mut subject = subject?;
        if !keep_included(&mut subject) {
            continue;
        }
        if origin == TableOrigin::External && !seen.insert(subject.subject.clone()) {
            let place = format!("{}, line {}", table.display(), subject.line);
            summary.report(StudyIssue::DuplicateSubject { subject: subject.subject, place });
            continue;
        }
        let name = subject.subject.clone();
        subject.rows.retain(|row| !left_out.contains(&(name.clone(), row.session)));
        if subject.rows.is_empty() {
            continue;
        }
        summary.add(&subject, stride);
    }
    let subjects = summary.complete.iter().map(MeanCovariance::count).max().unwrap_or(0);
    if subjects < 2 {
        summary.report(StudyIssue::TooFewSubjects { subjects });
    }
    Ok(summary)
}

impl StudySummary {
    fn new(
        grid: ConditionGrid,
        sessions: u32,
        issues: Vec<StudyIssue>,
        measured: [bool; QUANTITIES.len()],
    ) -> Self {
        let cells = grid.conditions.len();
        Self {
            complete: vec![MeanCovariance::new(cells); QUANTITIES.len()],
            cells: vec![vec![MeanVariance::default(); cells]; QUANTITIES.len()],
            by_session: vec![MeanCovariance::new(sessions as usize); QUANTITIES.len()],
            grid,
            measured,
            subjects: 0,
            sessions,
            excluded: Vec::new(),
            individuals: Vec::new(),
            issue_count: issues.len() as u64,
            issues,
        }
    }

    fn report(&mut self, issue: StudyIssue) {
        self.issue_count += 1;
        if self.issues.len() < LISTED_ISSUES {
            self.issues.push(issue);
        }
    }

    /// Adds a subject; the means of each `stride`-th are kept.
    fn add(&mut self, subject: &SubjectRows, stride: u64) {
        let cells = match CellMeans::of(subject.rows.iter(), &self.grid.conditions) {
            Ok(cells) => cells,
            Err((velocity, torque)) => {
                let difference =
                    format!("it has {velocity} rad/s at {torque} N m, which most subjects do not have");
                let subject = subject.subject.clone();
                return self.report(StudyIssue::OtherProtocol { subject, difference });
            }
        };
        if self.subjects.is_multiple_of(stride) {
            self.individuals.push(SubjectMeans { subject: subject.subject.clone(), cells: cells.clone() });
        }
        self.subjects += 1;
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
        self.report_missing(&subject.subject, &cells);
        if self.sessions > 1 {
            self.add_sessions(subject);
        }
    }

    /// Reports missing conditions once per subject: for the quantity with most of them.
    fn report_missing(&mut self, subject: &str, cells: &CellMeans) {
        let of = self.grid.conditions.len();
        let missing = |quantity: usize| (0..of).filter(move |cell| cells.mean(quantity, *cell).is_none());
        let quantities = (0..QUANTITIES.len()).rev().filter(|quantity| self.measured[*quantity]);
        let Some(worst) = quantities.max_by_key(|quantity| missing(*quantity).count()) else { return };
        if let Some(first) = missing(worst).next() {
            let (velocity, torque) = self.grid.conditions[first];
            self.report(StudyIssue::MissingConditions {
                subject: subject.to_owned(),
                quantity: QUANTITIES[worst],
                missing: missing(worst).count(),
                of,
                first: format!("{velocity} rad/s at {torque} N m"),
            });
        }
    }

    fn add_sessions(&mut self, subject: &SubjectRows) {
        let of_session = |session: u32| {
            let rows = subject.rows.iter().filter(move |row| row.session == session);
            CellMeans::of(rows, &self.grid.conditions).ok()
        };
        let sessions: Option<Vec<CellMeans>> = (1..=self.sessions).map(of_session).collect();
        let Some(sessions) = sessions else { return };
        for (quantity, moments) in self.by_session.iter_mut().enumerate() {
            let mean =
                |cells: &CellMeans| cells.all(quantity).map(|all| all.iter().sum::<f64>() / all.len() as f64);
            if let Some(means) = sessions.iter().map(mean).collect::<Option<Vec<f64>>>() {
                moments.add(&means);
            }
        }
    }
}
