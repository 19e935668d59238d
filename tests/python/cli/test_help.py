"""The --help of every installed program is the recorded one."""

import difflib
import sys
from pathlib import Path

from conftest import BUILD

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "golden"))

import help_texts


def test_help_texts_are_the_recorded_ones():
    recorded, now = help_texts.recorded(), help_texts.help_texts(BUILD)
    assert len(now) > 20 and "clearance query" in now
    changed = []
    for name in sorted({*recorded, *now}):
        before, after = recorded.get(name, ""), now.get(name, "")
        if help_texts.words(before) != help_texts.words(after):
            changed += difflib.unified_diff(before.splitlines(), after.splitlines(), name, name, lineterm="", n=0)
    assert not changed, "\n".join([*changed, f"If this is intended: {help_texts.RENEW}"])
