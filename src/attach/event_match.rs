//! Matches events of a session with times in a recording whose clock is not known: the intervals between the events must be
//! those between the times.

/// The most by which the interval of two clocks may differ, as a fraction. A quartz is off by less than 1e-4; a session counts
/// samples, and a period that its loop lost is a sample less.
pub const CLOCK_TOLERANCE: f64 = 1e-3;

/// Probability with which a recording without the events may be taken for one that has them.
const FALSE_MATCH: f64 = 1e-6;

/// Events from which a chain of matches is begun.
const MOST_ANCHORS: usize = 50;

/// A chain ends where so many more events were missed than found.
const MOST_MISSED: usize = 5;

/// A time in the recording that can be that of an event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EventCandidate {
    /// Time on the clock of the recording, s.
    pub time_s: f64,
    /// How well it fits, as its correlation; 1 for a pulse or a marker.
    pub weight: f64,
}

/// Why no match was accepted.
#[derive(Debug, Clone, PartialEq)]
pub enum MatchProblem {
    /// So few events were found that it may be chance.
    TooFew {
        /// Events found in the best chain.
        found: usize,
    },
    /// Two places of the recording fit alike.
    Ambiguous {
        /// Times of the first event found in both, s.
        at_s: [f64; 2],
        /// Events found.
        found: usize,
    },
}

/// For each event at `expected_s` on the session's clock, in order, its candidate, where one was found.
///
/// `candidates` gives those of an event, in order of time; times are exact to `grain_s`, the recording lasts `length_s`.
///
/// # Errors
/// If what was found may be chance, or two places fit alike.
pub fn match_events<'a>(
    expected_s: &[f64],
    candidates: impl Fn(usize) -> &'a [EventCandidate],
    grain_s: f64,
    length_s: f64,
) -> Result<Vec<Option<EventCandidate>>, MatchProblem> {
    let anchors = expected_s.len().div_ceil(MOST_ANCHORS).max(1);
    let mut best: Option<Chain> = None;
    let mut second: Option<Chain> = None;
    let mut tried = 0usize;
    for anchor in (0..expected_s.len()).step_by(anchors) {
        for candidate in candidates(anchor) {
            tried += 1;
            let chain = Chain::from_anchor(expected_s, &candidates, (anchor, *candidate), grain_s, length_s);
            match &best {
                Some(own) if own.is_same_place(&chain) => {
                    if chain.is_better_than(own) {
                        best = Some(chain);
                    }
                }
                Some(own) if !chain.is_better_than(own) => {
                    if second.as_ref().is_none_or(|second| chain.is_better_than(second)) {
                        second = Some(chain);
                    }
                }
                _ => second = best.replace(chain),
            }
        }
    }
    let best = best.ok_or(MatchProblem::TooFew { found: 0 })?;
    // The anchor is there by choice. Poisson's upper tail is at most exp(-m) (e m / q)^q.
    let (confirmed, by_chance) = (best.found.saturating_sub(1) as f64, best.found_by_chance.max(1e-300));
    let log_tail = -by_chance + confirmed * (1.0 + libm::log(by_chance) - libm::log(confirmed.max(1e-300)));
    let is_chance = confirmed <= by_chance || log_tail + libm::log(tried as f64) > libm::log(FALSE_MATCH);
    if is_chance {
        return Err(MatchProblem::TooFew { found: best.found });
    }
    if let Some(other) = second.filter(|other| other.found >= best.found && !best.is_heavier_than(other)) {
        let first = |chain: &Chain| chain.matched.iter().flatten().next().map_or(0.0, |own| own.time_s);
        return Err(MatchProblem::Ambiguous { at_s: [first(&best), first(&other)], found: best.found });
    }
    Ok(best.matched)
}

/// Events with the candidates that follow from one of them.
#[derive(Debug, Clone)]
struct Chain {
    matched: Vec<Option<EventCandidate>>,
    found: usize,
    weight: f64,
    /// Expected number of events that would be found among candidates at random times.
    found_by_chance: f64,
}

