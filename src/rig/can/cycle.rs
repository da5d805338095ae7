//! The control cycle: each period it sends the target, sends SYNC on time, receives the readings and checks them. It does
//! not allocate, wait for a lock or access a file.

use std::time::{Duration, Instant};

use super::canopen::Link;
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest};
use super::fault::CanFault;
use super::file::{CanRigFile, Tolerances};
use super::limits::HandleLimits;
use super::pdo_decoder::{Decoded, PdoDecoder, Readings};
use super::staleness::StalenessCheck;
use super::units::{JointAngle, SamplePeriod};
use crate::rig::LimitMonitor;
use crate::timing::PeriodicTimer;

/// Periods between a target and the motor being there: one to SYNC, one for the drive's interpolation.
const PENDING_TARGETS: usize = 3;

/// The cycle of a motor that has, or is given, power.
#[derive(Debug)]
pub struct Cycle {
    decoder: PdoDecoder,
    freshness: StalenessCheck,
    limits: HandleLimits,
    limit_monitor: LimitMonitor,
    timer: PeriodicTimer,
    tolerate: Tolerances,
    bits_per_period: u32,
    missed_in_a_row: u32,
    late_in_a_row: u32,
    /// Targets sent, the latest first.
    targets: [f64; PENDING_TARGETS],
    away_since: Option<Instant>,
    following_error: (f64, Duration),
}

/// Which checks are made on the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CheckLevel {
    /// All checks: the motor must follow its target.
    Full,
    /// Sensors and torque: the motor looks for its home, and angles have no meaning until it is found.
    Homing,
    /// Limits and sensors: the motor is given power and need not follow its target yet.
    Enabling,
    /// No checks: nothing may prevent the motor from being stopped.
    Stopping,
}

