//! `ramphold import`: a session from a foreign recording.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::app::{Console, Failure, ask_for_mapping, check_out, new_folder};
use crate::consistency;
use crate::files::{self, Folder};
use crate::import::{ImportedSession, Mapping, SourceTable, import, read_source};
use crate::json_file;

use super::verb::Verb;

/// Make a session of a foreign recording: a folder of CSV files, a .mat, Parquet, EDF, XDF or C3D file, or one long record.
///
/// A mapping says which column is what, in which unit and with which sign. Without --mapping it is asked for at the terminal, and kept
/// in the session's import.json. Onsets are found, speeds and torques are grouped into conditions. The session's import.svg shows the
/// first trials: look at it before anything is fitted. No file of the source is changed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold import recordings/ --mapping mapping.json --dry-run\n  \
                        ramphold import recordings/ --mapping mapping.json --out sessions/S01\n  \
                        ramphold schema import > import.schema.json")]
pub struct ImportArgs {
    /// The recording: a folder, or a .csv, .txt, .tsv, .mat, .parquet, .edf, .bdf, .xdf or .c3d file.
    source: PathBuf,
    /// The mapping [default: it is asked for].
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Folder of the session, which must not exist [default: a new folder in sessions/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print what would be written, and write nothing.
    #[arg(long)]
    dry_run: bool,
    /// Write the mapping that was asked for to this file, which must not exist.
    #[arg(long, value_name = "FILE", conflicts_with = "mapping")]
    save_mapping: Option<PathBuf>,
}

impl Verb for ImportArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        for (option, path) in [("--out", &self.out), ("--save-mapping", &self.save_mapping)] {
            // One that is there is refused as such.
            if let Some(path) = path.as_ref().filter(|path| !files::exists(path)) {
                check_out(option, path)?;
            }
        }
        // The mapping is checked before a large recording is read.
        let given = self.mapping.as_deref().map(Mapping::read).transpose()?;
        let tables = read_source(&self.source)?;
        let mapping = match given {
            Some(mapping) => mapping,
            None => self.asked(&tables)?,
        };
        let imported = import(tables, &mapping)?;
        show(console, &imported)?;
        if self.dry_run {
            console.message("dry run: nothing was written");
            return Ok(());
        }
        let folder =
            self.out.clone().unwrap_or_else(|| new_folder(&Path::new("sessions").join(&mapping.subject)));
        imported.write(&mapping, &folder)?;
        let shown = folder.display();
        console.message(format_args!("look at {shown}/import.svg, then: ramphold fit {shown}"));
        writeln!(console.results(), "{shown}")?;
        Ok(())
    }
}

impl ImportArgs {
    fn asked(&self, tables: &[SourceTable]) -> Result<Mapping, Failure> {
        let Some(first) = tables.first() else {
            return Err(Failure::Usage(format!("{}: has no table", self.source.display())));
        };
        let Some(mapping) = ask_for_mapping(first)? else {
            return Err(Failure::Usage(format!(
                "--mapping is required where nobody can be asked; {} has the columns {}. ramphold schema import describes the file",
                first.name,
                first.names()
            )));
        };
        if let Some(file) = &self.save_mapping {
            if files::exists(file) {
                return Err(Failure::Usage(format!(
                    "{}: exists already and is not overwritten",
                    file.display()
                )));
            }
            let text = json_file::pretty(&mapping);
            let written = Folder::open(file.parent().unwrap_or(Path::new("")))
                .and_then(|folder| folder.write(file.file_name().unwrap_or_default(), text.as_bytes()));
            written.map_err(|source| Failure::ResultsFolder { path: file.clone(), source })?;
        }
        Ok(mapping)
    }
}

/// Prints the trials that were found, and what they contradict.
fn show(console: &Console, imported: &ImportedSession) -> Result<(), Failure> {
    let mut out = console.results();
    writeln!(out, "trial  rad/s   N m   rep  onset s  from")?;
    for (trial, source) in imported.session.trials.iter().zip(&imported.sources) {
        writeln!(
            out,
            "{:5}  {:5.2}  {:4.2}  {:3}  {:7.4}  {source}",
            trial.number,
            trial.velocity_rad_s,
            trial.torque_nm,
            trial.repetition,
            trial.onset_s.unwrap_or(f64::NAN)
        )?;
    }
    for left_out in &imported.left_out {
        console.announce(format_args!("left out: {left_out}"));
    }
    for contradiction in consistency::contradictions(&imported.session) {
        console.announce(format_args!("ramphold fit will refuse this: {contradiction}"));
    }
    Ok(())
}
