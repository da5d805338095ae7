//! Supervision while a drive moves by itself, to its home: SYNC goes on, and the readings of every
//! period are compared with the limits, as in the cycle.

use std::sync::Arc;

use super::canopen::Link;
use super::cycle::{Cycle, PeriodCommand};
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest, MotionMonitor};
use super::fault::CanFault;
use super::file::ValidRigFile;
use super::limits::HandleLimits;
use super::motor_state::MotorState;
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
}

impl<'a> HomingMonitor<'a> {
    /// For the motor of a rig file.
    pub fn new(
        file: &'a ValidRigFile,
        limits: HandleLimits,
        stats: &'a mut CycleStats,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let cycle = Cycle::new(file, limits, 0.0, clock.now());
        Self { file, limits, stats, clock, cycle }
    }
}

impl MotionMonitor for HomingMonitor<'_> {
    fn begin(&mut self) {
        self.cycle = Cycle::new(self.file, self.limits, 0.0, self.clock.now());
    }

    fn period(&mut self, link: &mut Link, drive: &mut dyn Drive) -> Result<(Readings, JointAngle), CanFault> {
        let nothing = PeriodCommand { target_rad: 0.0, shown_nm: 0.0, request: DriveRequest::None };
        // A period without frames tells nothing; too many of them are a fault.
        loop {
            self.cycle.run(link, drive, self.stats, nothing, MotorState::Homing)?;
            if self.cycle.has_new_readings() {
                break;
            }
        }
        let readings = *self.cycle.readings();
        Ok((readings, drive.angle(&readings, self.cycle.samples() - 1)))
    }
}
