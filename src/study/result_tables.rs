//! The result tables of a study as CSV: one row per test, numbers in full precision.

use crate::fit::QUANTITIES;
use crate::statistics::{AnovaEffect, Contrast, MeanCovariance, anova, holm, reliability};

use super::aggregation::StudySummary;
use super::condition_grid::ConditionGrid;

/// Name of the file with the results of a study.
pub const RESULTS_FILE: &str = "study.json";

/// Format and version of `study.json`.
pub const RESULTS_FORMAT: &str = "ramphold-study-results/1";

/// A table of the results.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultTable {
    /// File name.
    pub name: &'static str,
    /// Contents of the file.
    pub text: String,
}

/// All tables of a study.
#[derive(Debug, Clone)]
pub struct ResultTables {
    /// Analysis of variance of each quantity, in the order of [`QUANTITIES`]; empty with fewer than two subjects.
    pub effects: Vec<Vec<AnovaEffect>>,
    /// The tables as files.
    pub files: Vec<ResultTable>,
}

impl ResultTables {
    /// Computes all tables.
    pub fn of(summary: &StudySummary) -> Self {
        let grid = &summary.grid;
        let effects: Vec<Vec<AnovaEffect>> = summary
            .complete
            .iter()
            .map(|moments| anova(moments, grid.factor_levels()).unwrap_or_default())
            .collect();
        let mut files = vec![
            ResultTable { name: "means.csv", text: means_table(summary) },
            ResultTable { name: "anova.csv", text: anova_table(&effects, &summary.complete) },
            ResultTable { name: "trends.csv", text: trends_table(grid, &summary.complete) },
            ResultTable { name: "contrasts.csv", text: contrasts_table(grid, &summary.complete) },
        ];
        if summary.sessions > 1 {
            files.push(ResultTable { name: "reliability.csv", text: reliability_table(&summary.by_session) });
        }
        Self { effects, files }
    }
}

/// Name of an effect in the tables.
pub fn effect_name(effect: &AnovaEffect) -> &'static str {
    match effect.factors {
        [true, false] => "velocity",
        [false, true] => "torque",
        _ => "velocity x torque",
    }
}

/// A number as a CSV cell; empty if it is not finite.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

fn row(first: &str, numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|value| number(*value)).collect();
    format!("{first},{}\n", numbers.join(","))
}

fn means_table(summary: &StudySummary) -> String {
    let mut text = "quantity,velocity_rad_s,torque_nm,persons,mean,sd\n".to_owned();
    for (name, cells) in QUANTITIES.iter().zip(&summary.cells) {
        for ((velocity, torque), sample) in summary.grid.conditions.iter().zip(cells) {
            let sd = sample.variance().map_or(f64::NAN, f64::sqrt);
            let mean = if sample.count() > 0 { sample.mean() } else { f64::NAN };
            text += &row(name, &[*velocity, *torque, sample.count() as f64, mean, sd]);
        }
    }
    text
}

fn anova_table(effects: &[Vec<AnovaEffect>], moments: &[MeanCovariance]) -> String {
    let mut text = "quantity,effect,persons,f,df_effect,df_error,p,epsilon_gg,p_gg,epsilon_hf,p_hf,mauchly_w,\
                    mauchly_chi_square,mauchly_df,mauchly_p,partial_eta_squared,generalised_eta_squared,ss,ss_error\n"
        .to_owned();
    for ((name, effects), moments) in QUANTITIES.iter().zip(effects).zip(moments) {
        for effect in effects {
            let mauchly =
                effect.mauchly.map_or([f64::NAN; 4], |test| [test.w, test.chi_square, test.df, test.p]);
            let numbers = [
                &[moments.count() as f64, effect.f, effect.df[0], effect.df[1], effect.p][..],
                &[effect.epsilon_gg, effect.p_gg, effect.epsilon_hf, effect.p_hf],
                &mauchly,
                &[effect.partial_eta_squared, effect.generalised_eta_squared, effect.ss, effect.ss_error],
            ]
            .concat();
            text += &row(&format!("{name},{}", effect_name(effect)), &numbers);
        }
    }
    text
}

fn trends_table(grid: &ConditionGrid, moments: &[MeanCovariance]) -> String {
    let mut text =
        "quantity,factor,persons,slope,slope_low,slope_high,t,df,p,intercept,intercept_low,intercept_high,\
                    intercept_p\n"
            .to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        for (factor, (factor_name, _)) in grid.factors().into_iter().enumerate() {
            let Some([slope, intercept]) = grid.trend_weights(factor) else { continue };
            let (Some(slope), Some(intercept)) = (moments.contrast(&slope), moments.contrast(&intercept))
            else {
                continue;
            };
            let with_interval = |contrast: &Contrast| {
                let (low, high) = contrast.interval();
                [contrast.estimate, low, high]
            };
            let numbers = [
                &[moments.count() as f64][..],
                &with_interval(&slope),
                &[slope.t(), slope.df, slope.p()],
                &with_interval(&intercept),
                &[intercept.p()],
            ]
            .concat();
            text += &row(&format!("{name},{factor_name}"), &numbers);
        }
    }
    text
}

fn contrasts_table(grid: &ConditionGrid, moments: &[MeanCovariance]) -> String {
    let mut text = "quantity,factor,level,other_level,persons,difference,low,high,t,df,p,p_holm\n".to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        for (factor, (factor_name, levels)) in grid.factors().into_iter().enumerate() {
            let pairs: Vec<(usize, usize)> =
                (0..levels.len()).flat_map(|a| (a + 1..levels.len()).map(move |b| (a, b))).collect();
            let found: Vec<((usize, usize), Contrast)> = pairs
                .iter()
                .filter_map(|(a, b)| {
                    let sign = |level: usize| f64::from(level == *b) - f64::from(level == *a);
                    Some(((*a, *b), moments.contrast(&grid.weights(factor, sign))?))
                })
                .collect();
            let adjusted = holm(&found.iter().map(|(_, contrast)| contrast.p()).collect::<Vec<f64>>());
            for (((a, b), contrast), p_holm) in found.iter().zip(adjusted) {
                let (low, high) = contrast.interval();
                let difference =
                    [contrast.estimate, low, high, contrast.t(), contrast.df, contrast.p(), p_holm];
                let numbers = [&[levels[*b], levels[*a], moments.count() as f64][..], &difference].concat();
                text += &row(&format!("{name},{factor_name}"), &numbers);
            }
        }
    }
    text
}

fn reliability_table(moments: &[MeanCovariance]) -> String {
    let mut text =
        "quantity,persons,sessions,mean,icc_agreement,icc_consistency,f,p,sem,smallest_detectable_change\n"
            .to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        let Some(found) = reliability(moments) else { continue };
        let numbers = [
            found.subjects as f64,
            found.sessions as f64,
            found.mean,
            found.icc_agreement,
            found.icc_consistency,
            found.f,
            found.p,
            found.sem,
            found.smallest_detectable_change,
        ];
        text += &row(name, &numbers);
    }
    text
}
