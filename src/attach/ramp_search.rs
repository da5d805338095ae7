//! The ramps of a session in a recording: at its trigger, at its markers, or by a signal that both have.

use std::ops::Range;

use super::aligned_ramps::{AlignedRamp, AlignedRamps};
use super::error::AttachError;
use super::event_match::{CLOCK_TOLERANCE, EventCandidate, MatchProblem, match_events};
use super::pieces::{Places, RecordingPart};
use super::ramp_places::{RampPlaces, matched, onsets_s, resolution_s};
use super::request::{AttachRequest, Reference};
use super::shared_signal::by_signal;
use super::timed_table::{TimedTable, edges_in};
use crate::dataset::{RampTime, Session, SessionClock, Trial};
use crate::import::Recording;

/// Longest delay of a marker that a program sends: two periods of a screen of 60 Hz, s.
const MARKER_GRAIN_S: f64 = 2.0 / 60.0;

/// Finds the ramps of a session in a recording, by what both have in common.
pub fn find_ramps(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    recording: &Recording,
    table: &TimedTable,
) -> Result<AlignedRamps, AttachError> {
    match &request.reference {
        Reference::Trigger { column, threshold, falling } => {
            let edges = edges_in(request, recording, column, *threshold, *falling)?;
            let found = at_events(request, session, ramps, &edges.times_s, table)?;
            // The ends of pulses are at the intervals of the ramps as well.
            edges
                .rest_on_other_side
                .map_or(Ok(found), |rest| Err(ends_of_pulses(request, column, rest, *falling)))
        }
        Reference::Marker(text) => at_markers(request, session, ramps, recording, text, table),
        Reference::SessionClock => Ok(on_session_clock(session, &SessionClock::default(), ramps, table)),
        Reference::Signal { column, shared } => by_signal(request, session, ramps, table, column, shared),
    }
}

fn ends_of_pulses(request: &AttachRequest, column: &str, rest: f64, falling: bool) -> AttachError {
    let (begin, option) = if falling { ("upwards", "without") } else { ("downwards", "with") };
    request.not_aligned(format!(
        "column {column:?} is at {rest} most of the time, so its pulses begin {begin}, and their ends would be taken for the ramps; align \
         {option} --falling, or turn the column's sign if the long level is the pulse"
    ))
}

/// Trials where the clock of the session has them, which the recording has too.
pub fn on_session_clock(
    session: &Session,
    clock: &SessionClock,
    ramps: &[RampTime],
    table: &TimedTable,
) -> AlignedRamps {
    let mut found = AlignedRamps { by: "clock of the session".to_owned(), ..AlignedRamps::default() };
    let mut pairs = Vec::new();
    for ramp in ramps {
        let known = ramp.trial.zip(clock.lsl_s(ramp.stretch, ramp.onset_s));
        let Some((trial, onset_s)) = known else { continue };
        found.trials.push(AlignedRamp { trial, onset_s, residual_s: None });
        pairs.push((ramp.stretch, ramp.onset_s, onset_s));
    }
    found.compare_clocks(pairs, resolution_s(session, table));
    found
}

/// Trials at events, of which the session has one at each ramp.
fn at_events(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    times_s: &[f64],
    table: &TimedTable,
) -> Result<AlignedRamps, AttachError> {
    let by = match &request.reference {
        Reference::Trigger { column, .. } => format!("trigger, column {column}"),
        Reference::Marker(text) => format!("marker {text:?}"),
        Reference::Signal { .. } | Reference::SessionClock => String::new(),
    };
    if ramps.is_empty() {
        return in_order(request, session, times_s, by);
    }
    let most = 10 * ramps.len() + 100;
    if times_s.len() > most {
        return Err(request.not_aligned(format!(
                "{} pulses for {} ramps; set --threshold between the two levels of the trigger, or name another column",
                times_s.len(),
                ramps.len()
            ),
        ));
    }
    let candidates = times_s.iter().map(|time_s| EventCandidate { time_s: *time_s, weight: 1.0 }).collect();
    let search = Events { ramps, candidates, table };
    matched(request, ramps, &search, resolution_s(session, table), by)
}

