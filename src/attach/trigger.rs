//! The edges of a trigger signal.

/// Times at which `values` cross `threshold`, upwards or, for a `falling` trigger, downwards, s; the crossing is interpolated between the
/// samples about it.
pub fn edges(times_s: &[f64], values: &[f64], threshold: f64, falling: bool) -> Vec<f64> {
    let sign = if falling { -1.0 } else { 1.0 };
    let above = |value: f64| sign * (value - threshold);
    let steps = values.windows(2).zip(times_s.windows(2));
    steps
        .filter(|(value, _)| above(value[0]) <= 0.0 && above(value[1]) > 0.0)
        .map(|(value, time)| {
            let share = (threshold - value[0]) / (value[1] - value[0]);
            time[0] + share * (time[1] - time[0])
        })
        .collect()
}

/// The level at which a trigger is most of the time, where that is on the side to which its pulses are said to go: their begin would be
/// taken at their end.
pub fn rest_on_other_side(values: &[f64], threshold: f64, falling: bool) -> Option<f64> {
    let [_, rest, _] = levels(values)?;
    let is_pulse = if falling { rest < threshold } else { rest > threshold };
    is_pulse.then_some(rest)
}

/// A threshold between the level at which a trigger rests and the level farthest from it.
pub fn middle(values: &[f64]) -> f64 {
    let Some([low, rest, high]) = levels(values) else { return 0.0 };
    let far = if high - rest >= rest - low { high } else { low };
    0.5 * (rest + far)
}

/// The lowest level of a trigger, the one at which it rests, its median, and the highest; `None` without samples.
fn levels(values: &[f64]) -> Option<[f64; 3]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    Some([*sorted.first()?, sorted[sorted.len() / 2], *sorted.last()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trigger_that_rests_where_its_pulses_are_said_to_go_is_noticed() {
        let values: Vec<f64> = (0..1000).map(|sample| if sample % 200 < 50 { 0.0 } else { 5.0 }).collect();
        assert_eq!(rest_on_other_side(&values, middle(&values), false), Some(5.0));
        assert_eq!(rest_on_other_side(&values, middle(&values), true), None);
    }

    #[test]
    fn edges_of_pulses_up_and_down_are_found_between_their_levels() {
        for (rest, pulse, falling) in [(0.1, 5.0, false), (5.0, 0.2, true), (-3.0, -1.0, false)] {
            let values: Vec<f64> =
                (0..1000).map(|sample| if (sample / 10) % 20 == 7 { pulse } else { rest }).collect();
            let times: Vec<f64> = (0..1000).map(|sample| f64::from(sample) * 1e-3).collect();
            let found = edges(&times, &values, middle(&values), falling);
            let expected = [0.0695, 0.2695, 0.4695, 0.6695, 0.8695];
            assert_eq!(found.len(), expected.len(), "{found:?}");
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
    }
}
