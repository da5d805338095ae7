//! The wrist's parameters out of the recorded torque, and how well they are known.

mod guess;
mod layout;
mod model;
mod normal;
mod prepare;
mod solve;

pub use guess::Guess;
pub use layout::{Component, Coordinate, Layout, Link};
pub use model::{FORMAT as MODEL_FORMAT, Model, ModelError, Scope, Switched, Term, Treatment};
pub use normal::{Normal, Objective};
pub use prepare::{LeftOut, PrepareError, Prepared, PreparedTrial, View};
pub use solve::{Effort, Outcome, Solution, Stop, solve};
