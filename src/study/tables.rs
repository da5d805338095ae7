//! The tables of a study as CSV: a row a test, every number with as many digits as it has.

use crate::fit::QUANTITIES;
use crate::statistics::{Contrast, Design, Effect, Moments, anova, holm, reliability};

use super::aggregation::Gathered;

/// Format of `study.json`.
pub const RESULTS_FORMAT: &str = "ramphold-study-results/1";

/// The conditions of a study: every velocity with every torque.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Velocities, rad/s, rising.
    pub velocities_rad_s: Vec<f64>,
    /// Torques, N m, rising.
    pub torques_nm: Vec<f64>,
    /// The cells: velocity by velocity.
    pub conditions: Vec<(f64, f64)>,
}

/// A file of the results.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Its name.
    pub name: &'static str,
    /// What it says.
    pub text: String,
}

/// All tables of a study.
#[derive(Debug, Clone)]
pub struct Tables {
    /// The analysis of variance of each quantity, in the order of [`QUANTITIES`]; none with fewer than two persons.
    pub effects: Vec<Vec<Effect>>,
    /// The files.
    pub files: Vec<Table>,
}

impl Layout {
    /// Whatever velocities and torques there are among the conditions, each with each.
    pub fn of(conditions: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut velocities_rad_s, mut torques_nm): (Vec<f64>, Vec<f64>) = conditions.unzip();
        for levels in [&mut velocities_rad_s, &mut torques_nm] {
            levels.sort_by(f64::total_cmp);
            levels.dedup();
        }
        let with =
            |velocity: &f64| torques_nm.iter().map(move |torque| (*velocity, *torque)).collect::<Vec<_>>();
        let conditions = velocities_rad_s.iter().flat_map(with).collect();
        Self { velocities_rad_s, torques_nm, conditions }
    }

    /// The cells for the analysis of variance.
    pub fn design(&self) -> Design {
        Design { first: self.velocities_rad_s.len(), second: self.torques_nm.len() }
    }

    /// Both factors: name and levels.
    fn factors(&self) -> [(&'static str, &[f64]); 2] {
        [("velocity_rad_s", &self.velocities_rad_s), ("torque_nm", &self.torques_nm)]
    }

    /// Weights of the cells for a weighted sum over the levels of a factor, averaged over the other one.
    fn weights(&self, factor: usize, of_level: impl Fn(usize) -> f64) -> Vec<f64> {
        let other = self.factors()[1 - factor].1.len() as f64;
        let per_velocity = self.torques_nm.len();
        let level = |cell: usize| if factor == 0 { cell / per_velocity } else { cell % per_velocity };
        (0..self.conditions.len()).map(|cell| of_level(level(cell)) / other).collect()
    }

    /// Slope and intercept over the levels of a factor, averaged over the other one: weights for each, or none for one level.
    pub fn trend(&self, factor: usize) -> Option<[Vec<f64>; 2]> {
        let levels = self.factors()[factor].1;
        let mean = levels.iter().sum::<f64>() / levels.len() as f64;
        let squares = levels.iter().map(|level| (level - mean) * (level - mean)).sum::<f64>();
        if levels.len() < 2 {
            return None;
        }
        let slope = |level: usize| (levels[level] - mean) / squares;
        let intercept = |level: usize| 1.0 / levels.len() as f64 - mean * slope(level);
        Some([self.weights(factor, slope), self.weights(factor, intercept)])
    }
}

impl Tables {
    /// Computes all of them.
    pub fn of(gathered: &Gathered) -> Self {
        let layout = &gathered.layout;
        let effects: Vec<Vec<Effect>> = gathered
            .complete
            .iter()
            .map(|moments| anova(moments, layout.design()).unwrap_or_default())
            .collect();
        let mut files = vec![
            Table { name: "means.csv", text: means(gathered) },
            Table { name: "anova.csv", text: analysis(&effects, &gathered.complete) },
            Table { name: "trends.csv", text: trends(layout, &gathered.complete) },
            Table { name: "contrasts.csv", text: contrasts(layout, &gathered.complete) },
        ];
        if gathered.sessions > 1 {
            files.push(Table { name: "reliability.csv", text: of_sessions(&gathered.by_session) });
        }
        Self { effects, files }
    }
}

/// What an effect is called in the tables.
pub fn effect_name(effect: &Effect) -> &'static str {
    match effect.factors {
        [true, false] => "velocity",
        [false, true] => "torque",
        _ => "velocity x torque",
    }
}

/// A cell: empty where there is no number.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

fn row(first: &str, numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|value| number(*value)).collect();
    format!("{first},{}\n", numbers.join(","))
}

fn means(gathered: &Gathered) -> String {
    let mut text = "quantity,velocity_rad_s,torque_nm,persons,mean,sd\n".to_owned();
    for (name, cells) in QUANTITIES.iter().zip(&gathered.cells) {
        for ((velocity, torque), sample) in gathered.layout.conditions.iter().zip(cells) {
            let sd = sample.variance().map_or(f64::NAN, f64::sqrt);
            let mean = if sample.count() > 0 { sample.mean() } else { f64::NAN };
            text += &row(name, &[*velocity, *torque, sample.count() as f64, mean, sd]);
        }
    }
    text
}

fn analysis(effects: &[Vec<Effect>], moments: &[Moments]) -> String {
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

fn trends(layout: &Layout, moments: &[Moments]) -> String {
    let mut text =
        "quantity,factor,persons,slope,slope_low,slope_high,t,df,p,intercept,intercept_low,intercept_high,\
                    intercept_p\n"
            .to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        for (factor, (factor_name, _)) in layout.factors().into_iter().enumerate() {
            let Some([slope, intercept]) = layout.trend(factor) else { continue };
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

fn contrasts(layout: &Layout, moments: &[Moments]) -> String {
    let mut text = "quantity,factor,level,other_level,persons,difference,low,high,t,df,p,p_holm\n".to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        for (factor, (factor_name, levels)) in layout.factors().into_iter().enumerate() {
            let pairs: Vec<(usize, usize)> =
                (0..levels.len()).flat_map(|a| (a + 1..levels.len()).map(move |b| (a, b))).collect();
            let found: Vec<Contrast> = pairs
                .iter()
                .filter_map(|(a, b)| {
                    let sign = |level: usize| f64::from(level == *b) - f64::from(level == *a);
                    moments.contrast(&layout.weights(factor, sign))
                })
                .collect();
            let adjusted = holm(&found.iter().map(Contrast::p).collect::<Vec<f64>>());
            for (((a, b), contrast), p_holm) in pairs.iter().zip(&found).zip(adjusted) {
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

fn of_sessions(moments: &[Moments]) -> String {
    let mut text =
        "quantity,persons,sessions,mean,icc_agreement,icc_consistency,f,p,sem,smallest_detectable_change\n"
            .to_owned();
    for (name, moments) in QUANTITIES.iter().zip(moments) {
        let Some(found) = reliability(moments) else { continue };
        let numbers = [
            found.persons as f64,
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
