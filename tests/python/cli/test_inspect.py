"""clearance inspect: the cost of a scene, and parts that it could do without."""

import json
import subprocess

import pytest

from conftest import CLEARANCE, ROOT
from patience import PATIENCE_S


def run(*arguments, program=CLEARANCE, **options):
    command = [program, "inspect", *map(str, arguments), "--no-covers"]  # test_covers.py has them
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, **options)


@pytest.mark.parametrize("name, bodies, pairs", [("nineteen", 19, 171), ("cell", 23, 193), ("extremes", 20, 190)])
def test_json_names_every_body(name, bodies, pairs):
    answer = run(ROOT / "scenes" / name / "scene.yaml", "--json", "--no-times")
    assert answer.returncode == 0, answer.stderr
    report = json.loads(answer.stdout)
    assert len(report["bodies"]) == bodies and report["pairs"] == pairs and report["ns_all_pairs"] is None
    assert sum(body["partners"] for body in report["bodies"]) == 2 * pairs
    assert report["bytes"] == pytest.approx(sum(body["bytes"] / body["shared_by"] for body in report["bodies"]))
    for body in report["bodies"]:
        assert body["ns_per_pair"] is None and body["vertices"] + (body["inside"] or 0) <= body["loaded"]


def test_times_are_measured_unless_they_are_not_wanted():
    answer = run(ROOT / "scenes" / "nineteen" / "scene.yaml", "--json")
    report = json.loads(answer.stdout)
    assert all(body["ns_per_pair"] > 0 for body in report["bodies"]) and report["ns_all_pairs"] > 0


def test_people_get_a_table_and_sentences(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "bodies:\n"
        "  - {name: globe, uv_sphere: {radius: 0.5, resolution: 40}}\n"
        "  - {name: crate, box: 1, pose: [3, 0, 0, 1, 0, 0, 0]}\n"
        "  - {name: crate_2, box: 1, pose: [3, 0, 0, 1, 0, 0, 0]}\n"
    )
    answer = run(scene)
    assert answer.returncode == 0, answer.stderr
    lines = answer.stdout.splitlines()
    assert lines[0].split()[:3] == ["body", "form", "kind"]
    assert any(line.startswith("globe: a sphere of radius 0.5 m") for line in lines)
    assert any(line.startswith('crate_2: the same shape at the same pose as "crate"') for line in lines)
    assert "3 bodies, 3 enabled pairs" in answer.stdout
    assert "globe: " not in run(scene, "--within", "1e-6", "--no-times").stdout
    assert "Found no redundancy" in run(ROOT / "scenes" / "cell" / "scene.yaml", "--no-times").stdout
    rows = run(scene, "--csv", "--no-times").stdout.splitlines()
    assert len(rows) == 4 and len({row.count(",") for row in rows}) == 1


def test_concave_meshes_are_warned_about():
    scene = ROOT / "scenes" / "cell" / "scene.yaml"
    report = json.loads(run(scene, "--json", "--no-times").stdout)
    bodies = {body["body"]: body for body in report["bodies"]}
    warned = {warning["body"]: warning["text"] for warning in report["warnings"]}
    for name, text in warned.items():
        assert bodies[name]["hull_excess_m"] > 0 and f"{bodies[name]['hull_excess_m']:.3g} m out of its mesh" in text
    assert warned and set(warned) < set(bodies)
    lines = run(scene, "--no-times").stdout.splitlines()
    assert sum(line.startswith("Warning: ") for line in lines) == len(warned)


def test_the_models_depend_on_the_margin():
    scene = ROOT / "scenes" / "cell" / "scene.yaml"
    groups = {group["group"]: group for group in json.loads(run(scene, "--json", "--no-times").stdout)["models"]}
    assert groups.keys() == {"movable bodies", "static bodies"}
    fixed = groups["static bodies"]
    assert 0.03 < fixed["hull_excess_m"] < 0.031 and fixed["farthest"] == "base" and fixed["true_meshes"] == 1

    def models(*arguments):
        lines = run(scene, *arguments).stdout.splitlines()
        return [line for line in lines if line.startswith(("static bodies (5): ", "For decisions by "))]

    group, choice = models()
    assert "up to 30.6 mm too small (base); true meshes cost " in group
    assert "mesh_as: solid for bottle, base; mesh_as: auto" in choice
    group, choice = models("--no-times", "--margin", "0.02")
    assert "(times not measured)" in group and choice.endswith("mesh_as: solid for base; mesh_as: hull for the others")
    assert "precise enough" in models("--no-times", "--margin", "0.031")[1]


def test_errors_name_their_cause(tmp_path):
    missing = run(tmp_path / "none.yaml")
    assert missing.returncode == 1 and "none.yaml" in missing.stderr
    assert run().returncode == 2
    assert run("a.yaml", "--within", "2").returncode == 2
    assert run("a.yaml", "--margin", "-1").returncode == 2
    assert run("--json", "--csv", "a.yaml").returncode == 2
    assert "clearance inspect [OPTIONS]" in run("--help").stdout
