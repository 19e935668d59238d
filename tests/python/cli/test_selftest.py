"""clearance selftest: every backend computes correctly."""

import json
import subprocess

from conftest import CLEARANCE
from patience import PATIENCE_S


def run(*arguments):
    return subprocess.run([CLEARANCE, "selftest", *arguments], capture_output=True, text=True, timeout=PATIENCE_S)


def test_every_way_to_answer_has_a_line_and_passes():
    answer = run("--json")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    tests = {test["what"]: test for test in json.loads(answer.stdout)}
    assert {"reference", "scalar", "baseline"} <= set(tests)
    for name, test in tests.items():
        assert test["wrong"] == 0 and test["first_wrong"] is None, test
        assert test["answers"] > 150 or name.startswith("cuda"), test


def test_people_get_a_table_and_mistakes_a_sentence():
    table = run().stdout.splitlines()
    assert table[0].split() == ["what", "answers", "wrong", "ms", "first_wrong"] and len(table) >= 4
    assert "clearance selftest [OPTIONS]" in run("--help").stdout
    wrong = run("--thorough")
    assert wrong.returncode == 2 and "--thorough" in wrong.stderr
