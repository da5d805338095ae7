//! Why a schedule cannot be drawn.

/// Why a schedule cannot be drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// A Williams square gives each subject one of its rows, and the subject has no number.
    #[error(
        "order \"williams\" takes its row from the subject's number, from 1, but there is {}. Give it with \
         --subject-number", .subject_number.map_or("none".to_owned(), |number| number.to_string())
    )]
    NoSubjectNumber {
        /// The number that was given.
        subject_number: Option<u32>,
    },
    /// No order that satisfies the constraint was found.
    #[error(
        "order.max_run is {max_run}: none of {draws} random orders of these {trials} trials has such short runs of \
         torque and velocity. Raise order.max_run, or use order \"blocked\""
    )]
    RunsTooShort {
        /// The longest run allowed.
        max_run: u32,
        /// How many trials there are to order.
        trials: usize,
        /// Number of orders that were drawn.
        draws: u32,
    },
}
