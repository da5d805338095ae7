//! The control cycle: each period it sends the target, sends SYNC on time, receives the readings and checks them. It does
//! not allocate, wait for a lock or access a file. Which checks run is told by the table of the motor's states.

use std::time::{Duration, Instant};

use super::canopen::Link;
use super::cycle_stats::CycleStats;
use super::drive::{Drive, DriveRequest};
use super::fault::{CanFault, FaultKind};
use super::file::{Tolerances, ValidRigFile};
use super::limits::HandleLimits;
use super::motor_state::{AllowedTargets, Check, MotorState};
use super::pdo_decoder::{Decoded, PdoDecoder, Readings, Wanted};
use super::staleness::StalenessCheck;
use super::target_guard::TargetGuard;
use super::target_motion::TargetMotion;
use super::units::JointAngle;
use crate::rig::LimitMonitor;
use crate::timing::PeriodicTimer;

/// Periods between a target and the motor being there: one to SYNC, one for the drive's interpolation.
const PENDING_TARGETS: usize = 3;

/// Frames that are taken in after their time in one period.
const MAX_LATE_FRAMES: usize = 256;

/// What goes to the motor in a period.
#[derive(Debug, Clone, Copy)]
pub struct PeriodCommand {
    /// Target angle of the handle, rad.
    pub target_rad: f64,
    /// Torque on the display, N m.
    pub shown_nm: f64,
    /// What the motor is asked to do with the target.
    pub request: DriveRequest,
}

/// The cycle of a motor that has, or is given, power.
#[derive(Debug)]
pub struct Cycle {
    decoder: PdoDecoder,
    freshness: StalenessCheck,
    limits: HandleLimits,
    limit_monitor: LimitMonitor,
    guard: TargetGuard,
    timer: PeriodicTimer,
    /// Time from one SYNC to the next as the drive knows it, s; on the bench the clock takes longer.
    period_s: f64,
    tolerate: Tolerances,
    /// Silence of the program after which the motor stops by itself: never tolerated.
    watchdog: Duration,
    /// The emulated motor's time moves with SYNC: its late frames are waited for.
    waits_for_frames: bool,
    bits_per_period: u32,
    missed_in_a_row: u32,
    late_in_a_row: u32,
    /// When SYNC was sent last.
    synced: Instant,
    /// Targets sent, the latest first, rad.
    targets: [f64; PENDING_TARGETS],
    /// The latest target that the motor answered, rad, and the identifier that is missing since then.
    answered_rad: f64,
    unanswered: Option<u16>,
    away_since: Option<Instant>,
    following_error: (f64, Duration),
    /// The state of the latest period.
    state: MotorState,
    has_new_readings: bool,
    /// The program missed points of the grid while the motor was moving: it came to its latest target and stood.
    has_come_to_rest: bool,
    /// The fault that is being reacted to: it may go on.
    excused: Option<FaultKind>,
}

impl Cycle {
    /// Before the first period; the handle is taken to be at `at_rad`.
    pub fn new(file: &ValidRigFile, limits: HandleLimits, at_rad: f64, now: Instant) -> Self {
        let stretch = file.bench.map_or(1.0, |bench| bench.time_stretch);
        let stretched_ms = |ms: u16| Duration::from_millis(u64::from(ms)).mul_f64(stretch);
        let period_s = file.period().seconds();
        Self {
            decoder: PdoDecoder::new(file),
            freshness: StalenessCheck::new(file),
            limits,
            limit_monitor: LimitMonitor::new(limits.measured(), file.sample_period().rate_hz()),
            guard: TargetGuard::new(limits, period_s, at_rad),
            timer: PeriodicTimer::new(file.period().duration().mul_f64(stretch), now),
            period_s,
            tolerate: file.tolerate,
            // The waits of a bench file are stretched already.
            watchdog: Duration::from_millis(u64::from(file.master.motor_waits_ms)),
            waits_for_frames: file.bench.is_some(),
            bits_per_period: file.budget().bits_per_period(),
            missed_in_a_row: 0,
            late_in_a_row: 0,
            synced: now,
            targets: [at_rad; PENDING_TARGETS],
            answered_rad: at_rad,
            unanswered: None,
            away_since: None,
            following_error: (limits.following_error_rad, stretched_ms(limits.following_error_ms)),
            // Until the first period, the motor may have been moving by itself.
            state: MotorState::Homing,
            has_new_readings: false,
            has_come_to_rest: false,
            excused: None,
        }
    }

