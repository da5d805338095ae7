//! The order of the trials, drawn from a seed.
//!
//! The same seed gives the same order on every platform and in every later version: the draws are this crate's own
//! ([`crate::random`]), and the tests hold golden orders.
//!
//! ```
//! use ramphold::{protocol::Protocol, schedule};
//!
//! let protocol = Protocol::parse(include_str!("../../protocols/de-vlugt-2011.json"), "de-vlugt-2011.json")?;
//! let order = schedule::draw(&protocol, 1, None)?;
//! assert_eq!(order.len(), 36);
//! assert_eq!(order, schedule::draw(&protocol, 1, None)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod constrained;
mod williams;

use std::io;

use serde::{Deserialize, Serialize};

use crate::protocol::{Condition, Order, Protocol, ValidProtocol};
use crate::random::Stream;

/// One trial of the order; also a row of `schedule.csv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Planned {
    /// Place in the order, from 1.
    pub position: u32,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Which repetition of its condition, from 1: the how-manieth time it comes.
    pub repetition: u32,
}

/// Why there is no order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Williams squares are rows for subjects.
    #[error(
        "order \"williams\" takes its row from the subject's number, from 1, but there is {}. Give it with \
         --subject-number", .subject_number.map_or("none".to_owned(), |number| number.to_string())
    )]
    NoSubjectNumber {
        /// The number that was given.
        subject_number: Option<u32>,
    },
    /// No order keeps the constraint, or so few do that none was found.
    #[error(
        "order.max_run is {max_run}: among {draws} draws was no order of these {trials} trials with so short runs of \
         torque and velocity; there is none, or too few to be found. Raise order.max_run, or use \"blocked\""
    )]
    RunsTooShort {
        /// The longest run allowed.
        max_run: u32,
        /// How many trials there are to order.
        trials: usize,
        /// How often it was tried.
        draws: u32,
    },
}

/// Draws the order of a session's trials.
///
/// The subject's number, from 1, is needed by [`Order::Williams`] only, which in turn needs no seed.
pub fn draw(
    protocol: &ValidProtocol,
    seed: u64,
    subject_number: Option<u32>,
) -> Result<Vec<Planned>, DrawError> {
    let conditions = conditions(protocol);
    let repetitions = protocol.repetitions as usize;
    let mut stream = Stream::new(seed, "order");
    let order = match &protocol.order {
        Order::Shuffled => shuffled(conditions.len(), repetitions, &mut stream),
        Order::Blocked => blocked(conditions.len(), repetitions, &mut stream),
        Order::Constrained { max_run } => {
            let design = constrained::Design {
                velocities: protocol.velocities_rad_s.len(),
                torques: protocol.torques_nm.len(),
                repetitions,
                max_run: *max_run,
            };
            constrained::draw(&design, &mut stream)?
        }
        Order::Williams => match subject_number {
            Some(number @ 1..) => williams::rows(conditions.len(), number - 1, repetitions),
            _ => return Err(DrawError::NoSubjectNumber { subject_number }),
        },
        Order::Fixed { trials } => return Ok(numbered(trials.iter().copied())),
    };
    Ok(numbered(order.into_iter().map(|index| conditions[index])))
}

/// The conditions of the familiarisation trials: each condition once in random order, and again if that is too few.
pub fn familiarisation(protocol: &ValidProtocol, seed: u64) -> Vec<Condition> {
    let conditions = conditions(protocol);
    let wanted = protocol.before.familiarisation_trials as usize;
    let mut stream = Stream::new(seed, "familiarisation");
    let mut order = blocked(conditions.len(), wanted.div_ceil(conditions.len()), &mut stream);
    order.truncate(wanted);
    order.into_iter().map(|index| conditions[index]).collect()
}

/// Where a rejected trial comes back: before which of the `remaining` trials (0 is next, `remaining` is last), each
/// place as likely as any other.
///
/// `trial` is the number of the rejected record, so that each rejection has a draw of its own. Constraints on the
/// order hold for the order as drawn, not for trials put back.
pub fn put_back(seed: u64, trial: u32, remaining: usize) -> usize {
    Stream::new(seed, &format!("put-back/{trial}")).below(remaining as u64 + 1) as usize
}

/// Writes an order as `schedule.csv`.
pub fn write_csv(order: &[Planned], out: impl io::Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    for planned in order {
        writer.serialize(planned).map_err(io::Error::from)?;
    }
    writer.flush()
}

/// Every combination of velocity and torque, velocity by velocity.
fn conditions(protocol: &Protocol) -> Vec<Condition> {
    let of_velocity = |velocity_rad_s: &f64| {
        let velocity_rad_s = *velocity_rad_s;
        protocol.torques_nm.iter().map(move |torque_nm| Condition { velocity_rad_s, torque_nm: *torque_nm })
    };
    protocol.velocities_rad_s.iter().flat_map(of_velocity).collect()
}

fn shuffled(conditions: usize, repetitions: usize, stream: &mut Stream) -> Vec<usize> {
    let mut order: Vec<usize> = (0..repetitions).flat_map(|_| 0..conditions).collect();
    stream.shuffle(&mut order);
    order
}

fn blocked(conditions: usize, repetitions: usize, stream: &mut Stream) -> Vec<usize> {
    (0..repetitions).flat_map(|_| shuffled(conditions, 1, stream)).collect()
}

fn numbered(order: impl Iterator<Item = Condition>) -> Vec<Planned> {
    let mut planned: Vec<Planned> = Vec::new();
    for Condition { velocity_rad_s, torque_nm } in order {
        let same =
            |earlier: &&Planned| (earlier.velocity_rad_s, earlier.torque_nm) == (velocity_rad_s, torque_nm);
        let repetition = 1 + planned.iter().filter(same).count() as u32;
        planned.push(Planned { position: planned.len() as u32 + 1, velocity_rad_s, torque_nm, repetition });
    }
    planned
}

#[cfg(test)]
mod tests;
