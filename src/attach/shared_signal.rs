//! The ramps of a session in a recording, by a signal that both have.

use std::ops::Range;

use super::aligned_ramps::AlignedRamps;
use super::correlation::{PiecewiseRecording, Sampled};
use super::error::AttachError;
use super::event_match::{EventCandidate, MatchProblem, match_events};
use super::pieces::{Places, RecordingPart, WHOLE};
use super::ramp_places::{RampPlaces, matched, onsets_s, resolution_s};
use super::request::AttachRequest;
use super::shared_hold;
use super::timed_table::TimedTable;
use crate::dataset::{RampTime, Record, Session};

/// Probability with which a column that shares the ramps alone is taken for one that shares the signal.
const FALSE_SIGNAL: f64 = 1e-3;

/// The most places of a trial by a shared signal: as many as a session has trials of one condition, and more.
const MOST_PLACES: usize = 200;

/// Exactness of the places of a trial before they are refined, s: two steps of the rate at which they are sought first.
const GRAIN_S: f64 = 0.01;

/// Trials by a signal that the recording shares with them.
pub fn by_signal(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    table: &TimedTable,
    column: &str,
    shared: &str,
) -> Result<AlignedRamps, AttachError> {
    if ramps.is_empty() {
        let reason = "ramps of one condition look alike, and a session without a journal has no times to tell them apart by; use a \
                      trigger or markers";
        return Err(request.not_aligned(reason.to_owned()));
    }
    let of_record: fn(&Record) -> Option<&Vec<f64>> = match shared {
        "theta_m_rad" => |record| Some(&record.theta_m_rad),
        "torque_l_nm" => |record| Some(&record.torque_l_nm),
        "emg_fcr_mvc" => |record| record.emg_fcr_mvc.as_ref(),
        "emg_ecr_mvc" => |record| record.emg_ecr_mvc.as_ref(),
        other => {
            let found = format!("--shared {other}");
            let expected = "theta_m_rad, torque_l_nm, emg_fcr_mvc or emg_ecr_mvc";
            return Err(request.unexpected(found, expected));
        }
    };
    let values = table.finite_column(column)?;
    let trial_of = |ramp: &RampTime| {
        let trial = session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
        let onset_s = trial.onset_s?;
        let values = of_record(&trial.record)?;
        // Time 0 is the onset.
        let start_s = trial.record.start_s - onset_s;
        Some(Sampled { start_s, rate_hz: session.sample_rate_hz, values })
    };
    let (ramps, trials): (Vec<RampTime>, Vec<Sampled>) =
        ramps.iter().filter_map(|ramp| Some((*ramp, trial_of(ramp)?))).unzip();
    if trials.is_empty() {
        return Err(request.not_aligned(format!("no trial of the session has {shared} and an onset")));
    }
    let whole = part_of(table, values, &WHOLE);
    let search = SharedSignal { request, ramps: &ramps, trials, table, values, whole, column, shared };
    let by = format!("correlation of {column} with {shared}");
    matched(request, &ramps, &search, resolution_s(session, table), by)
}

/// A part of a recording, in which trials are sought.
fn part_of<'a>(table: &TimedTable, values: &'a [f64], part: &RecordingPart) -> PiecewiseRecording<'a> {
    let samples = table.samples_within(part);
    let is_within = |gap: &&usize| samples.start <= **gap && **gap + 1 < samples.end;
    let gaps: Vec<usize> = table.gaps.iter().filter(is_within).map(|gap| gap - samples.start).collect();
    PiecewiseRecording::new(&table.times_s[samples.clone()], &values[samples], table.rate_hz, &gaps)
}

/// A signal of the trials in a column of the recording.
struct SharedSignal<'a> {
    request: &'a AttachRequest,
    ramps: &'a [RampTime],
    /// The signal of each ramp.
    trials: Vec<Sampled<'a>>,
    table: &'a TimedTable<'a>,
    values: &'a [f64],
    whole: PiecewiseRecording<'a>,
    column: &'a str,
    shared: &'a str,
}

impl RampPlaces for SharedSignal<'_> {
    fn find(&self, ramps: Range<usize>, part: &RecordingPart) -> Result<Places, MatchProblem> {
        let mut searched = part_of(self.table, self.values, part);
        // Trials of one condition look alike: each may fit at the places of the others.
        let most = self.trials.len().min(MOST_PLACES);
        let trials = &self.trials[ramps.clone()];
        let places: Vec<Vec<EventCandidate>> =
            trials.iter().map(|trial| searched.places(*trial, most)).collect();
        let length_s = self.table.length_within_s(part);
        let expected_s = onsets_s(&self.ramps[ramps]);
        let mut found = match_events(&expected_s, |at| places[at].as_slice(), GRAIN_S, length_s)?;
        for (place, trial) in found.iter_mut().zip(trials) {
            *place = place.map(|own| self.whole.refined(*trial, own));
        }
        Ok(found)
    }

    /// By what the holds before the ramps have in common.
    fn judge(&self, first: usize, places: &[Option<EventCandidate>]) -> Result<Option<f64>, AttachError> {
        let placed: Vec<(Sampled, f64)> = self.trials[first..]
            .iter()
            .zip(places)
            .filter_map(|(trial, place)| Some((*trial, (*place)?.time_s)))
            .collect();
        let chance = shared_hold::chance(&self.whole, &placed);
        if chance <= FALSE_SIGNAL {
            return Ok(Some(chance));
        }
        let Self { request, column, shared, .. } = self;
        Err(request.not_aligned(format!(
            "column {column:?} moves with the ramps, but in the holds before them it has nothing in common with {shared}: of random \
             assignments of its {} holds to the trials, a share of {chance:.2} fits as well, and of the same signal at most {FALSE_SIGNAL} \
             would. Name the column of {shared}; if this is it, its noise hides the hold, or there are too few trials: use a trigger or \
             markers",
            placed.len()
        )))
    }
}