    /// The state of the motor in the latest period.
    pub fn state(&self) -> MotorState {
        self.state
    }

    /// The latest readings.
    pub fn readings(&self) -> &Readings {
        self.decoder.readings()
    }

    /// Time from one SYNC to the next, as the drive knows it, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Where the target is and how fast it moves.
    pub fn target_motion(&self) -> TargetMotion {
        self.guard.given()
    }

    /// Whether the latest targets differ: the motor is moving.
    pub fn is_moving(&self) -> bool {
        self.targets.iter().any(|target| *target != self.targets[0])
    }

    /// Whether the latest period brought new readings; otherwise they are those of before.
    pub fn has_new_readings(&self) -> bool {
        self.has_new_readings
    }

    /// Whether the motor stood in the middle of a movement since this was asked last.
    pub fn take_standstill(&mut self) -> bool {
        std::mem::take(&mut self.has_come_to_rest)
    }

    /// Samples in a period.
    pub fn samples(&self) -> usize {
        self.decoder.samples()
    }

    /// The limits in force.
    pub fn limits(&self) -> &HandleLimits {
        &self.limits
    }

    /// Whether the motor has heard nothing for so long that it stopped by itself.
    pub fn is_given_up_by_motor(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.synced) >= self.watchdog
    }

    /// The handle stands at an angle, from which the first targets are counted.
    pub fn stand_at(&mut self, angle_rad: f64) {
        self.guard.stand(angle_rad);
        self.targets = [angle_rad; PENDING_TARGETS];
        self.answered_rad = angle_rad;
    }

    /// Excuses a fault from now on: it is being reacted to, and may go on.
    pub fn excuse(&mut self, fault: &CanFault) {
        // Frames of a sensor that stay away are not waited for any more; those of the motor are never excused.
        let is_missed = matches!(fault, CanFault::MissedCycle { .. } | CanFault::Malformed { .. });
        self.excused = (!is_missed).then(|| fault.kind());
        // A wrong reading may be among the angles that the speed is taken from.
        self.limit_monitor.restart();
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
        command: PeriodCommand,
        state: MotorState,
    ) -> Result<(), CanFault> {
        let PeriodCommand { target_rad, shown_nm, request } = command;
        self.state = state;
        self.check_target(target_rad, request)?;
        drive.send_target(link, JointAngle(target_rad), shown_nm, request)?;
        let late = self.timer.wait(link.clock());
        self.receive_late_frames(link, drive, stats)?;
        let came_to_rest = self.check_wake_up(link, stats)?;
        let target_rad = if came_to_rest && request == DriveRequest::Follow {
            // What was sent before the gap must not start the motor with a jump.
            let at_rad = self.targets[0];
            drive.send_target(link, JointAngle(at_rad), shown_nm, request)?;
            at_rad
        } else {
            target_rad
        };
        self.decoder.begin();
        let sync = link.now();
        stats.begin_period(late, sync.saturating_duration_since(self.synced));
        self.synced = sync;
        drive.send_sync(link)?;
        self.targets.rotate_right(1);
        self.targets[0] = target_rad;
        match request {
            DriveRequest::Enable => self.guard.stand(target_rad),
            DriveRequest::Follow => self.guard.give(target_rad),
            DriveRequest::QuickStop | DriveRequest::RemovePower | DriveRequest::None => {}
        }
        self.has_new_readings = self.receive_replies(link, drive, stats)?;
        stats.response.add(link.now().saturating_duration_since(sync));
        stats.periods += 1;
        stats.bits += u64::from(self.bits_per_period);
        stats.seconds += self.timer.period().as_secs_f64();
        if !self.has_new_readings {
            // The readings are those of before; they were checked then.
            self.limit_monitor.skip(self.decoder.samples() as u64);
            return Ok(());
        }
        (self.answered_rad, self.unanswered) = (target_rad, None);
        drive.period_complete(self.decoder.readings());
        self.check_readings(drive, link.now())
    }

    /// No target that gives or has power is sent unchecked.
    fn check_target(&mut self, target_rad: f64, request: DriveRequest) -> Result<(), CanFault> {
        match (request, self.state.rule().targets) {
            (DriveRequest::QuickStop | DriveRequest::RemovePower | DriveRequest::None, _) => Ok(()),
            (DriveRequest::Enable, AllowedTargets::MeasuredAngle) => self.limits.check_target(target_rad),
            (DriveRequest::Follow, AllowedTargets::Guarded) => {
                self.check_missed(target_rad)?;
                self.guard.check(target_rad)
            }
            (DriveRequest::Follow, AllowedTargets::ComingToRest) => {
                self.guard.check_coming_to_rest(target_rad)
            }
            _ => Err(CanFault::TargetNotAllowed { state: self.state.name() }),
        }
    }

    /// Nobody knows whether a motor that did not answer got its targets. From the last one that it answered, the next one
    /// may be no further than the handle may be from its target.
    fn check_missed(&self, target_rad: f64) -> Result<(), CanFault> {
        let step_rad = (target_rad - self.answered_rad).abs();
        let limit_rad = self.limits.following_error_rad;
        match self.unanswered {
            Some(id) if step_rad > limit_rad => Err(CanFault::MissedInMotion { id, step_rad, limit_rad }),
            _ => Ok(()),
        }
    }

    /// A wake-up that is late by a period or more has missed a SYNC. The points of the grid that were missed are counted,
    /// and the next SYNC goes out on the grid again. Returns whether the motor was moving, and came to rest meanwhile.
    fn check_wake_up(&mut self, link: &Link, stats: &mut CycleStats) -> Result<bool, CanFault> {
        let lost = self.timer.catch_up(link.now());
        if lost == 0 {
            self.late_in_a_row = 0;
            return Ok(false);
        }
        let gap = link.now().saturating_duration_since(self.synced);
        stats.overruns += 1;
        // On the bench, the motor's time stands still as well: nothing is lost.
        if !self.waits_for_frames {
            stats.lose_periods(lost);
            self.late_in_a_row = self.late_in_a_row.saturating_add(u32::try_from(lost).unwrap_or(u32::MAX));
        }
        self.freshness.expect_gap(lost);
        let (in_a_row, tolerated) = (self.late_in_a_row, self.tolerate.missed_cycles_in_a_row);
        if (in_a_row > tolerated || gap >= self.watchdog) && self.state.makes(Check::WakeUp) {
            let late_us = gap.saturating_sub(self.timer.period()).as_micros() as u64;
            self.unless_excused(Err(CanFault::Overrun { late_us, in_a_row, tolerated }))?;
        }
        self.limit_monitor.skip(lost * self.decoder.samples() as u64);
        let came_to_rest = self.is_moving() && !self.waits_for_frames;
        if came_to_rest {
            self.has_come_to_rest = true;
            self.guard.stand(self.targets[0]);
        }
        self.timer.wait(link.clock());
        Ok(came_to_rest)
    }

    /// Receives frames that arrived after the last period was over; they belong to no period.
    fn receive_late_frames(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        stats: &mut CycleStats,
    ) -> Result<(), CanFault> {
        // A flood must not keep the cycle from its SYNC.
        for _ in 0..MAX_LATE_FRAMES {
            let Some(frame) = link.receive(link.now())? else { break };
            if self.decoder.knows(frame.id) {
                // One that was not waited for, or that was given up, is late; others are double.
                if self.decoder.take_owed(frame.id) {
                    self.freshness.expect_gap(1);
                } else if !self.decoder.is_missing(frame.id) {
                    self.count_duplicate(frame.id, stats)?;
                }
            } else if !drive.handle_frame(&frame, link.arrival())? {
                link.count_foreign()?;
            }
        }
        Ok(())
    }

    fn count_duplicate(&self, id: u16, stats: &mut CycleStats) -> Result<(), CanFault> {
        stats.duplicates += 1;
        let (count, tolerated) = (stats.duplicates, self.tolerate.duplicate_frames);
        if count > tolerated && self.state.makes(Check::MotorFrames) {
            return self.unless_excused(Err(CanFault::Duplicated { id, count, tolerated }));
        }
        Ok(())
    }

    /// Waits for the frames that answer SYNC. Returns whether the needed ones came in time, or late and tolerated.
    fn receive_replies(
        &mut self,
        link: &mut Link,
        drive: &mut dyn Drive,
        stats: &mut CycleStats,
    ) -> Result<bool, CanFault> {
        let wanted = if self.state.makes(Check::SensorFrames) { Wanted::All } else { Wanted::OfMotor };
        let mut deadline = self.timer.next();
        let mut read_late = 0;
        // Frames that are not needed are waited for as long as the next SYNC is sure to be on time.
        let optional_deadline = deadline - self.timer.period() / 4;
        loop {
            let has_needed = self.decoder.first_missing(wanted).is_none() && drive.has_replied();
            let has_all = self.decoder.first_missing(Wanted::All).is_none();
            if has_needed && (has_all || link.now() >= optional_deadline) {
                break;
            }
            let received = link.receive(if has_needed { optional_deadline } else { deadline })?;
            // What waited in a queue is read after the deadline as well, but a flood must not go on for ever.
            read_late += usize::from(link.now() >= deadline);
            match received.filter(|_| read_late <= MAX_LATE_FRAMES) {
                Some(frame) => match self.decoder.decode(&frame) {
                    Ok(Decoded::Expected) => {}
                    Ok(Decoded::Duplicate) => self.count_duplicate(frame.id, stats)?,
                    Ok(Decoded::Foreign) if drive.handle_frame(&frame, link.arrival())? => {}
                    Ok(Decoded::Foreign) => link.count_foreign()?,
                    Err(malformed) => self.unless_excused(Err(malformed))?,
                },
                None if has_needed || link.now() < deadline => {}
                None => {
                    self.count_missed(drive, wanted, stats)?;
                    // A stop goes on without them.
                    if !self.waits_for_frames || !self.state.makes(Check::MotorFrames) {
                        self.unanswered = self.decoder.first_missing(Wanted::OfMotor).or(drive.reply_id());
                        stats.lose_periods(1);
                        self.freshness.expect_unanswered();
                        self.decoder.give_up();
                        return Ok(false);
                    }
                    deadline = link.now() + self.timer.period();
                }
            }
        }
        if link.now() < self.timer.next() {
            self.missed_in_a_row = 0;
        } else if deadline == self.timer.next() {
            // It waited in a queue while the program was kept from running: late all the same.
            self.count_missed(drive, wanted, stats)?;
        } else {
            // Only on the bench: the grid went on while the emulated motor's time stood still.
            self.timer.catch_up(link.now());
        }
        Ok(true)
    }

    fn count_missed(
        &mut self,
        drive: &dyn Drive,
        wanted: Wanted,
        stats: &mut CycleStats,
    ) -> Result<(), CanFault> {
        stats.missed += 1;
        self.missed_in_a_row += 1;
        let (in_a_row, tolerated) = (self.missed_in_a_row, self.tolerate.missed_cycles_in_a_row);
        if in_a_row > tolerated && self.state.makes(Check::MotorFrames) {
            let id = self.decoder.first_missing(wanted).or(drive.reply_id()).unwrap_or(0);
            return self.unless_excused(Err(CanFault::MissedCycle { in_a_row, tolerated, id }));
        }
        Ok(())
    }

    /// Makes the checks of the state on the readings of the period.
    fn check_readings(&mut self, drive: &dyn Drive, now: Instant) -> Result<(), CanFault> {
        let readings = *self.decoder.readings();
        let samples = self.decoder.samples();
        if self.state.makes(Check::MotorReport) {
            self.unless_excused(drive.check(&readings, now))?;
        }
        if self.state.makes(Check::Sensors) {
            let missing = readings.channel_without_number(samples);
            missing.map_or(Ok(()), |channel| Err(CanFault::NotANumber { channel }))?;
            self.freshness.check(&readings)?;
        }
        for sample in 0..samples {
            let angle_rad = drive.angle(&readings, sample).0;
            if self.state.makes(Check::Angle) {
                let angle = self.limit_monitor.check_angle(angle_rad);
                self.unless_excused(angle.map_err(CanFault::from))?;
            }
            if self.state.makes(Check::Speed) {
                let speed = self.limit_monitor.check_speed(angle_rad);
                self.unless_excused(speed.map_err(CanFault::from))?;
            }
            if self.state.makes(Check::Torque) && self.decoder.has_torque() {
                let torque = self.limit_monitor.check_torque(readings.torque_nm[sample]);
                self.unless_excused(torque.map_err(CanFault::from))?;
            }
        }
        if self.state.makes(Check::Following) {
            let following = self.check_following(drive.angle(&readings, samples - 1).0, now);
            self.unless_excused(following)?;
        }
        Ok(())
    }

    fn unless_excused(&self, outcome: Result<(), CanFault>) -> Result<(), CanFault> {
        match outcome {
            Err(fault) if self.excused == Some(fault.kind()) => Ok(()),
            outcome => outcome,
        }
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
