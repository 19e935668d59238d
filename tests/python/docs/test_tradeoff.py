"""The extremes of bench/tradeoff have the gaps of their names, and each interval is proved."""

import sys
from types import SimpleNamespace

import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "bench"))
sys.path.insert(0, str(ROOT / "bench/surfaces"))
sys.path.insert(0, str(ROOT / "bench/tradeoff"))
sys.path.insert(0, str(ROOT / "tools"))

import extremes


@pytest.fixture(scope="module")
def rows():
    extremes.PAIRS = 3
    return list(extremes.rows(SimpleNamespace(seed=1, rounds=1)))


def test_gaps_are_those_of_the_names(rows):
    exact = {row["case"]: float(row["distance_m"]) for row in rows if row["setting"] == "exact"}
    assert exact.keys() == extremes.KINDS.keys()
    for case, (size, gap, away, _) in extremes.KINDS.items():
        assert exact[case] == pytest.approx(gap, rel=0.01, abs=4e-16 * (max(size) + away)), case


def test_intervals_are_proved_and_as_narrow_as_requested(rows):
    assert not [row for row in rows if row["wrong"] or row["wider"]]
    unresolved = {(row["case"], row["setting"]) for row in rows if row["unresolved"]}
    assert {case for case, setting in unresolved if setting == "exact"} == {"boxes that touch"}
    # At a wide tolerance, some of these solids get [0, 1e-12]; for which depends on the last bits of the poses.
    assert {case for case, _ in unresolved} <= {"boxes that touch", "solids 1e-12 m apart"}
    widest = {s: max(float(row["width_most_m"]) for row in rows if row["setting"] == s) for s in ("exact", "0.001")}
    assert widest["exact"] < 1e-12 < widest["0.001"] <= 1e-3
