"""Covers: when they are made, and how to wait for them."""

import json
import subprocess

import pytest

import clearance
from conftest import CLEARANCE
from patience import PATIENCE_S

SCENE = """
bodies:
  - {name: crate, box: [0.3, 0.2, 0.1], pose: [0, 0, 1, 1, 0, 0, 0]}
  - {name: table, box: [1, 1, 0.1], static: true}
"""


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def counters(front):
    return {name: value for name, value in front.stats().items() if "cover" in name}


def test_an_engine_makes_them_in_the_background(scene_file):
    engine = clearance.Engine(clearance.Scene.load(scene_file))
    assert engine.wait_covers(timeout_s=PATIENCE_S)
    found = counters(engine)
    assert found.pop("engine.cover_bytes") > 1000
    assert found == {"engine.covers": 1, "engine.covers_pending": 0, "engine.covers_impossible": 0}
    tables = {name: value for name, value in engine.stats().items() if "joint_table" in name}
    assert tables == {"engine.joint_tables": 0, "engine.joint_tables_pending": 0, "engine.joint_table_bytes": 0}
    with pytest.raises(ValueError, match="timeout_s"):
        engine.wait_covers(-1)


def test_an_engine_without_them(scene_file):
    engine = clearance.Engine(clearance.Scene.load(scene_file), covers="off")
    assert engine.wait_covers(0) and counters(engine) == {}
    with pytest.raises(ValueError, match="covers: "):
        clearance.Engine(clearance.Scene(), covers="on")


def test_a_timeout_is_no_error():
    scene = clearance.Scene()
    for i in range(64):
        scene.add_box(f"box{i}", [1 + i, 1, 1])
    assert not clearance.Engine(scene).wait_covers(0)


def test_a_daemon_makes_them(start_daemon, scene_file):
    with clearance.connect(start_daemon(scene_file, ["ipc"]).urls["ipc"], timeout_s=PATIENCE_S) as client:
        assert client.wait_covers(timeout_s=PATIENCE_S) and counters(client)["engine.covers"] == 1
    with clearance.connect(start_daemon(scene_file, ["ipc"], "--covers", "off").urls["ipc"]) as client:
        assert client.wait_covers(0) and counters(client) == {}


def test_inspect_reports_them_and_fills_the_cache(scene_file, tmp_path, monkeypatch):
    monkeypatch.setenv("CLEARANCE_CACHE", str(tmp_path / "cache"))

    def run(*arguments):
        command = [CLEARANCE, "inspect", str(scene_file), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert done.returncode == 0, done.stderr
        return done.stdout

    (crate,) = json.loads(run("--json"))["covers"]
    assert crate["body"] == "crate" and crate["balls"] > 100 and crate["KiB"] > 1 and crate["build_s"] > 0
    assert 0 < crate["mean_m_0"] <= crate["greatest_m_0"] and crate["mean_m_3"] < crate["mean_m_1"]
    assert len(list((tmp_path / "cache").glob("cover-*"))) == 1
    lines = run().splitlines()
    row = lines[lines.index("Covers of bodies that may move, by levels 0 to 3") + 2].split()
    assert row[:2] == ["crate", str(crate["balls"])] and float(row[3]) == pytest.approx(crate["build_s"], rel=0.1)
    assert json.loads(run("--json", "--no-covers"))["covers"] == []
