//! Where the signal of a trial is in a recording, by the correlation coefficient at every lag.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::event_match::EventCandidate;

/// Rate at which places are sought first, Hz: ramp and stretch response last some ten milliseconds.
const COARSE_HZ: f64 = 200.0;

/// Two places are at least this far apart, s.
const APART_S: f64 = 0.05;

/// A signal with samples at equal steps.
#[derive(Debug, Clone, Copy)]
pub struct Sampled<'a> {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Samples a second.
    pub rate_hz: f64,
    /// Its values.
    pub values: &'a [f64],
}

impl Sampled<'_> {
    fn time_s(&self, sample: f64) -> f64 {
        self.start_s + sample / self.rate_hz
    }

    /// Means over pieces, at the coarse rate or the next that is a part of its own.
    fn coarse(&self) -> (f64, Vec<f64>) {
        let width = ((self.rate_hz / COARSE_HZ) as usize).max(1);
        let means = self.values.chunks_exact(width).map(|piece| piece.iter().sum::<f64>() / width as f64);
        (self.rate_hz / width as f64, means.collect())
    }

    /// The mean over `width_s` about a time, of the samples there, or the value between two samples; `None` where it is not all there.
    pub fn mean_at(&self, time_s: f64, width_s: f64) -> Option<f64> {
        let place = |time_s: f64| (time_s - self.start_s) * self.rate_hz;
        let (first, last) = (place(time_s - 0.5 * width_s).ceil(), place(time_s + 0.5 * width_s).floor());
        if last <= first {
            return self.at(time_s);
        }
        if !(first >= 0.0 && (last as usize) < self.values.len()) {
            return None;
        }
        let within = &self.values[first as usize..=last as usize];
        Some(within.iter().sum::<f64>() / within.len() as f64)
    }

    /// The value at a time, between the samples about it; `None` outside.
    fn at(&self, time_s: f64) -> Option<f64> {
        let place = (time_s - self.start_s) * self.rate_hz;
        let before = place.floor();
        if !(before >= 0.0 && (before as usize) + 1 < self.values.len()) {
            return None;
        }
        let (at, share) = (before as usize, place - before);
        Some(self.values[at] * (1.0 - share) + self.values[at + 1] * share)
    }
}

/// A recording with gaps, in whose pieces trials are sought.
pub struct PiecewiseRecording<'a> {
    pieces: Vec<SearchedRecording<'a>>,
}

impl<'a> PiecewiseRecording<'a> {
    /// The pieces of `values`, sampled at `times_s`, between the gaps that begin after the samples `gaps`.
    pub fn new(times_s: &[f64], values: &'a [f64], rate_hz: f64, gaps: &[usize]) -> Self {
        let mut pieces = Vec::new();
        let mut from = 0;
        for to in gaps.iter().map(|gap| gap + 1).chain([values.len()]) {
            let (own_s, own) = (&times_s[from..to], &values[from..to]);
            if !own.is_empty() {
                // The mean is off by less than one time that was rounded.
                let off_s = own_s
                    .iter()
                    .enumerate()
                    .map(|(sample, time_s)| time_s - own_s[0] - sample as f64 / rate_hz);
                let start_s = own_s[0] + off_s.sum::<f64>() / own.len() as f64;
                pieces.push(SearchedRecording::new(Sampled { start_s, rate_hz, values: own }));
            }
            from = to;
        }
        Self { pieces }
    }

    /// The places of all pieces at which `trial` fits best, as [`SearchedRecording::places`].
    pub fn places(&mut self, trial: Sampled, most: usize) -> Vec<EventCandidate> {
        let mut places: Vec<EventCandidate> =
            self.pieces.iter_mut().flat_map(|piece| piece.places(trial, most)).collect();
        places.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        places.truncate(most);
        places.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        places
    }

    /// As [`SearchedRecording::refined`], in the piece of the place.
    pub fn refined(&self, trial: Sampled, place: EventCandidate) -> EventCandidate {
        self.piece(place.time_s).map_or(place, |piece| piece.refined(trial, place))
    }

    /// As [`Sampled::mean_at`], in the piece of that time.
    pub fn mean_at(&self, time_s: f64, width_s: f64) -> Option<f64> {
        self.piece(time_s)?.whole.mean_at(time_s, width_s)
    }

    /// The last piece that begins before a time.
    fn piece(&self, time_s: f64) -> Option<&SearchedRecording<'a>> {
        let after = self.pieces.partition_point(|piece| piece.whole.start_s <= time_s);
        self.pieces.get(after.checked_sub(1)?)
    }
}

/// A recording without gaps in which trials are sought.
struct SearchedRecording<'a> {
    whole: Sampled<'a>,
    coarse_hz: f64,
    coarse: Vec<f64>,
    /// Sums of the coarse values and of their squares up to each.
    sums: Vec<[f64; 2]>,
    planner: FftPlanner<f64>,
}

