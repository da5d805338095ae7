//! NormalEquations equations and their solution by the Levenberg-Marquardt method.

pub mod levenberg_marquardt;
pub mod normal_equations;
