//! While a drive moves by itself, to its home or to the start position: SYNC goes on, and every period's readings are held
//! against the limits, as in the cycle.

use super::canopen::Link;
use super::cycle::{Cycle, Scrutiny, Tally};
use super::drive::{Drive, Wish};
use super::fault::CanFault;
use super::file::ValidRigFile;
use super::limits::HandleLimits;
use super::readings::Readings;
use super::units::JointAngle;

/// Looks on; nothing is asked of the motor.
#[derive(Debug)]
pub struct Lookout<'a> {
    file: &'a ValidRigFile,
    limits: HandleLimits,
    tally: &'a mut Tally,
    cycle: Cycle,
    scrutiny: Scrutiny,
}

impl<'a> Lookout<'a> {
    /// For the motor of a rig file.
    pub fn new(file: &'a ValidRigFile, limits: HandleLimits, tally: &'a mut Tally) -> Self {
        let cycle = cycle(file, limits);
        Self { file, limits, tally, cycle, scrutiny: Scrutiny::Homing }
    }

    /// The motor looks for its home: until it is found, angles mean nothing.
    pub fn homing(&mut self) {
        (self.cycle, self.scrutiny) = (cycle(self.file, self.limits), Scrutiny::Homing);
    }

    /// The motor goes from here to the start position. After a fault it may come from outside the limits, but may not go
    /// further out.
    pub fn going_from(&mut self, JointAngle(here_rad): JointAngle, slack_rad: f64) {
        let [low_rad, high_rad] = self.limits.angle_rad;
        let mut limits = self.limits;
        if here_rad < low_rad {
            limits.angle_rad[0] = here_rad - slack_rad;
        }
        if here_rad > high_rad {
            limits.angle_rad[1] = here_rad + slack_rad;
        }
        (self.cycle, self.scrutiny) = (cycle(self.file, limits), Scrutiny::Enabling);
    }

    /// One period of looking on; what the frames said, and the angle at SYNC.
    ///
    /// # Errors
    /// A limit that is broken, a sensor without a measurement, frames that stay away.
    pub fn period(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
    ) -> Result<(Readings, JointAngle), CanFault> {
        let nothing = (JointAngle(0.0), 0.0, Wish::Nothing);
        self.cycle.run(link, drive, self.tally, nothing, self.scrutiny)?;
        let readings = *self.cycle.readings();
        Ok((readings, drive.angle(&readings, self.cycle.samples() - 1)))
    }
}

fn cycle(file: &ValidRigFile, limits: HandleLimits) -> Cycle {
    Cycle::new(file, limits, file.sample_period(), file.budget().bits_per_period(), 0.0)
}
