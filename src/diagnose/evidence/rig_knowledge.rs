//! What rig trials say of the rig's constants, as evidence for and against causes.
//!
//! A calibration is one more observation, c_hat ~ N(c, C), of constants c. Without a cause a constant lies about its stated value within
//! a tolerance, as every rig is built; a cause says that it may lie anywhere within the cause's prior. All models are fitted with the
//! constants that are most probable by c_hat and by the tolerances of the rig, whose errors are unknowns that the trials share.

use super::gaussian::log_normal_distribution;
use super::weighed_constants::WeighedConstants;
use crate::calibrate::{
    CAUSED, PRESLIDING_FACTOR, PRESLIDING_RAD, RigDeviations, RigFaults, SOUND_DELAY_S, ToldConstant,
    servo_bandwidth_hz,
};
use crate::dataset::{
    AngleAgainstTarget, ROUNDING_STEPS, RigCalibration, RigQuantity, corner_frequency_hz, time_constant_s,
};
use crate::diagnose::interval::Interval;
use crate::fit::{CalibrationMisuse, FrictionLaw, RigConstants};
use crate::statistics::HALF_INTERVAL_95;
use crate::wrist::Lever;
use crate::wrist::mechanisms::MechanismKind;

/// Probabilities that a recorded angle which is the target in truth stays within a step of the encoder of the target that the session has,
/// within two samples' way of it, or neither: a drive may report the target late, or its own way between two targets. Assumed.
const TARGET_AS_ANGLE: [f64; 3] = [0.9, 0.099, 0.001];

/// Least probability that a motor stays within a step of the encoder of its target all along the ramps; more where the step is long beside
/// a servo's delay. Assumed.
const MOTOR_WITHIN_A_STEP: f64 = 1e-4;

/// Samples by which a drive may report a target late.
const LATE_SAMPLES: f64 = 2.0;

/// Part of a rig's faults that come between its trials and the person's: a clamp that slips, an amplifier that was set anew, a calibration of
/// another day. Assumed.
pub const CHANGED_AFTER_RIG_TRIALS: f64 = 0.05;

/// The constants of a rig, and how well they are known.
#[derive(Debug, Clone)]
pub struct RigKnowledge {
    /// The constants of the analysis.
    pub constants: RigConstants,
    /// What the session states.
    pub stated: RigConstants,
    /// Independent errors of the constants, of one standard deviation each: the constants with the error.
    pub errors: Vec<RigConstants>,
    deviations: RigDeviations,
    /// The recorded angle against the target, from which follows whether it is the motor's.
    angle: Option<AngleAgainstTarget>,
}

impl RigKnowledge {
    /// Nothing beside what a session with this lever states.
    pub fn stated(lever: Option<Lever>) -> Self {
        let stated = RigConstants::stated(lever);
        Self { constants: stated, stated, errors: Vec::new(), deviations: RigDeviations::none(), angle: None }
    }

    /// What `calibration` says of the rig of a session that states this lever.
    ///
    /// # Errors
    /// If the calibration cannot be used for such a session.
    pub fn measured(calibration: &RigCalibration, lever: Option<Lever>) -> Result<Self, CalibrationMisuse> {
        let measured = RigConstants::calibrated(calibration, lever)?;
        let stated = RigConstants::stated(lever);
        let deviations = RigDeviations::of(calibration, |quantity| stated.value(quantity));
        let angle = calibration.angle_against_target;
        let mut known = Self { errors: Vec::new(), constants: measured, stated, deviations, angle };
        let off: Vec<MechanismKind> =
            known.likely_faults().into_iter().flat_map(|cause| known.changed_by(cause)).collect();
        let WeighedConstants { constants, mut errors } =
            WeighedConstants::of(calibration, measured, &known.deviations.told, &off);
        let law_nm = FRICTION_LAW_SD * constants.bearing_friction_nm;
        if law_nm != 0.0 {
            let friction_nm = constants.bearing_friction_nm + law_nm;
            errors.push(constants.with(RigQuantity::BearingFriction, friction_nm));
        }
        known.constants = constants;
        known.errors = errors;
        Ok(known)
    }

