//! Trials of the base model, from step to step.

use super::batch::{Batch, Channels, Run, SampleOutput, recorded, seeded};
use super::integrate::HermiteSegment;
use super::plant::BASE_PARAMETERS;
use super::propagator::{MotorAtSample, MovingWrist, Propagator, part_of_sample};
use super::yield_loss::BaseYield;
use crate::number::{Jet, Number, Plain};

/// The base model, with `ALL` derivatives of which the first `LINEAR_PARAMETERS` are by parameters of its linear part.
#[inline(always)]
pub(super) fn base<P: Plain, const STATES: usize, const LINEAR: usize, const ALL: usize>(
    batch: &Batch,
    output: &mut impl SampleOutput<Jet<P, ALL>>,
) {
    let settings = batch.settings;
    let slots = batch.own_slots();
    let mut parameters = [P::splat(0.0); BASE_PARAMETERS.len()];
    parameters.copy_from_slice(&seeded::<P, P>(batch, &slots));
    let step_s = settings.period_s / settings.substeps as f64;
    let propagator =
        Propagator::<P, BaseYield<P, ALL>, STATES, LINEAR, ALL>::base(settings.lever, &parameters, step_s);
    let mut wrist = MovingWrist::<P, STATES, ALL>::at_rest();
    let has_further = !settings.further.is_empty();
    let channels = if has_further { Channels::All } else { Channels::Torque };
    let mut run = Run::<Jet<P, ALL>>::new(batch, slots, channels);
    let mut from = recorded::<P>(batch, 0);
    while run.sample < run.samples {
        let to = recorded::<P>(batch, run.sample + 1);
        let segment = HermiteSegment::new(from, to, settings.period_s);
        let torque = propagator.torque(&wrist.state, from.lift());
        if has_further {
            let motor = MotorAtSample {
                angle: Jet::lift(from.theta),
                acceleration: Jet::lift(segment.acceleration_at_start()),
            };
            let further = propagator.further_values(&wrist.state, motor, torque, Jet::constant(0.0));
            run.store(batch, output, torque, Some(&further));
        } else {
            run.store(batch, output, torque, None);
        }
        let mut step = 0;
        while step < settings.substeps {
            propagator.step(&mut wrist, &part_of_sample(&segment, step, settings.substeps));
            step += 1;
        }
        from = to;
    }
}
