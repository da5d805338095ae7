"""Stands in for the program: works out the truth of the session and answers as the mode says. `diagnose`, and `calibrate` before it."""

import json
import sys
from pathlib import Path

from hidden_effects.catalogue import parse
from hidden_effects.generator import generate
from hidden_effects.session_writer import truth_of

mode = sys.argv[1]
effects = dict(part.split(":", 1) for part in sys.argv[2].split(";"))
if sys.argv[3] == "calibrate":
    assert (Path(sys.argv[4]) / "rig-trials.csv").exists() and sys.argv[5] == "--out"
    assert not Path(sys.argv[6]).exists(), "a file, which is not overwritten"
    if mode != "no calibration":
        Path(sys.argv[6]).write_text("{}")
    sys.exit()
assert sys.argv[3] == "diagnose" and sys.argv[5] == "--out" and sys.argv[7] == "--seed"
assert ("--calibration" in sys.argv) == (Path(sys.argv[4]) / "rig-trials.csv").exists()
assert "--calibration" not in sys.argv or Path(sys.argv[10]).is_file()
session, out, seed = Path(sys.argv[4]), Path(sys.argv[6]), sys.argv[8]
assert (session / "session.json").exists()
effect = effects[seed]
truth = truth_of(generate(int(seed), effect), effect)


def cause(h):
    means = truth["means"]
    near = lambda v: {"value": v, "low": v - abs(v) * 0.1, "high": v + abs(v) * 0.1}
    return {"mechanism": h["mechanism"], "class": h["class"], "indistinguishable": [],
            "parameters": {k: near(p["value"]) if not isinstance(p["value"], list) else {"value": p["value"]}
                           for k, p in h["parameters"].items()},
            "parameter_shift": {k: {"before": means[k] * 1.1, "after": means[k] * 1.01}
                                for k in ("k_srs_nm_per_rad", "x_e_rad")}}


known = [h for h in truth["hidden"] if h["class"] != "alien"]
answer = {"format": "ramphold-diagnosis/1", "verdict": "adequate", "causes": []}
if mode == "right":
    alien = effect.startswith("alien:")
    answer["causes"] = [cause(h) for h in known]
    answer["verdict"] = "unexplained" if alien else "named" if parse(effect) else "adequate"
elif mode == "crash":
    sys.exit("no such verb")
out.mkdir(parents=True)
(out / "diagnosis.json").write_text(json.dumps(answer, default=float))
