//! Detection of the ramp's onset in recordings that do not state it.

use super::encoder_step::smallest_step;

/// A motor stands still where it is within this part of its way, a fortieth of the tenth by which a ramp is found: at the place that is
/// looked at, a ramp that rises with the third power of time moves by more than twice as much.
const STILL: f64 = 2.5e-3;

/// A motor that stands still between two steps of its encoder may read either: the reading is at rest within this number of steps, more than
/// one and less than two.
const RESTING_STEPS: f64 = 1.25;

/// Index of the last sample at rest before the ramp: the search goes back from the sample at a tenth of the whole movement to the last
/// sample within the noise of the rest before.
///
/// `None` if the record has fewer than 40 samples or no movement beyond its noise.
pub fn onset(theta_rad: &[f64]) -> Option<usize> {
    let count = theta_rad.len();
    if count < 40 {
        return None;
    }
    let rest = &theta_rad[..count / 20];
    let level = mean(rest);
    let noise = libm::sqrt(rest.iter().map(|x| (x - level) * (x - level)).sum::<f64>() / rest.len() as f64);
    let way = farthest(theta_rad.iter().map(|x| x - level));
    if way.abs() < 20.0 * noise || way == 0.0 {
        return None;
    }
    let moved = theta_rad.iter().position(|x| (x - level) / way > 0.1)?;
    // The rest just before the ramp, since the angle may have drifted in the hold. A ramp that rises with the third power of time needs
    // for its first tenth four times as long as for the second.
    let second_tenth = theta_rad[moved..].iter().position(|x| (x - level) / way > 0.2)?.max(1);
    let ramp = moved.saturating_sub(6 * second_tenth).max(1);
    let far = &theta_rad[ramp.saturating_sub(12 * second_tenth)..ramp];
    // A ramp of constant speed began a tenth before, and little more. Where it is so slow that the record does not reach back far enough, the
    // motor may have settled since the record began.
    let before = |tenths: f64| moved.saturating_sub((tenths * second_tenth as f64) as usize);
    let close = &theta_rad[before(1.5)..before(1.15)];
    let stands_still = !close.is_empty() && spread(close) < STILL * way.abs();
    let near = if moved < 18 * second_tenth && stands_still { close } else { far };
    let (level, spread) = (mean(near), spread(near));
    let band =
        spread.max(3e-4 * way.abs()).max(RESTING_STEPS * smallest_step([&theta_rad[..moved]].into_iter()));
    theta_rad[..moved].iter().rposition(|x| (x - level) * way.signum() <= band)
}

/// The value that is farthest from zero, with its sign.
pub fn farthest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |far: f64, x| if x.abs() > far.abs() { x } else { far })
}

/// Largest distance from the mean.
fn spread(values: &[f64]) -> f64 {
    let level = mean(values);
    values.iter().map(|x| (x - level).abs()).fold(0.0, f64::max)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn ramp(onset: usize, velocity: f64, noise: f64) -> Vec<f64> {
        let mut stream = Stream::new(3, "onset");
        (0..2000)
            .map(|i| {
                let t = (i as f64 - onset as f64).max(0.0) * 4e-4;
                let smooth = if t < 0.02 { t * t / 0.04 } else { t - 0.01 };
                0.3 + (velocity * smooth).clamp(-0.14, 0.14) + noise * stream.normal()
            })
            .collect()
    }

    #[test]
    fn finds_the_onset_to_a_few_samples_for_every_velocity_and_direction() {
        for velocity in [1.3, 3.25, -2.0] {
            let found = onset(&ramp(1200, velocity, 1.4e-5)).unwrap();
            assert!((1200..1208).contains(&found), "{velocity} rad/s: {found}");
        }
    }

    #[test]
    fn a_hold_in_which_the_angle_drifts_is_no_ramp() {
        let drifting: Vec<f64> = ramp(1200, 1.3, 1.4e-5)
            .into_iter()
            .enumerate()
            .map(|(sample, angle)| angle + 2e-4 * (sample as f64 / 1200.0).min(1.0))
            .collect();
        let found = onset(&drifting).unwrap();
        assert!((1200..1208).contains(&found), "{found}");
    }

    /// It was found 34 ms early: a step was beyond the band, and nothing came back from it.
    #[test]
    fn an_encoder_that_reads_its_next_step_before_the_ramp_has_not_begun_it() {
        for bits in [13, 14, 17, 20] {
            let step = std::f64::consts::TAU / f64::from(1 << bits);
            for velocity in [1.3, 3.25, -2.0] {
                let mut stepped: Vec<f64> =
                    ramp(1200, velocity, 0.0).iter().map(|angle| (angle / step).round() * step).collect();
                stepped[1115..1200].iter_mut().for_each(|angle| *angle += step * velocity.signum());
                let found = onset(&stepped).unwrap();
                // The time that it takes to move by two steps.
                let late = 2 + (libm::sqrt(2.5 * step * 0.04 / velocity.abs()) / 4e-4) as usize;
                assert!((1199..1200 + late).contains(&found), "{bits} bits, {velocity} rad/s: {found}");
            }
        }
    }

    #[test]
    fn a_ramp_that_takes_seconds_is_found_after_a_hold_in_which_the_motor_settled() {
        let settled = |i: usize| if i < 900 { -1e-3 } else { 0.0 };
        let slow = |i: usize| 0.05 * ((i as f64 - 1500.0) * 4e-4).clamp(0.0, 2.8);
        let angle: Vec<f64> = (0..10_000).map(|i| 0.3 + settled(i) + slow(i)).collect();
        let found = onset(&angle).unwrap();
        assert!((1499..1505).contains(&found), "{found}");
        let cubic: Vec<f64> = (0..10_000)
            .map(|i| {
                let part = ((i as f64 - 1500.0) / 7000.0).clamp(0.0, 1.0);
                0.3 + 0.14 * part * part * part
            })
            .collect();
        let found = onset(&cubic).unwrap();
        assert!((1499..2000).contains(&found), "{found}: within 0.03 % of the way");
    }

    #[test]
    fn a_record_without_movement_has_no_onset() {
        assert_eq!(onset(&ramp(1200, 0.0, 1.4e-5)), None);
        assert_eq!(onset(&[0.1; 2000]), None);
        assert_eq!(onset(&[0.1; 10]), None);
    }
}
