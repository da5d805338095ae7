//! Version numbers of the rules by which the session decides, so that a replay of an older session can say which rule has
//! changed.

/// The number of the rules in force. It goes up with every change that can make an old record come out differently.
pub const RULES: u32 = 3;

/// A change of the rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RuleChange {
    /// The rules that it led to.
    pub rules: u32,
    /// What is different since.
    pub text: &'static str,
}

/// Every change, the oldest first.
pub const CHANGES: &[RuleChange] = &[
    RuleChange {
        rules: 2,
        text: "the smoothing of torque and EMG begins anew with every trial, effort and offset, and a record keeps the \
               sample that ended it",
    },
    RuleChange {
        rules: 3,
        text: "a trial whose ramp lost periods, or whose measured velocity is not the asked one, is rejected",
    },
];

/// What has changed since the rules of a record.
pub fn changes_since(rules: u32) -> impl Iterator<Item = &'static RuleChange> {
    CHANGES.iter().filter(move |change| change.rules > rules)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_of_the_rules_is_told_once_and_in_order() {
        let numbers: Vec<u32> = CHANGES.iter().map(|change| change.rules).collect();
        assert_eq!(numbers, (2..=RULES).collect::<Vec<_>>());
        assert_eq!(changes_since(RULES).count(), 0);
        assert_eq!(changes_since(1).count(), CHANGES.len());
    }
}
