"""Certificates: rows of every status and kind are proved to a program that shares nothing with the engine."""

import copy
import json
import math
import subprocess
import sys

import numpy as np
import pytest

import clearance
from certificates import NAMES
from scenes import at, box_vertices, random_poses

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


def zoo():
    """Bodies of every kind, including some that are less certain than their parts."""
    rng = np.random.default_rng(7)
    scene = clearance.Scene()
    scene.add_hull("point", [[0.1, 0.2, 0.3]])
    scene.add_hull("segment", [[0, 0, 0], [0.5, 0.1, 0]])
    scene.add_hull("plate", [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    scene.add_sphere("ball", 0.2)
    scene.add_capsule("capsule", 0.1, 0.6)
    scene.add_box("box", [0.3, 0.5, 0.7])
    scene.add_hull("hull", rng.normal(size=(14, 3)) * 0.3)
    scene.add_hull("round", rng.normal(size=(12, 3)) * 0.3, radius=0.07)
    scene.add_cylinder("cylinder", 0.2, 0.6)
    scene.add_body("blunt", cone=(0.3, 0.5), radius=0.05)
    scene.add_ellipsoid("egg", (0.2, 0.5, 0.3))
    scene.add_hull("vague", box_vertices(0.4, 0.4, 0.4), uncertainty={"position": 0.01, "angle": 0.02}, padding=0.005)
    scene.add_sphere("follower", 0.1, parent="vague", pose=at(0.3, 0.1, 0.2))
    return scene


def dense(result, document):
    """Rows of a document together with those of the result."""
    rows = document["rows"]
    assert [row["row"] for row in rows] == list(range(result.lower.size))
    for name in ("lower", "upper"):
        bounds = np.array([float(row[name]) for row in rows])
        assert np.array_equal(bounds, getattr(result, name).ravel()), name
    assert [row["status"] for row in rows] == [NAMES[s] for s in result.status.ravel()]


def check_all(checker, certificate):
    """Checks that every row is proved; returns the number of rows by status."""
    document = certificate.document
    for (is_proved, why), row in zip(checker.verdicts(document), document["rows"]):
        assert is_proved, (why, row["row"], row["status"], row["lower"], row["upper"])
    statuses = [row["status"] for row in document["rows"]]
    return {status: statuses.count(status) for status in statuses}


@pytest.mark.parametrize(
    ("arguments", "seen"),
    [
        ({}, {"ok", "overlap"}),
        ({"signed_distance": True}, {"ok", "overlap"}),
        ({"max_distance": 0.3}, {"ok", "overlap", "beyond"}),
        ({"precision": "f32", "max_distance": 0.8}, {"ok", "overlap", "beyond"}),
        ({"rel_tol": 1e-15}, {"ok", "overlap"}),
        ({"rel_tol": 0.0}, {"unconverged", "overlap"}),
        ({"signed_distance": True, "rel_tol": 0.0}, {"unconverged"}),
    ],
    ids=str,
)
def test_rows_are_proved_and_are_those_of_distances(checker, arguments, seen):
    scene = zoo()
    engine = clearance.Engine(scene, backend="cpu", covers="off")
    movable = [body.name for body in engine.bodies if body.name != "follower"]
    rng = np.random.default_rng(3)
    arguments = {**arguments, "bodies": movable}
    configurations = np.stack([random_poses(rng, len(movable), spread) for spread in (0.4, 0.8)])
    result = engine.prepare("distances", **arguments).run(configurations)
    certificate = engine.certificate(configurations=configurations, **arguments)
    dense(result, certificate.document)
    assert set(check_all(checker, certificate)) >= seen


def test_hard_places(checker):
    """Grazing at 1e-9 m, exact contact, far from the origin, large and small."""
    scene, poses = clearance.Scene(), {}
    for i, (size, origin) in enumerate([(1.0, 0.0), (1.0, 1e6), (1e-6, 0.0), (1e6, 1e7)]):
        for j, gap in enumerate([1e-9, 0.0, -1e-9, 0.3]):
            for k, x in enumerate((0.0, size * (1 + gap))):
                name = f"{'ab'[k]}{i}{j}"
                scene.add_hull(name, box_vertices(size, size, size))
                poses[name] = at(origin + x, 100 * j * size, 0, (0.7, 0.1 * j, 0, 0) if j == 3 else (1, 0, 0, 0))
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses(poses)
    pairs = [(f"a{i}{j}", f"b{i}{j}") for i in range(4) for j in range(4)]
    for signed_distance in (False, True):
        certificate = engine.certificate(pairs=pairs, signed_distance=signed_distance)
        dense(engine.distances(pairs=pairs, signed_distance=signed_distance), certificate.document)
        assert set(check_all(checker, certificate)) >= {"ok", "contact", "overlap"}
    in_double_double = [p["arithmetic"] for row in certificate.document["rows"] for p in spans_of(row)[0]["lower"]]
    assert "double-double" in in_double_double and "float64" in in_double_double


@pytest.mark.parametrize("arguments", [{}, {"max_distance": 0.2}, {"signed_distance": True}], ids=str)
def test_bodies_of_several_pieces(checker, root, arguments):
    engine = clearance.Engine(clearance.Scene.load(root / "scenes" / "cell" / "scene.yaml"), covers="off")
    result = engine.distances(**arguments)
    rows = range(0, result.lower.size, 3)
    document = engine.certificate(rows, **arguments).document
    assert np.array_equal([float(row["lower"]) for row in document["rows"]], result.lower[0, ::3])
    assert any(len(spans_of(row)[0]["lower"]) > 1 for row in document["rows"])
    check_all(checker, engine.certificate(rows, **arguments))


def test_links_of_robots(checker, tmp_path):
    (tmp_path / "arm.urdf").write_text("""<robot name="arm">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0 0 0.3"/><geometry><box size="0.1 0.1 0.5"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.6"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>""")
    scene = clearance.Scene()
    scene.add_robot("arm", tmp_path / "arm.urdf", base=at(0.1, 0, 0.5))
    scene.add_box("wall", [0.1, 2, 2], static=True, pose=at(0.9))
    engine = clearance.Engine(scene, covers="off")
    requested = {"joints": "arm", "configurations": [[0.3, 0.4], [1.2, -2.5], [1.5, 0.1]]}
    certificate = engine.certificate(**requested)
    assert check_all(checker, certificate).keys() >= {"ok", "overlap"}
    links = [row for row in certificate.document["rows"] if any(t["of"] == "pair" for t in terms_of(row))]
    assert links, "rows of two links"
    for tampered in KINEMATICS.values():
        document = copy.deepcopy(certificate.document)
        tampered(document)
        assert not all(is_proved for is_proved, _ in checker.verdicts(document))


def link(document, name):
    return next(body for body in document["bodies"] if body["name"].endswith(name))


KINEMATICS = {
    "position": lambda d: d["configurations"][0]["positions"]["0"].__setitem__(0, 0.4),
    "position left out": lambda d: d["configurations"][0]["positions"].pop("0"),
    "origin of a joint": lambda d: link(d, "upper")["pose"].__setitem__(2, 0.2),
    "axis": lambda d: link(d, "fore")["moves"][-1].update(axis=[0, 1, 0]),
    "turn as a slide": lambda d: link(d, "upper")["moves"][-1].update(turns=False),
    "multiplier": lambda d: link(d, "upper")["moves"][-1].update(multiplier=1.1),
    "base": lambda d: next(b for b in d["bodies"] if b["name"] == "arm")["pose"].__setitem__(0, 0.2),
    "links that hang on themselves": lambda d: [b.update(on=b["id"]) for b in d["bodies"] if b["joint"]],
}


def spans_of(row):
    return row["pairs"][0]["spans"]


def terms_of(row):
    return spans_of(row)[0]["slack"]["terms"]


def test_unusable_rows_prove_nothing(checker):
    scene = clearance.Scene()
    for name in ("a", "b", "c"):
        scene.add_sphere(name, 0.1)
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses({"a": at(0), "b": at(math.nan)})
    pairs = np.array([[0, 1], [0, 2], [0, 9]])
    document = engine.certificate(pairs=pairs).document
    assert [row["status"] for row in document["rows"]] == ["bad_pose", "no_pose", "unknown_body"]
    assert all(is_proved and "nothing" in why for is_proved, why in checker.verdicts(document))
    for row in document["rows"]:
        row["lower"] = 0.1
    assert not any(is_proved for is_proved, _ in checker.verdicts(document))


def test_what_has_no_certificate():
    engine = clearance.Engine(zoo(), covers="off")
    with pytest.raises(clearance.QueryError, match=r"rows\[1\]: expected one of \d+ rows, got 1000"):
        engine.certificate([0, 1000])
    with pytest.raises(clearance.QueryError, match="only rows of reduce none"):
        engine.certificate(reduce="min")
    with pytest.raises(clearance.QueryError, match=r"at most 100000 rows at a time, got 100001"):
        engine.certificate([0] * 100_001)
    with pytest.raises(ValueError, match=r"rows\[0\]: expected an integer >= 0"):
        engine.certificate([-1])


def test_the_program(root, tmp_path):
    scene = clearance.Scene()
    scene.add_sphere("a", 0.1, pose=at(0))
    scene.add_sphere("b", 0.1, pose=at(1))
    certificate = clearance.Engine(scene, covers="off").certificate()
    assert "1 of 1 rows are proved" in repr(certificate)
    good, bad, none = tmp_path / "good.json", tmp_path / "bad.json", tmp_path / "none.json"
    certificate.save(good)
    assert good.read_text() == certificate.to_json()
    document = certificate.document
    for claim in (document["rows"][0], document["rows"][0]["pairs"][0]):
        claim["lower"] = 0.800000000000003  # above 0.8, below upper
    bad.write_text(json.dumps(document))
    none.write_text("[]")

    def run(*files):
        program = [sys.executable, "-I", root / "tools" / "check_certificate.py", *files]
        return subprocess.run(program, capture_output=True, text=True, check=False)

    assert run(good).returncode == 0
    wrong = run(good, bad, none)
    assert wrong.returncode == 1 and wrong.stderr == ""
    assert "good.json: 1 of 1 rows are proved" in wrong.stdout
    assert "NOT PROVED: pieces 0 and 0 of 'a' and 'b' are not 0.800000000000003 m apart" in wrong.stdout
    assert "none.json: no certificate" in wrong.stdout
    text = (root / "tools" / "check_certificate.py").read_text()
    assert len(text.splitlines()) <= 340 and "import clearance" not in text and "numpy" not in text
