//! The ramps of a session in a recording: at its trigger, at its markers, or by a signal that both have.

use super::attachment::{ClockComparison, StepBetweenTrials};
use super::clock_jump::{RampPair, clock_steps};
use super::correlation::{PiecewiseRecording, Sampled};
use super::error::AttachError;
use super::event_match::{CLOCK_TOLERANCE, EventCandidate, MatchProblem, match_events};
use super::request::{AttachRequest, Reference};
use super::shared_hold;
use super::timed_table::{TimedTable, edges_in};
use crate::dataset::{RampTime, Record, Session, SessionClock, Trial};
use crate::import::Recording;

/// Probability with which a column that shares the ramps alone is taken for one that shares the signal.
const FALSE_SIGNAL: f64 = 1e-3;

/// The most places of a trial by a shared signal: as many as a session has trials of one condition, and more.
const MOST_PLACES: usize = 200;

/// Longest delay of a marker that a program sends: two periods of a screen of 60 Hz, s.
const MARKER_GRAIN_S: f64 = 2.0 / 60.0;

/// A trial that was found.
#[derive(Debug, Clone, Copy)]
pub struct AlignedRamp {
    /// Number of the trial.
    pub trial: u32,
    /// When its ramp began, on the clock of the recording, s.
    pub onset_s: f64,
    /// How far that is off the straight line between the clocks, s.
    pub residual_s: Option<f64>,
}

/// What was found of all trials.
#[derive(Debug, Default)]
pub struct AlignedRamps {
    /// How they were found.
    pub by: String,
    /// The trials.
    pub trials: Vec<AlignedRamp>,
    /// How the clocks compare.
    pub clock: ClockComparison,
    /// Where the clocks step against each other.
    pub clock_steps: Vec<StepBetweenTrials>,
    /// Rate of the recording's clock over that of the session, where known.
    pub speed: Option<f64>,
}

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
    let candidates: Vec<EventCandidate> =
        times_s.iter().map(|time_s| EventCandidate { time_s: *time_s, weight: 1.0 }).collect();
    let grain_s = 2.0 / table.rate_hz;
    let times = (grain_s, table.length_s(), resolution_s(session, table));
    matched(request, ramps, |_| candidates.as_slice(), times, by, |_, own| own)
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

/// Trials by a signal that the recording shares with them.
fn by_signal(
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
    let mut searched = PiecewiseRecording::new(&table.times_s, values, table.rate_hz, &table.gaps);
    let trial_of = |ramp: &RampTime| {
        let trial = session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
        let onset_s = trial.onset_s?;
        let values = of_record(&trial.record)?;
        // Time 0 is the onset.
        let start_s = trial.record.start_s - onset_s;
        Some(Sampled { start_s, rate_hz: session.sample_rate_hz, values })
    };
    let known: Vec<(RampTime, Sampled)> =
        ramps.iter().filter_map(|ramp| Some((*ramp, trial_of(ramp)?))).collect();
    if known.is_empty() {
        return Err(request.not_aligned(format!("no trial of the session has {shared} and an onset")));
    }
    // Trials of one condition look alike: each may fit at the places of the others.
    let most = known.len().min(MOST_PLACES);
    let places: Vec<Vec<EventCandidate>> =
        known.iter().map(|(_, trial)| searched.places(*trial, most)).collect();
    let ramps: Vec<RampTime> = known.iter().map(|(ramp, _)| *ramp).collect();
    let by = format!("correlation of {column} with {shared}");
    let grain_s = 0.01;
    let length_s = table.length_s();
    let resolution_s = resolution_s(session, table);
    let mut found = matched(
        request,
        &ramps,
        |at| places[at].as_slice(),
        (grain_s, length_s, resolution_s),
        by,
        |at, own| searched.refined(known[at].1, own),
    )?;
    let onset_of = |ramp: &RampTime| found.trials.iter().find(|own| Some(own.trial) == ramp.trial);
    let placed: Vec<(Sampled, f64)> =
        known.iter().filter_map(|(ramp, trial)| Some((*trial, onset_of(ramp)?.onset_s))).collect();
    let chance = shared_hold::chance(&searched, &placed);
    if chance > FALSE_SIGNAL {
        return Err(request.not_aligned(format!(
            "column {column:?} moves with the ramps, but in the holds before them it has nothing in common with {shared}: of random \
             assignments of its {} holds to the trials, a share of {chance:.2} fits as well, and of the same signal at most {FALSE_SIGNAL} \
             would. Name the column of {shared}; if this is it, its noise hides the hold, or there are too few trials: use a trigger or \
             markers",
            placed.len()
        )));
    }
    found.clock.hold_chance = Some(chance);
    Ok(found)
}

/// What the coarser of the two clocks resolves, s.
fn resolution_s(session: &Session, table: &TimedTable) -> f64 {
    (1.0 / table.rate_hz).max(1.0 / session.sample_rate_hz)
}

