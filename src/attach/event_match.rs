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
    let search = IntervalSearch { expected_s, candidates, grain_s, length_s };
    let mut tried = 0usize;
    let best = search
        .chains()
        .inspect(|_| tried += 1)
        .reduce(|best, own| if own.is_better_than(&best) { own } else { best });
    let mut best = best.ok_or(MatchProblem::TooFew { found: 0 })?;
    // The anchor is there by choice. Poisson's upper tail is at most exp(-m) (e m / q)^q.
    let (confirmed, by_chance) = (best.found.saturating_sub(1) as f64, best.found_by_chance.max(1e-300));
    let log_tail = -by_chance + confirmed * (1.0 + libm::log(by_chance) - libm::log(confirmed.max(1e-300)));
    let is_chance = confirmed <= by_chance || log_tail + libm::log(tried as f64) > libm::log(FALSE_MATCH);
    if is_chance {
        return Err(MatchProblem::TooFew { found: best.found });
    }
    let fits_alike =
        |other: &Chain| other.is_rival_of(&best) && other.found >= best.found && !best.is_heavier_than(other);
    if let Some(other) = search.chains().find(fits_alike) {
        let first = |chain: &Chain| chain.matched.iter().flatten().next().map_or(0.0, |own| own.time_s);
        return Err(MatchProblem::Ambiguous { at_s: [first(&best), first(&other)], found: best.found });
    }
    search.fill(&mut best.matched);
    Ok(best.matched)
}

/// Events whose intervals are sought among the candidates of each.
struct IntervalSearch<'e, F> {
    expected_s: &'e [f64],
    candidates: F,
    grain_s: f64,
    length_s: f64,
}

impl<'a, F: Fn(usize) -> &'a [EventCandidate]> IntervalSearch<'_, F> {
    /// The chains of all anchors.
    fn chains(&self) -> impl Iterator<Item = Chain> {
        let apart = self.expected_s.len().div_ceil(MOST_ANCHORS).max(1);
        let anchors = (0..self.expected_s.len()).step_by(apart);
        anchors.flat_map(move |anchor| {
            (self.candidates)(anchor)
                .iter()
                .map(move |candidate| Chain::from_anchor(self, anchor, *candidate))
        })
    }

    /// How far the time of an event may be from where another event has it, s.
    fn within_s(&self, interval_s: f64) -> f64 {
        self.grain_s + CLOCK_TOLERANCE * interval_s.abs()
    }

    /// The candidate of an event that is where another event, expected and found at the times `at`, has it.
    fn near(&self, event: usize, at: (f64, f64)) -> Option<EventCandidate> {
        let interval_s = self.expected_s[event] - at.0;
        let (wanted_s, within_s) = (at.1 + interval_s, self.within_s(interval_s));
        let own = (self.candidates)(event);
        let from = own.partition_point(|one| one.time_s < wanted_s - within_s);
        let near = own[from..].iter().take_while(|one| one.time_s <= wanted_s + within_s);
        let off = |one: &EventCandidate| (one.time_s - wanted_s).abs();
        near.max_by(|a, b| a.weight.total_cmp(&b.weight).then(off(b).total_cmp(&off(a)))).copied()
    }

    /// Expected number of candidates of an event at random times that are as near.
    fn near_by_chance(&self, event: usize, interval_s: f64) -> f64 {
        let share = (2.0 * self.within_s(interval_s) / self.length_s).min(1.0);
        (self.candidates)(event).len() as f64 * share
    }

    /// Fills holes between events that were found. Where the clocks step, a chain misses the events beyond the step until their
    /// interval is so long that the step is within the tolerance; they follow from the events on their own side of it.
    fn fill(&self, matched: &mut [Option<EventCandidate>]) {
        let found: Vec<usize> = (0..matched.len()).filter(|event| matched[*event].is_some()).collect();
        for pair in found.windows(2) {
            let time_s =
                |event: usize, matched: &[Option<EventCandidate>]| matched[event].map(|own| own.time_s);
            let mut fill_beside = |from: usize, events: &mut dyn Iterator<Item = usize>| {
                let mut beside = from;
                for event in events {
                    let Some(at_s) = time_s(beside, matched) else { break };
                    let Some(own) = self.near(event, (self.expected_s[beside], at_s)) else { continue };
                    let is_between = |(first, last): (f64, f64)| (first..last).contains(&own.time_s);
                    let ends = time_s(pair[0], matched).zip(time_s(pair[1], matched));
                    if matched[event].is_none() && ends.is_some_and(is_between) {
                        matched[event] = Some(own);
                        beside = event;
                    }
                }
            };
            fill_beside(pair[1], &mut (pair[0] + 1..pair[1]).rev());
            fill_beside(pair[0], &mut (pair[0] + 1..pair[1]));
        }
    }
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
    fn from_anchor<'a, F: Fn(usize) -> &'a [EventCandidate]>(
        search: &IntervalSearch<F>,
        anchor: usize,
        candidate: EventCandidate,
    ) -> Self {
        let expected_s = search.expected_s;
        let mut chain =
            Self { matched: vec![None; expected_s.len()], found: 0, weight: 0.0, found_by_chance: 0.0 };
        chain.keep(anchor, candidate);
        let later = anchor + 1..expected_s.len();
        let earlier = (0..anchor).rev();
        let mut walk = |events: &mut dyn Iterator<Item = usize>| {
            let (mut at, mut missed, mut found) = ((expected_s[anchor], candidate.time_s), 0, 0);
            for event in events {
                chain.found_by_chance += search.near_by_chance(event, expected_s[event] - at.0);
                let Some(nearest) = search.near(event, at) else {
                    missed += 1;
                    if missed > found + MOST_MISSED {
                        break;
                    }
                    continue;
                };
                found += 1;
                chain.keep(event, nearest);
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

    /// Whether it has events of the other at another place: at least half of those that the other found, and none at the same time. Two
    /// chains of different events are two pieces of one recording.
    fn is_rival_of(&self, other: &Self) -> bool {
        let pairs = || self.matched.iter().zip(&other.matched).filter_map(|(own, other)| own.zip(*other));
        2 * pairs().count() >= other.found && pairs().all(|(own, other)| own.time_s != other.time_s)
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
    fn two_halves_of_one_recording_on_two_clocks_are_not_two_places_that_fit_alike() {
        let expected = events(1);
        let step = |at: usize| if at < 20 { 0.0 } else { -2.5 };
        let own = pulses(expected.iter().enumerate().map(|(at, time_s)| 100.0 + time_s + step(at)));
        let matched = match_events(&expected, |_| own.as_slice(), 1e-3, 500.0).unwrap();
        assert_eq!(matched.iter().flatten().count(), 20, "{matched:?}");
    }

    #[test]
    fn events_beside_a_step_that_the_chain_crosses_later_are_found_as_well() {
        let expected = events(1);
        for step_s in [-0.02, 0.05] {
            let on_clock = |at: usize| expected[at] + if at < 9 { 0.0 } else { step_s };
            let own = pulses((0..40).map(on_clock));
            let matched = match_events(&expected, |_| own.as_slice(), 1e-3, 500.0).unwrap();
            for (at, found) in matched.iter().enumerate() {
                assert_eq!(found.map(|own| own.time_s), Some(on_clock(at)), "step of {step_s} s, event {at}");
            }
        }
    }

    #[test]
    fn without_candidates_nothing_is_found() {
        assert_eq!(match_events(&events(1), |_| &[], 1e-3, 500.0), Err(MatchProblem::TooFew { found: 0 }));
    }
}
