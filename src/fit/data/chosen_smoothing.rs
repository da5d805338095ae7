//! How far recorded angles are smoothed: as far as their errors ask for, and no further.
//!
//! A wide smoothing takes the errors of the encoder out of the motion, and with them what the motor really does in a few milliseconds. The
//! width is the one with the smallest estimated square of both together, behind the filter of the torque (Mallows 1973, C_p).

use crate::signal::{Section, filter};
use crate::wrist::Smoothing;

/// Half-widths among which is chosen, s: each 1.4 times the one before, up to half of what is recorded beyond the window.
const HALF_WIDTHS_S: [f64; 7] = [0.001, 0.0014, 0.002, 0.0028, 0.004, 0.0056, 0.008];

/// Time in which a filter of 50 Hz or more forgets an impulse, s.
const FORGOTTEN_S: f64 = 0.1;

/// Records of an angle.
pub struct AngleRecords {
    /// The records, rad, from before the onset to beyond the end of the window.
    pub angle_rad: Vec<Vec<f64>>,
    /// Sample of the onset.
    pub onset: usize,
    /// Variance of the error of a sample, rad^2.
    pub variance_rad2: f64,
}

/// The smoothing that leaves the least error in the `samples` from the onset on of `records` that pass `sections`, `period_s` apart.
pub fn smoothing(records: &[AngleRecords], samples: usize, sections: &[Section], period_s: f64) -> Smoothing {
    let candidates = HALF_WIDTHS_S.map(|half_s| Smoothing { half_s, twice: true });
    let error = |smoothing: Smoothing| -> f64 {
        let [left, taken_out] = gains(smoothing, sections, period_s);
        let of_records = records.iter().map(|own| {
            let of_errors = samples as f64 * own.angle_rad.len() as f64 * own.variance_rad2;
            own.taken_out(smoothing, samples, sections, period_s) + of_errors * (left - taken_out)
        });
        of_records.sum()
    };
    let nearer = |best: (Smoothing, f64), own: (Smoothing, f64)| if own.1 < best.1 { own } else { best };
    let errors = candidates.map(|own| (own, error(own)));
    errors.into_iter().fold((candidates[0], f64::INFINITY), nearer).0
}

impl AngleRecords {
    /// Square of what the smoothing takes out of the records, behind the filter, summed over records and samples: of the motion, and of
    /// the errors.
    fn taken_out(&self, smoothing: Smoothing, samples: usize, sections: &[Section], period_s: f64) -> f64 {
        let of_record = |angle: &Vec<f64>| -> f64 {
            let smoothed = smoothing.motion(angle, period_s);
            let change: Vec<f64> = smoothed.iter().zip(angle).map(|(knot, own)| knot.theta - own).collect();
            let behind = filter(sections, &change);
            behind.iter().skip(self.onset).take(samples).map(|own| own * own).sum()
        };
        self.angle_rad.iter().map(of_record).sum()
    }
}

/// Variances, behind the filter, of what a smoothing leaves of a white error of variance one, and of what it takes out of it.
fn gains(smoothing: Smoothing, sections: &[Section], period_s: f64) -> [f64; 2] {
    // Smoothing narrows near the ends of a record; the filter has forgotten the impulse after some of its periods.
    let reach = smoothing.reach(period_s);
    let middle = 2 * reach + 1;
    let mut impulse = vec![0.0; 2 * middle + (FORGOTTEN_S / period_s) as usize];
    impulse[middle] = 1.0;
    let left: Vec<f64> = smoothing.motion(&impulse, period_s).iter().map(|knot| knot.theta).collect();
    let taken_out: Vec<f64> = left.iter().zip(&impulse).map(|(smooth, own)| smooth - own).collect();
    [left, taken_out].map(|own| filter(sections, &own).iter().map(|value| value * value).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::signal::FilterSpec;

    const PERIOD_S: f64 = 0.0005;

    /// A ramp that rises in 4 ms, recorded in steps, nine times.
    fn ramp(step_rad: f64) -> AngleRecords {
        let mut stream = Stream::new(3, "smoothing");
        let onset = 80;
        let angle = |sample: usize, rest: f64| {
            let t = (sample as f64 - onset as f64) * PERIOD_S;
            let rise = 0.004;
            let whole = if t < 0.0 {
                0.0
            } else if t < rise {
                t * t / (2.0 * rise)
            } else {
                t - 0.5 * rise
            };
            libm::round((2.0 * whole + rest) / step_rad) * step_rad
        };
        let record = |_| {
            let rest = step_rad * stream.uniform();
            (0..240).map(|sample| angle(sample, rest)).collect()
        };
        AngleRecords {
            angle_rad: (0..9).map(record).collect(),
            onset,
            variance_rad2: step_rad * step_rad / 12.0,
        }
    }

    fn half_width_s(bits: i32) -> f64 {
        let filter = FilterSpec::Butterworth { order: 3, cutoff_hz: 300.0, zero_phase: false };
        let sections = filter.sections(1.0 / PERIOD_S).unwrap();
        let records = [ramp(std::f64::consts::TAU / libm::exp2(f64::from(bits)))];
        smoothing(&records, 80, &sections, PERIOD_S).half_s
    }

    #[test]
    fn a_fine_encoder_is_smoothed_less_than_a_coarse_one() {
        let widths = [22, 16, 12].map(half_width_s);
        assert!(widths[0] <= 0.0014, "{widths:?}");
        assert!(widths[0] < widths[1] && widths[1] < widths[2], "{widths:?}");
    }
}
