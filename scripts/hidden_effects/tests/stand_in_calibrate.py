"""Stands in for `ramphold calibrate`: tells the truth of a random rig, beside it, or with too small errors, as the mode says."""

import json
import sys
import tempfile
from pathlib import Path

from hidden_effects.rig.random_rigs import QUANTITIES, write_random_rig

mode, verb, session, flag, out = sys.argv[1], sys.argv[2], Path(sys.argv[3]), sys.argv[4], Path(sys.argv[5])
assert verb == "calibrate" and flag == "--out"
for needed in ("session.json", "trials.csv", "rig-trials.csv"):
    assert (session / needed).exists(), needed
if mode == "crash":
    sys.exit("no such verb")
with tempfile.TemporaryDirectory() as other:
    rig = write_random_rig(int(session.name.removeprefix("rig-")), Path(other) / "s")
quantities = []
for name in QUANTITIES:
    true = rig.quantities[name]
    told = true is not None and mode != "silent"
    size = max(abs(true), 0.01) if told else None
    quantities.append({"name": name, "value": true + (0.05 * size if mode == "wrong" else 0.001 * size) if told else None,
                       "se": 0.01 * size if told else None, "stated": None, "reason": None if told else "these loads cannot tell it",
                       "above": 50.0 if name == "torque_cutoff_hz" and not told else None})
assert not out.exists(), "a file, which is not overwritten"
out.write_text(json.dumps({"format": "ramphold-rig-calibration/1", "quantities": quantities}))
