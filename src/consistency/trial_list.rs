//! Trials in a message: some of their numbers.

/// Numbers that are listed; the others are counted.
const LISTED: usize = 6;

/// `trial 7`, or `trials 1, 2, 3 and 21 more`.
pub fn trial_list(trials: &[u32]) -> String {
    let some: Vec<String> = trials.iter().take(LISTED).map(u32::to_string).collect();
    match trials.len() {
        1 => format!("trial {}", some[0]),
        count if count > LISTED => format!("trials {} and {} more", some.join(", "), count - LISTED),
        _ => format!("trials {}", some.join(", ")),
    }
}
