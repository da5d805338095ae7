//! How often a fit is wrong, and how often its 95 % intervals hold the truth: fits sessions whose truth is known, and counts.
//!
//! ```text
//! cargo run --release --example coverage -- DIR                            sessions of another program: `DIR/session-*` and
//!                                                                          `DIR/truth/session-*.json`, as `hidden_effects` writes them
//! cargo run --release --example coverage -- --own LAB SEED SESSIONS        sessions of the virtual wrist
//! cargo run --release --example coverage -- --own LAB SEED SESSIONS --calibration known|ignored
//!                                                                          on rigs that differ from their calibration as its covariance
//!                                                                          says; the standard errors contain that, or ignore it
//! ```
//!
//! Prints one line of JSON: the counts of each kind of fit. `scripts/coverage` makes the page of it.

mod calibrated_rig;
mod counts;
mod sessions;

use std::error::Error;
use std::path::Path;

use rayon::prelude::*;
use serde_json::json;

use calibrated_rig::RigErrors;
use counts::{count, worst};
use sessions::{Fitted, fit_folder, fit_own_wrist};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (words, errors) = match words.as_slice() {
        [words @ .., "--calibration", "known"] => (words, Some(RigErrors::Known)),
        [words @ .., "--calibration", "ignored"] => (words, Some(RigErrors::Ignored)),
        words => (words, None),
    };
    let fitted: Vec<[Fitted; 2]> = match words {
        ["--own", laboratory, seed, sessions] => {
            let (seed, sessions): (u64, u64) = (seed.parse()?, sessions.parse()?);
            (seed..seed + sessions)
                .into_par_iter()
                .filter_map(|seed| {
                    let fitted = fit_own_wrist(laboratory, seed, errors).transpose()?;
                    Some(fitted.map_err(|error| format!("seed {seed}: {error}")))
                })
                .collect::<Result<_, _>>()?
        }
        [folder] => {
            let folder = Path::new(folder);
            let mut sessions: Vec<_> = std::fs::read_dir(folder)?
                .map(|entry| entry.map(|own| own.path()))
                .collect::<Result<_, _>>()?;
            sessions.retain(|path| path.join("session.json").exists());
            sessions.sort();
            sessions
                .par_iter()
                .map(|session| {
                    fit_folder(folder, session).map_err(|error| format!("{}: {error}", session.display()))
                })
                .collect::<Result<_, _>>()?
        }
        _ => return Err("which folder, or --own LABORATORY SEED SESSIONS?".into()),
    };
    let (independent, session): (Vec<Fitted>, Vec<Fitted>) = fitted.into_iter().map(|[a, b]| (a, b)).unzip();
    let fits = json!([count("independent", &independent), count("session", &session)]);
    println!("{}", json!({ "fits": fits, "worst": worst(&independent, &session) }));
    Ok(())
}
