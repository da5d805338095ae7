"""Sessions of the paper's laboratory and of each mechanism's first law stay as they are, so that old results can be repeated.

Not to the last bit: NumPy and its linear algebra take other instructions on other processors, and now and then a last digit differs."""

import csv
import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

from hidden_effects.generator import generate
from hidden_effects.session_writer import write_session

# Written by the generator on a processor with AVX2: `PYTHONPATH=scripts python scripts/hidden_effects/tests/test_first_sessions.py`.
KEPT = Path(__file__).with_name("first_sessions.json")
SUMMARIES = json.loads(KEPT.read_text())

# By which a summary may differ, as a part of the root mean square of its column. A digit of a value in a thousand weighs less, another law or
# another draw of noise far more.
TOLERANCE = 1e-5


def columns(folder):
    """The numbers of a session by file and column, the trials one after the other."""
    found = {}
    for path in [folder / "trials.csv", *sorted((folder / "trials").iterdir())]:
        with path.open() as file:
            rows = list(csv.reader(file))
        for name, *cells in zip(*rows):
            if name not in ("file", "status"):
                found.setdefault(name if path.parent == folder else f"trials/{name}", []).extend(map(float, cells))
    return {name: np.array(values) for name, values in found.items()}


def summary(effect, folder):
    """Of each column its length, root mean square, mean, and the means under two waves, which move when a value changes its place."""
    write_session(generate(5, effect, repetitions=1), folder)

    def of(values):
        place = np.arange(len(values))
        means = [np.mean(values), np.mean(values * np.sin(0.7 * place)), np.mean(values * np.cos(0.011 * place))]
        return [len(values), *(float(f"{own:.9g}") for own in (np.sqrt(np.mean(values**2)), *means))]

    return {name: of(values) for name, values in columns(folder).items()}


@pytest.mark.parametrize("effect", SUMMARIES)
def test_a_first_session_stays_as_it_is(effect, tmp_path):
    now, kept = summary(effect, tmp_path / "s"), SUMMARIES[effect]
    assert now.keys() == kept.keys()
    for name, (count, size, *means) in kept.items():
        assert now[name][0] == count, name
        assert now[name][1:] == pytest.approx([size, *means], rel=0, abs=TOLERANCE * size), name


def test_another_seed_is_another_session(tmp_path):
    kept = SUMMARIES["none"]["trials/torque_l_nm"]
    write_session(generate(6, "none", repetitions=1), tmp_path / "s")
    assert abs(np.mean(columns(tmp_path / "s")["trials/torque_l_nm"]) - kept[2]) > TOLERANCE * kept[1]


def main():
    with tempfile.TemporaryDirectory() as folder:
        own = {effect: summary(effect, Path(folder) / effect) for effect in SUMMARIES}
    lines = (f" {json.dumps(effect)}: {json.dumps(of)}" for effect, of in own.items())
    KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
