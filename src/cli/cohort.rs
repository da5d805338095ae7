//! `ramphold cohort`: a study of many subjects.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::app::{
    Console, Failure, ResultsFolder, check_out, draw_seed, new_folder, parse_seed, write_study_report,
};
use crate::files::{self, limits};
use crate::fit::QUANTITIES;
use crate::study::{
    RESULTS_FILE, ResultTables, SessionStorage, Study, StudyFolder, StudyPart, StudySummary, effect_name,
    tables_from_csv,
};
use rayon::prelude::*;

use super::verb::Verb;

/// Run or read the sessions of many subjects, fit them all, and write the tables and the report of the study.
///
/// STUDY is a study file (`ramphold schema study` prints its schema), or the study.csv of an earlier study, whose tables
/// are then computed again. The study's folder receives study.csv (one row per subject and condition), study.json, the tables of the
/// repeated-measures analysis, and report.html.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold cohort protocols/de-vlugt-2011-study.json --seed 1 --out eight\n  \
                        ramphold cohort protocols/de-vlugt-2011-study.json --seed 1 --out eight --resume\n  \
                        ramphold cohort eight/study.csv --out again"
)]
pub struct CohortArgs {
    /// The study file, or a study.csv.
    study: PathBuf,
    /// Seed of all random draws [default: drawn and printed].
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// The study's folder, which must not exist yet [default: a new folder under sessions/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue in the folder of the same study; parts that are complete are not computed again.
    #[arg(long, requires = "out")]
    resume: bool,
    /// Compute this part only, counted from 0, and write no tables: for one worker of a cluster. Implies --resume.
    #[arg(long, value_name = "K", requires = "out", requires = "seed")]
    part: Option<u64>,
    /// Write the folder and its plan.json, which holds the number of parts, and compute nothing. Implies --resume.
    #[arg(long, requires = "out", requires = "seed", conflicts_with = "part")]
    plan: bool,
    /// Keep the folder of each virtual session, under sessions/ in the study's folder.
    #[arg(long)]
    keep: bool,
    /// Print study.json instead of a table.
    #[arg(long)]
    json: bool,
}

impl Verb for CohortArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        if let Some(out) = &self.out {
            check_out("--out", out)?;
        }
        if self.study.extension().is_some_and(|extension| extension == "csv") {
            return self.only_tables(console);
        }
        let begun = || self.out.as_deref().filter(|_| self.resume).and_then(StudyFolder::seed);
        let seed = self.seed.or_else(begun).unwrap_or_else(draw_seed);
        let study = Study::open(&self.study, seed)?;
        let path = self.folder(&format!("{}-{seed}", self.stem()));
        let folder = StudyFolder::open(&path, &study, self.resume || self.plan || self.part.is_some())?;
        if self.plan {
            return Ok(());
        }
        if let Some(number) = self.part {
            return self.one_part(console, &study, &folder, number);
        }
        console.message(format_args!(
            "study {}, seed {seed}, {} sessions in {}",
            study.name,
            study.units(),
            path.display()
        ));
        self.do_parts(console, &study, &folder)?;
        let (summary, tables) = folder.write_tables(&study)?;
        self.show(console, &path, &summary, &tables)
    }
}

