//! What a row of a Parquet table is.

/// What a row of a Parquet table is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rows {
    /// A sample of a trial.
    Samples,
    /// A trial, with its fit where there is one.
    Trials,
}
