//! One period after the other: target out, SYNC at its time, readings in, everything checked. Nothing here asks for
//! memory, waits for a lock or touches a file.

use std::time::{Duration, Instant};

use super::canopen::Link;
use super::drive::{Drive, Wish};
use super::fault::CanFault;
use super::file::{RigFile, Tolerate};
use super::histogram::Histogram;
use super::limits::{Guard, HandleLimits};
use super::readings::{Decoder, Freshness, Readings, Taken};
use super::realtime::Metronome;
use super::units::{JointAngle, SamplePeriod};

/// Periods between a target and the motor being there: one to SYNC, one for the drive's interpolation.
const TARGETS_IN_FLIGHT: usize = 3;

/// Counts of what the cycle did, kept with the session.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Periods.
    pub periods: u64,
    /// Periods whose frames came too late.
    pub missed: u64,
    /// Points in time that were slept through.
    pub overruns: u64,
    /// Frames that came twice.
    pub duplicates: u64,
    /// How late the program woke up.
    pub lateness: Histogram,
    /// How long the frames of a period took to come.
    pub response: Histogram,
    /// Bits sent and received in periods, at worst stuffing.
    pub bits: u64,
    /// Time in periods, s.
    pub seconds: f64,
}

impl Tally {
    /// Load of a bus that carries so many bits a second, 0 to 1.
    pub fn load(&self, bits_per_s: f64) -> f64 {
        let capacity = self.seconds * bits_per_s;
        if capacity > 0.0 { self.bits as f64 / capacity } else { 0.0 }
    }
}

/// The cycle of a motor that has, or is given, power.
#[derive(Debug)]
pub struct Cycle {
    decoder: Decoder,
    freshness: Freshness,
    guard: Guard,
    metronome: Metronome,
    tolerate: Tolerate,
    bits_per_period: u32,
    missed_in_a_row: u32,
    late_in_a_row: u32,
    /// Targets sent, the latest first.
    targets: [f64; TARGETS_IN_FLIGHT],
    away_since: Option<Instant>,
    following_error: (f64, Duration),
}

/// What is held against the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scrutiny {
    /// Everything: the motor must follow.
    Full,
    /// It looks for its home: sensors and torque; angles mean nothing yet, and jump when the home is found.
    Homing,
    /// It is being given power: limits and sensors, but it need not follow yet.
    Enabling,
    /// It is being stopped: nothing that would keep from stopping it.
    Stopping,
}

impl Cycle {
    /// Before the first period; `at_rad` is where the handle is.
    pub fn new(
        file: &RigFile,
        limits: HandleLimits,
        samples: SamplePeriod,
        bits_per_period: u32,
        at_rad: f64,
    ) -> Self {
        let stretch = file.bench.map_or(1.0, |bench| bench.time_stretch);
        let period = Duration::from_micros(u64::from(file.period_us)).mul_f64(stretch);
        let patience = Duration::from_millis(u64::from(limits.following_error_ms)).mul_f64(stretch);
        Self {
            decoder: Decoder::new(file),
            freshness: Freshness::new(file),
            guard: Guard::new(limits, 1.0 / samples.rate_hz()),
            metronome: Metronome::new(period),
            tolerate: file.tolerate,
            bits_per_period,
            missed_in_a_row: 0,
            late_in_a_row: 0,
            targets: [at_rad; TARGETS_IN_FLIGHT],
            away_since: None,
            following_error: (limits.following_error_rad, patience),
        }
    }

    /// The latest readings.
    pub fn readings(&self) -> &Readings {
        self.decoder.readings()
    }

    /// The latest target, rad.
    pub fn target_rad(&self) -> f64 {
        self.targets[0]
    }

    /// Whether the latest targets differ: the motor is moving.
    pub fn is_moving(&self) -> bool {
        self.targets.iter().any(|target| *target != self.targets[0])
    }

    /// Samples in a period.
    pub fn samples(&self) -> usize {
        self.decoder.samples()
    }

    /// The limits in force.
    pub fn limits(&self) -> &HandleLimits {
        self.guard.limits()
    }

    /// One period: the target, SYNC at its time, the readings.
    ///
    /// # Errors
    /// What is wrong; nothing was done about it yet.
    pub fn run(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        tally: &mut Tally,
        command: (JointAngle, f64, Wish),
        scrutiny: Scrutiny,
    ) -> Result<(), CanFault> {
        let (target, shown_nm, wish) = command;
        drive.send_target(link, target, shown_nm, wish)?;
        self.targets.rotate_right(1);
        self.targets[0] = target.0;
        let late = self.metronome.wait();
        tally.lateness.add(late);
        self.check_lateness(late, scrutiny, tally)?;
        self.take_leftovers(link, drive, tally, scrutiny)?;
        self.decoder.begin();
        let sync = Instant::now();
        drive.send_sync(link)?;
        self.collect(link, drive, tally, scrutiny)?;
        drive.saw(self.decoder.readings());
        tally.response.add(sync.elapsed());
        tally.periods += 1;
        tally.bits += u64::from(self.bits_per_period);
        tally.seconds += self.metronome.period().as_secs_f64();
        self.examine(drive, scrutiny)
    }

