//! The ramps of a session at the places that a search gives, piece by piece.

use std::ops::Range;

use super::aligned_ramps::{AlignedRamp, AlignedRamps};
use super::error::AttachError;
use super::event_match::{EventCandidate, MatchProblem};
use super::pieces::{Places, RecordingPart, WHOLE, find_further_pieces};
use super::request::{AttachRequest, Reference};
use super::timed_table::TimedTable;
use crate::dataset::{RampTime, Session};

/// Why a trial is not among those that were found by the intervals of their ramps.
const NOT_AT_INTERVALS: &str = "its ramp was not found in the recording: it is not where the trials that were found have it, and the trials \
                                beside it that were not found are too few, or not alike enough, to be aligned by themselves";

/// What is sought in a recording for the ramps of a session.
pub trait RampPlaces {
    /// The places of a run of the ramps, all of one stretch, in a part of the recording.
    fn find(&self, ramps: Range<usize>, part: &RecordingPart) -> Result<Places, MatchProblem>;

    /// Judges `places` of the ramps from the number `first` on by more than their intervals: the chance of places that are no better, where
    /// there is such a judgement.
    fn judge(&self, _first: usize, _places: &[Option<EventCandidate>]) -> Result<Option<f64>, AttachError> {
        Ok(None)
    }
}

/// Finds the ramps of each stretch of the session, first at one place, then what a step of the clocks leaves of the stretch.
pub fn matched(
    request: &AttachRequest,
    ramps: &[RampTime],
    search: &impl RampPlaces,
    resolution_s: f64,
    by: String,
) -> Result<AlignedRamps, AttachError> {
    let mut places: Places = vec![None; ramps.len()];
    let mut problem = None;
    let stretches = stretches(ramps);
    for stretch in &stretches {
        match search.find(stretch.clone(), &WHOLE) {
            Ok(own) => places[stretch.clone()].copy_from_slice(&own),
            Err(own) => problem = problem.or(Some(own)),
        }
    }
    let is_of_trial = |(ramp, place): (&RampTime, &Option<EventCandidate>)| ramp.trial.and(*place).is_some();
    if !ramps.iter().zip(&places).any(is_of_trial) {
        return Err(none_found(request, ramps.len(), problem));
    }
    let mut chance = search.judge(0, &places)?;
    for stretch in stretches {
        find_further_pieces(&mut places, stretch, |run, part| {
            let found = search.find(run.clone(), part).ok()?;
            let own = search.judge(run.start, &found).ok()?;
            chance = own.into_iter().chain(chance).reduce(f64::max);
            Some(found)
        });
    }
    let mut found = AlignedRamps { by, why_not_found: NOT_AT_INTERVALS, ..AlignedRamps::default() };
    found.clock.hold_chance = chance;
    let mut pairs = Vec::new();
    for (ramp, place) in ramps.iter().zip(places) {
        let Some((own, trial)) = place.zip(ramp.trial) else { continue };
        if matches!(request.reference, Reference::Signal { .. }) {
            let lowest = found.clock.lowest_correlation.unwrap_or(1.0).min(own.weight);
            found.clock.lowest_correlation = Some(lowest);
        }
        found.trials.push(AlignedRamp { trial, onset_s: own.time_s, residual_s: None });
        pairs.push((ramp.stretch, ramp.onset_s, own.time_s));
    }
    found.compare_clocks(pairs, resolution_s);
    Ok(found)
}

/// The ramps of each stretch.
fn stretches(ramps: &[RampTime]) -> Vec<Range<usize>> {
    let mut first = 0;
    let chunks = ramps.chunk_by(|a, b| a.stretch == b.stretch);
    chunks
        .map(|stretch| {
            let own = first..first + stretch.len();
            first = own.end;
            own
        })
        .collect()
}

/// Why none of `ramps` was found.
fn none_found(request: &AttachRequest, ramps: usize, problem: Option<MatchProblem>) -> AttachError {
    let reason = match problem {
        Some(MatchProblem::Ambiguous { at_s: [a, b], found }) => format!(
            "{found} ramps of the session fit alike from {a:.3} s and from {b:.3} s of the recording on; cut the recording"
        ),
        Some(MatchProblem::TooFew { found }) => format!(
            "{found} of {ramps} ramps are at the intervals of the session, which may be chance: is it the recording of this session, and \
             is {} right?",
            found_in(request)
        ),
        None => "no ramp of a trial is in it".to_owned(),
    };
    request.not_aligned(reason)
}

fn found_in(request: &AttachRequest) -> &'static str {
    match request.reference {
        Reference::Trigger { .. } => "the column of the trigger, its threshold and its direction",
        Reference::Marker(_) => "the text of the markers",
        Reference::SessionClock => "its clock",
        Reference::Signal { .. } => "the column, its sign and the signal that it shares",
    }
}

/// Onsets of ramps on the session's clock, s.
pub fn onsets_s(ramps: &[RampTime]) -> Vec<f64> {
    ramps.iter().map(|ramp| ramp.onset_s).collect()
}

/// What the coarser of the two clocks resolves, s.
pub fn resolution_s(session: &Session, table: &TimedTable) -> f64 {
    (1.0 / table.rate_hz).max(1.0 / session.sample_rate_hz)
}
