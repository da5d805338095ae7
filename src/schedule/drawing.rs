//! Draws the order of the trials.

use std::io;

use serde::{Deserialize, Serialize};

use crate::protocol::{Condition, Order, Protocol, ValidProtocol};
use crate::random::Stream;

use super::error::DrawError;
use super::{constrained, williams};

/// One trial of the schedule; also a row of `schedule.csv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScheduledTrial {
    /// Position in the schedule, from 1.
    pub position: u32,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Repetition index of its condition, from 1.
    pub repetition: u32,
}

/// Draws the order of a session's trials.
///
/// The subject's number, from 1, is needed by [`Order::Williams`] only, which in turn needs no seed.
pub fn draw(
    protocol: &ValidProtocol,
    seed: u64,
    subject_number: Option<u32>,
) -> Result<Vec<ScheduledTrial>, DrawError> {
    let conditions = conditions(protocol);
    let repetitions = protocol.repetitions as usize;
    let mut stream = Stream::new(seed, "order");
    let order = match &protocol.order {
        Order::Shuffled => shuffled(conditions.len(), repetitions, &mut stream),
        Order::Blocked => blocked(conditions.len(), repetitions, &mut stream),
        Order::Constrained { max_run } => {
            let design = constrained::ConstrainedDesign {
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

/// The conditions of the familiarisation trials: each condition once in random order, then again until there are enough.
pub fn familiarisation(protocol: &ValidProtocol, seed: u64) -> Vec<Condition> {
    let conditions = conditions(protocol);
    let wanted = protocol.before.familiarisation_trials as usize;
    let mut stream = Stream::new(seed, "familiarisation");
    let mut order = blocked(conditions.len(), wanted.div_ceil(conditions.len()), &mut stream);
    order.truncate(wanted);
    order.into_iter().map(|index| conditions[index]).collect()
}

/// Draws where a rejected trial is repeated: its index among the `remaining` trials, from 0 (next) to `remaining` (last).
///
/// Every index is equally likely. `trial` is the number of the rejected record, so that each rejection has a draw of its
/// own. Constraints on the order hold for the order as drawn, not for repeated trials.
pub fn put_back(seed: u64, trial: u32, remaining: usize) -> usize {
    Stream::new(seed, &format!("put-back/{trial}")).below(remaining as u64 + 1) as usize
}

/// Writes an order as `schedule.csv`.
pub fn write_csv(order: &[ScheduledTrial], out: impl io::Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    for planned in order {
        writer.serialize(planned).map_err(io::Error::from)?;
    }
    writer.flush()
}

/// Every combination of velocity and torque, velocity by velocity.
pub(super) fn conditions(protocol: &Protocol) -> Vec<Condition> {
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

fn numbered(order: impl Iterator<Item = Condition>) -> Vec<ScheduledTrial> {
    let mut planned: Vec<ScheduledTrial> = Vec::new();
    for Condition { velocity_rad_s, torque_nm } in order {
        let same = |earlier: &&ScheduledTrial| {
            (earlier.velocity_rad_s, earlier.torque_nm) == (velocity_rad_s, torque_nm)
        };
        let repetition = 1 + planned.iter().filter(same).count() as u32;
        planned.push(ScheduledTrial {
            position: planned.len() as u32 + 1,
            velocity_rad_s,
            torque_nm,
            repetition,
        });
    }
    planned
}
