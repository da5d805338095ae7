//! The motion of the shaft that commands rest on. A motor in MIT mode makes its torque by itself, from where its shaft truly is: a
//! command is safe only if no motion that the shaft may have makes more of it than the limit.
//!
//! Each reply is judged by the motion that was trusted before. Within the acceleration limit, its speed must be one that the
//! shaft can have reached, and its position must be the one that the speeds before and now lead to. A reply that is not so
//! moves nothing: commands rest on the trusted motion, carried on at its speed, which may be further off with every period.

use std::time::{Duration, Instant};

use super::frame::{FieldRanges, MitReply};
use crate::rig::can::limits::HandleLimits;

/// Replies in a row that may not fit the trusted motion; after more the motor is stopped.
const UNFIT_REPLIES: u32 = 2;
/// Periods from the reply that a command rests on to the end of its time: it is sent a period after that reply, and acts for
/// another. One more for the reply itself: a wrong one that fits is off by no more than the shaft can move in a period.
const PERIODS_AT_STAKE: u32 = 3;
/// Part of the speed limit up to which a shaft may be faster than it.
const MIT_SPEED_ALLOWANCE: f64 = 1.5;

/// How fast the shaft may change its motion, at the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Agility {
    speed_rad_s: f64,
    acceleration_rad_s2: f64,
    position_step_rad: f64,
    speed_step_rad_s: f64,
    period_s: f64,
    /// On the bench the clock takes so many times longer than the motor.
    stretch: f64,
}

/// How far the shaft's motion may be from the one that is expected, at the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShaftDeviation {
    pub(super) position_rad: f64,
    pub(super) speed_rad_s: f64,
}

impl Agility {
    /// Within the limits of the handle, with a motor of this gear.
    pub(super) fn new(
        limits: &HandleLimits,
        gear_ratio: f64,
        ranges: &FieldRanges,
        period: Duration,
        stretch: f64,
    ) -> Self {
        Self {
            speed_rad_s: MIT_SPEED_ALLOWANCE * limits.speed_rad_s * gear_ratio.abs(),
            acceleration_rad_s2: limits.acceleration_rad_s2 * gear_ratio.abs(),
            position_step_rad: ranges.position_step_rad(),
            speed_step_rad_s: ranges.speed_step_rad_s(),
            period_s: period.as_secs_f64(),
            stretch,
        }
    }

    /// What the shaft may have deviated from a constant speed in a time.
    fn within(&self, time_s: f64) -> ShaftDeviation {
        let most_rad_s = 2.0 * self.speed_rad_s;
        let change_rad_s = (self.acceleration_rad_s2 * time_s).min(most_rad_s);
        // At first it accelerates, then it is as fast as can be.
        let rising_s = change_rad_s / self.acceleration_rad_s2.max(f64::MIN_POSITIVE);
        ShaftDeviation {
            position_rad: change_rad_s * (time_s - 0.5 * rising_s) + 2.0 * self.position_step_rad,
            speed_rad_s: change_rad_s + 2.0 * self.speed_step_rad_s,
        }
    }

    /// What is at stake with a command that is sent so long after the reply that it rests on.
    fn at_stake(&self, since_s: f64) -> ShaftDeviation {
        self.within(since_s + f64::from(PERIODS_AT_STAKE - 1) * self.period_s)
    }

    /// What is at stake while every reply comes in time.
    pub(super) fn usually_at_stake(&self) -> ShaftDeviation {
        self.at_stake(self.period_s)
    }
}

/// Position and speed of the shaft at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ShaftMotion {
    position_rad: f64,
    speed_rad_s: f64,
    at: Instant,
}

impl ShaftMotion {
    fn time_s(&self, now: Instant, agility: &Agility) -> f64 {
        now.saturating_duration_since(self.at).as_secs_f64() / agility.stretch
    }

    /// The time that the motor took from this motion to a later one. It replies once a period: where a busy adapter hands over
    /// several replies together, their times of arrival are too close.
    fn time_to_s(&self, later: &Self, agility: &Agility) -> f64 {
        self.time_s(later.at, agility).max(agility.period_s)
    }

    /// Whether the shaft can have gone from this motion to a later one.
    fn leads_to(&self, later: &Self, agility: &Agility) -> bool {
        let arrived_s = self.time_s(later.at, agility);
        [arrived_s, self.time_to_s(later, agility)]
            .into_iter()
            .any(|time_s| self.leads_in(time_s, later, agility))
    }

