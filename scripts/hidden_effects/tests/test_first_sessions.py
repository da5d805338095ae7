"""Sessions of the paper's laboratory and of each mechanism's first law keep their bytes, so that old results can be repeated."""

import hashlib
import json
from pathlib import Path

import pytest

from hidden_effects.generator import generate
from hidden_effects.session_writer import write_session

# Written by the generator before it had laboratories and laws: the start of the SHA-256 over a session's files in order of name.
CHECKSUMS = json.loads(Path(__file__).with_name("first_sessions.json").read_text())


@pytest.mark.parametrize("effect", CHECKSUMS)
def test_a_first_session_keeps_its_bytes(effect, tmp_path):
    write_session(generate(5, effect, repetitions=1), tmp_path / "s")
    whole = hashlib.sha256()
    for path in sorted((tmp_path / "s").rglob("*")):
        if path.is_file():
            whole.update(path.read_bytes())
    assert whole.hexdigest()[:16] == CHECKSUMS[effect]
