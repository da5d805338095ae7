//! The pieces of a recording in which a stretch of a session is found.
//!
//! Where samples were lost or a clock was set, the intervals across that place are no longer those of the session, so one search finds what
//! is on one side of it. The ramps that it leaves are sought by themselves, in the part of the recording where their neighbours let them be.

use std::ops::Range;

use super::event_match::EventCandidate;

/// The places of events, where found.
pub type Places = Vec<Option<EventCandidate>>;

/// A part of the recording, s by its own clock.
pub type RecordingPart = Range<f64>;

/// The whole recording.
pub const WHOLE: RecordingPart = f64::NEG_INFINITY..f64::INFINITY;

/// Seeks the events of the range `events` that `places` does not have, piece by piece, and puts what is found into `places`.
///
/// `find` seeks a run of events in a part of the recording, with the rule by which a recording of that part alone is accepted.
pub fn find_further_pieces(
    places: &mut [Option<EventCandidate>],
    events: Range<usize>,
    mut find: impl FnMut(Range<usize>, &RecordingPart) -> Option<Places>,
) {
    let mut left = runs_not_found(places, events, &WHOLE);
    while let Some((run, part)) = left.pop() {
        let Some(found) = find(run.clone(), &part) else { continue };
        places[run.clone()].copy_from_slice(&found);
        // What is not found again is not sought again.
        if found.iter().any(Option::is_some) {
            left.extend(runs_not_found(places, run, &part));
        }
    }
}

/// The runs of events without a place among `events`, each with the part of the recording between its neighbours; none if no event has a
/// place, since that part was searched.
fn runs_not_found(
    places: &[Option<EventCandidate>],
    events: Range<usize>,
    part: &RecordingPart,
) -> Vec<(Range<usize>, RecordingPart)> {
    let found: Vec<(usize, f64)> =
        events.clone().filter_map(|event| Some((event, places[event]?.time_s))).collect();
    if found.is_empty() {
        return Vec::new();
    }
    let before =
        std::iter::once((events.start, part.start)).chain(found.iter().map(|own| (own.0 + 1, own.1)));
    let after = found.iter().copied().chain([(events.end, part.end)]);
    let runs = before.zip(after).map(|(first, end)| (first.0..end.0, first.1..end.1));
    runs.filter(|(run, _)| !run.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Option<EventCandidate> {
        Some(EventCandidate { time_s, weight: 1.0 })
    }

    #[test]
    fn what_is_not_found_is_sought_between_its_neighbours_and_what_that_leaves_as_well() {
        let mut places = vec![None, None, None, at(30.0), at(40.0), None, None];
        let mut sought = Vec::new();
        find_further_pieces(&mut places, 0..7, |run, part| {
            sought.push((run.clone(), part.clone()));
            (run == (0..3)).then(|| vec![None, at(12.0), at(22.0)])
        });
        assert_eq!(
            sought,
            [(5..7, 40.0..f64::INFINITY), (0..3, f64::NEG_INFINITY..30.0), (0..1, f64::NEG_INFINITY..12.0)]
        );
        assert_eq!(places, [None, at(12.0), at(22.0), at(30.0), at(40.0), None, None]);
    }

    #[test]
    fn a_stretch_of_which_nothing_is_found_is_not_sought_again() {
        let mut places = vec![None; 3];
        find_further_pieces(&mut places, 0..3, |_, _| panic!("sought again"));
    }
}
