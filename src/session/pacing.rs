//! How the control loop keeps its time: as fast as possible, or in real time.

use std::time::Duration;

use crate::rig::Vitals;
use crate::timing::{Clock, Histogram, PeriodicTimer, SystemClock};

/// Decides when the next period of the control loop begins.
pub trait Pacing {
    /// Waits for the next period.
    fn wait(&mut self);

    /// How well the periods were kept; `None` if they are not tied to a clock.
    fn vitals(&self) -> Option<Vitals> {
        None
    }
}

/// Simulated time: the next period begins at once.
#[derive(Debug, Default)]
pub struct Unpaced;

impl Pacing for Unpaced {
    fn wait(&mut self) {}
}

/// Real time: the periods begin at points on a fixed grid, however long the one before took.
#[derive(Debug)]
pub struct RealTime {
    clock: SystemClock,
    timer: PeriodicTimer,
    lateness: Histogram,
}

impl RealTime {
    /// `rate_hz` periods a second, beginning now.
    pub fn new(rate_hz: f64) -> Self {
        let clock = SystemClock::default();
        let timer = PeriodicTimer::new(Duration::from_secs_f64(1.0 / rate_hz), clock.now());
        Self { clock, timer, lateness: Histogram::default() }
    }

    /// By how much the periods began late.
    pub fn lateness(&self) -> &Histogram {
        &self.lateness
    }
}

impl Pacing for RealTime {
    fn wait(&mut self) {
        let late = self.timer.wait(&self.clock);
        self.lateness.add(late);
    }

    fn vitals(&self) -> Option<Vitals> {
        Some(Vitals {
            periods: self.lateness.count(),
            late_p99_us: self.lateness.quantile_us(0.99),
            latest_us: self.lateness.longest_us(),
            missed: self.lateness.longer_than(self.timer.period()),
            ..Vitals::default()
        })
    }
}
