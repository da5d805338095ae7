"""python -m hidden_effects --out DIR --effect ID[@LAW]|none|alien:KIND|A+B --seed N [--laboratory L] [--size X] [--sessions K]
       [--rig-trials] [--trap person_only|wrong_load|another_day]"""

import argparse
import sys
from pathlib import Path

from . import catalogue
from .generator import generate
from .laboratories import LABORATORIES
from .noise import CannotHold
from .rig.traps import TRAPS
from .session_writer import write_session, write_truth


def main() -> int:
    p = argparse.ArgumentParser(prog="python -m hidden_effects", description="Sessions with a known hidden effect. "
                                "Folders go to DIR/NAME, what is hidden to DIR/truth/NAME.json.")
    p.add_argument("--out", type=Path)
    p.add_argument("--effect", default="none", help="none, an id of the catalogue, ID@LAW for one of its other laws, alien:KIND, or A+B for two")
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--size", type=float, default=1.0, help="times the default size")
    p.add_argument("--sessions", type=int, default=1, help="this many, with seeds from --seed upward")
    p.add_argument("--laboratory", choices=LABORATORIES, default="paper")
    p.add_argument("--rig-trials", action="store_true", help="each session also has the laboratory's rig trials")
    p.add_argument("--trap", choices=TRAPS, help="what is wrong with the rig trials themselves; needs --rig-trials")
    p.add_argument("--list", action="store_true", help="print the known effects")
    a = p.parse_args()
    if a.list:
        print("\n".join(["none", *catalogue.EFFECTS, *(f"alien:{k}" for k in catalogue.ALIENS)]))
        return 0
    try:
        catalogue.parse(a.effect, LABORATORIES[a.laboratory])
    except ValueError as e:
        p.error(str(e))
    if a.trap and not a.rig_trials:
        p.error("--trap needs --rig-trials")
    if a.out is None or a.size <= 0 or a.sessions < 1:
        p.error("--out is needed, --size and --sessions must be positive")
    for seed in range(a.seed, a.seed + a.sessions):
        name = f"session-{seed:06d}"
        if (a.out / name).exists():
            p.error(f"{a.out / name} exists already")
        try:
            session = generate(seed, a.effect, a.size, laboratory=LABORATORIES[a.laboratory], with_rig_trials=a.rig_trials, trap=a.trap)
        except CannotHold as error:
            print(f"seed {seed} is passed over: {error}", file=sys.stderr)
            continue
        write_session(session, a.out / name)
        write_truth(session, a.effect, a.out / "truth" / f"{name}.json", a.laboratory)
        print(a.out / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
