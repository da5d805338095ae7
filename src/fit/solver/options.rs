//! Options of the solver.

/// Limits of an optimisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverOptions {
    /// Largest number of evaluations of the normal equations.
    pub max_iterations: usize,
    /// Decrease of the cost, relative to the cost, below which another step is not worth its time.
    pub tolerance: f64,
    /// Largest step of a logarithmic coordinate.
    pub max_log_step: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { max_iterations: 100, tolerance: 1e-6, max_log_step: 0.7 }
    }
}
