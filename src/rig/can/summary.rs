//! What happened on the bus, for the session's folder and for the operator.

use std::fmt;

use serde::Serialize;

use super::canopen::{Counters, Link};
use super::cycle_stats::CycleStats;
use super::fault::CanFault;
use super::file::ValidRigFile;
use super::realtime::Privileges;
use crate::timing::Histogram;

/// The bus of a session, summed up.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Format and version of this file.
    pub format: &'static str,
    /// Name of the rig.
    pub rig: String,
    /// The bus.
    pub bus: String,
    /// Time from one SYNC to the next, us, as the drive was told.
    pub period_us: u32,
    /// What the system granted; `null` if it was not armed.
    pub realtime: Option<Privileges>,
    /// Periods.
    pub periods: u64,
    /// Periods whose frames came too late.
    pub missed_cycles: u64,
    /// Points in time that were slept through.
    pub overruns: u64,
    /// Periods without new readings: slept through, or their frames were lost.
    pub lost_periods: u64,
    /// Frames that came twice.
    pub duplicate_frames: u64,
    /// Load of the bus while armed, 0 to 1, at worst stuffing.
    pub bus_load: f64,
    /// How late the program woke up.
    pub lateness: DurationSummary,
    /// From SYNC to the last frame that answers it.
    pub response: DurationSummary,
    /// Frames and errors.
    pub frames: Counters,
    /// What the adapter or the operating system said when the bus was gone; `null` if it never was.
    pub adapter_error: Option<String>,
    /// The motor that small motions have proved with a free handle, for `proved_with_free_handle` of the rig file.
    pub proved: Option<String>,
    /// Every fault, in order, in words.
    pub faults: Vec<String>,
}

/// A histogram in short, and whole.
#[derive(Debug, Clone, Serialize)]
pub struct DurationSummary {
    /// Median, us.
    pub p50_us: u64,
    /// 99 %, us.
    pub p99_us: u64,
    /// 99.9 %, us.
    pub p999_us: u64,
    /// Longest, us.
    pub longest_us: u64,
    /// Upper end in us and count of each bucket that is not empty.
    pub buckets: Vec<(u64, u64)>,
}

impl From<&Histogram> for DurationSummary {
    fn from(histogram: &Histogram) -> Self {
        Self {
            p50_us: histogram.quantile_us(0.5),
            p99_us: histogram.quantile_us(0.99),
            p999_us: histogram.quantile_us(0.999),
            longest_us: histogram.longest_us(),
            buckets: histogram.buckets().collect(),
        }
    }
}

impl Summary {
    pub(super) fn new(
        file: &ValidRigFile,
        stats: &CycleStats,
        link: &Link,
        realtime: Option<&Privileges>,
        proved: Option<&str>,
        faults: &[CanFault],
    ) -> Self {
        Self {
            format: "ramphold-bus/1",
            rig: file.name.clone(),
            bus: file.bus.to_string(),
            period_us: file.period_us,
            realtime: realtime.cloned(),
            periods: stats.periods,
            missed_cycles: stats.missed,
            overruns: stats.overruns,
            lost_periods: stats.lost_periods,
            duplicate_frames: stats.duplicates,
            bus_load: stats.load(f64::from(file.bit_rate.bits_per_s())),
            lateness: (&stats.lateness).into(),
            response: (&stats.response).into(),
            frames: *link.counters(),
            adapter_error: link.adapter_error().map(ToString::to_string),
            proved: proved.map(str::to_owned),
            faults: faults.iter().map(ToString::to_string).collect(),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "{} on {}: {} periods of {} us, {} missed, {} overruns, {} lost, load {:.0} %",
            self.rig,
            self.bus,
            self.periods,
            self.period_us,
            self.missed_cycles,
            self.overruns,
            self.lost_periods,
            self.bus_load * 100.0
        )?;
        let late = &self.lateness;
        writeln!(
            formatter,
            "  woke up late by p50 {} us, p99 {} us, p99.9 {} us, at most {} us",
            late.p50_us, late.p99_us, late.p999_us, late.longest_us
        )?;
        let frames = &self.frames;
        write!(
            formatter,
            "  {} frames sent, {} received, {} foreign, {} twice, {} garbled, {} bus errors, {} emergencies",
            frames.sent,
            frames.received,
            frames.foreign,
            self.duplicate_frames,
            frames.garbled,
            frames.bus_errors,
            frames.emergencies
        )?;
        if let Some(error) = &self.adapter_error {
            write!(formatter, "\n  the bus was gone: {error}")?;
        }
        if let Some(proved) = &self.proved {
            write!(
                formatter,
                "\n  proved with a free handle; for the rig file: \"proved_with_free_handle\": \"{proved}\""
            )?;
        }
        self.realtime.iter().try_for_each(|realtime| {
            let said = |what: &Result<(), String>| match what {
                Ok(()) => "yes".to_owned(),
                Err(why) => format!("no ({why})"),
            };
            write!(
                formatter,
                "\n  real-time priority: {}; memory locked: {}; one core: {}",
                said(&realtime.realtime_priority),
                said(&realtime.memory_locked),
                said(&realtime.pinned)
            )
        })
    }
}