impl Chain {
    fn from_anchor<'a>(
        expected_s: &[f64],
        candidates: &impl Fn(usize) -> &'a [EventCandidate],
        (anchor, candidate): (usize, EventCandidate),
        grain_s: f64,
        length_s: f64,
    ) -> Self {
        let mut chain =
            Self { matched: vec![None; expected_s.len()], found: 0, weight: 0.0, found_by_chance: 0.0 };
        chain.keep(anchor, candidate);
        let later = anchor + 1..expected_s.len();
        let earlier = (0..anchor).rev();
        let mut walk = |events: &mut dyn Iterator<Item = usize>| {
            let (mut at, mut missed, mut found) = ((expected_s[anchor], candidate.time_s), 0, 0);
            for event in events {
                let interval_s = expected_s[event] - at.0;
                let (wanted_s, within_s) = (at.1 + interval_s, grain_s + CLOCK_TOLERANCE * interval_s.abs());
                let own = candidates(event);
                chain.found_by_chance += own.len() as f64 * (2.0 * within_s / length_s).min(1.0);
                let from = own.partition_point(|one| one.time_s < wanted_s - within_s);
                let near = own[from..].iter().take_while(|one| one.time_s <= wanted_s + within_s);
                let off = |one: &EventCandidate| (one.time_s - wanted_s).abs();
                let nearest =
                    near.max_by(|a, b| a.weight.total_cmp(&b.weight).then(off(b).total_cmp(&off(a))));
                let Some(nearest) = nearest else {
                    missed += 1;
                    if missed > found + MOST_MISSED {
                        break;
                    }
                    continue;
                };
                found += 1;
                chain.keep(event, *nearest);
                at = (expected_s[event], nearest.time_s);
            }
        };
        walk(&mut { later });
        walk(&mut { earlier });
        chain
    }

    fn keep(&mut self, event: usize, candidate: EventCandidate) {
        self.matched[event] = Some(candidate);
        self.found += 1;
        self.weight += candidate.weight;
    }

    /// Whether both found some event at the same time.
    fn is_same_place(&self, other: &Self) -> bool {
        let pairs = self.matched.iter().zip(&other.matched);
        pairs.filter_map(|(own, other)| own.zip(*other)).any(|(own, other)| own.time_s == other.time_s)
    }

    fn is_better_than(&self, other: &Self) -> bool {
        (self.found, self.weight) > (other.found, other.weight)
    }

    /// Whether its candidates fit better, beyond rounding.
    fn is_heavier_than(&self, other: &Self) -> bool {
        self.weight > other.weight * (1.0 + 1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Times of 40 events, 6 to 12 s apart.
    fn events(seed: u64) -> Vec<f64> {
        let mut stream = Stream::new(seed, "events");
        let mut time_s = 0.0;
        (0..40)
            .map(|_| {
                time_s += 6.0 + 6.0 * stream.uniform();
                time_s
            })
            .collect()
    }

    fn pulses(times_s: impl Iterator<Item = f64>) -> Vec<EventCandidate> {
        let mut own: Vec<EventCandidate> =
            times_s.map(|time_s| EventCandidate { time_s, weight: 1.0 }).collect();
        own.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        own
    }

    #[test]
    fn events_are_found_on_a_clock_that_is_ahead_and_fast_though_some_are_missing_and_others_are_too_many() {
        let expected = events(1);
        let on_clock = |time_s: f64| 1234.5 + 1.0002 * time_s;
        let there = expected.iter().enumerate().filter(|(event, _)| *event > 4 && event % 7 != 0);
        let others = events(2).into_iter().map(|time_s| time_s * 0.7);
        let own = pulses(there.map(|(_, time_s)| on_clock(*time_s)).chain(others.map(on_clock)));
        let matched = match_events(&expected, |_| own.as_slice(), 1e-3, 500.0).unwrap();
        for (event, found) in matched.iter().enumerate() {
            let is_there = event > 4 && event % 7 != 0;
            match found {
                Some(found) if is_there => assert!((found.time_s - on_clock(expected[event])).abs() < 1e-9),
                None if !is_there => {}
                other => panic!("event {event}: {other:?}"),
            }
        }
    }

    #[test]
    fn the_recording_of_another_session_is_refused() {
        for seed in 2..12 {
            let own = pulses(events(seed).into_iter());
            let found = match_events(&events(1), |_| own.as_slice(), 1e-3, 500.0);
            assert!(matches!(found, Err(MatchProblem::TooFew { .. })), "seed {seed}: {found:?}");
        }
    }

    #[test]
    fn two_places_that_fit_alike_are_told() {
        let expected = events(1);
        let twice = expected.iter().chain(&expected).enumerate();
        let own = pulses(twice.map(|(at, time_s)| time_s + if at < 40 { 0.0 } else { 1000.0 }));
        let found = match_events(&expected, |_| own.as_slice(), 1e-3, 1500.0);
        assert!(matches!(found, Err(MatchProblem::Ambiguous { found: 40, .. })), "{found:?}");
    }

    #[test]
    fn without_candidates_nothing_is_found() {
        assert_eq!(match_events(&events(1), |_| &[], 1e-3, 500.0), Err(MatchProblem::TooFew { found: 0 }));
    }
}
