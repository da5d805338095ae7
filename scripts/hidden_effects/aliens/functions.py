"""Causes that are a plain function of one argument at one place, smooth and in no catalogue.

The program has no name for them, but its free laws can state place and argument.
"""

import numpy as np

from ..plant import Force
from ..scenario import SIZES
from .alien import alien


def _on(place, s, torque):
    """Adds `torque(argument, speed)` to a place of the plant; the argument is an angle or a deflection."""
    s.forces.append(Force(lambda t, x, speed, z, past: (torque(x, speed), None), on=place))


def _bump(x, at, width):
    return np.exp(-0.5 * ((x - at) / width) ** 2)


def _drag(place, s, size, name):
    """At `place`, a drag that is largest at one speed and lets go above it."""
    d = SIZES[name]
    a, peak = size * d["torque_nm"], d["peak_rad_s"]
    _on(place, s, lambda theta, speed: a * speed / peak * np.exp(0.5 * (1 - (speed / peak) ** 2)))
    return {"torque_nm": a, "peak_rad_s": peak}


@alien("torque_channel", "time")
def torque_burst(s, size, rng):
    """Interference: a burst in the torque at a fixed time in the window."""
    d = SIZES["alien:torque_burst"]
    a, at, width = size * d["amplitude_nm"], rng.uniform(*d["time_s"]), d["width_s"]
    s.torque_chain.append(lambda t, torque, *_: torque + a * _bump(t, at, width))
    return {"amplitude_nm": a, "time_s": at}, [], "the same in every trial"


@alien("interface", "deflection")
def handle_recoil(s, size, rng):
    """The foam around the hand lets go: its force drops at a set deflection and builds up again."""
    d = SIZES["alien:handle_recoil"]
    drop, at, width = size * d["drop"], d["deflection_rad"], d["width_rad"]
    base = s.interface
    s.interface = lambda x, p: base(x, p) - p.k_h * at * drop * _bump(x, at, width)
    return {"drop": drop, "deflection_rad": at}, [], "a dent in the force-deflection curve of the interface"


@alien("joint", "angle")
def rebound_wall(s, size, rng):
    """A soft stop in the joint at a set angle, thrown off again: stiffness in a band of angles only."""
    d = SIZES["alien:rebound_wall"]
    a, at, width = size * d["torque_nm"], rng.uniform(*d["angle_rad"]), d["width_rad"]
    _on("joint", s, lambda theta, speed: a * _bump(theta, at, width))
    return {"torque_nm": a, "angle_rad": at}, [], "a bump of torque about one joint angle"


@alien("joint", "angle")
def snapping_tendon(s, size, rng):
    """A tendon snaps over bone: joint torque that waves with the angle."""
    d = SIZES["alien:snapping_tendon"]
    a, wave = size * d["torque_nm"], rng.uniform(*d["wavelength_rad"])
    _on("joint", s, lambda theta, speed: a * np.sin(2 * np.pi * theta / wave))
    return {"torque_nm": a, "wavelength_rad": wave}, [], "a sine of the joint's angle"


@alien("joint", "speed")
def sticky_film(s, size, rng):
    """A film in the joint resists at one speed and lets go above it."""
    return _drag("joint", s, size, "alien:sticky_film"), [], "largest at one speed"


@alien("joint", "angle_beyond_yield")
def second_grip(s, size, rng):
    """Cross-bridges take hold once more beyond the elastic limit, over a band of angles."""
    d = SIZES["alien:second_grip"]
    a, at, width = size * d["torque_nm"], d["beyond_rad"], d["width_rad"]
    _on("joint", s, lambda theta, speed: a * _bump(theta - s.trials.x_e, at, width))
    return {"torque_nm": a, "beyond_rad": at}, [], "a bump of torque about one angle beyond x_e"


@alien("joint", "time")
def startle(s, size, rng):
    """The subject hears the motor and twitches at a fixed time."""
    d = SIZES["alien:startle"]
    a, at, width = size * d["torque_nm"], rng.uniform(*d["time_s"]), d["width_s"]
    s.forces.append(Force(lambda t, theta, speed, z, past: (a * _bump(t, at, width) * np.ones_like(theta), None)))
    return {"torque_nm": a, "time_s": at}, [], "a pulse of muscle torque"


@alien("interface", "speed")
def squelching_foam(s, size, rng):
    """The foam around the hand pumps air: its viscous torque bends with the speed of deflection."""
    d = SIZES["alien:squelching_foam"]
    a, scale = size * d["torque_nm"], d["speed_rad_s"]
    _on("interface", s, lambda deflection, speed: a * np.sin(np.clip(speed / scale, -3.0, 3.0) * np.pi))
    return {"torque_nm": a, "speed_rad_s": scale}, [], "a sine of the speed of deflection"


@alien("handle", "angle")
def cable_pull(s, size, rng):
    """The cable of the handle pulls taut over a band of angles."""
    d = SIZES["alien:cable_pull"]
    a, at, width = size * d["torque_nm"], rng.uniform(*d["angle_rad"]), d["width_rad"]
    _on("lever", s, lambda theta, speed: a * _bump(theta, at, width))
    return {"torque_nm": a, "angle_rad": at}, [], "a bump of torque about one angle of the handle"


@alien("handle", "speed")
def rough_bearing(s, size, rng):
    """The bearing of the handle drags most at one speed."""
    return _drag("lever", s, size, "alien:rough_bearing"), [], "largest at one speed of the handle"


@alien("torque_channel", "torque")
def bent_amplifier(s, size, rng):
    """The torque's amplifier is bent: the record waves about the true torque."""
    d = SIZES["alien:bent_amplifier"]
    a, wave = size * d["torque_nm"], rng.uniform(*d["wavelength_nm"])
    s.torque_chain.append(lambda t, torque, *_: torque + a * np.sin(2 * np.pi * torque / wave))
    return {"torque_nm": a, "wavelength_nm": wave}, [], "a sine of the torque"


@alien("torque_channel", "time")
def ringing_amplifier(s, size, rng):
    """The torque's amplifier rings after the motor is switched on at the onset."""
    d = SIZES["alien:ringing_amplifier"]
    a, hz, tau = size * d["amplitude_nm"], rng.uniform(*d["frequency_hz"]), d["decay_s"]

    def ring(t, torque, *_):
        u = np.clip(t - 0.002, 0.0, None)
        return torque + a * np.sin(2 * np.pi * hz * u) * np.exp(-u / tau)

    s.torque_chain.append(ring)
    return {"amplitude_nm": a, "frequency_hz": hz}, [], "the same in every trial"


@alien("angle_channel", "angle")
def eccentric_encoder(s, size, rng):
    """The disc of the encoder sits off its centre and its tracks are uneven: the record waves about the true angle."""
    d = SIZES["alien:eccentric_encoder"]
    a, wave = size * d["angle_rad"], rng.uniform(*d["wavelength_rad"])
    s.angle_chain.append(lambda t, angle, scenario: angle + a * np.sin(2 * np.pi * angle / wave))
    return {"angle_rad": a, "wavelength_rad": wave}, [], "a sine of the angle"
