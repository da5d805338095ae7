//! The trials of a protocol and how long they take, told in lines.

use crate::protocol::{MOUNTING_S, Order, Protocol, ValidProtocol, minutes};

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

/// How many trials a protocol has, of which conditions and in which order.
pub fn trials_text(protocol: &ValidProtocol) -> String {
    let order = match &protocol.order {
        Order::Shuffled => "shuffled".to_owned(),
        Order::Blocked => "blocked".to_owned(),
        Order::Constrained { max_run } => format!("constrained to runs of at most {max_run}"),
        Order::Williams => "Williams square".to_owned(),
        Order::Fixed { .. } => "fixed".to_owned(),
    };
    let before = match protocol.before.familiarisation_trials {
        0 => String::new(),
        count => format!("; before them {count} familiarisation trials"),
    };
    format!(
        "{} ({} velocities x {} torques x {} repetitions, {order}){before}",
        protocol.trial_count(),
        protocol.velocities_rad_s.len(),
        protocol.torques_nm.len(),
        protocol.repetitions
    )
}

/// How long a session of a protocol takes.
pub fn duration_text(protocol: &ValidProtocol) -> String {
    let duration = protocol.duration();
    format!(
        "{} ({} if every gate opens at once, {} if each takes its timeout)",
        minutes(duration.expected_s),
        minutes(duration.shortest_s),
        minutes(duration.longest_s)
    )
}
