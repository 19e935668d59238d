"""Certificates: rows of every status and kind are proved to a program that shares nothing with the engine, which
detects every tampering."""

import copy
import json
import math
import random
import subprocess
import sys

import numpy as np
import pytest

import clearance
from certificates import NAMES, junk_rejected, turned
from clearance import Status
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


# ---- tampering -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def documents(root, tmp_path_factory):
    """One proved row each, as inputs of mutations."""
    engine = clearance.Engine(zoo(), covers="off")
    q = np.array([0.9, 0.1, 0.3, 0.2])
    places = {"box": at(0), "hull": at(1.5, 0.2, 0.1, q), "round": at(0.1, 1.4, 0.2, q), "vague": at(-1.5, 0.3, 0.2, q)}
    places |= {"cylinder": at(0, -1.2, 0.1, q), "blunt": at(0.4, 0.3, 1.2, q), "egg": at(0.1, 0.3, -1.5)}
    engine.set_poses(places)
    requested = {
        "apart": {"pairs": [("box", "hull")], "rel_tol": 1e-12},
        "round": {"pairs": [("hull", "round")], "rel_tol": 1e-12},
        "slack": {"pairs": [("box", "vague")], "rel_tol": 1e-12},
        "can": {"pairs": [("cylinder", "box")], "rel_tol": 1e-12},
        "egg": {"pairs": [("box", "egg")], "rel_tol": 1e-12},
        "follower": {"pairs": [("follower", "box")], "rel_tol": 1e-12},
        "beyond": {"pairs": [("box", "hull")], "max_distance": 0.1},
    }
    made = {name: engine.certificate(**arguments).document for name, arguments in requested.items()}
    engine.set_poses({"hull": at(0.1, 0.05, 0.02, q)})
    made["depth"] = engine.certificate(pairs=[("box", "hull")], signed_distance=True).document
    made["overlap"] = engine.certificate(pairs=[("box", "hull")]).document
    cell = clearance.Engine(clearance.Scene.load(root / "scenes" / "cell" / "scene.yaml"), covers="off")
    result = cell.distances(rel_tol=1e-12)
    of_pieces = [len(body["pieces"]) for body in cell.certificate().document["bodies"]]
    several = [of_pieces[a] * of_pieces[b] > 1 for a, b in result.pairs] & (result.status[0] == Status.OK)
    made["pieces"] = cell.certificate([np.flatnonzero(several)[0]], rel_tol=1e-12).document
    urdf = tmp_path_factory.mktemp("prism") / "can.urdf"
    shape = '<collision><geometry><cylinder radius="0.2" length="0.6"/></geometry></collision>'
    urdf.write_text(f'<robot name="r"><link name="can">{shape}</link></robot>')
    prism = clearance.Scene()
    prism.add_robot("r", urdf)
    prism.add_box("box", [0.3, 0.5, 0.7], pose=at(1, 0.1, 0.2, q))
    made["shape"] = clearance.Engine(prism, covers="off").certificate(pairs=[("r/can", "box")], rel_tol=1e-12).document
    aged = clearance.Scene()
    aged.add_sphere("fast", 0.1, max_speed=0.01)
    aged.add_sphere("still", 0.1, static=True, pose=at(9))
    engine = clearance.Engine(aged, covers="off")
    engine.set_poses({"fast": at(0)})
    made["age"] = engine.certificate().document
    return made


def row(document):
    return document["rows"][0]


def span(document):
    return spans_of(row(document))[0]


def lower(document):
    return span(document)["lower"]


def upper(document):
    return row(document)["witness"]


def terms(document):
    return span(document)["slack"]["terms"]


def tilt(document):
    lower(document)[0]["direction"][0][0] += 0.1 * max(abs(x[0]) for x in lower(document)[0]["direction"])
    lower(document)[0]["direction"][1][0] -= 0.1 * max(abs(x[0]) for x in lower(document)[0]["direction"])


def directions(document, change):
    claim = lower(document)[0]
    claim["direction"] = [change(high, low) for high, low in claim["direction"]]


def move_vertex(document):
    """The vertex of a that is nearest, by half of the gap."""
    (i, _), (vertex, _) = upper(document)["pieces"], upper(document)["vertices"][0]
    body = next(body for body in document["bodies"] if body["id"] == row(document)["bodies"][0])
    direction = np.array([x[0] for x in lower(document)[0]["direction"]])
    direction *= row(document)["lower"] / 2 / np.linalg.norm(direction)
    place = document["pieces"][body["pieces"][i]]["vertices"][vertex]
    for k in range(3):
        place[k] += float(direction[k])


