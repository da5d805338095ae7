//! The distribution of motions that lie within intervals at every sample (expectation propagation: Minka 2001; for intervals: Cunningham,
//! Hennig and Lacoste-Julien 2011, arXiv:1111.6832).
//!
//! Each trial's motion is a mean motion of covariance A, which all share, and its own of covariance D. What an interval says of a sample is
//! replaced by a normal distribution (a site), so that mean and variance there are those within the interval. All angles are in steps.

use nalgebra::{DMatrix, DVector};

use super::truncated_normal::TruncatedNormal;

/// Largest change of a mean at which the sites count as found, in steps.
const TOLERANCE: f64 = 1e-3;

/// Most rounds of renewing all sites; some six are needed.
const MOST_ROUNDS: usize = 40;

/// Part of the way to its new value by which a site moves in a round: sites that are renewed all at once may overshoot. The second part is
/// that of sites which have not settled in half of the rounds.
const DAMPING: [f64; 2] = [0.8, 0.3];

/// Bounds of a site's precision: an interval that says nothing, and one that says all that numbers can hold.
const PRECISIONS: (f64, f64) = (1e-4, 1e6);

/// Covariances of the mean motion and of what each trial adds.
#[derive(Debug, Clone)]
pub struct Covariances {
    /// A factor of that of the mean motion: the covariance is this times its transpose.
    pub mean_factor: DMatrix<f64>,
    /// Of each trial's own.
    pub own: DMatrix<f64>,
}

/// Motions within their intervals.
#[derive(Debug, Clone)]
pub struct MotionsWithin {
    /// Mean of each trial's motion.
    pub motions: Vec<DVector<f64>>,
    /// Covariance of the mean motion.
    pub mean_covariance: DMatrix<f64>,
    /// For each trial, the change of its motion by a change of the mean motion: less than that, since its own record stays.
    pub of_mean: Vec<DMatrix<f64>>,
    /// For each trial, the covariance of its motion if the mean motion were known.
    pub own: Vec<DMatrix<f64>>,
    /// Natural logarithm of the probability of all intervals.
    pub log_evidence: f64,
}

/// The site of a sample: a normal distribution by its precision, and its mean times the precision.
#[derive(Debug, Clone, Copy)]
struct IntervalSite {
    precision: f64,
    weighted: f64,
}

impl MotionsWithin {
    /// The motions whose samples lie within half a step of `middles`, for each trial; `None` if the sites do not settle.
    pub fn new(covariances: &Covariances, middles: &[DVector<f64>]) -> Option<Self> {
        let site = |middle: &f64| IntervalSite { precision: 12.0, weighted: 12.0 * middle };
        let mut sites: Vec<Vec<IntervalSite>> =
            middles.iter().map(|own| own.iter().map(site).collect()).collect();
        for round in 0..MOST_ROUNDS {
            let damping = DAMPING[2 * round / MOST_ROUNDS];
            let given_sites = given(covariances, &sites)?;
            let renewed = renew(&given_sites, middles, damping, &mut sites);
            if renewed.change < TOLERANCE {
                let log_evidence = given_sites.log_evidence + renewed.log_normaliser;
                return Some(Self { log_evidence, ..given_sites });
            }
        }
        None
    }
}

/// The motions given the sites, with the density of the sites' means as evidence.
fn given(covariances: &Covariances, sites: &[Vec<IntervalSite>]) -> Option<MotionsWithin> {
    let factor_of_mean = &covariances.mean_factor;
    let count = factor_of_mean.nrows();
    let mut log_density = 0.0;
    let mut inverses = Vec::with_capacity(sites.len());
    let mut sum = DMatrix::zeros(count, count);
    let mut pull = DVector::zeros(count);
    for own in sites {
        let mut covariance = covariances.own.clone();
        for (place, site) in own.iter().enumerate() {
            covariance[(place, place)] += 1.0 / site.precision;
        }
        let factor = covariance.cholesky()?;
        let means = DVector::from_iterator(count, own.iter().map(|site| site.weighted / site.precision));
        log_density -= factor.l_dirty().diagonal().iter().map(|own| libm::log(*own)).sum::<f64>();
        let inverse = factor.inverse();
        let pulled = &inverse * &means;
        log_density -= 0.5 * (means.dot(&pulled) + count as f64 * libm::log(std::f64::consts::TAU));
        sum += &inverse;
        pull += pulled;
        inverses.push((inverse, means));
    }
    // By the factor, since the covariance itself is nearly singular.
    let precision = DMatrix::identity(count, count) + factor_of_mean.transpose() * &sum * factor_of_mean;
    let decomposed = precision.cholesky()?;
    log_density -= decomposed.l_dirty().diagonal().iter().map(|own| libm::log(*own)).sum::<f64>();
    let mean_covariance = factor_of_mean * decomposed.solve(&factor_of_mean.transpose());
    let mean = &mean_covariance * &pull;
    log_density += 0.5 * pull.dot(&mean);
    let mut motions = MotionsWithin {
        motions: Vec::new(),
        mean_covariance,
        of_mean: Vec::new(),
        own: Vec::new(),
        log_evidence: log_density,
    };
    for (inverse, means) in &inverses {
        let gain = &covariances.own * inverse;
        motions.motions.push(&mean + &gain * (means - &mean));
        motions.own.push(&covariances.own - &gain * &covariances.own);
        motions.of_mean.push(DMatrix::identity(count, count) - gain);
    }
    log_density.is_finite().then_some(motions)
}

/// What renewing the sites showed.
struct Renewed {
    /// Largest difference between the mean of a sample and its mean within the interval.
    change: f64,
    /// What the intervals have beyond the sites, natural logarithm.
    log_normaliser: f64,
}

/// Makes each site what its interval says beside all others.
fn renew(
    motions: &MotionsWithin,
    middles: &[DVector<f64>],
    damping: f64,
    sites: &mut [Vec<IntervalSite>],
) -> Renewed {
    let mut renewed = Renewed { change: 0.0, log_normaliser: 0.0 };
    for (trial, own) in sites.iter_mut().enumerate() {
        let of_mean = &motions.of_mean[trial];
        let through_mean = of_mean * &motions.mean_covariance;
        for (place, site) in own.iter_mut().enumerate() {
            let by_mean = through_mean.row(place).dot(&of_mean.row(place));
            let variance = (motions.own[trial][(place, place)] + by_mean).max(1e-10);
            let mean = motions.motions[trial][place];
            // All that is known of the sample but its own interval.
            let precision = (1.0 / variance - site.precision).max(1e-7);
            let weighted = mean / variance - site.weighted;
            let middle = middles[trial][place];
            let within =
                TruncatedNormal::new(weighted / precision, 1.0 / precision, (middle - 0.5, middle + 0.5));
            renewed.change = renewed.change.max((within.mean - mean).abs());
            let spread = 1.0 / precision + 1.0 / site.precision;
            let apart = site.weighted / site.precision - weighted / precision;
            renewed.log_normaliser +=
                within.log_mass + 0.5 * (libm::log(std::f64::consts::TAU * spread) + apart * apart / spread);
            let inside = within.variance.max(1e-8);
            let wanted = (1.0 / inside - precision).clamp(PRECISIONS.0, PRECISIONS.1);
            site.precision += damping * (wanted - site.precision);
            site.weighted += damping * (within.mean / inside - weighted - site.weighted);
        }
    }
    renewed
}
