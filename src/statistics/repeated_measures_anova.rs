//! Repeated-measures analysis of variance with two factors within subjects.
//!
//! Everything follows from the means and the covariance of the cells: with orthonormal contrasts C of an effect with d degrees
//! of freedom and n subjects, SS = n |C'm|^2 and SS_error = (n-1) tr(C'SC) (Winer 1971). The covariance of the contrasts,
//! C'SC, also gives the sphericity corrections and Mauchly's test.

use nalgebra::{DMatrix, DVector};

use super::distribution::{chi_square_tail, f_tail};
use super::moments::{MeanCovariance, ROUNDING_OF_SQUARES};

/// Numbers of levels of the two factors. A subject's cells are ordered by the first factor, then by the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FactorLevels {
    /// Number of levels of the first factor.
    pub first: usize,
    /// Number of levels of the second factor.
    pub second: usize,
}

/// A main effect or the interaction: one line of the analysis-of-variance table.
#[derive(Debug, Clone, PartialEq)]
pub struct AnovaEffect {
    /// Whether the first and the second factor take part; both do in the interaction.
    pub factors: [bool; 2],
    /// F ratio of the effect to its error.
    pub f: f64,
    /// Degrees of freedom of the effect and of its error.
    pub df: [f64; 2],
    /// p-value without correction, valid if the covariances are spherical.
    pub p: f64,
    /// Greenhouse and Geisser's epsilon, the estimated departure from sphericity (1: none).
    pub epsilon_gg: f64,
    /// p-value with both degrees of freedom multiplied by `epsilon_gg`.
    pub p_gg: f64,
    /// Huynh and Feldt's epsilon, at most 1.
    pub epsilon_hf: f64,
    /// p-value with both degrees of freedom multiplied by `epsilon_hf`.
    pub p_hf: f64,
    /// Mauchly's test of sphericity; `None` with one degree of freedom (always spherical) or too few subjects.
    pub mauchly: Option<Mauchly>,
    /// Sum of squares of the effect.
    pub ss: f64,
    /// Sum of squares of the error of the effect.
    pub ss_error: f64,
    /// SS / (SS + SS_error).
    pub partial_eta_squared: f64,
    /// SS / (SS + all sums of squares between subjects) (Olejnik and Algina 2003).
    pub generalised_eta_squared: f64,
}

/// Mauchly's test of sphericity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mauchly {
    /// Mauchly's W: 1 if the covariances are spherical, smaller the less they are.
    pub w: f64,
    /// Test statistic, approximately chi-square distributed.
    pub chi_square: f64,
    /// Degrees of freedom of `chi_square`.
    pub df: f64,
    /// p-value, with the second term of Box's expansion (Anderson 2003).
    pub p: f64,
}

/// The effects of both factors and of their interaction. A factor with one level has no effect, and a quantity that is equal in
/// all cells has none. `None` with fewer than two subjects.
pub fn anova(moments: &MeanCovariance, levels: FactorLevels) -> Option<Vec<AnovaEffect>> {
    let covariance = moments.covariance()?;
    let (first, second) = (Contrasts::of(levels.first), Contrasts::of(levels.second));
    let all = [
        ([true, false], first.differences.kronecker(&second.average)),
        ([false, true], first.average.kronecker(&second.differences)),
        ([true, true], first.differences.kronecker(&second.differences)),
    ];
    let subjects = moments.count() as f64;
    let level = first.average.kronecker(&second.average);
    // Sum of squares between subjects; the error of each effect is added below.
    let mut residual = (subjects - 1.0) * (level.transpose() * &covariance * &level).trace();
    let mut effects = Vec::new();
    for (factors, contrasts) in all {
        if contrasts.ncols() == 0 {
            continue;
        }
        let effect =
            effect(factors, moments, &(contrasts.transpose() * &covariance * &contrasts), &contrasts);
        // A quantity that is equal in all cells of each subject differs by rounding alone: no effect.
        if effect.ss + effect.ss_error <= ROUNDING_OF_SQUARES * subjects * moments.mean().norm_squared() {
            continue;
        }
        residual += effect.ss_error;
        effects.push(effect);
    }
    for effect in &mut effects {
        effect.generalised_eta_squared = effect.ss / (effect.ss + residual);
    }
    Some(effects)
}

