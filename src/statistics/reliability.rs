//! Test-retest reliability over repeated sessions of the same subjects.

use super::distribution::f_tail;
use super::moments::MeanCovariance;

/// Test-retest reliability of a quantity (Shrout and Fleiss 1979; McGraw and Wong 1996).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reliability {
    /// Number of subjects.
    pub subjects: usize,
    /// Number of sessions of each subject.
    pub sessions: usize,
    /// Mean over subjects and sessions, in the unit of the quantity.
    pub mean: f64,
    /// ICC(A,1), the absolute agreement of single sessions: ICC2 of Shrout and Fleiss.
    pub icc_agreement: f64,
    /// ICC(C,1), the consistency of single sessions, from which changes common to all subjects are removed: ICC3.
    pub icc_consistency: f64,
    /// F ratio of the variance between subjects to the error.
    pub f: f64,
    /// p-value of the hypothesis that the subjects do not differ.
    pub p: f64,
    /// Standard error of measurement: random error of one session's value, in the unit of the quantity.
    pub sem: f64,
    /// Smallest change of a subject that is detectable with 95 % confidence: 1.96 sqrt(2) SEM.
    pub smallest_detectable_change: f64,
}

/// Reliability from the means and covariance of subjects whose cells are their sessions. `None` with fewer than two subjects or
/// sessions.
pub fn reliability(moments: &MeanCovariance) -> Option<Reliability> {
    let (subjects, sessions) = (moments.count(), moments.cells());
    let covariance = moments.covariance()?;
    if sessions < 2 {
        return None;
    }
    let (n, k) = (subjects as f64, sessions as f64);
    let mean = moments.mean().mean();
    let everything = covariance.sum();
    // Mean squares of subjects, sessions and error in the two-way layout.
    let ms_subjects = everything / k;
    let ms_sessions = n * moments.mean().iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (k - 1.0);
    let ms_error = ((covariance.trace() - everything / k) / (k - 1.0)).max(0.0);
    let sem = ms_error.sqrt();
    let f = ms_subjects / ms_error;
    Some(Reliability {
        subjects,
        sessions,
        mean,
        icc_agreement: (ms_subjects - ms_error)
            / (ms_subjects + (k - 1.0) * ms_error + k * (ms_sessions - ms_error) / n),
        icc_consistency: (ms_subjects - ms_error) / (ms_subjects + (k - 1.0) * ms_error),
        f,
        p: f_tail(f, [n - 1.0, (n - 1.0) * (k - 1.0)]),
        sem,
        smallest_detectable_change: 1.96 * std::f64::consts::SQRT_2 * sem,
    })
}