    /// The causes by which the measured constants are more likely than by none, each beside those before it.
    fn likely_faults(&self) -> Vec<MechanismKind> {
        let mut causes: Vec<MechanismKind> = Vec::new();
        loop {
            let beside = |kind: MechanismKind| causes.iter().copied().chain([kind]).collect::<Vec<_>>();
            let now = self.log_density(&causes);
            let next = self.told().filter(|kind| !causes.contains(kind));
            let next = next.map(|kind| (kind, self.log_density(&beside(kind)) - now));
            match next.max_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((kind, gain)) if gain > 0.0 => causes.push(kind),
                _ => return causes,
            }
        }
    }

    /// Whether the rig trials tell the constant that this cause is about.
    pub fn tells(&self, kind: MechanismKind) -> bool {
        self.told().any(|own| own == kind)
    }

    /// The causes whose constants the rig trials tell.
    pub fn told(&self) -> impl Iterator<Item = MechanismKind> {
        let following = self.angle.and(self.motor_delay()).map(|_| MechanismKind::ServoFollowing);
        self.deviations.kinds().chain(following)
    }

    /// Logarithm of the density of the measured constants where `causes` are at work, against where none is.
    pub fn log_odds(&self, causes: &[MechanismKind]) -> f64 {
        if !self.told().any(|own| causes.contains(&own)) {
            return 0.0;
        }
        self.log_density(causes) - self.log_density(&[])
    }

    fn log_density(&self, causes: &[MechanismKind]) -> f64 {
        let angle_is_command = self.angle.is_some() && causes.contains(&MechanismKind::ServoFollowing);
        let of_angle = self.angle.map_or(0.0, |angle| libm::log(probability_of(&angle, angle_is_command)));
        of_angle + self.deviations.agreement(RigFaults { causes, angle_is_command }, None).log_density
    }

    /// Logarithm of the odds of `cause` in the session's own trials, by what the rig trials say, against those before. A constant that they
    /// tell well, and as stated, must have changed after them. What the recorded angle is does not change.
    pub fn log_odds_in_session(&self, cause: MechanismKind) -> f64 {
        if !self.tells(cause) {
            return 0.0;
        }
        let was_there = self.log_odds(&[cause]).min(0.0);
        if cause == MechanismKind::ServoFollowing {
            return was_there;
        }
        libm::log(CHANGED_AFTER_RIG_TRIALS + (1.0 - CHANGED_AFTER_RIG_TRIALS) * libm::exp(was_there))
    }

    /// Whether the rig trials say nothing of `kind` but how late the torque is: so it is with a motor behind its command, and with a low-pass
    /// that the calibration has no value for.
    fn is_told_by_delay(&self, kind: MechanismKind) -> bool {
        kind == MechanismKind::ServoFollowing
            || kind == MechanismKind::TorqueLag && self.deviations.hidden_low_pass.is_some()
    }

    /// The causes that are about those measured constants which `cause` changes.
    pub fn changed_by(&self, cause: MechanismKind) -> Vec<MechanismKind> {
        let by_delay = self.is_told_by_delay(cause);
        let told = self.deviations.told.iter();
        told.filter(|own| own.kind == cause || by_delay && own.priors.has_motor_delay())
            .map(|own| own.kind)
            .collect()
    }

    /// How late the torque is behind the recorded angle at low frequencies, and the variance, s: the motor's delay where that angle is the
    /// command.
    fn motor_delay(&self) -> Option<(f64, f64)> {
        let RigDeviations { told, covariance, .. } = &self.deviations;
        let late: Vec<usize> =
            (0..told.len()).filter(|place| told[*place].priors.has_motor_delay()).collect();
        let delay_s = late.iter().map(|place| told[*place].deviation).sum();
        let variance = late.iter().flat_map(|i| late.iter().map(|j| covariance[(*i, *j)])).sum();
        (!late.is_empty()).then_some((delay_s, variance))
    }

    /// The constants that causes can be about, each with the constants of a rig where that one is farther from its stated value by
    /// `part` of its distance.
    pub fn with_larger_deviations(&self, part: f64) -> Vec<(MechanismKind, RigConstants)> {
        let farther = |own: &ToldConstant| {
            let value = self.constants.value(own.quantity).unwrap_or(own.value);
            let measured = own.quantity.normal_coordinate(value);
            // A channel without a low-pass is one of no time constant.
            let stated =
                self.stated.value(own.quantity).map_or(0.0, |value| own.quantity.normal_coordinate(value));
            let value = own.quantity.value_at(measured + part * (measured - stated));
            (own.kind, self.constants.with(own.quantity, value))
        };
        self.deviations.told.iter().map(farther).collect()
    }

    fn told_by(&self, kind: MechanismKind) -> Option<&ToldConstant> {
        self.deviations.told.iter().find(|own| own.kind == kind)
    }

    /// The measured value of the constant that a cause is about, with its 95 % interval.
    pub fn interval(&self, kind: MechanismKind) -> Option<Interval> {
        let (value, se) = if self.is_told_by_delay(kind) {
            let (delay_s, variance) = self.motor_delay().filter(|(delay_s, _)| *delay_s > 0.0)?;
            let is_motor = kind == MechanismKind::ServoFollowing;
            let frequency_hz =
                if is_motor { following_bandwidth_hz(delay_s) } else { corner_frequency_hz(delay_s) };
            (frequency_hz, frequency_hz * libm::sqrt(variance) / delay_s)
        } else {
            let own = self.told_by(kind)?;
            (own.value, own.se)
        };
        let half = HALF_INTERVAL_95 * se;
        Some(Interval { value, low: Some(value - half), high: Some(value + half) })
    }

    /// How far the constant that a cause is about is from its stated value, in standard deviations of a sound rig's and of the
    /// measurement together.
    pub fn deviation_sds(&self, kind: MechanismKind) -> Option<f64> {
        if self.is_told_by_delay(kind) {
            let (delay_s, variance) = self.motor_delay()?;
            return Some(delay_s.abs() / libm::hypot(libm::sqrt(variance), SOUND_DELAY_S));
        }
        let RigDeviations { told, covariance, .. } = &self.deviations;
        let place = told.iter().position(|own| own.kind == kind)?;
        let own = &told[place];
        let (_, tolerance) = own.priors.sound;
        let variance = covariance[(place, place)] + tolerance * tolerance;
        Some(own.deviation.abs() / libm::sqrt(variance))
    }

    /// The constants of the analysis, but that which a cause is about as the session states it.
    pub fn as_stated(&self, kind: MechanismKind) -> Option<RigConstants> {
        if self.is_told_by_delay(kind) {
            let RigConstants { torque_delay_s, torque_cutoff_hz, .. } = self.stated;
            return Some(RigConstants { torque_delay_s, torque_cutoff_hz, ..self.constants });
        }
        let own = self.told_by(kind)?;
        Some(match self.stated.value(own.quantity) {
            Some(stated) => self.constants.with(own.quantity, stated),
            None => RigConstants { torque_cutoff_hz: self.stated.torque_cutoff_hz, ..self.constants },
        })
    }
}

