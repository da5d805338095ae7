//! The trials that were found in a recording, and how its clock compares with that of the session.

use super::attachment::{ClockComparison, StepBetweenTrials};
use super::clock_jump::{RampPair, clock_steps};

/// A trial that was found.
#[derive(Debug, Clone, Copy)]
pub struct AlignedRamp {
    /// Number of the trial.
    pub trial: u32,
    /// When its ramp began, on the clock of the recording, s.
    pub onset_s: f64,
    /// How far that is off the straight line between the clocks, s.
    pub residual_s: Option<f64>,
}

/// What was found of all trials.
#[derive(Debug)]
pub struct AlignedRamps {
    /// How they were found.
    pub by: String,
    /// The trials.
    pub trials: Vec<AlignedRamp>,
    /// How the clocks compare.
    pub clock: ClockComparison,
    /// Where the clocks step against each other.
    pub clock_steps: Vec<StepBetweenTrials>,
    /// Rate of the recording's clock over that of the session, where known.
    pub speed: Option<f64>,
    /// Why the other trials are not among them.
    pub why_not_found: &'static str,
}

impl Default for AlignedRamps {
    fn default() -> Self {
        Self {
            by: String::new(),
            trials: Vec::new(),
            clock: ClockComparison::default(),
            clock_steps: Vec::new(),
            speed: None,
            why_not_found: "its ramp was not found in the recording",
        }
    }
}

impl AlignedRamps {
    /// Fits one speed of the recording's clock, and an offset for each stretch, to the pairs of the trials. What comes after a step of the
    /// clocks is a stretch of its own.
    pub fn compare_clocks(&mut self, mut pairs: Vec<RampPair>, resolution_s: f64) {
        let steps = clock_steps(&pairs, resolution_s);
        self.clock_steps = steps
            .iter()
            .map(|step| StepBetweenTrials {
                after_trial: self.trials[step.before].trial,
                before_trial: self.trials[step.before + 1].trial,
                step_s: step.step_s,
            })
            .collect();
        let ahead = |at: usize| steps.iter().filter(|step| step.before < at).count();
        for (at, pair) in pairs.iter_mut().enumerate().filter(|(_, pair)| pair.0 != usize::MAX) {
            pair.0 += ahead(at);
        }
        self.fit_line(&pairs);
    }

    fn fit_line(&mut self, pairs: &[RampPair]) {
        let mut stretches: Vec<usize> = pairs.iter().map(|pair| pair.0).collect();
        stretches.sort_unstable();
        stretches.dedup();
        // A stretch that is not known has no times.
        stretches.retain(|stretch| *stretch != usize::MAX);
        let mean = |stretch: usize, of: fn(&(usize, f64, f64)) -> f64| {
            let own: Vec<f64> = pairs.iter().filter(|pair| pair.0 == stretch).map(of).collect();
            own.iter().sum::<f64>() / own.len() as f64
        };
        let means: Vec<(usize, f64, f64)> = stretches
            .iter()
            .map(|own| (*own, mean(*own, |pair| pair.1), mean(*own, |pair| pair.2)))
            .collect();
        let centred = |pair: &(usize, f64, f64)| {
            let own = means.iter().find(|mean| mean.0 == pair.0)?;
            Some((pair.1 - own.1, pair.2 - own.2))
        };
        let known: Vec<(f64, f64)> = pairs.iter().filter_map(centred).collect();
        let square: f64 = known.iter().map(|(session, _)| session * session).sum();
        if square == 0.0 {
            return;
        }
        let speed = known.iter().map(|(session, own)| session * own).sum::<f64>() / square;
        let residual = |pair: &(usize, f64, f64)| centred(pair).map(|(session, own)| own - speed * session);
        for (trial, pair) in self.trials.iter_mut().zip(pairs) {
            trial.residual_s = residual(pair);
        }
        // The speed, and an offset of each stretch, are taken from the same times.
        let free = known.len().saturating_sub(1 + means.len());
        let squares: f64 = pairs.iter().filter_map(residual).map(|own| own * own).sum();
        let largest = pairs.iter().filter_map(residual).fold(0.0, |most: f64, own| most.max(own.abs()));
        self.speed = Some(speed);
        self.clock.drift_ppm = Some((speed - 1.0) * 1e6);
        self.clock.residual_rms_s = (free > 0).then(|| (squares / free as f64).sqrt());
        self.clock.residual_largest_s = (free > 0).then_some(largest);
    }
}