/// Trials of a session whose times nobody knows: as many events as ramps, in order.
fn in_order(
    request: &AttachRequest,
    session: &Session,
    times_s: &[f64],
    by: String,
) -> Result<AlignedRamps, AttachError> {
    let trials: Vec<&Trial> = session.trials.iter().filter(|trial| trial.onset_s.is_some()).collect();
    if trials.len() != times_s.len() {
        return Err(request.not_aligned(format!(
                "{} events for {} trials with an onset; a session without a journal has no times to tell them apart by, so there must be \
                 one for each: set --threshold, or cut the recording",
                times_s.len(),
                trials.len()
            ),
        ));
    }
    let found = trials.iter().zip(times_s);
    let trials =
        found.map(|(trial, time_s)| AlignedRamp { trial: trial.number, onset_s: *time_s, residual_s: None });
    Ok(AlignedRamps { by, trials: trials.collect(), ..AlignedRamps::default() })
}

/// Trials at markers: those with a number are of that trial, the others are matched by their times.
fn at_markers(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    recording: &Recording,
    text: &str,
    table: &TimedTable,
) -> Result<AlignedRamps, AttachError> {
    let numbered: Vec<(u32, f64)> = recording
        .markers
        .iter()
        .filter_map(|marker| Some((marker.text.strip_prefix(text)?.trim().parse().ok()?, marker.time_s)))
        .collect();
    if numbered.is_empty() {
        let mut times_s: Vec<f64> = recording
            .markers
            .iter()
            .filter(|marker| marker.text.trim() == text)
            .map(|marker| marker.time_s)
            .collect();
        times_s.sort_by(f64::total_cmp);
        if times_s.is_empty() {
            let mut texts: Vec<&str> = recording.markers.iter().map(|marker| marker.text.as_str()).collect();
            texts.sort_unstable();
            texts.dedup();
            texts.truncate(10);
            return Err(request.not_aligned(format!(
                "no marker {text:?}; its markers are {texts:?}: name one with --marker"
            )));
        }
        return at_events(request, session, ramps, &times_s, table);
    }
    let mut found =
        AlignedRamps { by: format!("marker {text:?} with the trial's number"), ..AlignedRamps::default() };
    for trial in &session.trials {
        let own: Vec<f64> = numbered
            .iter()
            .filter(|(number, _)| *number == trial.number)
            .map(|(_, time_s)| *time_s)
            .collect();
        match own.as_slice() {
            [] => {}
            [time_s] => {
                found.trials.push(AlignedRamp { trial: trial.number, onset_s: *time_s, residual_s: None });
            }
            several => {
                let reason = format!("{} markers of trial {}; expected one", several.len(), trial.number);
                return Err(request.not_aligned(reason));
            }
        }
    }
    if found.trials.is_empty() {
        let reason = format!("its markers {text:?} are of none of the session's trials");
        return Err(request.not_aligned(reason));
    }
    let pairs: Vec<(usize, f64, f64)> = found
        .trials
        .iter()
        .map(|own| {
            let ramp = ramps.iter().find(|ramp| ramp.trial == Some(own.trial));
            ramp.map_or((usize::MAX, 0.0, own.onset_s), |ramp| (ramp.stretch, ramp.onset_s, own.onset_s))
        })
        .collect();
    if let Some((trial, off_s)) = farthest_off(&found.trials, &pairs) {
        return Err(request.not_aligned(format!(
            "its marker of trial {trial} is {off_s:+.3} s off the times of the session: is it the recording of this session, and do its \
             markers count the trials as the session does?"
        )));
    }
    found.compare_clocks(pairs, resolution_s(session, table));
    Ok(found)
}

/// The trial whose marker is farthest from where the others of its stretch have it, and by how much, if that is farther than clocks and
/// programs that send markers differ.
fn farthest_off(trials: &[AlignedRamp], pairs: &[(usize, f64, f64)]) -> Option<(u32, f64)> {
    let known: Vec<(u32, &(usize, f64, f64))> =
        trials.iter().map(|own| own.trial).zip(pairs).filter(|(_, pair)| pair.0 != usize::MAX).collect();
    let offs = known.iter().filter_map(|(trial, pair)| {
        let stretch = known.iter().map(|(_, other)| *other).filter(|other| other.0 == pair.0);
        // How much later than the trial another one is, on one clock less the other.
        let mut differences: Vec<(f64, f64)> = stretch
            .map(|other| ((other.2 - pair.2) - (other.1 - pair.1), (other.1 - pair.1).abs()))
            .collect();
        differences.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (median_s, interval_s) = differences[differences.len() / 2];
        (median_s.abs() > MARKER_GRAIN_S + CLOCK_TOLERANCE * interval_s).then_some((*trial, -median_s))
    });
    offs.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

/// Times of events, in order, of which the session has one at each ramp.
struct Events<'a> {
    ramps: &'a [RampTime],
    candidates: Vec<EventCandidate>,
    table: &'a TimedTable<'a>,
}

