"""Mechanisms of the torque's sensor, amplifier and converter."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d
from scipy.signal import bessel, bilinear, cont2discrete, lfilter

from ..plant import FINE_HZ
from ..scenario import SIZES
from .law import by_torque, by_trial, constant, drifting, law


@law("channel_skew", "constant", "torque recorded at t is that of t - delay", "assumed: one converter for two channels")
def constant_skew(s, size, rng):
    return _skew(s, size, rng, constant, [], "positive: torque late")


@law("channel_skew", "drifting", "the delay grows by 20 % over the session", "assumed: two clocks")
def drifting_skew(s, size, rng):
    return _skew(s, size, rng, drifting, ["delay_s"], "positive: torque late; the value is the mean")


@law("channel_skew", "by_trial", "another delay in each trial, with a standard deviation of 10 %", "assumed: buffers of two devices")
def skew_by_trial(s, size, rng):
    return _skew(s, size, rng, lambda scenario: by_trial(scenario, rng), ["delay_s"], "positive: torque late; the value is the mean")


def _skew(s, size, rng, way, nominal, note):
    delay = size * SIZES["channel_skew"]["delay_s"] * rng.choice([-1, 1])
    each = delay * way(s)

    def shift(t, torque, *_):
        if np.ndim(each) == 0:
            return CubicSpline(t, torque, axis=1)(np.clip(t - each, t[0], t[-1]))
        return np.stack([CubicSpline(t, row)(np.clip(t - d, t[0], t[-1])) for row, d in zip(torque, each)])

    s.torque_chain.append(shift)
    return {"delay_s": float(delay)}, nominal, note


@law("torque_lag", "two_poles", "second order, poles a factor 10 apart", "assumed: an amplifier behind a gauge")
def two_poles(s, size, rng):
    cutoff = SIZES["torque_lag"]["cutoff_hz"] / size
    poles = 2 * np.pi * cutoff * np.array([1.1, 11.0])
    num, den, _ = cont2discrete((np.prod(poles), np.poly(-poles)), 1 / FINE_HZ, method="foh")
    _filtered(s, num.ravel(), den)
    return {"cutoff_hz": cutoff}, ["cutoff_hz"], "poles a factor 10 apart; the value is the single pole of the same delay"


@law("torque_lag", "one_pole", "dT_rec/dt = 2 pi cutoff (T - T_rec)", "an RC filter")
def one_pole(s, size, rng):
    cutoff = SIZES["torque_lag@one_pole"]["cutoff_hz"] / size
    pole = 2 * np.pi * cutoff
    num, den, _ = cont2discrete(([pole], [1, pole]), 1 / FINE_HZ, method="foh")
    _filtered(s, num.ravel(), den)
    return {"cutoff_hz": cutoff}, [], "first order"


@law("torque_lag", "moving_average", "mean of the last 2 / (2 pi cutoff)", "a converter that integrates")
def moving_average(s, size, rng):
    cutoff = SIZES["torque_lag@moving_average"]["cutoff_hz"] / size
    n = max(2, round(2 / (2 * np.pi * cutoff) * FINE_HZ) + 1)
    s.torque_chain.append(lambda t, torque, *_: uniform_filter1d(torque, n, axis=1, origin=(n - 1) // 2, mode="nearest"))
    return {"cutoff_hz": cutoff}, ["cutoff_hz"], "finite impulse response; the value is the single pole of the same delay"


@law("torque_lag", "bessel", "Bessel low-pass of third order", "Thomson 1949; usual in bridge amplifiers")
def bessel_filter(s, size, rng):
    cutoff = SIZES["torque_lag@bessel"]["cutoff_hz"] / size
    num, den = bilinear(*bessel(3, 2 * np.pi * cutoff, analog=True, norm="delay"), fs=FINE_HZ)
    _filtered(s, num, den)
    return {"cutoff_hz": cutoff}, ["cutoff_hz"], "of the same delay as a single pole at the value"


def _filtered(s, num, den):
    def lag(t, torque, *_):
        return torque[:, :1] + lfilter(num, den, torque - torque[:, :1], axis=1)

    s.torque_chain.append(lag)


@law("torque_gain", "constant", "torque recorded = factor times the true one", "assumed: a wrong calibration")
def constant_gain(s, size, rng):
    return _gain(s, size, constant(s), [])


@law("torque_gain", "drifting", "factor - 1 grows by 20 % over the session", "assumed: an amplifier that warms")
def drifting_gain(s, size, rng):
    return _gain(s, size, drifting(s), ["factor"])


@law("torque_gain", "loaded", "factor - 1 is 10 % less at the lowest torque and 10 % more at the highest", "assumed: a gauge that is not linear")
def loaded_gain(s, size, rng):
    return _gain(s, size, by_torque(s), ["factor"])


def _gain(s, size, share, nominal):
    """The person follows the display, so the true torque is the target over the gain."""
    factor = SIZES["torque_gain"]["factor"] ** size
    g = factor if np.isscalar(share) else 1 + (factor - 1) * share
    t = s.trials
    for name, own in (("k_srs", lambda x: s.person.k_srs(x)), ("k_dec", lambda x: s.person.k_dec(t.velocity_rad_s, x)),
                      ("x_e", lambda x: s.person.x_e(t.velocity_rad_s, x))):
        setattr(t, name, getattr(t, name) * own(t.torque_nm / g) / own(t.torque_nm))
    excess = np.reshape(g - 1, (-1, 1))

    def amplify(time, torque, scenario, motion):
        """The hold is already what the display shows; only what the ramp adds is not."""
        out = torque.copy()
        out[:, -motion.torque_l.shape[1]:] += excess * motion.torque_l
        return out

    s.torque_chain.append(amplify)
    return {"factor": factor}, nominal, "recorded over true"


@law("torque_saturation", "algebraic", "T / (1 + (T / L)^60)^(1/60)", "assumed")
def algebraic_clip(s, size, rng):
    """Clips a part of the largest change that the window would have shown, with a knee of a few per cent."""
    sharpness = 60
    return _clip(s, SIZES["torque_saturation"], size, "absolute torque; an algebraic knee",
                 lambda torque, level: torque / (1 + np.abs(torque / level) ** sharpness) ** (1 / sharpness))


@law("torque_saturation", "hard", "min(T, L)", "a converter at the end of its range")
def hard_clip(s, size, rng):
    return _clip(s, SIZES["torque_saturation@hard"], size, "absolute torque; a sharp corner", np.minimum)


@law("torque_saturation", "tanh", "T up to 0.97 L, then L (0.97 + 0.03 tanh((T - 0.97 L) / 0.03 L))", "assumed: an amplifier near its supply")
def tanh_clip(s, size, rng):
    def soft(torque, level):
        knee, rest = 0.97 * level, 0.03 * level
        return np.where(torque < knee, torque, knee + rest * np.tanh((torque - knee) / rest))

    return _clip(s, SIZES["torque_saturation@tanh"], size, "absolute torque; a knee of 3 %", soft)


@law("torque_saturation", "latching", "min(T, L), which once reached is left only below 0.97 L", "assumed: an amplifier that recovers late")
def latching_clip(s, size, rng):
    def latch(torque, level):
        out, stuck = np.minimum(torque, level), np.zeros(len(torque), bool)
        for i in range(torque.shape[1]):
            stuck = (torque[:, i] >= level) | (stuck & (torque[:, i] > 0.97 * level))
            out[stuck, i] = level
        return out

    return _clip(s, SIZES["torque_saturation@latching"], size, "absolute torque; with hysteresis", latch)


def _clip(s, d, size, note, clipped):
    part = 1 - size * (1 - d["part_of_peak"])
    truth = {"level_nm": None}

    def clip(t, torque, *_):
        if truth["level_nm"] is None:
            truth["level_nm"] = float(part * np.max(torque[:, (t >= 0) & (t <= 0.04)]))
        return clipped(torque, truth["level_nm"])

    s.torque_chain.append(clip)
    return truth, [], note


@law("mains_hum", "third_harmonic", "A (sin w t + 0.12 sin(3 w t + 1)), another phase in each trial", "assumed")
def third_harmonic(s, size, rng):
    return _hum(s, SIZES["mains_hum"], size, rng, lambda w: np.sin(w) + 0.12 * np.sin(3 * w + 1.0),
                "with an eighth of third harmonic, another phase in each trial")


@law("mains_hum", "sine", "A sin w t, another phase in each trial", "a ground loop")
def sine(s, size, rng):
    return _hum(s, SIZES["mains_hum@sine"], size, rng, lambda w: np.sin(w), "a pure sine, another phase in each trial")


@law("mains_hum", "flat_topped", "A tanh(2 sin w t) / tanh(2), another phase in each trial", "mains as rectifiers leave it")
def flat_topped(s, size, rng):
    return _hum(s, SIZES["mains_hum@flat_topped"], size, rng, lambda w: np.tanh(2 * np.sin(w)) / np.tanh(2.0),
                "odd harmonics, another phase in each trial")


def _hum(s, d, size, rng, wave, note):
    a, hz = size * d["amplitude_nm"], float(rng.choice([50.0, 60.0]))
    phase = rng.uniform(0, 2 * np.pi, (len(s.trials), 1))
    a_trial = a * (1 + 0.05 * np.clip(rng.standard_normal(phase.shape), -2, 2))
    grid = hz * (1 + rng.uniform(-0.0005, 0.0005))
    s.torque_chain.append(lambda t, torque, *_: torque + a_trial * wave(2 * np.pi * grid * t + phase))
    return {"amplitude_nm": a, "frequency_hz": hz}, [], note
