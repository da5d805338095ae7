//! The solver: Gauss-Newton normal equations, and their solution by the Levenberg-Marquardt method.

pub mod arrowhead;
pub mod levenberg_marquardt;
pub mod normal_equations;
pub mod options;
pub mod step_control;
