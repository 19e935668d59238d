"""python -m clearance.examples: short programs with true claims, each with a picture and a command in the docs."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

import clearance
from clearance.examples.__main__ import FOLDER, NAMES, main

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", NAMES)
def test_each_runs_and_is_short(name, capsys):
    assert len((FOLDER / f"{name}.py").read_text().splitlines()) <= 30
    scene, engine, lines = importlib.import_module(f"clearance.examples.{name}").main()
    printed = capsys.readouterr().out
    assert printed and isinstance(scene, clearance.Scene)
    states = engine.body_states()
    assert all(state.status == clearance.Status.OK for state in states), "all is placed, as a picture needs"
    assert np.isfinite(np.asarray(lines, dtype=float)).all()
    if name != "two_bodies":
        assert len(engine.joints("arm")) == 3


def test_what_they_say(capsys):
    """Their claims, by other calls."""
    said = {}
    for name in NAMES:
        main([name])
        said[name] = capsys.readouterr().out
    assert re.search(r"samples: \[( *True){5}\]\n.*way: *False - arm/hand sheet", said["proved_edge"])
    assert "free: [ True  True  True]" in said["trajectory"] and "trajectory free: False" in said["trajectory"]
    assert "turn 0.00: free True" in said["grasp"] and "turn 0.45: free False" in said["grasp"]
    turned, least = map(float, re.search(r"turned by (\S+); never nearer than (\S+) mm", said["barrier"]).groups())
    assert 0.1 < turned < 1.0 and least >= 49.9
    low, high = map(float, re.search(r"(\S+) to (\S+) m", said["two_bodies"]).groups())
    assert 0.24 < low <= high < 0.25


def test_the_barrier_without_anything_near(monkeypatch, capsys):
    barrier = importlib.import_module("clearance.examples.barrier")
    scene = barrier.arm_scene()
    for body in ("table", "box"):
        scene.ignore(body, "*")
    monkeypatch.setattr(barrier, "arm_scene", lambda: scene)
    barrier.main()
    assert "turned by 2.400; never nearer than 400.0 mm" in capsys.readouterr().out


def test_the_list_and_the_source(capsys):
    main([])
    listed = capsys.readouterr().out
    assert all(re.search(rf"^{name} .+\.$", listed, re.MULTILINE) for name in NAMES)
    main(["batch", "--source"])
    assert capsys.readouterr().out == (FOLDER / "batch.py").read_text()


def test_a_picture(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    main(["two_bodies", "--picture", str(tmp_path / "a.png")])
    assert (tmp_path / "a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_gallery_has_each():
    page = (ROOT / "docs/gallery.md").read_text()
    assert re.findall(r"^    python -m clearance\.examples (\w+)$", page, re.MULTILINE) == list(NAMES)
    for name in NAMES:
        assert f"(gallery/{name}.png)" in page and (ROOT / f"docs/gallery/{name}.png").stat().st_size > 1000


def test_llms_txt_leads_to_pages():
    pages = re.findall(r"\]\(([\w./]+)\)", (ROOT / "docs/llms.txt").read_text())
    assert len(pages) > 10 and all((ROOT / "docs" / page).is_file() for page in pages)