def scale(name, factor):
    def mutate(document):
        row(document)[name] *= factor
        if name == "lower":
            row(document)["pairs"][0]["lower"] *= factor

    return mutate


def drop(name):
    def mutate(document):
        before = len(terms(document))
        terms(document)[:] = [term for term in terms(document) if term["name"] != name]
        assert len(terms(document)) < before

    return mutate


def pose_of(document, side):
    return next(body for body in document["bodies"] if body["id"] == row(document)["bodies"][side])["pose"]


def follower(document):
    return next(body for body in document["bodies"] if body["name"] == "follower")


def worse_shape(name):
    def mutate(document):
        for body in document["bodies"]:
            body["shape"][name] += 0.01

    return mutate


def lessen(name, factor=0.99):
    def mutate(document):
        for term in terms(document):
            if term["name"] == name:
                term["inner"] *= factor

    return mutate


def shift_pose(side, metres):
    def mutate(document):
        step = metres * (1 if side else -1) * np.sign(lower(document)[0]["direction"][0][0])
        pose_of(document, side)[0] += step

    return mutate


def core(document):
    return next(piece["core"] for piece in document["pieces"] if "core" in piece)


def resize(factor):
    def mutate(document):
        core(document)["size"] = [factor * x for x in core(document)["size"]]

    return mutate


def move_point(document):
    next(points for points in upper(document)["points"] if points)[0][0][0] += 0.01


def leave_out_vertex(document):
    del document["pieces"][0]["vertices"][-1]


def cancelling_weights(document):
    """The same point, by weights of which one is negative."""
    upper(document)["vertices"] += [upper(document)["vertices"][0]] * 2
    upper(document)["weights"] += [[1.0, 0.0], [-1.0, 0.0]]


def there_and_back(document):
    """Closed, and beyond a ball, but not around it."""
    faces, normals = upper(document)["faces"], upper(document)["normals"]
    faces += [face[::-1] for face in faces]
    normals += copy.deepcopy(normals)


def doubt_more(key, value):
    def mutate(document):
        for body in document["bodies"]:
            target = body["uncertainty"] if key in ("angle", "position") else body
            target[key] = value

    return mutate


