//! Test-retest reliability over repeated sessions of the same persons.

use super::distribution::f_tail;
use super::moments::Moments;

/// How well a value tells persons apart from session to session (Shrout and Fleiss 1979; McGraw and Wong 1996).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reliability {
    /// Persons.
    pub persons: usize,
    /// Sessions of each.
    pub sessions: usize,
    /// Mean over persons and sessions.
    pub mean: f64,
    /// ICC(A,1), the absolute agreement of single sessions: ICC2 of Shrout and Fleiss.
    pub icc_agreement: f64,
    /// ICC(C,1), their consistency, whatever all persons change by: ICC3.
    pub icc_consistency: f64,
    /// Whether persons differ at all: F and p of the consistency.
    pub f: f64,
    /// See `f`.
    pub p: f64,
    /// Standard error of measurement: what one session's value is off by, in its unit (without what all persons change by).
    pub sem: f64,
    /// Smallest change of a person that is detectable with 95 % confidence: 1.96 sqrt(2) SEM.
    pub smallest_detectable_change: f64,
}

/// From the moments of persons whose cells are their sessions. `None` with fewer than two persons or sessions.
pub fn reliability(moments: &Moments) -> Option<Reliability> {
    let (persons, sessions) = (moments.count(), moments.cells());
    let covariance = moments.covariance()?;
    if sessions < 2 {
        return None;
    }
    let (n, k) = (persons as f64, sessions as f64);
    let mean = moments.mean().mean();
    let everything = covariance.sum();
    // Mean squares of persons, of sessions, and of the rest, of the two-way layout.
    let of_persons = everything / k;
    let of_sessions = n * moments.mean().iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (k - 1.0);
    let of_error = ((covariance.trace() - everything / k) / (k - 1.0)).max(0.0);
    let sem = of_error.sqrt();
    let f = of_persons / of_error;
    Some(Reliability {
        persons,
        sessions,
        mean,
        icc_agreement: (of_persons - of_error)
            / (of_persons + (k - 1.0) * of_error + k * (of_sessions - of_error) / n),
        icc_consistency: (of_persons - of_error) / (of_persons + (k - 1.0) * of_error),
        f,
        p: f_tail(f, [n - 1.0, (n - 1.0) * (k - 1.0)]),
        sem,
        smallest_detectable_change: 1.96 * std::f64::consts::SQRT_2 * sem,
    })
}
