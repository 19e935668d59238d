"""Certificates of distances: both checkers detect every tampering."""

import copy
import random

import numpy as np
import pytest

import clearance
from certificates import junk_rejected, turned
from clearance import Status
from scenes import at
from test_certificates import spans_of, zoo

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


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
