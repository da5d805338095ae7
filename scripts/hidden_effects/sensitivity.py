"""How large an effect is beside the noise, after the wrist's free parameters have absorbed what they can.

python -m hidden_effects.sensitivity [--seeds N] [--filter causal|zero-phase|none] [NAME ...]
prints, in standard deviations over a whole session:
raw (before the refit), left (after it), and the nearest mechanisms by the cosine of what is left. For an alien also
what remains of it after the best one and the best two mechanisms of the catalogue. Linear about the truth: a guide to
choosing sizes, not a substitute for the benchmark.
"""

import argparse
import copy
import itertools

import numpy as np
from scipy.signal import filtfilt, lfilter

from . import catalogue, noise
from .generator import base_model_response, generate
from .laboratories import LABORATORIES
from .plant import END_S, FINE_HZ
from .response import FREE, measured_torque

SAMPLE_HZ = LABORATORIES["paper"].sample_hz
STEP = FINE_HZ // SAMPLE_HZ
WINDOW = 100  # samples: 40 ms
COMPONENTS = {"causal": 8, "zero-phase": 8, "none": WINDOW}
FLOOR_NM = {"causal": 0.0015, "zero-phase": 0.0012, "none": 0.0206}  # the encoder's steps, through Eq. 5


def filtered_by(kind, y):
    if kind == "none":
        return y
    return (lfilter if kind == "causal" else filtfilt)(*noise.low_pass(SAMPLE_HZ), y, axis=1)


def window(fine_torque, t, kind):
    """The filtered change in the analysis window; `t` is the fine time axis of `fine_torque`."""
    sampled, time = fine_torque[:, ::STEP], t[::STEP]
    filtered = filtered_by(kind, sampled - sampled[:, :1])
    start = int(np.argmin(np.abs(time)))
    return filtered[:, start:start + WINDOW]


class Judge:
    """The whitened sensitivities of one person's session without an effect."""

    def __init__(self, seed, kind="causal"):
        self.seed, self.kind = seed, kind
        self.session = generate(seed)
        s, m = self.session.scenario, self.session.motion
        self.white = self._whiteners()
        base = window(base_model_response(s, m).torque_l, m.t_s, self.kind)
        self.jacobian, self.se = self._sensitivities(s, m, base)

    def _whiteners(self):
        s = self.session.scenario
        fine = np.arange(round(-0.8 * FINE_HZ), round(END_S * FINE_HZ) + 1) / FINE_HZ
        parts = {t: [] for t in np.unique(s.trials.torque_nm)}
        for k in range(6):
            voluntary, gauge = noise.voluntary_torque(10_000 + k, s.person, s.trials.torque_nm, fine, s.laboratory)
            y = filtered_by(self.kind, voluntary[:, ::STEP] + gauge - s.trials.torque_nm[:, None])
            for start in range(200, y.shape[1] - WINDOW - 50, 75):
                piece = y[:, start + 50:start + 50 + WINDOW] - y[:, start:start + 50].mean(axis=1, keepdims=True)
                for t in parts:
                    parts[t].append(piece[s.trials.torque_nm == t])
        out, keep = [], COMPONENTS[self.kind]
        for t in s.trials.torque_nm:
            x = np.concatenate(parts[t])
            values, vectors = np.linalg.eigh(x.T @ x / len(x) + FLOOR_NM[self.kind] ** 2 * np.eye(WINDOW))
            out.append((vectors[:, -keep:] / np.sqrt(values[-keep:])).T)
        return out

    def whiten(self, y):
        return np.stack([w @ row for w, row in zip(self.white, y)])

    def _sensitivities(self, s, m, base):
        columns = []
        for name in FREE + ("i_j",):
            changed = copy.copy(s)
            changed.trials = copy.copy(s.trials)
            setattr(changed.trials, name, getattr(s.trials, name) * 1.005)
            answer = window(base_model_response(changed, m).torque_l, m.t_s, self.kind)
            columns.append(self.whiten(answer - base) / 0.005)
        j = np.stack(columns, axis=-1)  # trials x components x parameters, per relative change
        info = np.einsum("tcp,tcq->tpq", j[..., :5], j[..., :5])
        return j, np.sqrt(np.stack([np.diag(np.linalg.inv(i)) for i in info]))

    def left_over(self, d):
        """Whitened signature less what free parameters absorb; flat over trials and components."""
        out, shared = [], []
        for di, ji in zip(d, self.jacobian):
            q, _ = np.linalg.qr(ji[:, :5])
            out.append(di - q @ (q.T @ di))
            shared.append(ji[:, 5] - q @ (q.T @ ji[:, 5]))
        out, shared = np.concatenate(out), np.concatenate(shared)
        return out - shared * (shared @ out) / (shared @ shared)

    def signature(self, effect, size=1.0):
        return self._noise_free(generate(self.seed, effect, size))

    def _noise_free(self, e):
        """What the sensors would give without noise, less the base model driven by the recorded angle."""
        s, m = e.scenario, e.motion
        torque = np.repeat(measured_torque(s, m)[1], STEP, axis=1)[:, :m.torque_l.shape[1]]
        base = base_model_response(s, m).torque_l
        return self.whiten(window(torque, m.t_s, self.kind) - window(base, m.t_s, self.kind))

    def across_trials(self, effect, size=1.0):
        """The same for an effect on k_srs (or x_e) over the trials, where conditions have a mean of their own."""
        e, b = generate(self.seed, effect, size).trials, self.session.trials
        total = 0.0
        for name, spread, at in (("k_srs", 0.025, 2), ("x_e", 0.02, 4)):
            change = getattr(e, name) / getattr(b, name) - 1
            for key in {(v, t) for v, t in zip(b.velocity_rad_s, b.torque_nm)}:
                same = (b.velocity_rad_s == key[0]) & (b.torque_nm == key[1])
                change[same] -= change[same].mean()
            total += np.sum(change**2 / (spread**2 + self.se[:, at] ** 2))
        return np.sqrt(total)


