//! `ramphold fit`: the wrist's parameters from measured sessions.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::app::{
    AnalysedSession, AnalysisRequest, Console, Failure, FittedSession, ResultsFolder, announce_unfinished,
    check_has_none, check_none_left_out, check_out, fit_table, folder_of_fit, folders_in, lock_results,
    parse_seed, read_model, write_report,
};
use crate::consistency::SignalCheck;
use crate::dataset::{Disk, Manifest, Session, session_folders};
use crate::fit::{self, Model, Results, Weighting};
use crate::json_file;
use rayon::prelude::*;

use super::verb::Verb;

/// Fit the wrist model to sessions; write fit.csv, conditions.csv, fit.json and the report.
///
/// A session with a velocity and a torque per condition gives one set of parameters per condition (I_j, b_h, k_h, k_srs,
/// k_dec, x_e) with standard errors, and the mean over repetitions. A table is printed. All trials of a session are fitted
/// together: their parameters vary around a regression on velocity and torque. The fit of each trial on its own, the method of the
/// paper, is always written beside it, as fit-independent.csv and conditions-independent.csv.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold fit sessions/S01\n  ramphold fit ankle-0 --window 0.180 --out results\n  \
                        ramphold fit sessions"
)]
pub struct FitArgs {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
    /// Analysed time after the onset of the ramp, s [default: that of the session's protocol, else 0.040].
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    /// A model file: the mechanisms, and how each parameter is shared between trials [default: the model of the paper].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The file of the rig's measured constants, as `ramphold calibrate` writes it; `none` uses what the session states [default:
    /// rig-calibration.json in the session's folder, if there is one].
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Weight every sample equally, as the paper does, instead of by the noise measured in the holds.
    #[arg(long)]
    plain: bool,
    /// Each trial on its own, as in the paper, without the model of the session.
    #[arg(long)]
    independent: bool,
    /// Parametric bootstrap of the fit of each trial on its own: refit N sessions simulated from the fit, and write the scatter of the estimates to fit.json.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    bootstrap: Option<u32>,
    /// Seed of the bootstrap.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed, default_value_t = 1, requires = "bootstrap")]
    seed: u64,
    /// Analyse although a check of the signals against the table fails; the results keep it. Names, separated by commas:
    /// ramp-speed, ramp-direction, onset, steady-torque, resistance, angle-range, emg, emg-frozen, held-samples, spike,
    /// clipped, lever, repeated-record.
    #[arg(long, value_name = "CHECKS", value_delimiter = ',')]
    accept: Vec<SignalCheck>,
    /// Folder for the results; earlier results there are not overwritten [default: results/ in the session's folder, or a named
    /// folder in it if results/ holds a fit or a diagnosis of other settings].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print fit.json instead of a table.
    #[arg(long)]
    json: bool,
}

/// Files of results, of a fit or of a diagnosis, beside which a fit is not written.
const FIT_RESULTS: [&str; 9] = [
    "fit.json",
    "fit.csv",
    "conditions.csv",
    "fit-independent.csv",
    "conditions-independent.csv",
    "diagnosis.json",
    "model.json",
    "report.html",
    "figures",
];

impl Verb for FitArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let model = read_model(self.model.as_deref())?;
        let sessions = session_folders(&self.sessions)?;
        let folders = self.result_folders(&sessions)?;
        if let ([session], [folder]) = (sessions.as_slice(), folders.as_slice()) {
            let (read, fitted) = self.fit(session, &model, console)?;
            self.write(session, read, folder.as_ref(), &fitted.results, console)?;
            self.show(console, &fitted.results)?;
            return check_none_left_out(session, &fitted.observations);
        }
        self.fit_many(console, &sessions, &folders, &model)
    }
}

