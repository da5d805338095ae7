//! The fitted model: what it predicts, how well its parameters are known, and fits that go on from it.

pub mod block_subproblem;
pub mod fit;
pub mod uncertainty;