def report(names, seeds, kind):
    rows = {}
    for seed in seeds:
        judge = Judge(seed, kind)
        errors = dict(zip(FREE, np.median(judge.se, axis=0).round(3).tolist()))
        print(f"seed {seed}: relative standard errors of a trial", errors)
        within = [n for n in catalogue.MECHANISMS if n not in ACROSS]
        left = {}
        for name in dict.fromkeys(within + names):
            if catalogue.mechanism_of(name) in ACROSS:
                rows.setdefault(name, []).append((np.nan, judge.across_trials(name), ""))
                continue
            d = judge.signature(name)
            left[name] = judge.left_over(d)
            rows.setdefault(name, []).append((np.linalg.norm(d), np.linalg.norm(left[name]), ""))
        for name in names:
            if name in left:
                rows[name][-1] = rows[name][-1][:2] + (_neighbours(name, left, within),)
    for name in names:
        raw, after, note = zip(*rows[name])
        print(f"{name:28s} raw {np.mean(raw):8.1f}  left " + " ".join(f"{a:6.1f}" for a in after) + "  " + note[0])


def _neighbours(name, left, within):
    unit = lambda x: x / max(np.linalg.norm(x), 1e-12)
    pool = [o for o in within if o != catalogue.mechanism_of(name)]
    others = sorted(((unit(left[name]) @ unit(left[o]), o) for o in pool), key=lambda c: -abs(c[0]))
    text = " ".join(f"{o}:{c:+.2f}" for c, o in others[:4])
    remains = lambda group: np.linalg.norm(_without(left[name], np.stack([left[o] for o in group], axis=1)))
    one = min((remains([o]), o) for o in pool)
    two = min((remains(p), p) for p in itertools.combinations(pool, 2))
    return f"{text} | after best one {one[0]:.1f}, best two {two[0]:.1f} {two[1]}"


def _without(x, columns):
    return x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0]


ACROSS = ("fatigue", "thixotropy", "cocontraction", "outlier_trial", "activation_scaling", "timed_yield")


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("names", nargs="*")
    p.add_argument("--seeds", type=int, default=2)
    p.add_argument("--filter", choices=list(COMPONENTS), default="causal")
    a = p.parse_args()
    everything = [*catalogue.MECHANISMS, *(f"alien:{k}" for k in catalogue.ALIENS)]
    report(a.names or everything, range(1, a.seeds + 1), a.filter)


if __name__ == "__main__":
    main()