MUTATIONS = {
    "direction tilted": ("apart", tilt),
    "direction turned round": ("apart", lambda d: directions(d, lambda high, low: [-high, -low])),
    "direction of nothing": ("apart", lambda d: directions(d, lambda high, low: [0, 0])),
    "direction without its high parts": ("apart", lambda d: directions(d, lambda high, low: [0, low])),
    "direction left out": ("apart", lambda d: lower(d).clear()),
    "direction of a pair of pieces left out": ("pieces", lambda d: lower(d).pop()),
    "lower raised": ("apart", scale("lower", 1 + 1e-9)),
    "lower of rounded bodies raised": ("round", scale("lower", 1 + 1e-9)),
    "lower of uncertain bodies raised": ("slack", scale("lower", 1 + 1e-9)),
    "lower raised beyond the cut-off": ("beyond", scale("lower", 10)),
    "upper lowered": ("apart", scale("upper", 1 - 1e-9)),
    "upper of rounded bodies lowered": ("round", scale("upper", 1 - 1e-9)),
    "upper of several pieces lowered": ("pieces", scale("upper", 1 - 1e-9)),
    "depth raised": ("depth", scale("upper", 1.01)),
    "depth raised to what is not disproved": ("depth", lambda d: row(d).update(upper=row(d)["lower"])),
    "depth lowered": ("depth", scale("lower", 0.99)),
    "weight changed": ("apart", lambda d: upper(d)["weights"][0].__setitem__(0, upper(d)["weights"][0][0] + 0.5)),
    "weight negative": ("apart", lambda d: upper(d)["weights"][0].__setitem__(0, -1.0)),
    "weights that cancel": ("apart", cancelling_weights),
    "weight left out": ("apart", lambda d: upper(d)["weights"].pop()),
    "witness of another piece": ("pieces", lambda d: upper(d)["pieces"].__setitem__(0, 99)),
    "vertex moved": ("apart", move_vertex),
    "vertex left out": ("apart", leave_out_vertex),
    "no such vertex": ("apart", lambda d: upper(d)["vertices"][0].__setitem__(0, -1)),
    "core larger": ("can", resize(1 + 1e-9)),
    "core smaller": ("can", resize(1 - 1e-9)),
    "round core larger": ("egg", resize(1 + 1e-9)),
    "round core smaller": ("egg", resize(1 - 1e-9)),
    "core of no size": ("egg", resize(0)),
    "core of another kind": ("can", lambda d: core(d).update(kind="ellipsoid")),
    "unknown core": ("can", lambda d: core(d).update(kind="torus")),
    "core left out": ("egg", lambda d: [piece.pop("core", None) for piece in d["pieces"]]),
    "point of a core moved": ("can", move_point),
    "point of a round core moved": ("egg", move_point),
    "points of a core left out": ("can", lambda d: upper(d).pop("points")),
    "radius": ("round", lambda d: [piece.update(radius=piece["radius"] * 1.01) for piece in d["pieces"]]),
    "pose of a changed": ("apart", shift_pose(0, -1e-3)),
    "pose of b changed": ("apart", shift_pose(1, -1e-3)),
    "quaternion changed": ("apart", lambda d: pose_of(d, 1).__setitem__(4, 0.5)),
    "slack of turns dropped": ("slack", drop("turn")),
    "slack of turns lessened": ("slack", lessen("turn")),
    "slack of a parent's doubt dropped": ("follower", drop("parent")),
    "slack of a parent's doubt lessened": ("follower", lessen("parent", 0.5)),
    "parent hidden": ("follower", lambda d: follower(d).update(on=None)),
    "parent of itself": ("follower", lambda d: follower(d).update(on=follower(d)["id"])),
    "slack of age dropped": ("age", drop("age")),
    "slack of age lessened": ("age", lambda d: [b.update(age_s=b["age_s"] + 1) for b in d["bodies"]]),
    "shape that stands out farther": ("apart", worse_shape("inner")),
    "shape that reaches less far": ("apart", worse_shape("outer")),
    "more angle": ("slack", doubt_more("angle", 0.05)),
    "more position": ("slack", doubt_more("position", 0.5)),
    "padding": ("apart", doubt_more("padding", 0.01)),
    "max_speed": ("apart", doubt_more("max_speed", 1.0)),
    "face left out": ("depth", lambda d: (upper(d)["faces"].pop(), upper(d)["normals"].pop())),
    "face turned round": ("overlap", lambda d: upper(d)["faces"][0].reverse()),
    "normal turned round": ("overlap", lambda d: upper(d)["normals"].__setitem__(0, turned(upper(d)["normals"][0]))),
    "surface of nothing": ("overlap", lambda d: upper(d).update(faces=[], normals=[])),
    "surface there and back": ("overlap", there_and_back),
    "surface beside the origin": ("overlap", lambda d: pose_of(d, 1).__setitem__(0, 50.0)),
    "overlap said of bodies apart": ("apart", lambda d: row(d).update(status="overlap", lower=0.0, upper=0.0)),
    "ok said of what is beyond": ("beyond", lambda d: row(d).update(status="ok")),
    "beyond said of what is ok": ("apart", lambda d: row(d).update(status="beyond")),
    "unknown status": ("apart", lambda d: row(d).update(status="fine")),
    "bounds crossed": ("apart", lambda d: row(d).update(upper=row(d)["lower"] / 2)),
    "a bound that is no number": ("apart", lambda d: row(d).update(lower="nan")),
    "not proved, as the engine says": ("apart", lambda d: row(d).update(proved=False)),
    "two spans": ("apart", lambda d: spans_of(row(d)).append(span(d))),
    "other bodies": ("apart", lambda d: row(d).update(bodies=[0, 0])),
    "no pairs": ("apart", lambda d: row(d).update(pairs=[])),
    "span that ends early": ("apart", lambda d: span(d).update(end=0.5)),
    "span that begins late": ("apart", lambda d: span(d).update(begin=0.5, at=0.5)),
    "no configuration": ("apart", lambda d: d["configurations"].clear()),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_tampering_is_found(checker, documents, name):
    kind, mutate = MUTATIONS[name]
    document = copy.deepcopy(documents[kind])
    [(is_proved, why)] = checker.verdicts(document)
    assert is_proved, why
    mutate(document)
    assert document != documents[kind]
    try:
        [(is_proved, why)] = checker.verdicts(document)
    except checker.MALFORMED as error:
        assert name in ("vertex left out", "more position", "padding", "unknown core", "core of no size"), error
    else:
        assert not is_proved, why


def test_any_junk_is_answered(checker, documents):
    chosen = [documents[name] for name in ("apart", "slack", "overlap", "follower", "age", "can")]
    assert 150 < junk_rejected(checker, chosen, random.Random(5), 400) < 400  # names and digests may be anything
