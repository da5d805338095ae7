//! Tests of the friction of the handle's bearing: what is taken out of torque and motion is what an integration with friction has put in.

use super::*;
use crate::wrist::{
    AddedDynamics, Context, HermiteSegment, Integrator, Kinematics, Mechanics, Plant, Torques,
};

const FRICTION_NM: f64 = 0.05;

/// A friction that has its full torque at a thousandth of the slowest ramp, or builds up over a travel, and may grow with speed.
struct Rubbing {
    law: FrictionLaw,
    velocity_rad_s: f64,
}

impl AddedDynamics<f64> for Rubbing {
    const ACTIVE: bool = true;

    fn state_count(&self) -> usize {
        1
    }

    fn add_torques(
        &self,
        context: &Context<'_, f64>,
        states: &[f64],
        torques: &mut Torques<f64>,
        rates: &mut [f64],
    ) {
        let FrictionLaw { presliding_part, presliding_rad, growth } = self.law;
        let speed = context.handle.omega;
        rates[0] =
            if presliding_part == 0.0 { 0.0 } else { (speed - speed.abs() * states[0]) / presliding_rad };
        let part = presliding_part * states[0] + (1.0 - presliding_part) * libm::tanh(speed / 0.001);
        let friction_nm = FRICTION_NM * part * (1.0 + growth * (speed / self.velocity_rad_s).abs());
        // On the handle, not on the joint.
        torques.interface += friction_nm;
        torques.joint += friction_nm;
    }

    fn alter_measurement(&self, _: &[f64], _: f64, torque: f64, _: &mut [f64]) -> f64 {
        torque
    }
}

/// A session without noise whose bearing rubs.
fn rubbing_session(lever: Option<Lever>, law: FrictionLaw) -> Session {
    let mut session = SyntheticSession { noise_nm: 0.0, hold_s: 0.1, ..SyntheticSession::new(1) }.session();
    session.lever = lever;
    for trial in &mut session.trials {
        let record = &mut trial.record;
        let before = record.theta_m_rad.iter().take_while(|angle| **angle == 0.0).count() - 1;
        let motion = wrist::motor_motion(&record.theta_m_rad, PERIOD_S);
        let mechanics = Mechanics::new(Plant::base(lever, &truth(trial.velocity_rad_s, trial.torque_nm)));
        let rubbing = Rubbing { law, velocity_rad_s: trial.velocity_rad_s };
        let mut integrator = Integrator::at_rest();
        let mut from = Kinematics::default();
        for (nm, to) in record.torque_l_nm.iter_mut().zip(motion).skip(before.saturating_sub(10)) {
            let input = HermiteSegment::new(from, to, PERIOD_S);
            integrator.advance(&mechanics, &rubbing, &input, 0.0, PERIOD_S, 4000);
            *nm = trial.torque_nm + integrator.torques(&mechanics, &rubbing, to, 0.0).0.measured;
            from = to;
        }
    }
    session
}

/// Largest difference between measured and predicted torque at the true parameters, N m, and its root mean square.
fn misfit(observations: &Observations) -> (f64, f64) {
    let at_truth: Vec<Vec<f64>> = observations
        .trials
        .iter()
        .map(|trial| truth(trial.velocity_rad_s, trial.torque_nm).to_vec())
        .collect();
    let mut response = SimulatedTorque::default();
    let all: Vec<usize> = (0..observations.trials.len()).collect();
    predict(observations, &[], &[], &all, &at_truth.concat(), &mut response);
    let rows = response.torque_nm.chunks_exact(observations.rows()).zip(&observations.trials);
    let errors: Vec<f64> = rows
        .flat_map(|(predicted, trial)| {
            predicted.iter().zip(&trial.measured_nm).map(|(own, nm)| own - nm).collect::<Vec<_>>()
        })
        .collect();
    let largest = errors.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
    (largest, libm::sqrt(errors.iter().map(|own| own * own).sum::<f64>() / errors.len() as f64))
}

#[test]
fn friction_of_the_bearing_goes_out_of_the_records() {
    let undamped = Lever { damping_nm_s_per_rad: 0.0, ..LEVER };
    let soft = Lever { stiffness_nm_per_rad: 200.0, ..LEVER };
    for lever in [Some(LEVER), Some(soft), Some(undamped), None] {
        let session = rubbing_session(lever, FrictionLaw::default());
        let of = |friction_nm: f64| {
            let constants = RigConstants { bearing_friction_nm: friction_nm, ..RigConstants::stated(lever) };
            Observations::of_rig(&session, PreprocessingSettings::default(), constants).unwrap()
        };
        let ((most, typical), (most_before, typical_before)) = (misfit(&of(FRICTION_NM)), misfit(&of(0.0)));
        // At the onset the friction begins within a sample, and rings in a lever without damping.
        assert!(most < 0.2 * FRICTION_NM && typical < 0.06 * FRICTION_NM, "{lever:?}: {most}, {typical}");
        assert!(most_before > 0.8 * FRICTION_NM && typical_before > 0.5 * FRICTION_NM, "{lever:?}");
        // A friction that is set later is the same.
        let changed = of(0.0).with_constants(of(FRICTION_NM).constants);
        let back = of(FRICTION_NM).with_constants(of(0.0).constants);
        assert!((misfit(&changed).0 - most).abs() < 1e-6, "{lever:?}");
        assert!((misfit(&back).0 - most_before).abs() < 1e-9, "{lever:?}");
        let mut averaged = of(FRICTION_NM);
        averaged.average_motion();
        assert!(misfit(&averaged).1 < 0.1 * FRICTION_NM, "{lever:?}: {}", misfit(&averaged).1);
    }
}

#[test]
fn friction_of_another_law_goes_out_of_the_records_by_that_law() {
    let gives = FrictionLaw { presliding_part: 1.0, presliding_rad: 3e-3, growth: 0.0 };
    let grows = FrictionLaw { growth: 0.4, ..FrictionLaw::default() };
    for law in [gives, grows] {
        let session = rubbing_session(Some(LEVER), law);
        let constants =
            RigConstants { bearing_friction_nm: FRICTION_NM, ..RigConstants::stated(Some(LEVER)) };
        let constant = Observations::of_rig(&session, PreprocessingSettings::default(), constants).unwrap();
        let (_, typical) = misfit(&constant.with_friction_law(law));
        let (_, before) = misfit(&constant);
        // The handle moves a little later than the motor, whose motion the friction is computed along.
        assert!(typical < 0.2 * before, "{law:?}: {typical}, {before}");
        let there_and_back = constant.with_friction_law(law).with_friction_law(FrictionLaw::default());
        assert!((misfit(&there_and_back).1 - before).abs() < 1e-9);
    }
}
