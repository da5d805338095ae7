//! How often the input checks refuse sound sessions, and which mistakes they find when each is made in these sessions.
//!
//!     cargo run --release --example input_checks -- FOLDER...
//!
//! Prints every session that is refused as it is, then for each mistake in how many of the sessions it was refused.

mod mistakes;

use std::path::PathBuf;

use mistakes::MISTAKES;
use ramphold::consistency::contradictions;
use ramphold::dataset::{self, Session};
use rayon::prelude::*;

fn main() {
    let folders: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let sessions: Vec<(PathBuf, Session)> = folders
        .into_par_iter()
        .filter_map(|folder| Some((folder.clone(), dataset::load(&folder).ok()?)))
        .collect();
    let refused: Vec<&Session> = sessions
        .iter()
        .filter(|(folder, session)| {
            let found = contradictions(session);
            for one in &found {
                println!("{}: {one}", folder.display());
            }
            !found.is_empty()
        })
        .map(|(_, session)| session)
        .collect();
    println!("{} of {} sound sessions refused", refused.len(), sessions.len());
    for mistake in MISTAKES {
        let made: Vec<bool> = sessions
            .par_iter()
            .filter_map(|(_, session)| {
                let mut spoilt = session.clone();
                (mistake.make)(&mut spoilt).then(|| !contradictions(&spoilt).is_empty())
            })
            .collect();
        println!(
            "{}: {} of {} refused",
            mistake.name,
            made.iter().filter(|found| **found).count(),
            made.len()
        );
    }
}
