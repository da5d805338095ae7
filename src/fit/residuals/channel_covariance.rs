//! Covariances of several channels: each channel is whitened, and its precision corrected, given the channels before it.
//!
//! The torque comes first. Its part of the whitening and of the correction is then that of a session without further channels, and a
//! further channel can only add information.

use nalgebra::DMatrix;

use crate::signal::NoiseCovariance;

/// Enlarges the covariance of channels with `samples` values each: that of the first by `1 / factors[0]`, what each further one has
/// beyond its regression on the channels before it by `1 / factors[k]`. Directions with a variance below `floor` do not count.
pub fn enlarged(covariance: &DMatrix<f64>, factors: &[f64], samples: usize, floor: f64) -> DMatrix<f64> {
    let mut large = covariance.view((0, 0), (samples, samples)) / factors[0];
    for (channel, factor) in factors.iter().enumerate().skip(1) {
        let before = channel * samples;
        let (slopes, rest) = regression(covariance, before, samples, floor);
        let cross = &slopes * &large;
        let own = rest / *factor + &cross * slopes.transpose();
        let mut next = DMatrix::zeros(before + samples, before + samples);
        next.view_mut((0, 0), (before, before)).copy_from(&large);
        next.view_mut((before, 0), (samples, before)).copy_from(&cross);
        next.view_mut((0, before), (before, samples)).copy_from(&cross.transpose());
        next.view_mut((before, before), (samples, samples)).copy_from(&own);
        large = next;
    }
    large
}

/// Whitening matrix of channels with `samples` values each; directions with a variance below `floor` are dropped.
pub fn whitener(covariance: &DMatrix<f64>, samples: usize, floor: f64) -> DMatrix<f64> {
    let mut whole = whitener_of(covariance.view((0, 0), (samples, samples)).into_owned(), floor);
    for before in (samples..covariance.nrows()).step_by(samples) {
        let (slopes, rest) = regression(covariance, before, samples, floor);
        let own = whitener_of(rest, floor);
        let mut next = DMatrix::zeros(whole.nrows() + own.nrows(), before + samples);
        next.view_mut((0, 0), whole.shape()).copy_from(&whole);
        next.view_mut((whole.nrows(), 0), (own.nrows(), before)).copy_from(&(-(&own * slopes)));
        next.view_mut((whole.nrows(), before), own.shape()).copy_from(&own);
        whole = next;
    }
    whole
}

/// Regression of the `samples` values after the first `before` on those: the slopes, and the covariance of what is left.
fn regression(
    covariance: &DMatrix<f64>,
    before: usize,
    samples: usize,
    floor: f64,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let white = whitener_of(covariance.view((0, 0), (before, before)).into_owned(), floor);
    let cross = covariance.view((before, 0), (samples, before));
    // The inverse of the covariance in the directions that are kept is white' white.
    let projected = cross * white.transpose();
    let rest = covariance.view((before, before), (samples, samples)) - &projected * projected.transpose();
    (projected * white, rest)
}

fn whitener_of(covariance: DMatrix<f64>, floor: f64) -> DMatrix<f64> {
    NoiseCovariance { covariance, stretches: 0 }.whitener(floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A covariance of two channels of four values.
    fn covariance() -> DMatrix<f64> {
        let mut stream = Stream::new(3, "covariance");
        let root = DMatrix::from_fn(8, 12, |_, _| stream.normal());
        &root * root.transpose()
    }

    #[test]
    fn the_whitener_makes_both_channels_white_and_leaves_the_first_as_it_is_alone() {
        let covariance = covariance();
        let white = whitener(&covariance, 4, 1e-9);
        let left = &white * &covariance * white.transpose() - DMatrix::identity(8, 8);
        assert!(left.norm() < 1e-9, "{left}");
        let alone = whitener(&covariance.view((0, 0), (4, 4)).into_owned(), 4, 1e-9);
        assert_eq!(white.view((0, 0), (4, 4)), alone);
        assert_eq!(white.view((0, 4), (4, 4)).norm(), 0.0);
    }

    #[test]
    fn equal_factors_enlarge_the_whole_and_others_what_a_channel_adds() {
        let covariance = covariance();
        let same = enlarged(&covariance, &[0.8, 0.8], 4, 1e-9) - &covariance / 0.8;
        assert!(same.norm() < 1e-9, "{same}");
        let large = enlarged(&covariance, &[0.8, 0.5], 4, 1e-9);
        let white = whitener(&covariance, 4, 1e-9);
        let variances = (&white * large * white.transpose()).diagonal();
        for (place, variance) in variances.iter().enumerate() {
            let expected = if place < 4 { 1.0 / 0.8 } else { 1.0 / 0.5 };
            assert!((variance - expected).abs() < 1e-9, "{place}: {variance}");
        }
    }
}
