//! Mistakes that a session can have and still parse.

use ramphold::dataset::{Session, Trial};

/// A mistake.
pub struct Mistake {
    /// Its name.
    pub name: &'static str,
    /// Makes it; `false` where the session has nothing to make it in.
    pub make: fn(&mut Session) -> bool,
}

const fn mistake(name: &'static str, make: fn(&mut Session) -> bool) -> Mistake {
    Mistake { name, make }
}

/// The mistakes.
pub const MISTAKES: [Mistake; 29] = [
    mistake("angle in degrees", |s| each(s, |t| scale(&mut t.record.theta_m_rad, 57.295_78))),
    mistake("angle in milliradians", |s| each(s, |t| scale(&mut t.record.theta_m_rad, 1e3))),
    mistake("speed in degrees a second", |s| each(s, |t| t.velocity_rad_s *= 57.295_78)),
    mistake("torque of the wrong sign", |s| each(s, |t| scale(&mut t.record.torque_l_nm, -1.0))),
    mistake("angle of the wrong sign", |s| each(s, |t| scale(&mut t.record.theta_m_rad, -1.0))),
    mistake("left hand on a right one", |s| {
        each(s, |t| {
            scale(&mut t.record.theta_m_rad, -1.0);
            scale(&mut t.record.torque_l_nm, -1.0);
        })
    }),
    mistake("onset 100 ms late", |s| each(s, |t| shift(t, 0.1))),
    mistake("onset 20 ms late", |s| each(s, |t| shift(t, 0.02))),
    mistake("onset 20 ms early", |s| each(s, |t| shift(t, -0.02))),
    mistake("onset 100 ms early", |s| each(s, |t| shift(t, -0.1))),
    mistake("onset of one trial 20 ms late", |s| {
        s.trials[0].onset_s = s.trials[0].onset_s.map(|onset| onset + 0.02);
        s.trials[0].onset_s.is_some()
    }),
    mistake("onset of one trial 20 ms early", |s| {
        s.trials[0].onset_s = s.trials[0].onset_s.map(|onset| onset - 0.02);
        s.trials[0].onset_s.is_some()
    }),
    mistake("time in milliseconds", |s| {
        s.sample_rate_hz /= 1e3;
        each(s, |t| {
            t.onset_s = t.onset_s.map(|onset| 1e3 * onset);
            t.record.start_s *= 1e3;
        })
    }),
    mistake("torque in N cm", |s| each(s, |t| scale(&mut t.record.torque_l_nm, 100.0))),
    mistake("torque in mN m", |s| each(s, |t| scale(&mut t.record.torque_l_nm, 1e3))),
    mistake("stated torque in N cm", |s| each(s, |t| t.torque_nm *= 100.0)),
    mistake("angle zeroed half a turn elsewhere", |s| {
        each(s, |t| t.record.theta_m_rad.iter_mut().for_each(|x| *x += std::f64::consts::PI))
    }),
    mistake("torque measured at a fifth of the rate", |s| {
        each(s, |t| {
            let torque = &mut t.record.torque_l_nm;
            (0..torque.len()).for_each(|at| torque[at] = torque[at - at % 5]);
        })
    }),
    mistake("angle and torque swapped", |s| {
        each(s, |t| std::mem::swap(&mut t.record.theta_m_rad, &mut t.record.torque_l_nm))
    }),
    mistake("speed and torque swapped in the table", |s| {
        each(s, |t| std::mem::swap(&mut t.velocity_rad_s, &mut t.torque_nm))
    }),
    mistake("rows of the table in another order", |s| {
        let rows: Vec<(f64, f64)> = s.trials.iter().map(|t| (t.velocity_rad_s, t.torque_nm)).collect();
        for (index, trial) in s.trials.iter_mut().enumerate() {
            (trial.velocity_rad_s, trial.torque_nm) = rows[(index + 1) % rows.len()];
        }
        true
    }),
    mistake("two records with different torques exchanged", |s| {
        exchange(s, |a, b| a.torque_nm != b.torque_nm)
    }),
    mistake("two records with different speeds exchanged", |s| {
        exchange(s, |a, b| a.velocity_rad_s.abs() > 1.2 * b.velocity_rad_s.abs())
    }),
    mistake("torque of one trial of the wrong sign", |s| {
        scale(&mut s.trials[0].record.torque_l_nm, -1.0);
        true
    }),
    mistake("torque of one trial in N cm", |s| {
        scale(&mut s.trials[0].record.torque_l_nm, 100.0);
        true
    }),
    mistake("EMG of half its size as offset", |s| emg(s, |i, x| 0.1 + if (i / 3) % 2 == 0 { x } else { -x })),
    mistake("EMG in percent", |s| emg(s, |_, x| 100.0 * x)),
    mistake("EMG in microvolts (0.5 mV at MVC)", |s| emg(s, |_, x| 500.0 * x)),
    mistake("EMG in millivolts (0.5 mV at MVC)", |s| emg(s, |_, x| 0.5 * x)),
];

fn each(session: &mut Session, change: impl Fn(&mut Trial)) -> bool {
    session.trials.iter_mut().for_each(change);
    true
}

fn scale(values: &mut [f64], factor: f64) {
    values.iter_mut().for_each(|value| *value *= factor);
}

/// Exchanges the record of the first trial with that of the first one that differs.
fn exchange(session: &mut Session, differs: impl Fn(&Trial, &Trial) -> bool) -> bool {
    let differs = |other: &Trial| differs(&session.trials[0], other) || differs(other, &session.trials[0]);
    let Some(other) = session.trials.iter().position(differs) else { return false };
    let record = session.trials[0].record.clone();
    session.trials[0].record = std::mem::replace(&mut session.trials[other].record, record);
    true
}

fn shift(trial: &mut Trial, by_s: f64) {
    trial.onset_s = trial.onset_s.map(|onset| onset + by_s);
}

fn emg(session: &mut Session, change: impl Fn(usize, f64) -> f64) -> bool {
    let mut is_there = false;
    for trial in &mut session.trials {
        let channels = [&mut trial.record.emg_fcr_mvc, &mut trial.record.emg_ecr_mvc];
        for signal in channels.into_iter().flatten() {
            is_there = true;
            signal.iter_mut().enumerate().for_each(|(i, x)| *x = change(i, *x));
        }
    }
    is_there
}
