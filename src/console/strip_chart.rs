//! Data of the strip charts: the extremes of each bin of 10 ms in the last minute.

use std::collections::VecDeque;

use serde::Serialize;

use crate::rig::Cue;
use crate::session::Step;

/// Width of a bin, s.
pub const BIN_S: f64 = 0.01;
/// Number of bins: one minute.
const BINS_KEPT: usize = 6000;

/// Extremes of the signals in one bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Start of the bin, s.
    pub t_s: f64,
    /// Lowest and highest angle, rad.
    pub angle_rad: [f32; 2],
    /// Lowest and highest torque on the display, N m.
    pub torque_nm: [f32; 2],
    /// Highest smoothed EMG of flexor and extensor, MVC; `None` where it is not measured.
    pub emg_mvc: [Option<f32>; 2],
    /// The target, N m, while there is one.
    pub target_nm: Option<f32>,
    /// Fraction of the gate's time that the torque has been in the band, 0 to 1.
    pub gate: f32,
}

/// The latest bins; the last one is still being filled.
#[derive(Debug, Default)]
pub struct StripChart {
    bins: VecDeque<Bin>,
    /// Number of the oldest bin.
    first: u64,
}

impl StripChart {
    /// Adds a measured step at time `t_s`.
    pub fn take(&mut self, t_s: f64, step: &Step) {
        let Some(sample) = step.measured else { return };
        let begins_s = (t_s / BIN_S).floor() * BIN_S;
        let target_nm = match step.cue {
            Cue::Target { target_nm, .. } => Some(target_nm as f32),
            _ => None,
        };
        let (angle, torque) = (sample.theta_m_rad as f32, step.feedback_torque_nm as f32);
        let emg = step.feedback_emg_mvc.map(|level| level.map(|value| value as f32));
        match self.bins.back_mut().filter(|bin| begins_s <= bin.t_s) {
            Some(bin) => {
                bin.angle_rad = [bin.angle_rad[0].min(angle), bin.angle_rad[1].max(angle)];
                bin.torque_nm = [bin.torque_nm[0].min(torque), bin.torque_nm[1].max(torque)];
                for (highest, now) in bin.emg_mvc.iter_mut().zip(emg) {
                    *highest = highest.zip(now).map(|(highest, now)| highest.max(now)).or(now);
                }
                bin.gate = step.gate_fraction as f32;
            }
            None => {
                self.bins.push_back(Bin {
                    t_s: begins_s,
                    angle_rad: [angle; 2],
                    torque_nm: [torque; 2],
                    emg_mvc: emg,
                    target_nm,
                    gate: step.gate_fraction as f32,
                });
                if self.bins.len() > BINS_KEPT {
                    self.bins.pop_front();
                    self.first += 1;
                }
            }
        }
    }

    /// The complete bins from number `next` on, and the number of the bin after them.
    pub fn since(&self, next: u64) -> (Vec<Bin>, u64) {
        let end = self.first + self.bins.len().saturating_sub(1) as u64;
        let skipped = next.clamp(self.first, end) - self.first;
        let whole = self.bins.len().saturating_sub(1) - skipped as usize;
        (self.bins.iter().skip(skipped as usize).take(whole).copied().collect(), end)
    }

    /// Removes all bins; the numbers of new bins continue.
    pub fn clear(&mut self) {
        self.first += self.bins.len() as u64;
        self.bins.clear();
    }
}