    fn leads_in(&self, time_s: f64, later: &Self, agility: &Agility) -> bool {
        let allowed = agility.within(time_s);
        let turned_rad = later.position_rad - self.position_rad;
        let added_rad = 0.5 * (self.speed_rad_s + later.speed_rad_s) * time_s;
        (turned_rad - added_rad).abs() <= allowed.position_rad
            && (later.speed_rad_s - self.speed_rad_s).abs() <= allowed.speed_rad_s
    }
}

/// Speeds that do not fit one another, rad/s at the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Misfit {
    pub(super) reported_rad_s: f64,
    pub(super) measured_rad_s: f64,
}

/// The trusted motion, and what does not fit it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TrustedMotion {
    trusted: Option<ShaftMotion>,
    /// The latest reply, where it is not trusted, or not yet.
    doubtful: Option<ShaftMotion>,
    unfit_in_a_row: u32,
    misfit: Option<Misfit>,
}

impl TrustedMotion {
    /// Forgets everything: positions are on another scale, or the shaft turned without being looked at.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// A reply of the motor, which tells where the shaft was at a time.
    ///
    /// One that fits the trusted motion is trusted if that is of the period before. After a gap much fits, so that the reply
    /// before it must fit, too. A motor that has no power may have been turned by hand in any way: two replies that fit each
    /// other are trusted.
    pub(super) fn observe(&mut self, reply: &MitReply, at: Instant, agility: &Agility, has_power: bool) {
        let seen = ShaftMotion { position_rad: reply.position_rad, speed_rad_s: reply.speed_rad_s, at };
        let fits = |before: &ShaftMotion| before.leads_to(&seen, agility);
        let fits_doubtful = self.doubtful.as_ref().is_some_and(fits);
        let trusted = self.trusted.filter(|_| self.misfit.is_none());
        let is_trusted = match &trusted {
            Some(trusted) if has_power => {
                let is_next = trusted.time_s(at, agility) <= 1.5 * agility.period_s;
                fits(trusted) && (is_next || fits_doubtful)
            }
            Some(trusted) => fits(trusted) || fits_doubtful,
            None => fits_doubtful && !(has_power && self.misfit.is_some()),
        };
        if is_trusted {
            *self = Self { trusted: Some(seen), ..Self::default() };
            return;
        }
        self.doubtful = Some(seen);
        if let Some(before) = trusted.filter(|trusted| has_power && !fits(trusted)) {
            self.unfit_in_a_row += 1;
            let measured_rad_s = (seen.position_rad - before.position_rad) / before.time_to_s(&seen, agility);
            let misfit = Misfit { reported_rad_s: seen.speed_rad_s, measured_rad_s };
            self.misfit = (self.unfit_in_a_row > UNFIT_REPLIES).then_some(misfit);
        }
    }

    /// What did not fit, where too many replies in a row did not. With power, nothing is trusted any more.
    pub(super) fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// Whether there is a motion that commands may rest on.
    pub(super) fn is_known(&self) -> bool {
        self.trusted.is_some()
    }

