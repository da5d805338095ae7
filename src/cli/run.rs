//! `ramphold run`: runs a session of a protocol.

use std::path::{Path, PathBuf};

use crate::app::{
    Console, ConsoleOptions, Failure, NewSessionFolder, Pace, RequestedRig, RequestedSubject, SessionRequest,
    is_can_rig_file, parse_seed,
};
use crate::dataset::Wrist;
use crate::protocol::ValidProtocol;

use super::verb::Verb;

/// Run a session of a protocol and write its folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold run protocols/quick.json --seed 1\n  \
                        ramphold run protocols/de-vlugt-2011.json --subject S03 --out sessions/s03")]
pub struct RunArgs {
    /// The protocol file.
    protocol: PathBuf,
    /// Seed of all random numbers [default: a new seed, which is printed].
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// Subject: an identifier, or the JSON file of a virtual subject. A virtual subject is drawn from its identifier [default:
    /// the average virtual subject]. Required with a motor.
    #[arg(long, value_name = "FILE|ID")]
    subject: Option<String>,
    /// Folder of the session, which must not exist [default: a new folder in sessions/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Rig file [default: the virtual wrist].
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Run in real time [default: as fast as possible]. A motor always runs in real time.
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// Run at this multiple of real time; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// Model file whose mechanisms the virtual wrist gets, with the given values. The fit at the end uses the paper's model.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Hide an effect of the catalogue in the virtual wrist, drawn with this seed. The session's folder does not say which;
    /// `ramphold reveal` does, and checks the diagnosis.
    #[arg(long, value_name = "SEED", allow_negative_numbers = true, value_parser = parse_seed)]
    hide: Option<u64>,
    /// The file of the rig's measured constants, as `ramphold calibrate` writes it; it is copied into the session's folder, and the
    /// analyses of the session use it.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Confirm that a motor may be armed, instead of being asked. A virtual rig needs no confirmation.
    #[arg(long)]
    yes: bool,
    /// Who runs the session; kept in session.json.
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    /// The hand that is measured, left or right; kept in session.json.
    #[arg(long, value_name = "HAND", value_enum)]
    hand: Option<Hand>,
    /// A field of the subject that session.json keeps, such as age=31 or condition=fatigued. May be given several times.
    #[arg(long, value_name = "FIELD=VALUE", value_parser = subject_field)]
    about: Vec<(String, String)>,
    /// Publish the session over Lab Streaming Layer: its samples, and a marker for each transition. Needs a motor, or --real-time.
    #[arg(long)]
    lsl: bool,
    /// The file of liblsl, for --lsl and for the streams of the rig file [default: where the operating system finds it].
    #[arg(long, value_name = "FILE")]
    lsl_library: Option<PathBuf>,
    #[command(flatten)]
    console: ConsoleOptions,
}

/// The hand that is measured.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Hand {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
}

/// Reads `FIELD=VALUE`.
fn subject_field(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some(("id", _)) => Err("the identifier is given with --subject".to_owned()),
        Some((field, value)) if !field.trim().is_empty() => {
            Ok((field.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected FIELD=VALUE, such as age=31".to_owned()),
    }
}

impl Verb for RunArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        self.console.check()?;
        let pace = Pace::new(self.real_time, self.speed)?;
        let is_motor = self.rig.as_deref().is_some_and(is_can_rig_file);
        if self.lsl && !self.real_time && !is_motor {
            return Err(Failure::Usage(
                "--lsl: others see the session while it runs, so it must run in real time; add --real-time"
                    .to_owned(),
            ));
        }
        let needs_library = || -> Result<bool, Failure> {
            Ok(self.lsl || !RequestedRig::read(self.rig.as_deref(), &protocol)?.streams().is_empty())
        };
        if self.lsl_library.is_some() && !needs_library()? {
            return Err(Failure::Usage(
                "--lsl-library: nothing needs the library; expected --lsl, or a rig file with streams"
                    .to_owned(),
            ));
        }
        let stem = self.protocol.file_stem().unwrap_or_default().to_string_lossy();
        let folder = match &self.out {
            Some(folder) => NewSessionFolder::Here(folder.clone()),
            None => NewSessionFolder::In("sessions".into(), &stem),
        };
        SessionRequest {
            protocol: &protocol,
            rig: self.rig.as_deref(),
            subject: self.subject.as_deref().map(|given| {
                match given.ends_with(".json") || Path::new(given).is_file() {
                    true => RequestedSubject::File(given),
                    false => RequestedSubject::Identifier(given),
                }
            }),
            seed: self.seed,
            folder,
            pace,
            model: self.model.as_deref(),
            hide: self.hide,
            calibration: self.calibration.as_deref(),
            is_confirmed: self.yes,
            operator: self.operator.as_deref(),
            hand: self.hand.map(|hand| match hand {
                Hand::Left => Wrist::Left,
                Hand::Right => Wrist::Right,
            }),
            subject_fields: self.subject_fields()?,
            lsl: self.lsl,
            lsl_library: self.lsl_library.as_deref(),
            console: &self.console,
        }
        .run(console)
    }
}

impl RunArgs {
    /// The fields of the subject; a number is kept as a number.
    fn subject_fields(&self) -> Result<serde_json::Map<String, serde_json::Value>, Failure> {
        let value = |text: &str| match text.parse::<f64>() {
            Ok(number) if number.is_finite() => serde_json::from_str(text).unwrap_or_else(|_| text.into()),
            _ => text.into(),
        };
        let mut fields = serde_json::Map::new();
        for (field, text) in &self.about {
            if fields.insert(field.clone(), value(text)).is_some() {
                return Err(Failure::Usage(format!("--about gives {field} twice; give each field once")));
            }
        }
        Ok(fields)
    }
}
