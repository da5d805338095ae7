//! Supervision while a drive moves by itself, to its home or to the start position: SYNC goes on, and the readings of every
//! period are compared with the limits, as in the cycle.

use std::sync::Arc;
use std::time::Instant;

use super::canopen::Link;
use super::cycle::{CheckLevel, Cycle};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, MotionMonitor};
use super::fault::CanFault;
use super::file::ValidRigFile;
use super::limits::HandleLimits;
use super::pdo_decoder::Readings;
use super::units::JointAngle;
use crate::timing::Clock;

/// Runs the cycle without a target, and checks what the motor reports.
#[derive(Debug)]
pub struct HomingMonitor<'a> {
    file: &'a ValidRigFile,
    limits: HandleLimits,
    stats: &'a mut CycleStats,
    clock: Arc<dyn Clock>,
    cycle: Cycle,
    check_level: CheckLevel,
}

impl<'a> HomingMonitor<'a> {
    /// For the motor of a rig file.
    pub fn new(
        file: &'a ValidRigFile,
        limits: HandleLimits,
        stats: &'a mut CycleStats,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let cycle = new_cycle(file, limits, clock.now());
        Self { file, limits, stats, clock, cycle, check_level: CheckLevel::Homing }
    }
}

impl MotionMonitor for HomingMonitor<'_> {
    fn homing(&mut self) {
        (self.cycle, self.check_level) =
            (new_cycle(self.file, self.limits, self.clock.now()), CheckLevel::Homing);
    }

    fn moving_from(&mut self, JointAngle(here_rad): JointAngle, slack_rad: f64) {
        let [low_rad, high_rad] = self.limits.angle_rad;
        let mut limits = self.limits;
        if here_rad < low_rad {
            limits.angle_rad[0] = here_rad - slack_rad;
        }
        if here_rad > high_rad {
            limits.angle_rad[1] = here_rad + slack_rad;
        }
        (self.cycle, self.check_level) =
            (new_cycle(self.file, limits, self.clock.now()), CheckLevel::Enabling);
    }

    fn period(&mut self, link: &mut Link, drive: &mut dyn Drive) -> Result<(Readings, JointAngle), CanFault> {
        let nothing = (JointAngle(0.0), 0.0, DriveRequest::None);
        self.cycle.run(link, drive, self.stats, nothing, self.check_level)?;
        let readings = *self.cycle.readings();
        Ok((readings, drive.angle(&readings, self.cycle.samples() - 1)))
    }
}

fn new_cycle(file: &ValidRigFile, limits: HandleLimits, now: Instant) -> Cycle {
    Cycle::new(file, limits, file.sample_period(), file.budget().bits_per_period(), 0.0, now)
}