impl CohortArgs {
    fn stem(&self) -> String {
        self.study.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| new_folder(&Path::new("sessions").join(name)))
    }

    fn only_tables(&self, console: &Console) -> Result<(), Failure> {
        let path = self.folder(&format!("{}-tables", self.stem()));
        let (summary, tables) = tables_from_csv(&self.study, &path)?;
        self.show(console, &path, &summary, &tables)
    }

    /// Computes the parts that are not complete yet, on all cores.
    fn do_parts(&self, console: &Console, study: &Study, folder: &StudyFolder) -> Result<(), Failure> {
        let pending_parts = folder.pending_parts(study);
        let units: u64 =
            pending_parts.iter().map(|part| study.units_of(part.number)).map(|r| r.end - r.start).sum();
        if units < study.units() {
            console.message(format_args!("{} sessions were done before", study.units() - units));
        }
        let progress = console.progress(units, "sessions");
        let sessions = folder.path().join("sessions");
        let done = pending_parts
            .par_iter()
            .try_for_each(|part| part.run(study, self.storage(&sessions)?, || progress.inc(1)));
        progress.finish_and_clear();
        Ok(done?)
    }

    fn storage<'a>(&self, sessions: &'a Path) -> Result<SessionStorage<'a>, crate::study::StudyError> {
        if !self.keep {
            return Ok(SessionStorage::Memory);
        }
        files::make_folders(sessions).map_err(crate::study::StudyError::at(sessions))?;
        Ok(SessionStorage::Folder(sessions))
    }

    fn one_part(
        &self,
        console: &Console,
        study: &Study,
        folder: &StudyFolder,
        number: u64,
    ) -> Result<(), Failure> {
        if number >= study.parts() {
            return Err(Failure::Usage(format!(
                "--part {number}: expected 0 to {}, the last part of this study",
                study.parts().saturating_sub(1)
            )));
        }
        let part = StudyPart::of(folder.path(), number);
        let was_done = part.is_done(study);
        if !was_done {
            let sessions = folder.path().join("sessions");
            part.run(study, self.storage(&sessions)?, || ())?;
        }
        let contents = part.read(study).map_err(crate::study::StudyError::from)?;
        let units = study.units_of(number);
        let told = serde_json::json!({
            "part": number, "units": units.end - units.start, "failed": contents.failed.len(),
            "sha256": contents.sha256, "was_done": was_done,
        });
        writeln!(console.results(), "{told}")?;
        Ok(())
    }

    fn show(
        &self,
        console: &Console,
        folder: &Path,
        summary: &StudySummary,
        tables: &ResultTables,
    ) -> Result<(), Failure> {
        write_study_report(folder, &ResultsFolder::Given(folder.to_owned()).open()?)?;
        if self.json {
            let file = folder.join(RESULTS_FILE);
            let text = files::read_text(&file, limits::STUDY_BYTES)
                .map_err(|source| Failure::Read { file: file.display().to_string(), source })?;
            write!(console.results(), "{text}")?;
        } else {
            table(console, summary, tables)?;
        }
        for issue in &summary.issues {
            console.error(issue);
        }
        let told = summary.issues.len() as u64;
        if summary.issue_count > told {
            console.error(format_args!("and {} more like these", summary.issue_count - told));
        }
        console.message(format_args!("{}", folder.display()));
        match summary.issue_count {
            0 => Ok(()),
            problems => Err(Failure::PartOfStudy { problems, folder: folder.to_owned() }),
        }
    }
}

/// Prints F and p of every effect on every quantity.
fn table(console: &Console, summary: &StudySummary, tables: &ResultTables) -> Result<(), Failure> {
    let mut out = console.results();
    let (velocities, torques) = (summary.grid.velocities_rad_s.len(), summary.grid.torques_nm.len());
    writeln!(out, "{} subjects, {velocities} velocities x {torques} torques", summary.subjects)?;
    writeln!(
        out,
        "{:<22} {:<19} {:>9} {:>12} {:>9} {:>9} {:>9}",
        "", "", "F", "df", "p", "p (GG)", "part eta2"
    )?;
    for (name, effects) in QUANTITIES.iter().zip(&tables.effects) {
        for effect in effects {
            writeln!(
                out,
                "{name:<22} {:<19} {:>9.2} {:>12} {:>9} {:>9} {:>9.3}",
                effect_name(effect),
                effect.f,
                format!("{}, {}", effect.df[0], effect.df[1]),
                p_value(effect.p),
                p_value(effect.p_gg),
                effect.partial_eta_squared,
            )?;
        }
    }
    Ok(())
}

fn p_value(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { format!("{p:.3}") }
}