/// Natural frequency of a critically damped servo, of two equal poles, that is late by `delay_s`, Hz.
fn following_bandwidth_hz(delay_s: f64) -> f64 {
    corner_frequency_hz(0.5 * delay_s)
}

/// How late a critically damped servo of this natural frequency is, s.
fn following_delay_s(bandwidth_hz: f64) -> f64 {
    2.0 * time_constant_s(bandwidth_hz)
}

/// Probability of a recorded angle so near its target, where it is the command or the motor's.
fn probability_of(angle: &AngleAgainstTarget, is_command: bool) -> f64 {
    let late_s = LATE_SAMPLES * angle.sample_s;
    let near = if angle.is_target() {
        0
    } else if angle.largest_s <= late_s {
        1
    } else {
        2
    };
    if is_command {
        return TARGET_AS_ANGLE[near];
    }
    let (median, log_sd) = servo_bandwidth_hz();
    let faster_than = |delay_s: f64| {
        libm::exp(log_normal_distribution(-libm::log(following_bandwidth_hz(delay_s) / median) / log_sd))
    };
    let within_steps = MOTOR_WITHIN_A_STEP.max(faster_than(ROUNDING_STEPS * angle.step_s()));
    [within_steps, faster_than(late_s), 1.0 - faster_than(late_s)][near]
}

