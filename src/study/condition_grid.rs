//! The grid of conditions of a study and the weights of its contrasts.

use crate::statistics::FactorLevels;

/// The conditions of a study: every velocity combined with every torque.
#[derive(Debug, Clone, PartialEq)]
pub struct ConditionGrid {
    /// Velocities, rad/s, ascending.
    pub velocities_rad_s: Vec<f64>,
    /// Torques, N m, ascending.
    pub torques_nm: Vec<f64>,
    /// The cells as (velocity, rad/s; torque, N m): all torques of the first velocity, then of the next.
    pub conditions: Vec<(f64, f64)>,
}

impl ConditionGrid {
    /// The grid of all velocities and all torques that occur in `conditions`.
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

    /// Numbers of levels of velocity and torque, for the analysis of variance.
    pub fn factor_levels(&self) -> FactorLevels {
        FactorLevels { first: self.velocities_rad_s.len(), second: self.torques_nm.len() }
    }

    /// Name and levels of both factors: velocity (0) and torque (1).
    pub(super) fn factors(&self) -> [(&'static str, &[f64]); 2] {
        [("velocity_rad_s", &self.velocities_rad_s), ("torque_nm", &self.torques_nm)]
    }

    /// Weights of the cells for a weighted sum over the levels of a factor, averaged over the other factor.
    pub(super) fn weights(&self, factor: usize, of_level: impl Fn(usize) -> f64) -> Vec<f64> {
        let other = self.factors()[1 - factor].1.len() as f64;
        let per_velocity = self.torques_nm.len();
        let level = |cell: usize| if factor == 0 { cell / per_velocity } else { cell % per_velocity };
        (0..self.conditions.len()).map(|cell| of_level(level(cell)) / other).collect()
    }

    /// Weights of the cells for the mean at one level of a factor, velocity (0) or torque (1), over the levels of the other.
    pub fn level_weights(&self, factor: usize, level: usize) -> Vec<f64> {
        self.weights(factor, |own| f64::from(u8::from(own == level)))
    }

    /// Weights of the cells for slope and intercept of the regression on a factor, averaged over the other factor. `None` if the factor
    /// has one level.
    pub fn trend_weights(&self, factor: usize) -> Option<[Vec<f64>; 2]> {
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
