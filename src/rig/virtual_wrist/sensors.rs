//! The encoder, the strain gauges and the EMG amplifier: resolution, noise, offset, delay.

use std::f64::consts::TAU;

use super::mechanism_list::MechanismList;
use super::person::Person;
use super::setup::Setup;
use super::wrist_response::channels;
use crate::random::Stream;
use crate::rig::Sample;
use crate::wrist::mechanisms::ChannelErrors;
use crate::wrist::{FurtherChannel, FurtherValues};

/// The sensors of a virtual rig.
#[derive(Debug, Clone)]
pub struct VirtualSensors {
    setup: Setup,
    disturbances: MechanismList,
    stream: Stream,
    /// Noise of the further channels, so that a sensor more does not change the others.
    further_stream: Stream,
    count_rad: f64,
    channels: ChannelErrors<f64>,
    angle: Delay,
    torque: Delay,
    further: [Delay; FurtherChannel::COUNT],
}

impl VirtualSensors {
    /// The sensors of a rig. Noise comes from `streams`: that of the torque, and that of the further channels.
    pub fn new(setup: &Setup, person: &Person, sample_rate_hz: f64, streams: [Stream; 2]) -> Self {
        let switched = person.mechanisms.and(&setup.mechanisms);
        let channels = channels(&switched);
        // The records show only which of the two channels is late.
        let torque_delay = channels.torque_delay_s * sample_rate_hz;
        let [stream, further_stream] = streams;
        Self {
            count_rad: TAU / setup.encoder_counts_per_revolution,
            setup: setup.clone(),
            disturbances: switched,
            stream,
            further_stream,
            channels,
            angle: Delay::new((-torque_delay).max(0.0)),
            torque: Delay::new(torque_delay.max(0.0)),
            // A torque that is early is one that all other channels are late behind.
            further: std::array::from_fn(|_| Delay::new((-torque_delay).max(0.0))),
        }
    }

    /// Begins anew, with random numbers of its own, as in [`VirtualSensors::new`].
    pub fn restart(&mut self, streams: [Stream; 2]) {
        [self.stream, self.further_stream] = streams;
        self.angle.restart();
        self.torque.restart();
        self.further.iter_mut().for_each(Delay::restart);
    }

    /// The recorded sample at `time_s` of the session, where the further channels would show `further` without an error.
    #[inline]
    pub fn measure(
        &mut self,
        angle_rad: f64,
        torque_nm: f64,
        emg_mvc: [f64; 2],
        further: &FurtherValues<f64>,
        time_s: f64,
    ) -> Sample {
        let angle_rad = self.channels.recorded_angle_rad(self.angle.step(angle_rad));
        let torque_nm = self.torque.step(torque_nm)
            + self.setup.gauge_offset_nm
            + self.setup.gauge_noise_nm * self.stream.normal()
            + self.disturbance(time_s);
        let step =
            |value: f64, step: f64| if step > 0.0 { (value / step).round_ties_even() * step } else { value };
        let emg = |value: f64| self.setup.emg.then(|| step(value, self.setup.emg_step_mvc));
        Sample {
            theta_m_rad: step(angle_rad, self.count_rad),
            torque_l_nm: step(torque_nm, self.setup.gauge_step_nm),
            emg_fcr_mvc: emg(emg_mvc[0]),
            emg_ecr_mvc: emg(emg_mvc[1]),
            further: std::array::from_fn(|place| self.measure_further(place, further)),
        }
    }

    /// What the further channel at this place shows; `None` if the rig does not have its sensor.
    fn measure_further(&mut self, place: usize, further: &FurtherValues<f64>) -> Option<f64> {
        let channel = FurtherChannel::ALL[place];
        let counted = |counts: Option<f64>| counts.map(|counts| (0.0, TAU / counts));
        let (noise, step) = match channel {
            FurtherChannel::HandleAngle => counted(self.setup.handle_encoder_counts_per_revolution),
            FurtherChannel::HandleAcceleration => {
                self.setup.accelerometer_noise_rad_s2.map(|noise| (noise, 0.0))
            }
            FurtherChannel::HandTorque => self.setup.hand_load_cell_noise_nm.map(|noise| (noise, 0.0)),
            FurtherChannel::JointAngle => counted(self.setup.joint_encoder_counts_per_revolution),
        }?;
        let value = self.further[place].step(further.of(channel));
        if step > 0.0 {
            return Some((value / step).round_ties_even() * step);
        }
        Some(value + noise * self.further_stream.normal())
    }

    fn disturbance(&self, time_s: f64) -> f64 {
        let mut first = 0;
        let mut sum_nm = 0.0;
        for kind in &self.disturbances.kinds {
            let next = first + kind.parameter_count();
            sum_nm += kind.disturbance_nm(&self.disturbances.parameters[first..next], time_s);
            first = next;
        }
        sum_nm
    }
}

/// A delay by any number of samples, integer or fractional.
#[derive(Debug, Clone)]
struct Delay {
    samples: f64,
    /// The latest values, the newest last; three more than the delay, for the cubic between samples.
    values: Vec<f64>,
    started: bool,
}

