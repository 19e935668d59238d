"""clearance cache: its entries for meshes, and their removal."""

import csv
import json
import os
import subprocess

import clearance
from conftest import CLEARANCE
from patience import PATIENCE_S

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def run(cache, *arguments):
    environment = {**os.environ, "CLEARANCE_CACHE": str(cache)}
    return subprocess.run(
        [CLEARANCE, "cache", *arguments], capture_output=True, text=True, timeout=PATIENCE_S, env=environment
    )


def load(folder, cache, monkeypatch, scale):
    (folder / "mesh.obj").write_text(TETRAHEDRON)
    monkeypatch.setenv("CLEARANCE_CACHE", str(cache))
    scene = clearance.Scene()
    scene.add_mesh("it", str(folder / "mesh.obj"), scale=scale)
    return scene


def test_entries_are_listed_and_cleared(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    for scale in (1.0, 2.0, 2.0):
        load(tmp_path, cache, monkeypatch, scale)
    entries = json.loads(run(cache, "list", "--json").stdout)
    assert len(entries) == 2 and len({entry["entry"] for entry in entries}) == 2
    for entry in entries:
        assert entry["kind"] == "mesh" and entry["bytes"] == (cache / entry["entry"]).stat().st_size
    assert len(list(csv.DictReader(run(cache, "list", "--csv").stdout.splitlines()))) == 2
    table = run(cache, "list").stdout
    assert "2 entries" in table and str(cache) in table
    answer = run(cache, "clear")
    assert answer.returncode == 0 and "2 entries removed" in answer.stdout
    assert json.loads(run(cache, "list", "--json").stdout) == [] and not list(cache.iterdir())
    assert load(tmp_path, cache, monkeypatch, 1.0).bodies  # and rebuilt
    assert len(list(cache.iterdir())) == 1


def test_no_cache_is_said_with_the_reason(tmp_path):
    answer = run("off", "list")
    assert answer.returncode == 1 and "CLEARANCE_CACHE=off" in answer.stderr
    open_to_all = tmp_path / "open"
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    answer = run(open_to_all, "clear")
    assert answer.returncode == 1 and "may write to it" in answer.stderr
    assert run(tmp_path, "dance").returncode == 2 and run(tmp_path).returncode == 2


def test_a_daemon_uses_the_cache_directory_of_its_unit(tmp_path, monkeypatch, start_daemon):
    (tmp_path / "mesh.obj").write_text(TETRAHEDRON)
    scene = tmp_path / "scene.yaml"
    scene.write_text("bodies:\n  - {name: it, mesh: mesh.obj}\n")
    own, said = tmp_path / "own", tmp_path / "said"
    monkeypatch.delenv("CLEARANCE_CACHE")
    monkeypatch.setenv("CACHE_DIRECTORY", f"{own}:{tmp_path / 'another'}")
    assert "cache_off" not in start_daemon(scene, ["ipc"]).log()
    assert len(list(own.iterdir())) == 1
    monkeypatch.setenv("CLEARANCE_CACHE", str(said))
    start_daemon(scene, ["ipc"])
    assert len(list(said.iterdir())) == 1
    said.chmod(0o777)
    assert "event=cache_off" in start_daemon(scene, ["ipc"]).log()
