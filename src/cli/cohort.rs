//! `ramphold cohort`: many people, fitted and tabulated.

use std::io::Write;
use std::path::{Path, PathBuf};

use ramphold::fit::QUANTITIES;
use ramphold::study::{
    ResultTables, SessionStorage, Study, StudyFolder, StudyPart, StudySummary, effect_name, tables_from_csv,
};
use rayon::prelude::*;

use super::{Console, Failure, Verb};
use crate::app::{draw_seed, new_folder};

/// Run or read many people's sessions, fit them all, and make the study's tables.
///
/// STUDY is a study file (see protocols/study.schema.json), or the study.csv of an earlier one, whose tables are then made anew.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold cohort protocols/de-vlugt-2011-study.json --seed 1 --out eight\n  \
                        ramphold cohort protocols/de-vlugt-2011-study.json --seed 1 --out eight --resume\n  \
                        ramphold cohort eight/study.csv --out again"
)]
pub struct Cohort {
    /// The study file, or a study.csv.
    study: PathBuf,
    /// The seed of every random draw; drawn and printed if not given.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The study's folder, which must not be there yet; a new one under sessions/ if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on in the folder of the same study; what is done and whole is not done again.
    #[arg(long, requires = "out")]
    resume: bool,
    /// Do this part alone, from 0, and make no tables: for a worker of a cluster. Implies --resume.
    #[arg(long, value_name = "K", requires = "out", requires = "seed")]
    part: Option<u64>,
    /// Make the folder and its plan.json, which says how many parts there are, and do nothing. Implies --resume.
    #[arg(long, requires = "out", requires = "seed", conflicts_with = "part")]
    plan: bool,
    /// Keep the folder of every virtual session, under sessions/ in the study's folder.
    #[arg(long)]
    keep: bool,
    /// Print the result file instead of a table.
    #[arg(long)]
    json: bool,
}

impl Verb for Cohort {
    fn run(self, console: &Console) -> Result<(), Failure> {
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

impl Cohort {
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

    /// Does what is not done yet, as many sessions at once as there are cores.
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

    fn storage<'a>(&self, sessions: &'a Path) -> Result<SessionStorage<'a>, ramphold::study::StudyError> {
        if !self.keep {
            return Ok(SessionStorage::Memory);
        }
        std::fs::create_dir_all(sessions).map_err(ramphold::study::StudyError::at(sessions))?;
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
        let contents = part.read(study).map_err(ramphold::study::StudyError::from)?;
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
        if self.json {
            let file = folder.join("study.json");
            let text = std::fs::read_to_string(&file)
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

/// F and p of every effect on every quantity, for a person to read.
fn table(console: &Console, summary: &StudySummary, tables: &ResultTables) -> Result<(), Failure> {
    let mut out = console.results();
    let (velocities, torques) = (summary.grid.velocities_rad_s.len(), summary.grid.torques_nm.len());
    writeln!(out, "{} persons, {velocities} velocities x {torques} torques", summary.subjects)?;
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