impl Delay {
    fn new(samples: f64) -> Self {
        let length = if samples > 0.0 { samples as usize + 4 } else { 0 };
        Self { samples, values: vec![0.0; length], started: false }
    }

    fn restart(&mut self) {
        self.started = false;
    }

    #[inline]
    fn step(&mut self, value: f64) -> f64 {
        if self.values.is_empty() {
            return value;
        }
        if !self.started {
            self.started = true;
            self.values.fill(value);
        }
        self.values.rotate_left(1);
        let newest = self.values.len() - 1;
        self.values[newest] = value;
        // Lagrange's cubic through the four samples about the wanted moment; near the newest, through the last four.
        let place = newest as f64 - self.samples;
        let first = (place.floor() as usize).saturating_sub(1).min(newest - 3);
        let x = place - first as f64;
        let y = &self.values[first..first + 4];
        -y[0] * (x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0 + y[1] * x * (x - 2.0) * (x - 3.0) / 2.0
            - y[2] * x * (x - 1.0) * (x - 3.0) / 2.0
            + y[3] * x * (x - 1.0) * (x - 2.0) / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_of_any_number_of_samples_delays_by_that_many() {
        for samples in [0.3, 1.0, 1.5, 2.0, 7.25] {
            let mut delay = Delay::new(samples);
            let wave = |n: f64| libm::sin(TAU * 50.0 / 2500.0 * n);
            for n in 0..200 {
                let late = delay.step(wave(f64::from(n)));
                if n > 20 {
                    assert!((late - wave(f64::from(n) - samples)).abs() < 1e-4, "delay {samples} at {n}");
                }
            }
        }
    }

    const FURTHER: FurtherValues<f64> =
        FurtherValues { theta_l: 0.0123, alpha_l: -250.0, torque_h: 1.4, theta_j: 0.0321 };

    fn streams() -> [Stream; 2] {
        ["noise", "noise/further"].map(|name| Stream::new(1, name))
    }

    #[test]
    fn a_sensor_that_the_rig_has_not_shows_nothing_and_one_that_it_has_changes_no_other() {
        let plain = Setup::default();
        let more = Setup {
            handle_encoder_counts_per_revolution: Some(20_000.0),
            accelerometer_noise_rad_s2: Some(3.0),
            hand_load_cell_noise_nm: Some(0.02),
            ..Setup::default()
        };
        let [without, with] = [plain, more].map(|setup| {
            let mut sensors = VirtualSensors::new(&setup, &Person::default(), 2500.0, streams());
            (0..5000).map(|_| sensors.measure(0.1, 1.5, [0.2, 0.02], &FURTHER, 0.0)).collect::<Vec<Sample>>()
        });
        assert!(without.iter().all(|sample| sample.further == [None; FurtherChannel::COUNT]));
        for (a, b) in without.iter().zip(&with) {
            assert_eq!(*a, Sample { further: a.further, ..*b });
            assert_eq!(b.further[3], None);
        }
        let step = TAU / 20_000.0;
        let angle = with[0].further[0].unwrap();
        assert!(
            (angle - 0.0123).abs() <= step / 2.0 && ((angle / step) - (angle / step).round()).abs() < 1e-9
        );
        for (place, mean, sd) in [(1, -250.0, 3.0), (2, 1.4, 0.02)] {
            let values: Vec<f64> = with.iter().map(|sample| sample.further[place].unwrap()).collect();
            let found = values.iter().sum::<f64>() / values.len() as f64;
            let squares = values.iter().map(|x| (x - found) * (x - found)).sum::<f64>();
            assert!((found - mean).abs() < 5.0 * sd / 5000f64.sqrt(), "{place}: mean {found}");
            assert!(((squares / values.len() as f64).sqrt() / sd - 1.0).abs() < 0.05, "{place}");
        }
    }

    #[test]
    fn the_sensors_show_steps_of_their_size_and_noise_of_their_size() {
        let setup = Setup::default();
        let mut sensors = VirtualSensors::new(&setup, &Person::default(), 2500.0, streams());
        let samples: Vec<Sample> =
            (0..20_000).map(|_| sensors.measure(0.1, 1.5, [0.2, 0.02], &FURTHER, 0.0)).collect();
        let counts = samples[0].theta_m_rad / (TAU / 131_072.0);
        assert!((counts - counts.round()).abs() < 1e-6 && (samples[0].theta_m_rad - 0.1).abs() < 3e-5);
        let mean = samples.iter().map(|sample| sample.torque_l_nm).sum::<f64>() / 2e4;
        let variance = samples.iter().map(|sample| (sample.torque_l_nm - mean).powi(2)).sum::<f64>() / 2e4;
        assert!((mean - 1.53).abs() < 5e-4, "mean {mean}");
        assert!((variance.sqrt() / setup.gauge_noise_nm - 1.0).abs() < 0.03);
    }
}
