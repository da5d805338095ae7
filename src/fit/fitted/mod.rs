//! The fitted model: its parameters, what it predicts, how well its parameters are known, and fits that start from it.

pub mod block_subproblem;
pub mod fit;
pub mod predictions;
pub mod quantities;
pub mod uncertainty;
pub mod warm_start;
