"""The tables of laboratories, laws and aliens for the docs: python -m hidden_effects.benchmark.reference [--worth SEED]"""

import argparse

from .. import catalogue, oracle
from ..aliens import ALIENS
from ..laboratories import LABORATORIES
from ..laws import LAWS
from . import purpose
from .table import table


def laboratories() -> str:
    rows = [[name, purpose.purpose_of("laboratories", name), f"{own.sample_hz}", own.encoder_bits, _lever(own), _ramp(own),
             f"{_list(own.velocities_rad_s)} rad/s, {_list(own.torques_nm)} N m, {own.repetitions} times", _noise(own),
             own.source] for name, own in LABORATORIES.items()]
    return table(["laboratory", "for", "rate (Hz)", "encoder (bits)", "lever", "ramp", "conditions", "noise and hold", "source"], rows)


def laws() -> str:
    rows = [[f"{mechanism}@{name}" + (" (first)" if i == 0 else ""), purpose.purpose_of("laws", f"{mechanism}@{name}"), _cell(own.equation),
             _cell(own.source)] for mechanism in catalogue.MECHANISMS for i, (name, own) in enumerate(LAWS[mechanism].items())]
    return table(["law", "for", "equation", "source"], rows)


def aliens() -> str:
    rows = [[name, purpose.purpose_of("aliens", name), f"{own.place}, {own.argument}" if own.place else "", _cell(own.description)]
            for name, own in ALIENS.items()]
    return table(["alien", "for", "place, argument", "cause"], rows)


def worth(seed: int) -> str:
    """What the oracle says of each law and alien of usual size, in the paper's laboratory."""
    rows = []
    for effect in [*catalogue.EFFECTS, *(f"alien:{kind}" for kind in ALIENS)]:
        found = oracle.finding(seed, effect, LABORATORIES["paper"])
        rows.append([effect, f"{found.raw:.0f}", f"{found.distance:.1f}", f"{found.limit:.1f}", found.nearest_rival,
                     f"{found.distance_beyond_rival:.1f}"])
    return table(["effect", "before absorption", "distance", "limit", "nearest rival", "distance beyond it"], rows)


def _lever(own):
    return f"{own.own_lever()['stiffness_nm_per_rad']:g} N m/rad" if own.lever else "rigid"


def _ramp(own):
    return f"{own.ramp_profile}, rise {16 * own.ramp_rise_factor:g} ms, servo {80 * own.servo_bandwidth_factor:g}-{105 * own.servo_bandwidth_factor:g} Hz"


def _noise(own):
    parts = [f"gauge {own.gauge_spectrum}" + (f" x {own.gauge_noise:g}" if own.gauge_noise != 1 else "")]
    if own.tremor != 1:
        parts.append(f"tremor x {own.tremor:g}" + (f" at {8.5 * own.tremor_frequency:g}-{10.5 * own.tremor_frequency:g} Hz"
                                                  if own.tremor_frequency != 1 else ""))
    parts.append(f"hold {own.longest_hold_s - own.hold_spread_s:.2f}-{own.longest_hold_s:.2f} s")
    told = {"command": [], "none": ["no onsets"], "2 mrad": ["onsets 2 mrad late"]}[own.onsets]
    return ", ".join(parts + ([] if own.has_emg else ["no EMG"]) + told)


def _list(values):
    return "/".join(f"{v:g}" for v in values)


def _cell(text):
    return text.replace("|", "\\|")


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--worth", type=int, metavar="SEED", help="instead: what each effect is worth, in this subject (a few minutes)")
    a = p.parse_args()
    print(worth(a.worth) if a.worth is not None else "\n\n".join([laboratories(), laws(), aliens()]))


if __name__ == "__main__":
    main()