impl RampPlaces for Events<'_> {
    fn find(&self, ramps: Range<usize>, part: &RecordingPart) -> Result<Places, MatchProblem> {
        let before = |end_s: f64| self.candidates.partition_point(|own| own.time_s < end_s);
        let from = self.candidates.partition_point(|own| own.time_s <= part.start);
        let there = &self.candidates[from..before(part.end).max(from)];
        let grain_s = 2.0 / self.table.rate_hz;
        match_events(&onsets_s(&self.ramps[ramps]), |_| there, grain_s, self.table.length_within_s(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attach::request::ClockSource;
    use crate::import::SourceTable;
    use crate::random::Stream;

    const RATE_HZ: f64 = 2000.0;

    /// 36 ramps, 6 to 12 s apart.
    fn ramps() -> Vec<RampTime> {
        let mut stream = Stream::new(1, "ramps");
        let mut onset_s = 0.0;
        let mut ramp = |trial| {
            onset_s += 6.0 + 6.0 * stream.uniform();
            RampTime { stretch: 0, trial: Some(trial), onset_s }
        };
        (1..=36).map(&mut ramp).collect()
    }

    /// What is found by pulses of which those from trial `first` on are later by `step_s`.
    fn found_with_step(first: u32, step_s: f64) -> AlignedRamps {
        let ramps = ramps();
        let reference = Reference::Trigger { column: "TRIG".into(), threshold: None, falling: false };
        let request = AttachRequest {
            session: "S".into(),
            file: "emg.csv".into(),
            clock: ClockSource::Rate(RATE_HZ),
            reference,
            table: None,
            emg: [None, None],
            emg_at_mvc: [None, None],
            name: None,
        };
        let samples = (400.0 * RATE_HZ) as usize;
        let columns = vec![("TRIG".to_owned(), vec![0.0; samples])];
        let recording =
            Recording { tables: vec![SourceTable::new("emg.csv".into(), columns)], markers: Vec::new() };
        let table = TimedTable::new(&request, &recording).unwrap();
        let on_clock = |ramp: &RampTime| {
            let step_s = if ramp.trial >= Some(first) { step_s } else { 0.0 };
            // A sample of the recording.
            libm::ceil((5.0 + 1.00003 * ramp.onset_s + step_s) * RATE_HZ) / RATE_HZ
        };
        let candidates =
            ramps.iter().map(|ramp| EventCandidate { time_s: on_clock(ramp), weight: 1.0 }).collect();
        let search = Events { ramps: &ramps, candidates, table: &table };
        matched(&request, &ramps, &search, 1.0 / RATE_HZ, "trigger".into()).unwrap()
    }

    #[test]
    fn what_is_before_and_after_a_step_of_any_size_is_found_and_the_step_is_told() {
        for (first, step_s) in
            [(9, -0.01), (9, -0.05), (9, -0.2), (9, 2.5), (19, -0.2), (29, -0.35), (32, -1.0)]
        {
            let found = found_with_step(first, step_s);
            assert_eq!(found.trials.len(), 36, "step of {step_s} s before trial {first}");
            let [step] = found.clock_steps.as_slice() else {
                panic!("step of {step_s} s before trial {first}: {:?}", found.clock_steps)
            };
            assert_eq!((step.after_trial, step.before_trial), (first - 1, first));
            assert!((step.step_s - step_s).abs() < 1.5e-3, "{step:?}");
            assert!(found.clock.residual_largest_s.unwrap() < 1e-3, "{:?}", found.clock);
        }
    }

    #[test]
    fn a_piece_that_would_not_be_accepted_alone_is_not_accepted_beside_another() {
        for first in [2, 3] {
            let found = found_with_step(first, -0.2);
            let numbers: Vec<u32> = found.trials.iter().map(|own| own.trial).collect();
            assert_eq!(numbers, (first..=36).collect::<Vec<u32>>());
            assert!(found.why_not_found.contains("too few"));
        }
    }
}
