//! `ramphold calibrate`: the constants of the rig from its rig trials, and whether today's agree with them.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{
    Console, Failure, calibrate_rig, check_out, compare_rig, lock_results, warn_of_calibration,
};
use crate::calibrate::{CalibrationOutcome, RigComparison, RigVerdict, named_load};
use crate::dataset::{Disk, Manifest, RIG_CALIBRATION, RigCalibration};
use crate::files;
use crate::json_file;
use crate::protocol::significant;

use super::verb::Verb;

/// Calibrate the rig: fit its constants to the rig trials of a session, or compare them with an earlier calibration.
///
/// The verb fits lever inertia, damping and stiffness, gain, offset, non-linearity, delay and low-pass of the torque, gain of the angle,
/// bandwidth of the servo and friction of the bearing to all rig trials together (rig-trials.csv). It says which of them these loads
/// cannot tell and which load would, whether the model of the rig describes the trials, and whether a stated load disagrees with the
/// others. It writes rig-calibration.json into the session's folder.
///
/// With --compare it writes nothing: the empty-handle trials of the session are compared with that calibration, and the quantity that
/// differs is named. Exit code 1 if one differs, if the trials differ and no single quantity explains it, or if they could not be compared.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold calibrate sessions/rig-2026-11\n  \
                        ramphold calibrate sessions/S01 --compare sessions/rig-2026-11/rig-calibration.json")]
pub struct CalibrateArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// File for the calibration [default: rig-calibration.json in the session's folder, which is replaced].
    #[arg(long, value_name = "FILE", conflicts_with = "compare")]
    out: Option<PathBuf>,
    /// Compare the session's empty-handle trials with this calibration.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
    /// Print JSON instead of the summary.
    #[arg(long)]
    json: bool,
}

impl Verb for CalibrateArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        if let Some(out) = &self.out {
            check_out("--out", out)?;
            if files::exists(out) {
                return Err(Failure::Usage(format!(
                    "{}: exists already and is not overwritten; give another --out",
                    out.display()
                )));
            }
        }
        let earlier = self.compare.as_deref().map(RigCalibration::read).transpose()?;
        if let (Some(file), Some(earlier)) = (&self.compare, &earlier) {
            warn_of_calibration(earlier, file, console);
        }
        match earlier {
            Some(earlier) => self.compare_with(&earlier, console),
            None => self.calibrate(console),
        }
    }
}

impl CalibrateArgs {
    fn calibrate(&self, console: &Console) -> Result<(), Failure> {
        let stages = console.stages();
        stages.set_message("fitting the rig's constants to its trials, from several starts");
        let outcome = calibrate_rig(&self.session);
        stages.finish_and_clear();
        let outcome = outcome?;
        match &self.out {
            Some(out) => outcome.calibration.write_as(&Disk::default(), out)?,
            None => {
                let _alone = lock_results(&self.session)?;
                outcome.calibration.write(&Disk::default(), &self.session)?;
                Manifest::renew_results(&Disk::default(), &self.session)?;
            }
        }
        let file = self.out.clone().unwrap_or_else(|| self.session.join(RIG_CALIBRATION));
        console.message(format_args!("written: {}", file.display()));
        warn_of_calibration(&outcome.calibration, &file, console);
        if self.json {
            write!(console.results(), "{}", json_file::pretty(&outcome.to_json()))?;
            return Ok(());
        }
        print_calibration(console, &outcome)
    }

    fn compare_with(&self, earlier: &RigCalibration, console: &Console) -> Result<(), Failure> {
        let comparison = compare_rig(&self.session, earlier)?;
        if self.json {
            write!(console.results(), "{}", json_file::pretty(&comparison.to_json()))?;
        } else {
            print_comparison(console, earlier, &comparison)?;
        }
        let session = self.session.clone();
        match comparison.verdict() {
            RigVerdict::Agrees => Ok(()),
            RigVerdict::Differs(changed) => {
                let names: Vec<&str> = changed.iter().map(|name| name.name()).collect();
                Err(Failure::RigChanged { session, quantities: names.join(" or ") })
            }
            RigVerdict::DiffersUnexplained => {
                Err(Failure::RigDiffers { session, p_value: comparison.p_value })
            }
            RigVerdict::NotComparable(reason) => Err(Failure::RigNotCompared { session, reason }),
        }
    }
}

fn print_calibration(console: &Console, outcome: &CalibrationOutcome) -> Result<(), Failure> {
    let mut out = console.results();
    let number = |value: Option<f64>| value.map_or("-".to_owned(), significant);
    writeln!(out, "{:28} {:>12} {:>12} {:>12}", "quantity", "value", "se", "stated")?;
    for own in &outcome.calibration.quantities {
        let stated = number(own.stated);
        writeln!(
            out,
            "{:28} {:>12} {:>12} {stated:>12}",
            own.name.name(),
            number(own.value),
            number(own.se)
        )?;
        if let Some(reason) = &own.reason {
            writeln!(out, "  {reason}")?;
        }
    }
    writeln!(out, "\nresidual by load, beside what noise and encoder make (1: as expected)")?;
    for own in &outcome.misfit.loads {
        let side = match own.load.sign() {
            Some(sign) if sign < 0 => ", other side",
            _ => "",
        };
        let name = format!("{}{side}", named_load(own.load));
        writeln!(out, "{name:44} {:3} trials {:>6.2}  p = {:.3}", own.trials, own.ratio, own.p_value)?;
    }
    writeln!(
        out,
        "misfit of the model of the rig beside the scatter of repetitions: p = {:.3}; of the servo: p = {:.3}",
        outcome.misfit.p_value, outcome.misfit.servo_p_value
    )?;
    for own in &outcome.loads {
        let name = named_load(own.load);
        match own.difference {
            Some(difference) => writeln!(
                out,
                "{name}: by the other loads {:+.1} % from its stated value (standard error {:.1} %), p = {:.3}",
                100.0 * difference,
                100.0 * own.se,
                own.p_value
            )?,
            None => {
                let wrong = own.by_rig.map_or(f64::NAN, |rig| rig.probability);
                writeln!(
                    out,
                    "{name}: the other loads do not tell its value; by the rig as stated it is wrong with probability {wrong:.3}"
                )?;
            }
        }
    }
    for warning in &outcome.calibration.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(())
}

fn print_comparison(
    console: &Console,
    earlier: &RigCalibration,
    comparison: &RigComparison,
) -> Result<(), Failure> {
    let mut out = console.results();
    writeln!(
        out,
        "{} trials with the empty handle beside the calibration of {} ({}): p = {:.3}",
        comparison.trials,
        earlier.session,
        earlier.measured_utc.as_deref().or(earlier.made_utc.as_deref()).unwrap_or("date not known"),
        comparison.p_value
    )?;
    writeln!(
        out,
        "{:28} {:>12} {:>12} {:>12} {:>9}",
        "quantity, if it alone differs", "calibrated", "difference", "se", "p"
    )?;
    for own in &comparison.quantities {
        let [calibrated, difference, se] = [own.calibrated, own.difference, own.se].map(significant);
        writeln!(
            out,
            "{:28} {calibrated:>12} {difference:>12} {se:>12} {:>9.4}",
            own.name.name(),
            own.p_value
        )?;
    }
    if comparison.verdict() == RigVerdict::Agrees {
        writeln!(out, "no quantity differs from the calibration")?;
    }
    Ok(())
}
