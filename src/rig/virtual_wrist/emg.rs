//! Surface EMG of flexor and extensor: noise between 20 and 450 Hz in proportion to the muscle's activity.

use super::noise::{Biquad, cheap_normal, noise_gain};
use super::person::{Muscles, Person, Reflex};
use super::voluntary::{TrialSpread, VoluntaryTorque};
use crate::random::Stream;

/// Standard deviation of a normal number whose absolute value has mean 1.
const DEVIATION_OF_UNIT_MEAN: f64 = 1.253_314_137_315_500_1;

/// Cut-off frequencies of the virtual amplifier, of second order each, Hz: the band of the paper's amplifier, or what the
/// sampling rate leaves of it.
pub fn amplifier_band_hz(sample_rate_hz: f64) -> [f64; 2] {
    [20.0, 450f64.min(0.45 * sample_rate_hz)]
}

/// EMG of the flexor carpi radialis (FCR) and the extensor carpi radialis (ECR).
#[derive(Debug, Clone)]
pub struct Emg {
    muscles: Muscles,
    reflex: Reflex,
    spread: super::person::Spread,
    stream: Stream,
    bands: [[Biquad; 2]; 2],
    gain: f64,
    flexor_factor: f64,
    cocontraction: f64,
}

impl Emg {
    /// The EMG of `person`.
    pub fn new(person: &Person, sample_rate_hz: f64, stream: Stream) -> Self {
        let [lowest_hz, highest_hz] = amplifier_band_hz(sample_rate_hz);
        let band =
            [Biquad::high_pass(lowest_hz, sample_rate_hz), Biquad::low_pass(highest_hz, sample_rate_hz)];
        Self {
            muscles: person.muscles,
            reflex: person.reflex,
            spread: person.spread,
            stream,
            bands: [band; 2],
            gain: DEVIATION_OF_UNIT_MEAN / noise_gain(band.to_vec()),
            flexor_factor: 1.0,
            cocontraction: person.muscles.cocontraction,
        }
    }

    /// Resets the filters and takes a new stream of random numbers.
    pub fn restart(&mut self, stream: Stream) {
        self.stream = stream;
        self.bands.iter_mut().flatten().for_each(Biquad::restart);
    }

    /// Sets the activity of this trial. Returns the flexor's excess over what is usual at this torque and the extensor's
    /// level, as fractions of MVC.
    pub fn prepare(&mut self, spread: &TrialSpread, target_nm: f64) -> [f64; 2] {
        let active = target_nm.abs() / self.muscles.flexion_nm;
        self.flexor_factor = libm::exp(self.spread.flexor_emg * spread.flexor_emg);
        let factor = libm::exp(self.spread.cocontraction * spread.cocontraction);
        self.cocontraction = self.muscles.cocontraction * factor;
        [active * (self.flexor_factor - 1.0), active * self.cocontraction]
    }

    /// The next sample of FCR and ECR, fraction of nominal MVC.
    pub fn step(
        &mut self,
        voluntary: &VoluntaryTorque,
        since_onset_s: Option<f64>,
        speed_rad_s: f64,
    ) -> [f64; 2] {
        let [flexion, extension] = voluntary.activity();
        let reflex = since_onset_s.map_or(0.0, |since_onset_s| {
            let burst = burst(since_onset_s - self.reflex.emg_latency_s, self.reflex.rise_s);
            self.reflex.emg_mvc_s_per_rad * speed_rad_s * burst
        });
        let levels = [
            flexion * self.flexor_factor
                + self.cocontraction * extension
                + reflex
                + self.muscles.emg_at_rest_mvc,
            extension + self.cocontraction * flexion + self.muscles.emg_at_rest_mvc,
        ];
        let mut signals = [0.0; 2];
        for ((signal, level), [high, low]) in signals.iter_mut().zip(levels).zip(&mut self.bands) {
            *signal = level * self.gain * low.step(high.step(cheap_normal(&mut self.stream)));
        }
        signals
    }
}

/// A burst that begins at 0, has its peak of 1 at `rise_s` and decays: (t/r) exp(1 - t/r).
pub fn burst(t_s: f64, rise_s: f64) -> f64 {
    let x = t_s / rise_s;
    if x > 0.0 { x * libm::exp(1.0 - x) } else { 0.0 }
}