impl Cycle {
    /// Before the first period; `at_rad` is where the handle is.
    pub fn new(
        file: &CanRigFile,
        limits: HandleLimits,
        samples: SamplePeriod,
        bits_per_period: u32,
        at_rad: f64,
        now: Instant,
    ) -> Self {
        let stretch = file.bench.map_or(1.0, |bench| bench.time_stretch);
        let period = Duration::from_micros(u64::from(file.period_us)).mul_f64(stretch);
        let timeout = Duration::from_millis(u64::from(limits.following_error_ms)).mul_f64(stretch);
        Self {
            decoder: PdoDecoder::new(file),
            freshness: StalenessCheck::new(file),
            limits,
            limit_monitor: LimitMonitor::new(limits.measured(), samples.rate_hz()),
            timer: PeriodicTimer::new(period, now),
            tolerate: file.tolerate,
            bits_per_period,
            missed_in_a_row: 0,
            late_in_a_row: 0,
            targets: [at_rad; PENDING_TARGETS],
            away_since: None,
            following_error: (limits.following_error_rad, timeout),
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
        &self.limits
    }

    /// One period: the target, SYNC at its time, the readings.
    ///
    /// # Errors
    /// The first fault that was found. The motor is not made safe here.
    pub fn run(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        stats: &mut CycleStats,
        command: (JointAngle, f64, DriveRequest),
        check_level: CheckLevel,
    ) -> Result<(), CanFault> {
        let (target, shown_nm, request) = command;
        drive.send_target(link, target, shown_nm, request)?;
        self.targets.rotate_right(1);
        self.targets[0] = target.0;
        let late = self.timer.wait(link.clock());
        stats.lateness.add(late);
        self.check_lateness(late, link.now(), check_level, stats)?;
        self.receive_late_frames(link, drive, stats, check_level)?;
        self.decoder.begin();
        let sync = link.now();
        drive.send_sync(link)?;
        self.receive_replies(link, drive, stats, check_level)?;
        drive.period_complete(self.decoder.readings());
        stats.response.add(link.now().saturating_duration_since(sync));
        stats.periods += 1;
        stats.bits += u64::from(self.bits_per_period);
        stats.seconds += self.timer.period().as_secs_f64();
        self.check_readings(drive, link.now(), check_level)
    }

    /// A wake-up that is late by a period or more has missed a SYNC.
    fn check_lateness(
        &mut self,
        late: Duration,
        now: Instant,
        check_level: CheckLevel,
        stats: &mut CycleStats,
    ) -> Result<(), CanFault> {
        if late < self.timer.period() {
            self.late_in_a_row = 0;
            return Ok(());
        }
        self.timer.catch_up(now);
        stats.overruns += 1;
        self.late_in_a_row += 1;
        let tolerated = self.tolerate.missed_cycles_in_a_row;
        if self.late_in_a_row > tolerated && check_level != CheckLevel::Stopping {
            let in_a_row = self.late_in_a_row;
            return Err(CanFault::Overrun { late_us: late.as_micros() as u64, in_a_row, tolerated });
        }
        Ok(())
    }

    /// Receives frames that arrived after the last period was complete; they belong to no period.
    fn receive_late_frames(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        stats: &mut CycleStats,
        check_level: CheckLevel,
    ) -> Result<(), CanFault> {
        // A flood must not keep the cycle from its SYNC.
        for _ in 0..256 {
            let Some(frame) = link.receive(link.now())? else { break };
            if self.decoder.knows(frame.id) {
                self.count_duplicate(frame.id, stats, check_level)?;
            } else if !drive.handle_frame(&frame, link.now())? {
                link.count_foreign()?;
            }
        }
        Ok(())
    }

    fn count_duplicate(
        &self,
        id: u16,
        stats: &mut CycleStats,
        check_level: CheckLevel,
    ) -> Result<(), CanFault> {
        stats.duplicates += 1;
        let (count, tolerated) = (stats.duplicates, self.tolerate.duplicate_frames);
        if count > tolerated && check_level != CheckLevel::Stopping {
            return Err(CanFault::Duplicated { id, count, tolerated });
        }
        Ok(())
    }

    /// Waits for the frames that answer SYNC.
    fn receive_replies(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        stats: &mut CycleStats,
        check_level: CheckLevel,
    ) -> Result<(), CanFault> {
        let mut deadline = self.timer.next();
        while !(self.decoder.complete() && drive.has_replied()) {
            match link.receive(deadline)? {
                Some(frame) => match self.decoder.decode(&frame)? {
                    Decoded::Expected => {}
                    Decoded::Duplicate => self.count_duplicate(frame.id, stats, check_level)?,
                    Decoded::Foreign if drive.handle_frame(&frame, link.now())? => {}
                    Decoded::Foreign => link.count_foreign()?,
                },
                None if link.now() < deadline => {}
                None => {
                    stats.missed += 1;
                    self.missed_in_a_row += 1;
                    let (in_a_row, tolerated) = (self.missed_in_a_row, self.tolerate.missed_cycles_in_a_row);
                    if in_a_row > tolerated || check_level == CheckLevel::Stopping {
                        let id = self.decoder.first_missing().unwrap_or(0);
                        return Err(CanFault::MissedCycle { in_a_row, tolerated, id });
                    }
                    deadline = link.now() + self.timer.period();
                }
            }
        }
        if link.now() < self.timer.next() {
            self.missed_in_a_row = 0;
        } else {
            self.timer.catch_up(link.now());
        }
        Ok(())
    }

    /// Checks the readings of the period.
    fn check_readings(
        &mut self,
        drive: &dyn Drive,
        now: Instant,
        check_level: CheckLevel,
    ) -> Result<(), CanFault> {
        if check_level == CheckLevel::Stopping {
            return Ok(());
        }
        let readings = *self.decoder.readings();
        if check_level == CheckLevel::Full {
            drive.check(&readings, now)?;
        }
        if let Some(channel) = readings.channel_without_number(self.decoder.samples()) {
            return Err(CanFault::NotANumber { channel });
        }
        self.freshness.check(&readings)?;
        for sample in 0..self.decoder.samples() {
            let torque_nm = readings.torque_nm[sample];
            match check_level {
                CheckLevel::Homing => self.limit_monitor.check_torque(torque_nm)?,
                _ => self.limit_monitor.check(drive.angle(&readings, sample).0, torque_nm)?,
            }
        }
        if check_level == CheckLevel::Full {
            self.check_following(drive.angle(&readings, self.decoder.samples() - 1).0, now)?;
        }
        Ok(())
    }

    /// The handle must be near one of the targets that are under way. The drive watches the same by itself; this is
    /// for a drive that does not notice.
    fn check_following(&mut self, angle_rad: f64, now: Instant) -> Result<(), CanFault> {
        let off = self.targets.iter().map(|target| (target - angle_rad).abs());
        let error_rad = off.fold(f64::INFINITY, f64::min);
        let (limit_rad, timeout) = self.following_error;
        if error_rad <= limit_rad {
            self.away_since = None;
            return Ok(());
        }
        let since = *self.away_since.get_or_insert(now);
        if now.saturating_duration_since(since) < timeout {
            return Ok(());
        }
        Err(CanFault::FollowingError { error_rad, limit_rad })
    }
}
