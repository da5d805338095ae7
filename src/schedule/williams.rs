//! Williams' Latin squares: every condition follows every other equally often (Williams 1949).

/// The order of a subject: for each repetition a row of the square, `subject` counting from 0.
///
/// Over as many subjects as the square has rows (the number of conditions if it is even, twice that if odd), each
/// condition comes equally often at each place of a repetition, and directly after each other condition within it.
/// The next repetition takes the next row, and the same row again in squares so small (2 and 3 conditions) that the
/// next would begin with the condition that has just been.
pub(super) fn rows(conditions: usize, subject: u32, repetitions: usize) -> Vec<usize> {
    let step = if conditions <= 3 { 0 } else { 1 };
    (0..repetitions).flat_map(|repetition| row(conditions, subject as usize, repetition * step)).collect()
}

/// Row `subject` of the square, `shift` rows further on. Rows beyond the square of an odd number of conditions run
/// backwards through a second one.
fn row(conditions: usize, subject: usize, shift: usize) -> Vec<usize> {
    let backwards = conditions % 2 == 1 && (subject / conditions) % 2 == 1;
    let start = (subject % conditions + shift) % conditions;
    let mut row: Vec<usize> = zigzag(conditions).map(|place| (start + place) % conditions).collect();
    if backwards {
        row.reverse();
    }
    row
}

/// 0, 1, n-1, 2, n-2, ...: the differences of neighbours are all different, which balances the carry-over.
fn zigzag(conditions: usize) -> impl Iterator<Item = usize> {
    (0..conditions).map(move |place| {
        if place % 2 == 1 { place.div_ceil(2) } else { (conditions - place / 2) % conditions }
    })
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    fn square(conditions: usize, repetition: usize) -> Vec<Vec<usize>> {
        let rows = if conditions.is_multiple_of(2) { conditions } else { 2 * conditions };
        let of_subject = |subject| self::rows(conditions, subject as u32, repetition + 1);
        (0..rows).map(|subject| of_subject(subject)[repetition * conditions..].to_vec()).collect()
    }

    #[test]
    fn every_condition_follows_every_other_equally_often() {
        for conditions in 2..=13 {
            for repetition in 0..3 {
                let mut followed: HashMap<(usize, usize), usize> = HashMap::new();
                for row in square(conditions, repetition) {
                    for pair in row.windows(2) {
                        *followed.entry((pair[0], pair[1])).or_default() += 1;
                    }
                }
                let expected = if conditions.is_multiple_of(2) { 1 } else { 2 };
                assert_eq!(followed.len(), conditions * (conditions - 1), "{conditions} conditions");
                assert!(followed.values().all(|count| *count == expected), "{conditions}: {followed:?}");
            }
        }
    }

    #[test]
    fn every_condition_comes_equally_often_at_every_place() {
        for conditions in 1..=13 {
            let square = square(conditions, 1);
            for place in 0..conditions {
                for condition in 0..conditions {
                    let count = square.iter().filter(|row| row[place] == condition).count();
                    assert_eq!(count * conditions, square.len(), "{condition} of {conditions} at {place}");
                }
            }
        }
    }

    #[test]
    fn no_repetition_begins_with_the_condition_that_has_just_been() {
        for conditions in 2..=13 {
            for subject in 0..2 * conditions as u32 {
                let order = rows(conditions, subject, 4);
                assert!(
                    order.windows(2).all(|pair| pair[0] != pair[1]),
                    "{conditions}, {subject}: {order:?}"
                );
            }
        }
    }
}