/// Orthonormal contrasts over the levels of a factor.
struct Contrasts {
    /// Mean over the levels, scaled to unit length.
    average: DMatrix<f64>,
    /// Helmert contrasts: each level against the mean of the levels before it.
    differences: DMatrix<f64>,
}

impl Contrasts {
    fn of(levels: usize) -> Self {
        let average = DMatrix::from_element(levels, 1, 1.0 / (levels as f64).sqrt());
        let differences = DMatrix::from_fn(levels, levels.saturating_sub(1), |level, column| {
            let before = column as f64 + 1.0;
            let length = (before * (before + 1.0)).sqrt();
            match level.cmp(&(column + 1)) {
                std::cmp::Ordering::Less => -1.0 / length,
                std::cmp::Ordering::Equal => before / length,
                std::cmp::Ordering::Greater => 0.0,
            }
        });
        Self { average, differences }
    }
}

fn effect(
    factors: [bool; 2],
    moments: &MeanCovariance,
    spread: &DMatrix<f64>,
    contrasts: &DMatrix<f64>,
) -> AnovaEffect {
    let subjects = moments.count() as f64;
    let d = contrasts.ncols() as f64;
    let means: DVector<f64> = contrasts.transpose() * moments.mean();
    let ss = subjects * means.norm_squared();
    let ss_error = (subjects - 1.0) * spread.trace();
    let df = [d, d * (subjects - 1.0)];
    let f = (ss / df[0]) / (ss_error / df[1]);
    let trace = spread.trace();
    let epsilon_gg = trace * trace / (d * spread.norm_squared());
    // Huynh and Feldt 1976, for one group.
    let numerator = subjects * d * epsilon_gg - 2.0;
    let epsilon_hf = (numerator / (d * (subjects - 1.0 - d * epsilon_gg))).clamp(epsilon_gg.min(1.0), 1.0);
    // With too few subjects the denominator is negative and epsilon is not defined: no correction then.
    let epsilon_hf = if subjects - 1.0 > d * epsilon_gg { epsilon_hf } else { 1.0 };
    let corrected = |epsilon: f64| f_tail(f, [epsilon * df[0], epsilon * df[1]]);
    AnovaEffect {
        factors,
        f,
        df,
        p: f_tail(f, df),
        epsilon_gg,
        p_gg: corrected(epsilon_gg),
        epsilon_hf,
        p_hf: corrected(epsilon_hf),
        mauchly: mauchly(spread, subjects - 1.0),
        ss,
        ss_error,
        partial_eta_squared: ss / (ss + ss_error),
        generalised_eta_squared: f64::NAN,
    }
}

/// Mauchly's (1940) test of the covariance `spread` of the contrasts, with the p-value of Anderson (2003, section 10.7.4). R's `mauchly.test` has the number of conditions for d in one
/// place of the second term, which changes the fourth digit.
fn mauchly(spread: &DMatrix<f64>, df: f64) -> Option<Mauchly> {
    let d = spread.ncols() as f64;
    if d < 2.0 || df < d {
        return None;
    }
    let roots = spread.clone().symmetric_eigenvalues();
    if roots.iter().any(|root| *root <= 0.0) {
        return None;
    }
    let log_w = roots.iter().map(|root| root.ln()).sum::<f64>() - d * (roots.sum() / d).ln();
    let rho = 1.0 - (2.0 * d * d + d + 2.0) / (6.0 * d * df);
    let second = (d + 2.0) * (d - 1.0) * (d - 2.0) * (2.0 * d.powi(3) + 6.0 * d * d + 3.0 * d + 2.0)
        / (288.0 * (df * d * rho).powi(2));
    let chi_square = -df * rho * log_w;
    let own_df = d * (d + 1.0) / 2.0 - 1.0;
    let tail = chi_square_tail(chi_square, own_df);
    let p = tail + second * (chi_square_tail(chi_square, own_df + 4.0) - tail);
    Some(Mauchly { w: log_w.exp(), chi_square, df: own_df, p: p.clamp(0.0, 1.0) })
}
