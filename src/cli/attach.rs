//! `ramphold attach`: a recording of another device beside the trials of a session.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure};
use crate::attach::{AttachRequest, ClockSource, Reference, align};

use super::verb::Verb;

/// Attach a recording of another device, such as an EMG amplifier, to a session.
///
/// The ramps of the session are found in the recording by a trigger, by markers, or by a signal that both have. The recording is cut
/// into the trials and written to SESSION/attached/NAME, beside a copy of its file. No sample is changed or resampled: each has its
/// own time on the axis of its trial. How well the clocks agree is printed and kept in attachment.json.
///
/// Read are .csv, .txt, .tsv, .mat, .parquet, .edf, .bdf, .xdf and .c3d files. EDF, BDF, XDF and C3D have times of their own; the
/// others need --time or --rate. Of C3D, the analog channels are read.
#[derive(Debug, clap::Args)]
#[command(
    group(clap::ArgGroup::new("reference").required(true).args(["trigger", "marker", "signal"])),
    after_help = "Examples:\n  ramphold attach sessions/S01 emg.bdf --trigger TRIG --emg-fcr EMG1 --emg-ecr EMG2\n  \
                  ramphold attach sessions/S01 emg.xdf --marker onset --table EMG\n  \
                  ramphold attach sessions/S01 motion.c3d --trigger Sync --emg-fcr FCR\n  \
                  ramphold attach sessions/S01 torque.csv --time t --signal torque --shared torque_l_nm"
)]
pub struct AttachArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// The recording.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Column with a pulse at the beginning of each ramp.
    #[arg(long, value_name = "COLUMN")]
    trigger: Option<String>,
    /// Level that the pulses of the trigger cross [default: the middle of its two levels].
    #[arg(long, value_name = "LEVEL", requires = "trigger", allow_negative_numbers = true)]
    threshold: Option<f64>,
    /// The pulses of the trigger begin downwards.
    #[arg(long, requires = "trigger")]
    falling: bool,
    /// Text of the markers at the beginning of each ramp; the number of the trial may follow it.
    #[arg(long, value_name = "TEXT")]
    marker: Option<String>,
    /// Column with a signal that the session has too.
    #[arg(long, value_name = "COLUMN", requires = "shared")]
    signal: Option<String>,
    /// Which signal of the session that is: theta_m_rad, torque_l_nm, emg_fcr_mvc or emg_ecr_mvc.
    #[arg(long, value_name = "COLUMN", requires = "signal")]
    shared: Option<String>,
    /// Column of time, s.
    #[arg(long, value_name = "COLUMN", conflicts_with = "rate")]
    time: Option<String>,
    /// Samples a second, where there is no column of time.
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Part of the name of the table or stream to attach, where the file has several.
    #[arg(long, value_name = "NAME")]
    table: Option<String>,
    /// Column with the EMG of the flexor carpi radialis.
    #[arg(long, value_name = "COLUMN")]
    emg_fcr: Option<String>,
    /// Column with the EMG of the extensor carpi radialis.
    #[arg(long, value_name = "COLUMN")]
    emg_ecr: Option<String>,
    /// Mean rectified EMG of the flexor at maximal effort, in the unit of its column; the report then shows the EMG.
    #[arg(long, value_name = "VALUE", requires = "emg_fcr")]
    fcr_at_mvc: Option<f64>,
    /// Mean rectified EMG of the extensor at maximal effort, in the unit of its column.
    #[arg(long, value_name = "VALUE", requires = "emg_ecr")]
    ecr_at_mvc: Option<f64>,
    /// Name of the attachment [default: that of the file].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Print how the recording would be aligned, and write nothing.
    #[arg(long)]
    dry_run: bool,
}

impl Verb for AttachArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let dry_run = self.dry_run;
        let aligned = align(&self.request()?)?;
        let attachment = &aligned.attachment;
        let clock = &attachment.clock;
        let mut out = console.results();
        writeln!(out, "aligned by {}: {} trials", attachment.aligned_by, attachment.trials.len())?;
        writeln!(out, "samples a second: {:.4}", clock.rate_hz)?;
        let ms =
            |value_s: Option<f64>| value_s.map_or("not known".to_owned(), |s| format!("{:.3} ms", s * 1e3));
        match clock.drift_ppm {
            Some(drift_ppm) => writeln!(
                out,
                "drift against the session's clock: {drift_ppm:.1} ppm; residual: {} rms, {} at most",
                ms(clock.residual_rms_s),
                ms(clock.residual_largest_s)
            )?,
            None => {
                writeln!(out, "drift and residual: not known, for the session has no times of its ramps")?
            }
        }
        if let Some(lowest) = clock.lowest_correlation {
            writeln!(out, "lowest correlation of a trial: {lowest:.4}")?;
        }
        if let Some(chance) = clock.hold_chance {
            writeln!(out, "chance that the holds are alike though the column is another: {chance:.1e}")?;
        }
        for step in &attachment.clock_steps {
            console.announce(step);
        }
        if let Some(gaps) = &attachment.gaps {
            console.announce(gaps);
        }
        for frozen in &attachment.frozen_emg {
            console.announce(frozen);
        }
        for warning in &attachment.emg_warnings {
            console.announce(warning);
        }
        for left in &attachment.left_out {
            console.announce(format_args!("trial {} left out: {}", left.trial, left.because));
        }
        if dry_run {
            console.message("dry run: nothing was written");
            return Ok(());
        }
        aligned.write()?;
        writeln!(out, "{}", aligned.folder().display())?;
        Ok(())
    }
}

impl AttachArgs {
    fn request(self) -> Result<AttachRequest, Failure> {
        let clock = match (self.time, self.rate) {
            (Some(column), _) => ClockSource::Column(column),
            (None, Some(rate_hz)) if rate_hz > 0.0 && rate_hz.is_finite() => ClockSource::Rate(rate_hz),
            (None, Some(rate_hz)) => {
                return Err(Failure::Usage(format!("--rate {rate_hz}: expected a number above 0")));
            }
            (None, None) => ClockSource::Format,
        };
        for (option, value) in [("--fcr-at-mvc", self.fcr_at_mvc), ("--ecr-at-mvc", self.ecr_at_mvc)] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(Failure::Usage(format!("{option} {value}: expected a number above 0")));
            }
        }
        if let Some(level) = self.threshold.filter(|level| !level.is_finite()) {
            return Err(Failure::Usage(format!(
                "--threshold {level}: expected a number, in the unit of the trigger's column"
            )));
        }
        let reference = match (self.trigger, self.marker, self.signal, self.shared) {
            (Some(column), ..) => {
                Reference::Trigger { column, threshold: self.threshold, falling: self.falling }
            }
            (None, Some(text), ..) => Reference::Marker(text),
            (None, None, Some(column), Some(shared)) => Reference::Signal { column, shared },
            _ => {
                return Err(Failure::Usage("expected --trigger, --marker, or --signal with --shared".into()));
            }
        };
        Ok(AttachRequest {
            session: self.session,
            file: self.file,
            clock,
            reference,
            table: self.table,
            emg: [self.emg_fcr, self.emg_ecr],
            emg_at_mvc: [self.fcr_at_mvc, self.ecr_at_mvc],
            name: self.name,
        })
    }
}