/// Standard deviation of a bearing's friction about a constant one, as a part of it: of its level, and of its growth up to the ramp's speed.
/// Assumed: grease and Stribeck's drop change it by some 20 % over the speeds of the ramps.
const FRICTION_LAW_SD: f64 = 0.2;

/// Deviations of that law from a constant friction, each of one standard deviation (assumed): it grows with the speed, and some or all of it
/// builds up over a travel, of which only the order of magnitude is known. The three travels lie one standard deviation apart and share
/// the variance of a part of 1.
pub const FRICTION_LAWS: [FrictionLaw; 4] = {
    let constant = FrictionLaw { presliding_part: 0.0, presliding_rad: PRESLIDING_RAD, growth: 0.0 };
    let gives = FrictionLaw { presliding_part: 0.577_350_269_189_625_8, ..constant };
    [
        FrictionLaw { growth: FRICTION_LAW_SD, ..constant },
        gives,
        FrictionLaw { presliding_rad: PRESLIDING_RAD / PRESLIDING_FACTOR, ..gives },
        FrictionLaw { presliding_rad: PRESLIDING_RAD * PRESLIDING_FACTOR, ..gives },
    ]
};

/// Standard error that rig trials leave of a constant, as a part of it: loads that are known to 1 % leave about that much.
const EXPECTED_RELATIVE_SE: f64 = 0.01;

/// Standard error that rig trials leave of the delay and of the time constant of the torque channel, s: a tenth of a sample of a rig of
/// 1 kHz. Assumed.
const EXPECTED_SE_S: f64 = 1e-4;

