//! The rig trials of a protocol, told in a line.

use crate::protocol::{MOUNTING_S, Protocol, minutes};

/// How many rig trials a protocol has, how many loads are mounted for them, and how long they take; `None` without any.
pub fn rig_trials_text(protocol: &Protocol) -> Option<String> {
    let plan = protocol.rig_plan();
    if plan.is_empty() {
        return None;
    }
    let changes = plan.windows(2).filter(|pair| pair[0].load != pair[1].load).count();
    Some(format!(
        "{}, with {} loads to mount, about {} ({MOUNTING_S} s for each load)",
        plan.len(),
        changes + 1,
        minutes(protocol.rig_trials_s())
    ))
}
