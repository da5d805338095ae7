//! The end of a session: trial counts, fit, report and manifest.

use std::path::Path;

use crate::dataset::{Disk, Manifest, Resumable, Session};
use crate::fit::{Model, Results, Weighting};
use crate::session::{Machine, Phase, Status};

use super::{
    AnalysedSession, AnalysisRequest, Console, Failure, ResultsFolder, attach_streams, fit_table,
    lock_results, ran_on_can_motor, write_report,
};

/// A session that has just been run, and its results, as nothing was asked for.
fn fit_as_run(folder: &Path, console: &Console) -> Result<(Session, Results), Failure> {
    let session = AnalysedSession::read(folder, &AnalysisRequest::default(), console)?;
    let results = session.fit(&Model::default(), Weighting::default(), false)?.results;
    Ok((session.checked.session, results))
}

/// Prints how many trials have which status; fits the session if every trial is done, and writes results, report and
/// manifest.
///
/// # Errors
/// If the session ended before its last trial, or the results cannot be made.
pub fn finish_session(
    machine: &Machine,
    was_finished: bool,
    folder: &Path,
    console: &Console,
) -> Result<(), Failure> {
    let count = |wanted: Status| {
        let measured = machine.progress().attempts().iter().filter(|attempt| !attempt.planned.key.practice);
        measured.filter(|attempt| matches!(attempt.ended, Some((status, _)) if status == wanted)).count()
    };
    console.message(format_args!(
        "{} trials ok, {} rejected, {} aborted; {}",
        count(Status::Ok),
        count(Status::Rejected),
        count(Status::Aborted),
        folder.display()
    ));
    // Locks the session until the results are written.
    let _lock = Resumable::open(folder, Disk::default())?;
    let disk = Disk::default();
    let is_virtual = !ran_on_can_motor(folder)?;
    if let Err(failure) = attach_streams(folder, console) {
        console.announce(format_args!("the recorded streams were not cut into the trials: {failure}"));
    }
    if !was_finished && machine.phase() != Phase::Finished {
        Manifest::take(folder, is_virtual)?.write(&disk, folder)?;
        return Err(Failure::Ended { folder: folder.to_owned(), left: machine.progress().queue().len() });
    }
    let fitted = fit_as_run(folder, console);
    if fitted.is_err() {
        // What was measured is complete, whatever the analysis says of it.
        Manifest::take(folder, is_virtual)?.write(&disk, folder)?;
    }
    let (session, results) = fitted?;
    let _alone = lock_results(folder)?;
    let own = ResultsFolder::OfSession(folder.to_owned()).open()?;
    results.write(&disk, &own)?;
    write_report(folder, session, &own, console)?;
    // The manifest comes last: a session without it is not complete.
    Manifest::take(folder, is_virtual)?.write(&disk, folder)?;
    fit_table(console, &results)
}