/// Matches the ramps of each stretch of the session with their candidates, and makes the times `exact`.
fn matched<'a>(
    request: &AttachRequest,
    ramps: &[RampTime],
    candidates: impl Fn(usize) -> &'a [EventCandidate],
    (grain_s, length_s, resolution_s): (f64, f64, f64),
    by: String,
    exact: impl Fn(usize, EventCandidate) -> EventCandidate,
) -> Result<AlignedRamps, AttachError> {
    let mut found = AlignedRamps { by, ..AlignedRamps::default() };
    let mut pairs = Vec::new();
    let mut problem = None;
    let mut first = 0;
    for stretch in ramps.chunk_by(|a, b| a.stretch == b.stretch) {
        let at = first;
        first += stretch.len();
        let expected: Vec<f64> = stretch.iter().map(|ramp| ramp.onset_s).collect();
        match match_events(&expected, |event| candidates(at + event), grain_s, length_s) {
            Err(own) => problem = problem.or(Some(own)),
            Ok(matched) => {
                for (event, own) in matched.into_iter().enumerate() {
                    let Some((own, trial)) = own.zip(stretch[event].trial) else { continue };
                    let own = exact(at + event, own);
                    let lowest = found.clock.lowest_correlation.unwrap_or(1.0).min(own.weight);
                    if matches!(request.reference, Reference::Signal { .. }) {
                        found.clock.lowest_correlation = Some(lowest);
                    }
                    found.trials.push(AlignedRamp { trial, onset_s: own.time_s, residual_s: None });
                    pairs.push((stretch[event].stretch, stretch[event].onset_s, own.time_s));
                }
            }
        }
    }
    if found.trials.is_empty() {
        let reason = match problem {
            Some(MatchProblem::Ambiguous { at_s: [a, b], found }) => format!(
                "{found} ramps of the session fit alike from {a:.3} s and from {b:.3} s of the recording on; cut the recording"
            ),
            Some(MatchProblem::TooFew { found }) => format!(
                "{found} of {} ramps are at the intervals of the session, which may be chance: is it the recording of this session, and \
                 is {} right?",
                ramps.len(),
                found_in(request)
            ),
            None => "no ramp of a trial is in it".to_owned(),
        };
        return Err(request.not_aligned(reason));
    }
    found.compare_clocks(pairs, resolution_s);
    Ok(found)
}

fn found_in(request: &AttachRequest) -> &'static str {
    match request.reference {
        Reference::Trigger { .. } => "the column of the trigger, its threshold and its direction",
        Reference::Marker(_) => "the text of the markers",
        Reference::SessionClock => "its clock",
        Reference::Signal { .. } => "the column, its sign and the signal that it shares",
    }
}

impl AlignedRamps {
    /// Fits one speed of the recording's clock, and an offset for each stretch, to the pairs of the trials. What comes after a step of the
    /// clocks is a stretch of its own.
    fn compare_clocks(&mut self, mut pairs: Vec<RampPair>, resolution_s: f64) {
        let steps = clock_steps(&pairs, resolution_s);
        self.clock_steps = steps
            .iter()
            .map(|step| StepBetweenTrials {
                after_trial: self.trials[step.before].trial,
                before_trial: self.trials[step.before + 1].trial,
                step_s: step.step_s,
            })
            .collect();
        let ahead = |at: usize| steps.iter().filter(|step| step.before < at).count();
        for (at, pair) in pairs.iter_mut().enumerate().filter(|(_, pair)| pair.0 != usize::MAX) {
            pair.0 += ahead(at);
        }
        self.fit_line(&pairs);
    }

    fn fit_line(&mut self, pairs: &[RampPair]) {
        let mut stretches: Vec<usize> = pairs.iter().map(|pair| pair.0).collect();
        stretches.sort_unstable();
        stretches.dedup();
        // A stretch that is not known has no times.
        stretches.retain(|stretch| *stretch != usize::MAX);
        let mean = |stretch: usize, of: fn(&(usize, f64, f64)) -> f64| {
            let own: Vec<f64> = pairs.iter().filter(|pair| pair.0 == stretch).map(of).collect();
            own.iter().sum::<f64>() / own.len() as f64
        };
        let means: Vec<(usize, f64, f64)> = stretches
            .iter()
            .map(|own| (*own, mean(*own, |pair| pair.1), mean(*own, |pair| pair.2)))
            .collect();
        let centred = |pair: &(usize, f64, f64)| {
            let own = means.iter().find(|mean| mean.0 == pair.0)?;
            Some((pair.1 - own.1, pair.2 - own.2))
        };
        let known: Vec<(f64, f64)> = pairs.iter().filter_map(centred).collect();
        let square: f64 = known.iter().map(|(session, _)| session * session).sum();
        if square == 0.0 {
            return;
        }
        let speed = known.iter().map(|(session, own)| session * own).sum::<f64>() / square;
        let residual = |pair: &(usize, f64, f64)| centred(pair).map(|(session, own)| own - speed * session);
        for (trial, pair) in self.trials.iter_mut().zip(pairs) {
            trial.residual_s = residual(pair);
        }
        // The speed, and an offset of each stretch, are taken from the same times.
        let free = known.len().saturating_sub(1 + means.len());
        let squares: f64 = pairs.iter().filter_map(residual).map(|own| own * own).sum();
        let largest = pairs.iter().filter_map(residual).fold(0.0, |most: f64, own| most.max(own.abs()));
        self.speed = Some(speed);
        self.clock.drift_ppm = Some((speed - 1.0) * 1e6);
        self.clock.residual_rms_s = (free > 0).then(|| (squares / free as f64).sqrt());
        self.clock.residual_largest_s = (free > 0).then_some(largest);
    }
}