impl FitArgs {
    /// The session in the folder `session`, fitted.
    fn fit(
        &self,
        session: &Path,
        model: &Model,
        console: &Console,
    ) -> Result<(Session, FittedSession), Failure> {
        let asked = AnalysisRequest {
            window_s: self.window,
            calibration: self.calibration.clone(),
            accept: self.accept.clone(),
        };
        let weighting = if self.plain { Weighting::Plain } else { Weighting::MeasuredNoise };
        announce_unfinished(session, console);
        let session = AnalysedSession::read(session, &asked, console)?;
        let mut fitted = session.fit(model, weighting, self.independent)?;
        if let Some(refits) = self.bootstrap {
            let refits = refits as usize;
            let scatter = fit::bootstrap(&fitted.observations, &fitted.independent, refits, self.seed);
            fitted.results.add_bootstrap(refits, self.seed, &scatter);
        }
        Ok((session.checked.session, fitted))
    }

    /// The results folder of each session in `--out`, where nothing is replaced; none without `--out`: the fit then decides.
    fn result_folders(&self, sessions: &[PathBuf]) -> Result<Vec<Option<ResultsFolder>>, Failure> {
        let Some(out) = &self.out else { return Ok(vec![None; sessions.len()]) };
        check_out("--out", out)?;
        let folders = folders_in(out, sessions)?;
        folders.iter().try_for_each(|folder| check_has_none("--out", folder, &FIT_RESULTS))?;
        Ok(folders.into_iter().map(|folder| Some(ResultsFolder::Given(folder))).collect())
    }

    /// Fits many sessions on all cores. An error in one session is printed, and the others are still fitted.
    fn fit_many(
        &self,
        console: &Console,
        sessions: &[PathBuf],
        folders: &[Option<ResultsFolder>],
        model: &Model,
    ) -> Result<(), Failure> {
        let progress = console.progress(sessions.len() as u64, "fitting");
        let partly = AtomicUsize::new(0);
        let tell = |failure: Failure| progress.suspend(|| console.error(&failure));
        let fitted: Vec<Option<serde_json::Value>> = (sessions, folders)
            .into_par_iter()
            .map(|(session, folder)| {
                let done = self.fit(session, model, &console.silent()).and_then(|(read, fitted)| {
                    self.write(session, read, folder.as_ref(), &fitted.results, &console.silent())?;
                    Ok(fitted)
                });
                progress.inc(1);
                let fitted = done.map_err(tell).ok()?;
                if let Err(failure) = check_none_left_out(session, &fitted.observations) {
                    partly.fetch_add(1, Ordering::Relaxed);
                    tell(failure);
                }
                Some(fitted.results.json)
            })
            .collect();
        progress.finish_and_clear();
        let partly = partly.into_inner();
        let failed = fitted.iter().filter(|result| result.is_none()).count();
        if self.json {
            let fitted: Vec<_> = fitted.into_iter().flatten().collect();
            write!(console.results(), "{}", json_file::pretty(&fitted))?;
        } else {
            writeln!(console.results(), "fitted {} of {} sessions", sessions.len() - failed, sessions.len())?;
        }
        if failed + partly == 0 {
            return Ok(());
        }
        Err(Failure::Some { failed, partly, of: sessions.len() })
    }

    /// Writes results and report of the session that was `read`, and updates its manifest. Without `folder`, the session's results are
    /// replaced only by those of the same settings.
    fn write(
        &self,
        session: &Path,
        read: Session,
        folder: Option<&ResultsFolder>,
        results: &Results,
        console: &Console,
    ) -> Result<(), Failure> {
        let _alone = if folder.is_none() { Some(lock_results(session)?) } else { None };
        let folder = match folder {
            Some(folder) => folder.clone(),
            None => folder_of_fit(session, &results.json)?,
        };
        if matches!(folder, ResultsFolder::Named { .. }) {
            console.announce(format_args!(
                "results/ holds results of other settings, which are kept; this fit is in {}",
                folder.path().display()
            ));
        }
        let folder = folder.open()?;
        results.write(&Disk::default(), &folder)?;
        write_report(session, read, &folder, console)?;
        if self.out.is_none() {
            Manifest::renew_results(&Disk::default(), session)?;
        }
        Ok(())
    }

    fn show(&self, console: &Console, results: &Results) -> Result<(), Failure> {
        if self.json {
            write!(console.results(), "{}", json_file::pretty(&results.json))?;
        } else {
            fit_table(console, results)?;
        }
        Ok(())
    }
}
