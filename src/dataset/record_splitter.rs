//! Splits the samples of a session into records: which record a sample belongs to, and when a record begins and ends.

use crate::session::RecordTarget;

/// Follows the record that is open while a session runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RecordSplitter {
    open: RecordTarget,
}

/// What a step means for the open record and the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Split {
    /// The record that was open; the sample belongs to it, also if it ends the record.
    pub open: RecordTarget,
    /// Whether the open record ends with this sample.
    pub ends: bool,
    /// The record that begins with this sample, if one does.
    pub begins: Option<RecordTarget>,
}

impl RecordSplitter {
    /// No record is open.
    pub fn new() -> Self {
        Self { open: RecordTarget::None }
    }

    /// Takes the next step, whose sample belongs to `target` by the phase after the step.
    pub fn split(&mut self, target: RecordTarget) -> Split {
        let open = std::mem::replace(&mut self.open, target);
        let changes = open != target;
        Split {
            open,
            // The sample that ends a record belongs to it: a replay needs it to find the same end.
            ends: changes && open != RecordTarget::None,
            begins: (changes && target != RecordTarget::None).then_some(target),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sample_that_ends_a_record_belongs_to_it_and_one_that_begins_a_record_to_the_new_one() {
        let mut splitter = RecordSplitter::new();
        let targets =
            [RecordTarget::None, RecordTarget::Effort(1), RecordTarget::Effort(1), RecordTarget::Trial];
        let splits = targets.map(|target| splitter.split(target));
        let split = |open, ends, begins| Split { open, ends, begins };
        assert_eq!(
            splits,
            [
                split(RecordTarget::None, false, None),
                split(RecordTarget::None, false, Some(RecordTarget::Effort(1))),
                split(RecordTarget::Effort(1), false, None),
                split(RecordTarget::Effort(1), true, Some(RecordTarget::Trial)),
            ]
        );
        assert_eq!(splitter.split(RecordTarget::None), split(RecordTarget::Trial, true, None));
    }
}
