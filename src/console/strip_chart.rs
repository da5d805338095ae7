//! The strip charts: what was measured lately, the extremes of each hundredth of a second.

use std::collections::VecDeque;

use serde::Serialize;

use super::step_feed::TimedStep;
use crate::rig::Cue;

/// Width of a bin, s.
pub const BIN_S: f64 = 0.01;
/// Bins that are kept: a minute.
const KEPT: usize = 6000;

/// What was measured in one bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Its beginning, s.
    pub t_s: f64,
    /// Lowest and highest angle, rad.
    pub angle_rad: [f32; 2],
    /// Lowest and highest torque on the display, N m.
    pub torque_nm: [f32; 2],
    /// Highest smoothed EMG of flexor and extensor, MVC.
    pub emg_mvc: [f32; 2],
    /// The target, N m, while there is one.
    pub target_nm: Option<f32>,
    /// How much of the gate's time was held, 0 to 1.
    pub gate: f32,
}

/// The bins so far; the latest is still growing.
#[derive(Debug, Default)]
pub struct StripChart {
    bins: VecDeque<Bin>,
    /// Number of the first bin that is kept.
    first: u64,
}

impl StripChart {
    /// Takes a measured step in.
    pub fn take(&mut self, t_s: f64, beat: &TimedStep) {
        let Some(sample) = beat.step.measured else { return };
        let begins_s = (t_s / BIN_S).floor() * BIN_S;
        let target_nm = match beat.cue {
            Cue::Target { target_nm, .. } => Some(target_nm as f32),
            _ => None,
        };
        let (angle, torque) = (sample.theta_m_rad as f32, beat.shown_nm as f32);
        let emg = beat.emg_mvc.map(|value| value as f32);
        match self.bins.back_mut().filter(|bin| begins_s <= bin.t_s) {
            Some(bin) => {
                bin.angle_rad = [bin.angle_rad[0].min(angle), bin.angle_rad[1].max(angle)];
                bin.torque_nm = [bin.torque_nm[0].min(torque), bin.torque_nm[1].max(torque)];
                bin.emg_mvc = [bin.emg_mvc[0].max(emg[0]), bin.emg_mvc[1].max(emg[1])];
                bin.gate = beat.gate as f32;
            }
            None => {
                self.bins.push_back(Bin {
                    t_s: begins_s,
                    angle_rad: [angle; 2],
                    torque_nm: [torque; 2],
                    emg_mvc: emg,
                    target_nm,
                    gate: beat.gate as f32,
                });
                if self.bins.len() > KEPT {
                    self.bins.pop_front();
                    self.first += 1;
                }
            }
        }
    }

    /// Every bin from number `next` on that grows no more, and the number after them.
    pub fn since(&self, next: u64) -> (Vec<Bin>, u64) {
        let end = self.first + self.bins.len().saturating_sub(1) as u64;
        let skipped = next.clamp(self.first, end) - self.first;
        let whole = self.bins.len().saturating_sub(1) - skipped as usize;
        (self.bins.iter().skip(skipped as usize).take(whole).copied().collect(), end)
    }

    /// Forgets everything; numbers go on, so that nobody takes new bins for old ones.
    pub fn clear(&mut self) {
        self.first += self.bins.len() as u64;
        self.bins.clear();
    }
}
