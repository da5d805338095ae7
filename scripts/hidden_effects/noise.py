"""What a person and the instruments add: unsteady voluntary torque, gauge and encoder noise, EMG.

All of it is added to the raw signals, so that whoever filters them filters the noise too.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfilt

from .streams import stream

TREMOR_HZ = (8.5, 10.5)  # of healthy subjects
TREMOR_SPREAD_HZ = 0.3
WANDER_HZ = (0.15, 2.5)


def _white(white, sample_hz):
    return white


def _one_over_f(white, sample_hz):
    """Half of the power white, half with a density that falls as 1/f above 1 Hz."""
    hz = np.fft.rfftfreq(white.shape[1], 1 / sample_hz)
    density = 1 / np.maximum(hz, 1.0)
    gain = np.sqrt(0.5 + 0.5 * density / density.mean())
    return np.fft.irfft(np.fft.rfft(white, axis=1) * gain, white.shape[1], axis=1)


# The gauge's noise from white noise of the same standard deviation.
SPECTRA = {"white": _white, "1/f": _one_over_f}


class CannotHold(RuntimeError):
    """A person who never keeps the torque within the gate."""


def low_pass(sample_hz):
    """The paper's filter."""
    return butter(3, 50.0, fs=sample_hz)


def voluntary_torque(seed, person, torque_nm, fine_t, laboratory):
    """The hold: target, offset, wander below 2.5 Hz and tremor, redrawn until it passes the gate that starts a ramp."""
    rng = stream(seed, "voluntary torque")
    gauge = stream(seed, "gauge noise")
    step = max(1, round((fine_t[1] - fine_t[0]) ** -1 / laboratory.sample_hz))
    white = person.gauge_noise_nm * gauge.standard_normal((len(torque_nm), len(fine_t[::step])))
    noise = SPECTRA[laboratory.gauge_spectrum](white, laboratory.sample_hz)
    out = np.empty((len(torque_nm), len(fine_t)))
    waiting = np.arange(len(torque_nm))
    for _ in range(500):
        target = torque_nm[waiting, None]
        out[waiting] = target * (1 + _unsteadiness(rng, person, len(waiting), fine_t, laboratory.tremor_frequency))
        measured = out[waiting][:, ::step] + noise[waiting]
        waiting = waiting[~gate_held(measured, torque_nm[waiting], fine_t[::step], laboratory)]
        if len(waiting) == 0:
            return out, noise
    raise CannotHold("this person cannot hold the target torque; the noise is too large for the gate")


def gate_held(torque, target, t, laboratory):
    """Was the 50 Hz torque within the band for the whole time before the onset at t = 0?"""
    filtered = target[:, None] + lfilter(*low_pass(laboratory.sample_hz), torque - target[:, None], axis=1)
    before = (t >= -laboratory.gate_s) & (t <= 0)
    return np.all(np.abs(filtered[:, before] / target[:, None] - 1) < laboratory.gate_fraction, axis=1)


def _unsteadiness(rng, person, n, fine_t, tremor_frequency):
    """Fraction of the torque: sums of sines on a coarse grid, splined onto the fine one."""
    coarse = np.arange(fine_t[0], fine_t[-1] + 0.01, 0.004)
    wander = _sines(rng, n, coarse, rng.uniform(*WANDER_HZ, (n, 12)), person.wander)
    tremor_hz = np.clip(person.tremor_hz + rng.normal(0, TREMOR_SPREAD_HZ, (n, 4)), *(tremor_frequency * hz for hz in TREMOR_HZ))
    tremor = _sines(rng, n, coarse, tremor_hz, person.tremor)
    return CubicSpline(coarse, wander + tremor, axis=1)(fine_t)


def _sines(rng, n, t, hz, rms):
    size = rng.rayleigh(1.0, hz.shape) / np.sqrt(hz.shape[1]) * rms
    phase = rng.uniform(0, 2 * np.pi, hz.shape)
    sine = lambda i: np.sin(2 * np.pi * hz[:, i, None] * t + phase[:, i, None])
    return sum(size[:, i, None] * sine(i) for i in range(hz.shape[1]))


def encoder(angle_rad, counts):
    count = 2 * np.pi / counts
    return np.round(angle_rad / count) * count


def emg(seed, person, trials, t, burst_onset_s, sample_hz):
    """Rectified EMG of FCR and ECR; the stretch gives FCR a burst from `burst_onset_s` on."""
    rng = stream(seed, "emg")
    band = butter(2, [20.0, 450.0], btype="band", fs=sample_hz, output="sos")
    lead = 250
    carrier = sosfilt(band, rng.standard_normal((2, len(trials), len(t) + lead)), axis=-1)[..., lead:]
    carrier = np.abs(carrier) / np.mean(np.abs(carrier))
    late = (t - burst_onset_s) / 0.006
    burst = np.where(late > 0, np.maximum(late, 0) * np.exp(1 - np.maximum(late, 0)), 0.0)
    strength = person.emg["burst"] * trials.velocity_rad_s[:, None] / 2.0
    return carrier[0] * trials.emg_fcr_mvc[:, None] * (1 + strength * burst), carrier[1] * trials.emg_ecr_mvc[:, None]