/// Squared distance, in standard deviations, at which a calibration is expected to place the constant that `kind` is about from a sound
/// rig's, where the cause's parameter is `value`; `None` if rig trials do not tell it.
pub fn expected_distance(kind: MechanismKind, value: f64, lever: Option<Lever>) -> Option<f64> {
    if kind == MechanismKind::ServoFollowing {
        let sds = following_delay_s(value) / libm::hypot(EXPECTED_SE_S, SOUND_DELAY_S);
        return Some(sds * sds);
    }
    let own = CAUSED.iter().find(|own| own.kind == kind)?;
    let (deviation, se) = match own.quantity {
        RigQuantity::TorqueDelay => (value, EXPECTED_SE_S),
        RigQuantity::TorqueCutoff => (time_constant_s(value), EXPECTED_SE_S),
        _ => (value / RigConstants::stated(lever).value(own.quantity)? - 1.0, EXPECTED_RELATIVE_SE),
    };
    Some(deviation * deviation / (se * se + own.tolerance * own.tolerance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::test_session::{LEVER, measured_rig};

    fn known(told: &[(RigQuantity, f64, f64)]) -> RigKnowledge {
        measured_rig(told, None)
    }

    #[test]
    fn a_measured_friction_enters_with_the_doubt_about_its_law_and_an_assumed_one_does_not() {
        let gain = (RigQuantity::TorqueGain, 1.0, 0.002);
        let with = known(&[gain, (RigQuantity::BearingFriction, 0.01, 0.0003)]);
        assert_eq!(with.constants.bearing_friction_nm, 0.01);
        let squared = |own: &RigConstants| (own.bearing_friction_nm - 0.01).powi(2);
        let sd = with.errors.iter().map(squared).sum::<f64>().sqrt();
        assert!((sd - libm::hypot(0.0003, 0.002)).abs() < 1e-9, "{sd}");
        assert!(known(&[gain]).errors.iter().all(|own| own.bearing_friction_nm == 0.0));
    }

    #[test]
    fn a_constant_that_is_off_speaks_for_its_cause_and_one_within_the_tolerance_against_it() {
        let causes = [
            (MechanismKind::LeverInertia, RigQuantity::LeverInertia, [0.0024, 0.001_616], 1e-5),
            (MechanismKind::LeverDamping, RigQuantity::LeverDamping, [0.6, 0.41], 0.01),
            (MechanismKind::LeverStiffness, RigQuantity::LeverStiffness, [650.0, 905.0], 5.0),
            (MechanismKind::TorqueGain, RigQuantity::TorqueGain, [1.1, 1.003], 0.000_5),
            (MechanismKind::AngleGain, RigQuantity::AngleGain, [0.9, 0.998], 0.000_5),
            (MechanismKind::ChannelSkew, RigQuantity::TorqueDelay, [0.001, 0.000_03], 1e-5),
            (MechanismKind::TorqueLag, RigQuantity::TorqueCutoff, [150.0, 2500.0], 5.0),
        ];
        for (kind, quantity, [off, sound], se) in causes {
            let odds = |value: f64| known(&[(quantity, value, se)]).log_odds(&[kind]);
            assert!(odds(off) > 10.0, "{kind:?} at {off}: {}", odds(off));
            assert!(odds(sound) < -1.0, "{kind:?} at {sound}: {}", odds(sound));
            let knowledge = known(&[(quantity, off, se)]);
            assert!(knowledge.tells(kind));
            let interval = knowledge.interval(kind).unwrap();
            assert!((interval.value - off).abs() < 1e-12 && interval.low.unwrap() < off);
            assert!(knowledge.deviation_sds(kind).unwrap() > 4.0);
            let stated = knowledge.as_stated(kind).unwrap();
            assert_eq!(stated.value(quantity), RigConstants::stated(Some(LEVER)).value(quantity));
        }
    }

    #[test]
    fn a_torque_that_is_late_is_the_motors_delay_where_the_recorded_angle_is_the_target() {
        let late = [(RigQuantity::TorqueDelay, 0.000_1, 0.000_02), (RigQuantity::TorqueCutoff, 180.0, 4.0)];
        let sound = [(RigQuantity::TorqueDelay, 0.0, 0.000_02), (RigQuantity::TorqueCutoff, 5000.0, 4.0)];
        let seen = |told: &[(RigQuantity, f64, f64)], largest_steps: f64, largest_s: f64| {
            let angle = AngleAgainstTarget { largest_steps, largest_s, sample_s: 0.000_4 };
            RigKnowledge { angle: Some(angle), ..known(told) }
        };
        let (following, lag) = (&[MechanismKind::ServoFollowing], &[MechanismKind::TorqueLag]);
        let target = seen(&late, 0.6, 0.000_02);
        assert!(target.log_odds(following) > target.log_odds(lag) + 5.0 && target.log_odds(lag) > 10.0);
        // Steps that a motor is as late as hide it.
        let coarse = seen(&late, 1.2, 0.001);
        assert!(coarse.log_odds(following) < coarse.log_odds(lag) + 2.0);
        let motor = seen(&late, 150.0, 0.003);
        assert!(motor.log_odds(lag) > motor.log_odds(following) + 5.0);
        // A drive that reports its target a sample late is not told from a motor as fast.
        let between = seen(&late, 40.0, 0.000_4);
        assert!((between.log_odds(lag) - between.log_odds(following)).abs() < 5.0);
        assert!(seen(&sound, 150.0, 0.003).log_odds(following) < -5.0, "a motor without a late torque");
        let interval = target.interval(MechanismKind::ServoFollowing).unwrap();
        let expected_hz = 1.0 / (std::f64::consts::PI * (0.000_1 + 1.0 / (std::f64::consts::TAU * 180.0)));
        assert!((interval.value / expected_hz - 1.0).abs() < 1e-9 && interval.low.unwrap() < interval.value);
        assert!(target.deviation_sds(MechanismKind::ServoFollowing).unwrap() > 5.0);
        let stated = target.as_stated(MechanismKind::ServoFollowing).unwrap();
        assert_eq!((stated.torque_delay_s, stated.torque_cutoff_hz), (0.0, None));
        // Where nobody compared the angle with the target, rig trials do not tell it.
        assert!(!known(&late).tells(MechanismKind::ServoFollowing));
    }

    #[test]
    fn a_late_torque_is_a_delay_or_a_low_pass_where_the_trials_tell_no_low_pass() {
        let (skew, lag) = (&[MechanismKind::ChannelSkew], &[MechanismKind::TorqueLag]);
        let late = |delay_s: f64, above_hz: f64| {
            measured_rig(&[(RigQuantity::TorqueDelay, delay_s, 0.000_03)], Some(above_hz))
        };
        // A low-pass of 150 Hz is late by 1.06 ms.
        let either = late(0.001_06, 100.0);
        assert!(either.tells(lag[0]) && either.log_odds(skew) > 5.0);
        assert!((either.log_odds(skew) - either.log_odds(lag)).abs() < 2.0, "neither is sure");
        let interval = either.interval(lag[0]).unwrap();
        assert!((interval.value - 150.1).abs() < 0.1 && interval.low.unwrap() < 150.0, "{interval:?}");
        assert!(either.deviation_sds(lag[0]).unwrap() > 5.0);
        assert_eq!(either.as_stated(lag[0]).unwrap().torque_delay_s, 0.0);
        // One that the trials exclude is none, and a torque that is early has none.
        for delay in [late(0.001_06, 600.0), late(-0.001_06, 100.0)] {
            assert!(delay.log_odds(skew) > delay.log_odds(lag) + 5.0 && delay.log_odds(skew) > 10.0);
        }
        let sound = late(0.000_05, 100.0);
        assert!(sound.log_odds(skew) < -1.0 && sound.log_odds(lag) < 0.0);
        assert!(!known(&[(RigQuantity::TorqueDelay, 0.001, 0.000_03)]).tells(lag[0]));
    }

    #[test]
    fn a_constant_that_rig_trials_tell_can_be_off_in_the_session_only_if_it_was_then_or_has_changed() {
        let (gain, friction) = (MechanismKind::TorqueGain, MechanismKind::JointFriction);
        let sound = known(&[(RigQuantity::TorqueGain, 1.0, 0.002)]);
        let odds = sound.log_odds_in_session(gain);
        assert!(odds < libm::log(0.2) && odds > libm::log(CHANGED_AFTER_RIG_TRIALS), "{odds}");
        assert!(known(&[(RigQuantity::TorqueGain, 1.0, 0.5)]).log_odds_in_session(gain).abs() < 0.1);
        assert!(known(&[(RigQuantity::TorqueGain, 1.3, 0.002)]).log_odds_in_session(gain).abs() < 1e-12);
        assert_eq!(sound.log_odds_in_session(friction), 0.0);
    }

    #[test]
    fn a_constant_that_nobody_measured_well_speaks_for_nothing() {
        let badly = known(&[(RigQuantity::LeverInertia, 0.0024, 0.0024)]);
        assert!(badly.log_odds(&[MechanismKind::LeverInertia]).abs() < 0.2);
        let nothing = RigKnowledge::stated(Some(LEVER));
        assert_eq!(nothing.log_odds(&[MechanismKind::LeverInertia]), 0.0);
        assert!(!nothing.tells(MechanismKind::LeverInertia) && nothing.errors.is_empty());
    }

    #[test]
    fn a_cause_of_the_wrist_has_the_rigs_odds_of_none() {
        let knowledge = known(&[(RigQuantity::TorqueGain, 1.3, 0.01)]);
        assert_eq!(knowledge.log_odds(&[MechanismKind::JointFriction]), 0.0);
        let both = knowledge.log_odds(&[MechanismKind::JointFriction, MechanismKind::TorqueGain]);
        assert_eq!(both, knowledge.log_odds(&[MechanismKind::TorqueGain]));
    }

    #[test]
    fn the_errors_of_constants_that_are_off_are_their_covariance() {
        let knowledge = known(&[
            (RigQuantity::TorqueGain, 1.1, 0.002),
            (RigQuantity::TorqueCutoff, 200.0, 8.0),
            (RigQuantity::LeverInertia, 0.0016, 2e-5),
        ]);
        assert_eq!(knowledge.errors.len(), 3);
        for (quantity, se) in [(RigQuantity::TorqueGain, 0.002), (RigQuantity::TorqueCutoff, 8.0)] {
            let coordinate = |own: &RigConstants| quantity.normal_coordinate(own.value(quantity).unwrap());
            let centre = coordinate(&knowledge.constants);
            let variance: f64 = knowledge
                .errors
                .iter()
                .map(|own| (coordinate(own) - centre) * (coordinate(own) - centre))
                .sum();
            let expected = quantity.normal_error(knowledge.constants.value(quantity).unwrap(), se);
            assert!((variance / (expected * expected) - 1.0).abs() < 1e-9, "{quantity:?}: {variance}");
        }
    }
}
