//! What a motor with power was told: the targets, and how far and how suddenly they stepped.

/// Extremes of the targets that a powered motor received.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetLog {
    /// Lowest and highest target, rad.
    pub angles_rad: [f64; 2],
    /// Largest step from one target to the next, rad.
    pub largest_step_rad: f64,
    /// Largest change from one step to the next, rad.
    pub largest_step_change_rad: f64,
    /// Targets received.
    pub count: u64,
    last: Option<(f64, f64)>,
}

impl Default for TargetLog {
    fn default() -> Self {
        Self {
            angles_rad: [f64::INFINITY, f64::NEG_INFINITY],
            largest_step_rad: 0.0,
            largest_step_change_rad: 0.0,
            count: 0,
            last: None,
        }
    }
}

impl TargetLog {
    /// The motor has got power and stands at an angle.
    pub fn powered_at(&mut self, angle_rad: f64) {
        self.last = Some((angle_rad, 0.0));
    }

    /// A motor that has power receives a target.
    pub fn received(&mut self, target_rad: f64) {
        let [low, high] = self.angles_rad;
        self.angles_rad = [low.min(target_rad), high.max(target_rad)];
        self.count += 1;
        let (last_rad, last_step_rad) = self.last.unwrap_or((target_rad, 0.0));
        let step_rad = target_rad - last_rad;
        self.largest_step_rad = self.largest_step_rad.max(step_rad.abs());
        self.largest_step_change_rad = self.largest_step_change_rad.max((step_rad - last_step_rad).abs());
        self.last = Some((target_rad, step_rad));
    }
}