    /// The motion that is expected now, as position and speed, and how far from it the shaft may be until the next command acts.
    pub(super) fn expected(&self, now: Instant, agility: &Agility) -> Option<(f64, f64, ShaftDeviation)> {
        let trusted = self.trusted?;
        let since_s = trusted.time_s(now, agility);
        let position_rad = trusted.position_rad + trusted.speed_rad_s * since_s;
        Some((position_rad, trusted.speed_rad_s, agility.at_stake(since_s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::can::limits::EXAMPLE_LIMITS;

    const PERIOD: Duration = Duration::from_millis(2);

    fn agility() -> Agility {
        let ranges =
            FieldRanges { position_rad: 12.5, speed_rad_s: 50.0, kp: 500.0, kd: 5.0, torque_nm: 18.0 };
        Agility::new(&EXAMPLE_LIMITS, 1.0, &ranges, PERIOD, 1.0)
    }

    /// The motion after replies (position, speed), one each period.
    fn after(replies: &[(f64, f64)], has_power: bool) -> (TrustedMotion, Instant) {
        let (mut motion, mut at) = (TrustedMotion::default(), Instant::now());
        for (position_rad, speed_rad_s) in replies {
            let reply =
                MitReply { position_rad: *position_rad, speed_rad_s: *speed_rad_s, torque_nm: 0.0, error: 0 };
            motion.observe(&reply, at, &agility(), has_power);
            at += PERIOD;
        }
        (motion, at)
    }

    fn expected_rad(replies: &[(f64, f64)]) -> Option<f64> {
        let (motion, at) = after(replies, true);
        motion.expected(at, &agility()).map(|(position_rad, ..)| position_rad)
    }

    #[test]
    fn motion_is_trusted_after_two_replies_that_fit_each_other() {
        assert_eq!(expected_rad(&[(0.1, 1.0)]), None);
        assert_eq!(expected_rad(&[(0.1, 1.0), (0.2, 1.0)]), None);
        assert_eq!(expected_rad(&[(0.1, 1.0), (0.102, 1.0)]), Some(0.104));
    }

    #[test]
    fn reply_that_does_not_fit_moves_nothing_and_several_in_a_row_are_a_misfit() {
        let still = [(0.1, 0.0), (0.1, 0.0)];
        for wrong in [(0.12, 0.0), (0.08, 0.0), (0.1, 3.0), (0.1, -25.0), (0.106, 3.0)] {
            assert_eq!(expected_rad(&[still[0], still[1], wrong]), Some(0.1), "{wrong:?}");
            let (motion, _) = after(&[still[0], still[1], wrong, wrong], true);
            assert!(motion.misfit().is_none());
            let (motion, _) = after(&[still[0], still[1], wrong, wrong, wrong, wrong, wrong], true);
            assert!(motion.misfit().is_some(), "{wrong:?}");
        }
    }

    #[test]
    fn reply_after_a_gap_is_trusted_once_the_next_one_fits_it() {
        let wrong = (0.13, 0.0);
        let replies = [(0.1, 0.0), (0.1, 0.0), wrong, (0.101, 0.0)];
        assert_eq!(expected_rad(&replies), Some(0.1), "not yet");
        assert_eq!(expected_rad(&[&replies[..], &[(0.101, 0.0)]].concat()), Some(0.101));
    }

    #[test]
    fn replies_that_an_adapter_hands_over_together_are_a_period_apart() {
        let (mut motion, mut at) = after(&[(0.1, 2.0), (0.104, 2.0)], true);
        // Three periods of silence, then the replies of all of them at once.
        at += 2 * PERIOD;
        for position_rad in [0.108, 0.112, 0.116] {
            let reply = MitReply { position_rad, speed_rad_s: 2.0, torque_nm: 0.0, error: 0 };
            motion.observe(&reply, at, &agility(), true);
        }
        assert!(motion.misfit().is_none());
        let (position_rad, ..) = motion.expected(at, &agility()).unwrap();
        assert_eq!(position_rad, 0.116);
    }

    #[test]
    fn speed_of_a_misfit_is_one_that_a_shaft_can_have() {
        let (mut motion, at) = after(&[(0.1, 0.0), (0.1, 0.0)], true);
        for _ in 0..5 {
            let reply = MitReply { position_rad: 0.16, speed_rad_s: 0.0, torque_nm: 0.0, error: 0 };
            motion.observe(&reply, at - PERIOD, &agility(), true);
        }
        let measured_rad_s = motion.misfit().unwrap().measured_rad_s;
        assert!((measured_rad_s - 0.06 / PERIOD.as_secs_f64()).abs() < 1e-9, "{measured_rad_s}");
    }

    #[test]
    fn motor_without_power_may_be_turned_in_any_way() {
        let replies = [(0.1, 0.0), (0.1, 0.0), (0.5, 0.0), (0.5, 0.0)];
        let (motion, at) = after(&replies, false);
        let expected = motion.expected(at, &agility()).map(|(position_rad, ..)| position_rad);
        assert_eq!(expected, Some(0.5));
        assert_eq!(expected_rad(&replies), Some(0.1), "with power it cannot have been");
    }

    #[test]
    fn the_longer_nothing_fits_the_further_off_the_shaft_may_be() {
        let (motion, at) = after(&[(0.1, 0.0), (0.1, 0.0)], true);
        let off = |periods: u32| motion.expected(at + periods * PERIOD, &agility()).unwrap().2;
        assert_eq!(off(0), agility().usually_at_stake());
        assert!((off(0).speed_rad_s - (400.0 * 0.006 + 2.0 * 100.0 / 4095.0)).abs() < 1e-9);
        assert!(off(1).position_rad > off(0).position_rad && off(1).speed_rad_s > off(0).speed_rad_s);
        assert!(off(1000).speed_rad_s <= 12.1, "it is no faster than the speed limit allows");
    }
}