impl<'a> SearchedRecording<'a> {
    /// Prepares a recording.
    fn new(whole: Sampled<'a>) -> Self {
        let (coarse_hz, mut coarse) = whole.coarse();
        let mean = coarse.iter().sum::<f64>() / coarse.len().max(1) as f64;
        coarse.iter_mut().for_each(|value| *value -= mean);
        let mut sums = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for value in &coarse {
            sum = [sum[0] + value, sum[1] + value * value];
            sums.push(sum);
        }
        Self { whole, coarse_hz, coarse, sums, planner: FftPlanner::new() }
    }

    /// The places at which `trial` fits best, at most `most`, in order of time: when its time 0 is there, and the correlation
    /// coefficient.
    fn places(&mut self, trial: Sampled, most: usize) -> Vec<EventCandidate> {
        // The trial at the steps of the coarse recording.
        let duration_s = trial.values.len().saturating_sub(1) as f64 / trial.rate_hz;
        let length = (duration_s * self.coarse_hz) as usize;
        if length < 4 {
            return Vec::new();
        }
        let (own_hz, means) = trial.coarse();
        let own = Sampled { start_s: 0.0, rate_hz: own_hz, values: &means };
        let template: Vec<f64> =
            (0..length).map_while(|sample| own.at(sample as f64 / self.coarse_hz)).collect();
        if template.len() > self.coarse.len() {
            return Vec::new();
        }
        let coefficients = self.coefficients(&template);
        // The mean over a piece is at its middle.
        let middle_s = |rate_hz: f64, coarse_hz: f64| 0.5 * (1.0 / coarse_hz - 1.0 / rate_hz);
        let shift_s = middle_s(self.whole.rate_hz, self.coarse_hz) - middle_s(trial.rate_hz, own_hz);
        let apart = (APART_S * self.coarse_hz).ceil() as usize;
        let mut peaks: Vec<(usize, f64)> = coefficients
            .iter()
            .copied()
            .enumerate()
            .filter(|(at, own)| {
                let around =
                    &coefficients[at.saturating_sub(apart)..(at + apart + 1).min(coefficients.len())];
                *own > 0.0 && around.iter().all(|other| other <= own)
            })
            .collect();
        peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
        peaks.truncate(most);
        peaks.sort_by_key(|peak| peak.0);
        let time_s = |at: usize| self.whole.time_s(at as f64 * self.whole.rate_hz / self.coarse_hz) + shift_s;
        peaks
            .into_iter()
            .map(|(at, weight)| EventCandidate { time_s: time_s(at) - trial.start_s, weight })
            .collect()
    }

    /// Correlation coefficient of the template with the coarse recording from each sample on.
    fn coefficients(&mut self, template: &[f64]) -> Vec<f64> {
        let length = template.len();
        let mean = template.iter().sum::<f64>() / length as f64;
        let norm: f64 = template.iter().map(|value| (value - mean) * (value - mean)).sum();
        let size = (self.coarse.len() + length).next_power_of_two();
        let transformed = |values: &mut dyn Iterator<Item = f64>, planner: &mut FftPlanner<f64>| {
            let mut own: Vec<Complex<f64>> = values.map(|value| Complex::new(value, 0.0)).collect();
            own.resize(size, Complex::new(0.0, 0.0));
            planner.plan_fft_forward(size).process(&mut own);
            own
        };
        let recording = transformed(&mut self.coarse.iter().copied(), &mut self.planner);
        let wanted = transformed(&mut template.iter().map(|value| value - mean), &mut self.planner);
        let mut product: Vec<Complex<f64>> =
            recording.iter().zip(&wanted).map(|(own, wanted)| own * wanted.conj()).collect();
        self.planner.plan_fft_inverse(size).process(&mut product);
        (0..=self.coarse.len() - length)
            .map(|at| {
                let sum = |place: usize| self.sums[at + length][place] - self.sums[at][place];
                let spread = sum(1) - sum(0) * sum(0) / length as f64;
                let scale = (norm * spread).sqrt();
                // A stretch without any change has no correlation; rounding leaves a little of it.
                let flat = 1e-12 * self.sums[self.sums.len() - 1][1].max(f64::MIN_POSITIVE);
                if scale > 0.0 && spread > flat { product[at].re / size as f64 / scale } else { 0.0 }
            })
            .collect()
    }