    /// A wake-up later than a period has slept through a SYNC.
    fn check_lateness(
        &mut self,
        late: Duration,
        scrutiny: Scrutiny,
        tally: &mut Tally,
    ) -> Result<(), CanFault> {
        if late < self.metronome.period() {
            self.late_in_a_row = 0;
            return Ok(());
        }
        self.metronome.catch_up();
        tally.overruns += 1;
        self.late_in_a_row += 1;
        let tolerated = self.tolerate.missed_cycles_in_a_row;
        if self.late_in_a_row > tolerated && scrutiny != Scrutiny::Stopping {
            let in_a_row = self.late_in_a_row;
            return Err(CanFault::Overrun { late_us: late.as_micros() as u64, in_a_row, tolerated });
        }
        Ok(())
    }

    /// What arrived since the last period was complete belongs to no period.
    fn take_leftovers(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        tally: &mut Tally,
        scrutiny: Scrutiny,
    ) -> Result<(), CanFault> {
        // A flood must not keep the cycle from its SYNC.
        for _ in 0..256 {
            let Some(frame) = link.receive(Instant::now())? else { break };
            if self.decoder.knows(frame.id) {
                self.duplicate(frame.id, tally, scrutiny)?;
            } else if !drive.take(&frame)? {
                link.count_foreign()?;
            }
        }
        Ok(())
    }

    fn duplicate(&self, id: u16, tally: &mut Tally, scrutiny: Scrutiny) -> Result<(), CanFault> {
        tally.duplicates += 1;
        let (count, tolerated) = (tally.duplicates, self.tolerate.duplicate_frames);
        if count > tolerated && scrutiny != Scrutiny::Stopping {
            return Err(CanFault::Duplicated { id, count, tolerated });
        }
        Ok(())
    }

    /// Waits for the frames that answer SYNC.
    fn collect(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        tally: &mut Tally,
        scrutiny: Scrutiny,
    ) -> Result<(), CanFault> {
        let mut deadline = self.metronome.next();
        while !(self.decoder.complete() && drive.answered()) {
            match link.receive(deadline)? {
                Some(frame) => match self.decoder.take(&frame)? {
                    Taken::Yes => {}
                    Taken::Twice => self.duplicate(frame.id, tally, scrutiny)?,
                    Taken::Foreign if drive.take(&frame)? => {}
                    Taken::Foreign => link.count_foreign()?,
                },
                None if Instant::now() < deadline => {}
                None => {
                    tally.missed += 1;
                    self.missed_in_a_row += 1;
                    let (in_a_row, tolerated) = (self.missed_in_a_row, self.tolerate.missed_cycles_in_a_row);
                    if in_a_row > tolerated || scrutiny == Scrutiny::Stopping {
                        let id = self.decoder.first_missing().unwrap_or(0);
                        return Err(CanFault::MissedCycle { in_a_row, tolerated, id });
                    }
                    deadline = Instant::now() + self.metronome.period();
                }
            }
        }
        if Instant::now() < self.metronome.next() {
            self.missed_in_a_row = 0;
        } else {
            self.metronome.catch_up();
        }
        Ok(())
    }

    /// Holds the readings against everything that must be so.
    fn examine(&mut self, drive: &dyn Drive, scrutiny: Scrutiny) -> Result<(), CanFault> {
        if scrutiny == Scrutiny::Stopping {
            return Ok(());
        }
        let readings = *self.decoder.readings();
        if scrutiny == Scrutiny::Full {
            drive.check(&readings)?;
        }
        if let Some(channel) = readings.without_number(self.decoder.samples()) {
            return Err(CanFault::NotANumber { channel });
        }
        self.freshness.check(&readings)?;
        for sample in 0..self.decoder.samples() {
            let torque_nm = readings.torque_nm[sample];
            match scrutiny {
                Scrutiny::Homing => self.guard.check_torque(torque_nm)?,
                _ => self.guard.check(drive.angle(&readings, sample).0, torque_nm)?,
            }
        }
        if scrutiny == Scrutiny::Full {
            self.check_following(drive.angle(&readings, self.decoder.samples() - 1).0)?;
        }
        Ok(())
    }

    /// The handle must be near one of the targets that are under way. The drive watches the same by itself; this is
    /// for a drive that does not notice.
    fn check_following(&mut self, angle_rad: f64) -> Result<(), CanFault> {
        let off = self.targets.iter().map(|target| (target - angle_rad).abs());
        let error_rad = off.fold(f64::INFINITY, f64::min);
        let (limit_rad, patience) = self.following_error;
        if error_rad <= limit_rad {
            self.away_since = None;
            return Ok(());
        }
        let since = *self.away_since.get_or_insert_with(Instant::now);
        if since.elapsed() < patience {
            return Ok(());
        }
        Err(CanFault::FollowingError { error_rad, limit_rad })
    }
}
