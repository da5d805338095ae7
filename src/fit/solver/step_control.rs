//! Step control: the damping factor and the largest step of one block.
//!
//! Except for the border, the blocks of a component are independent problems. Each has its own step control, so that only the trial
//! whose cost deviates from the quadratic model takes shorter steps.

use super::options::SolverOptions;

/// Step control of one block, or of the border.
#[derive(Debug, Clone, Copy)]
pub struct StepControl {
    /// Levenberg-Marquardt damping factor, relative to the diagonal of the Gauss-Newton matrix.
    pub damping: f64,
    /// Factor by which the damping grows after the next failed step.
    growth: f64,
    /// Largest step of logarithmic coordinates.
    pub max_log_step: f64,
}

impl StepControl {
    /// Step control at the start of an optimisation.
    pub fn new(options: SolverOptions) -> Self {
        Self { damping: 1e-2, growth: 2.0, max_log_step: options.max_log_step }
    }

    /// Adapts to a step whose actual decrease of the cost was `gain_ratio` times the predicted decrease (Nielsen's rule).
    pub fn after_success(&mut self, gain_ratio: f64, options: SolverOptions) {
        let excess = 2.0 * gain_ratio - 1.0;
        self.damping = (self.damping * (1.0 - excess * excess * excess).clamp(0.1, 2.0)).max(1e-12);
        self.growth = 2.0;
        if gain_ratio > 0.75 {
            self.max_log_step = (2.0 * self.max_log_step).min(4.0 * options.max_log_step);
        }
    }

    /// Adapts to a step for which hardly any decrease was predicted.
    pub fn after_negligible_step(&mut self) {
        (self.damping, self.growth) = ((0.3 * self.damping).max(1e-12), 2.0);
    }

    /// Adapts to a step that increased the cost, or decreased it far less than predicted.
    pub fn after_failure(&mut self, options: SolverOptions) {
        self.damping *= self.growth;
        self.growth *= 2.0;
        self.max_log_step = (0.5 * self.max_log_step).min(options.max_log_step);
    }
}