    /// The place near `place` at which `trial` fits best, to a part of a sample.
    fn refined(&self, trial: Sampled, place: EventCandidate) -> EventCandidate {
        let step_s = 0.5 / self.whole.rate_hz.max(trial.rate_hz);
        let reach = (1.5 / self.coarse_hz / step_s).ceil() as i64;
        let at = |step: i64| place.time_s + step as f64 * step_s;
        let fits: Vec<f64> = (-reach..=reach).map(|step| self.coefficient_at(trial, at(step))).collect();
        let best = (0..fits.len()).max_by(|a, b| fits[*a].total_cmp(&fits[*b])).unwrap_or(0);
        let mut time_s = at(best as i64 - reach);
        if best > 0 && best + 1 < fits.len() {
            // The vertex of the parabola through the best and its neighbours.
            let (before, own, after) = (fits[best - 1], fits[best], fits[best + 1]);
            let bend = before - 2.0 * own + after;
            if bend < 0.0 {
                time_s += 0.5 * (before - after) / bend * step_s;
            }
        }
        EventCandidate { time_s, weight: fits.get(best).copied().unwrap_or(0.0) }
    }

    /// Correlation coefficient with the time 0 of the trial at `time_s` of the recording, over the samples of the recording.
    fn coefficient_at(&self, trial: Sampled, time_s: f64) -> f64 {
        let first = (time_s + trial.start_s - self.whole.start_s) * self.whole.rate_hz;
        let last = first + trial.values.len() as f64 * self.whole.rate_hz / trial.rate_hz;
        let from = first.max(0.0).ceil() as usize;
        let to = (last.max(0.0) as usize).min(self.whole.values.len());
        let mut sums = [0.0; 6];
        for sample in from..to {
            let Some(y) = trial.at(self.whole.time_s(sample as f64) - time_s) else { continue };
            let x = self.whole.values[sample];
            for (sum, term) in sums.iter_mut().zip([1.0, x, y, x * x, y * y, x * y]) {
                *sum += term;
            }
        }
        let [count, x, y, xx, yy, xy] = sums;
        let scale = ((xx - x * x / count) * (yy - y * y / count)).sqrt();
        if scale > 0.0 { (xy - x * y / count) / scale } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::random::Stream;

    /// A signal of noise below 30 Hz as a function of time, with a ramp at 0.5 s.
    fn signal(seed: u64) -> impl Fn(f64) -> f64 {
        let mut stream = Stream::new(seed, "correlation");
        let waves: Vec<[f64; 3]> =
            (0..40).map(|_| [1.0 + 29.0 * stream.uniform(), 6.3 * stream.uniform(), 0.05]).collect();
        move |time_s: f64| {
            let ramp = ((time_s - 0.5) / 0.05).clamp(0.0, 1.0);
            ramp + waves
                .iter()
                .map(|[hz, phase, size]| size * libm::sin(TAU * hz * time_s + phase))
                .sum::<f64>()
        }
    }

    #[test]
    fn a_trial_is_found_in_a_recording_of_another_rate_to_a_tenth_of_a_millisecond() {
        let trials: Vec<Vec<f64>> = (0..5)
            .map(|trial| {
                let own = signal(trial);
                (0..2500).map(|sample| own(f64::from(sample) / 2500.0)).collect()
            })
            .collect();
        let begin_s = |trial: usize| 3.0 + 7.123_456 * trial as f64;
        for rate_hz in [1000.0, 2048.0, 4000.0] {
            let mut stream = Stream::new(9, "noise");
            let values: Vec<f64> = (0..(40.0 * rate_hz) as usize)
                .map(|sample| {
                    let time_s = 100.0 + sample as f64 / rate_hz;
                    let trial = (0..5).find(|trial| (0.0..1.0).contains(&(time_s - 100.0 - begin_s(*trial))));
                    let own =
                        trial.map_or(0.0, |trial| signal(trial as u64)(time_s - 100.0 - begin_s(trial)));
                    -4.0 + 2.5 * (own + 0.02 * stream.normal())
                })
                .collect();
            let mut searched = SearchedRecording::new(Sampled { start_s: 100.0, rate_hz, values: &values });
            for (number, values) in trials.iter().enumerate() {
                let trial = Sampled { start_s: 0.0, rate_hz: 2500.0, values };
                let places = searched.places(trial, 10);
                let best = places.iter().max_by(|a, b| a.weight.total_cmp(&b.weight)).unwrap();
                let refined = searched.refined(trial, *best);
                let off_s = refined.time_s - 100.0 - begin_s(number);
                assert!(off_s.abs() < 1e-4 && refined.weight > 0.99, "{rate_hz} Hz: {off_s}, {refined:?}");
            }
        }
    }

    #[test]
    fn a_flat_recording_or_one_shorter_than_the_trial_has_no_place() {
        let values: Vec<f64> = (0..2500).map(|sample| signal(1)(f64::from(sample) / 2500.0)).collect();
        let trial = Sampled { start_s: 0.0, rate_hz: 2500.0, values: &values };
        for recording in [vec![1.0; 100_000], values[..1200].to_vec()] {
            let own = Sampled { start_s: 0.0, rate_hz: 2500.0, values: &recording };
            assert_eq!(SearchedRecording::new(own).places(trial, 10), []);
        }
    }
}
