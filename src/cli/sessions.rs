//! `ramphold sessions`: the sessions of a laboratory, and how far each is.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, SessionSummary};
use crate::dataset::{is_session, session_folders};
use crate::files::Folder;
use crate::json_file;

use super::verb::Verb;

/// List sessions with date, subject, trials and state.
///
/// The state is unfinished (ramphold resume goes on with it), measured, fitted, diagnosed, or doubtful: its files cannot be read, its
/// signals contradict its table, its results are of other data, or its fit describes none of its trials. The reasons are among the messages, and in --json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold sessions\n  ramphold sessions study/sessions --json")]
pub struct SessionsArgs {
    /// Session folders, or folders of session folders.
    #[arg(value_name = "DIR", default_value = "sessions")]
    folders: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Verb for SessionsArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        for folder in &self.folders {
            Folder::open(folder).map_err(|error| {
                let folder = folder.display();
                Failure::Usage(format!(
                    "{folder}: {error}; expected a session's folder, or a folder of sessions"
                ))
            })?;
        }
        let mut folders = session_folders(&self.folders)?;
        folders.retain(|folder| {
            let is_one = Folder::open(folder).is_ok_and(|folder| is_session(&folder));
            if !is_one {
                console.message(format_args!("{}: no session in it", folder.display()));
            }
            is_one
        });
        folders.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
        let sessions: Vec<SessionSummary> = folders.iter().map(|folder| SessionSummary::of(folder)).collect();
        let mut out = console.results();
        if self.json {
            write!(out, "{}", json_file::pretty(&sessions))?;
            return Ok(());
        }
        let width = |of: &dyn Fn(&SessionSummary) -> usize, least: usize| {
            sessions.iter().map(of).max().unwrap_or(0).max(least)
        };
        let name = |own: &SessionSummary| own.session.display().to_string();
        let subject = |own: &SessionSummary| own.subject.clone().unwrap_or_else(|| "-".to_owned());
        let (wide, subjects) =
            (width(&|own| name(own).chars().count(), 7), width(&|own| subject(own).chars().count(), 7));
        writeln!(
            out,
            "{:wide$}  {:20}  {:subjects$}  {:>9}  state",
            "session", "began (UTC)", "subject", "trials ok"
        )?;
        for own in &sessions {
            let started = own.started_utc.as_deref().unwrap_or("-");
            let trials = format!("{}/{}", own.trials_ok, own.trials);
            let (name, subject) = (name(own), subject(own));
            writeln!(
                out,
                "{name:wide$}  {started:20}  {subject:subjects$}  {trials:>9}  {}",
                own.state.name()
            )?;
            for reason in &own.reasons {
                console.message(format_args!("{name}: {reason}"));
            }
        }
        Ok(())
    }
}
