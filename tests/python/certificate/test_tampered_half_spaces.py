"""Certificates of half-spaces: both checkers detect every tampering."""

import copy
import random

import numpy as np
import pytest

import clearance
from certificates import junk_rejected
from scenes import at
from test_certificates import zoo
from test_half_space_certificates import TILTED, add_planes, arm_on_a_cart, claims, moves

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


@pytest.fixture(scope="module")
def documents(checker, tmp_path_factory):
    """One proved row each, as inputs of mutations. The half-space is b; in `first` it is a."""
    scene = add_planes(zoo())
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses({"box": at(0.4, 0.2, 0.5, (0.9, 0.1, 0.3, 0.2)), "egg": at(0.6, 0.1, 0.7), "hull": at(0.1)})
    requested = {
        "apart": {"pairs": [("box", "wall")], "rel_tol": 1e-12},
        "first": {"pairs": [("floor", "box")], "rel_tol": 1e-12},
        "egg": {"pairs": [("egg", "wall")], "rel_tol": 1e-12},
        "beyond": {"pairs": [("box", "wall")], "max_distance": 0.1},
    }
    made = {name: engine.certificate(**arguments).document for name, arguments in requested.items()}
    engine.set_poses({"box": at(0.4, 0.2, -0.35, (0.9, 0.1, 0.3, 0.2))})
    made["depth"] = engine.certificate(pairs=[("box", "floor")], signed_distance=True).document
    made["overlap"] = engine.certificate(pairs=[("box", "floor")]).document
    engine.set_poses({"box": at(0.4, 0.2, -2, (0.9, 0.1, 0.3, 0.2))})
    made["sunk"] = engine.certificate(pairs=np.array([[13, 5]])).document  # the floor is a
    robot = arm_on_a_cart(tmp_path_factory.mktemp("arm"))
    for seed in range(10, 60):
        found = robot.certificate(**moves(1, seed), pairs=[("arm/finger", "wall")], reduce="none").document
        (row,) = found["rows"]
        if row["status"] == "ok" and 2 in {claim["order"] for claim in claims(found)}:
            made["motion"] = found
            break
    for document in made.values():
        ((is_proved, why),) = checker.verdicts(document)
        assert is_proved, why
    return made


def row(d):
    return d["rows"][0]


def plane(d):
    """The part that is a half-space."""
    return next(piece for piece in d["pieces"] if piece.get("core", {}).get("kind") == "half_space")


def plane_body(d):
    return next(b for b in d["bodies"] if any(d["pieces"][k] is plane(d) for k in b["pieces"]))


def other_body(d):
    return next(b for b in d["bodies"] if b["id"] in row(d)["bodies"] and b["id"] != plane_body(d)["id"])


def points(d):
    """The witness's points of the half-space."""
    side = row(d)["bodies"].index(plane_body(d)["id"])
    return row(d)["witness"]["points"][side]


def rounded_direction(d):
    """The engine's normal of the plane: rounded once, in a's axes."""

    def matrix(b):
        w, x, y, z = np.array(b["pose"][3:]) / np.linalg.norm(b["pose"][3:])
        return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip

    n = -matrix(other_body(d)).T @ matrix(plane_body(d))[:, 2]
    for claim in claims(d):
        claim["direction"] = [[float(x), 0.0] for x in n]


def lower_by(metres):
    def mutate(d):
        row(d)["lower"] += metres
        row(d)["pairs"][0]["lower"] += metres
        row(d)["upper"] = max(row(d)["upper"], row(d)["lower"])

    return mutate


def follow(d):
    """Attaches the half-space to the other body."""
    plane_body(d)["on"] = other_body(d)["id"]


def hang_on_a_joint(d):
    joint = {"axis": [0, 0, 1], "turns": True, "column": None, "multiplier": 1, "offset": 0, "stands": 0}
    plane_body(d)["moves"] = [joint]


def move_plane(start, end):
    def mutate(d):
        d["configurations"][0]["poses"][str(plane_body(d)["id"])] = [start, end]

    return mutate


def swap(d):
    """Exchanges a and b."""
    row(d)["bodies"].reverse()
    row(d)["pairs"][0]["bodies"].reverse()


def swap_all(d):
    """Exchanges them and the witness, but not the direction."""
    swap(d)
    row(d)["witness"]["pieces"].reverse()
    row(d)["witness"]["points"].reverse()
    row(d)["witness"]["vertices"] = [[k, m] for m, k in row(d)["witness"]["vertices"]]


def raise_plane(metres):
    """Along its normal, by as much as the document's numbers resolve."""

    def mutate(d):
        w, x, y, z = np.array(plane_body(d)["pose"][3:]) / np.linalg.norm(plane_body(d)["pose"][3:])
        up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        for k in range(3):
            plane_body(d)["pose"][k] += float(metres * up[k])

    return mutate


def dig(d):
    """A point above the plane, which reduces the other body's height; a smaller bound is claimed."""
    points(d)[0][2] = [0.01, 0.0]
    row(d)["upper"] -= 0.005
    lower_by(-0.01)(d)


def call_apart(direction):
    """Claims separation of a body inside the half-space, by a direction away from it."""

    def mutate(d):
        row(d).update(status="unconverged", upper="inf", lower=0.2)
        row(d)["pairs"][0].update(lower=0.2)
        claim = {"pieces": None, "order": 1, "seer": None, "arithmetic": "float64", "direction": direction}
        row(d)["pairs"][0]["spans"][0]["lower"] = [claim]

    return mutate


def tilt_plane(d):
    plane_body(d)["pose"][4] += 1e-6


MUTATIONS = {
    "lower raised": ("apart", lower_by(1e-9)),
    "lower raised of what stands on it": ("first", lower_by(1e-9)),
    "lower raised over a round core": ("egg", lower_by(1e-9)),
    "lower of a depth raised": ("depth", lower_by(1e-9)),
    "upper lowered": ("apart", lambda d: row(d).update(upper=row(d)["upper"] - 1e-9)),
    "upper lowered of what stands on it": ("first", lambda d: row(d).update(upper=row(d)["upper"] - 1e-9)),
    "upper lowered over a round core": ("egg", lambda d: row(d).update(upper=row(d)["upper"] - 1e-9)),
    "depth raised": ("depth", lambda d: row(d).update(upper=row(d)["upper"] - 1e-9)),
    "direction given, but rounded": ("apart", rounded_direction),
    "direction given, another": ("apart", lambda d: claims(d)[0].update(direction=[[1, 0], [0, 0], [0, 0]])),
    "direction of a floor tilted": ("first", lambda d: claims(d)[0]["direction"][0].__setitem__(0, 1e-300)),
    "direction of a floor turned round": ("first", lambda d: claims(d)[0]["direction"][2].__setitem__(0, -1.0)),
    "direction of a floor left to b": ("first", lambda d: claims(d)[0].update(direction=None)),
    "directions left out": ("apart", lambda d: row(d)["pairs"][0]["spans"][0]["lower"].clear()),
    "bodies swapped": ("apart", swap),
    "bodies swapped with their witness": ("apart", swap_all),
    "plane raised": ("apart", raise_plane(1e-9)),
    "plane lowered": ("apart", raise_plane(-1e-9)),
    "plane raised into the depth": ("depth", raise_plane(1e-9)),
    "plane lowered out of the depth": ("depth", raise_plane(-1e-9)),
    "plane tilted": ("apart", tilt_plane),
    "floor tilted": ("first", lambda d: plane_body(d)["pose"].__setitem__(5, 1e-9)),
    "plane tilted under an egg": ("egg", tilt_plane),
    "plane thicker": ("apart", lambda d: plane(d).update(radius=plane(d)["radius"] + 1e-9)),
    "plane thinner": ("apart", lambda d: plane(d).update(radius=plane(d)["radius"] - 1e-9)),
    "plane thinner than its doubt": ("apart", lambda d: plane(d).update(radius=0.001)),
    "plane in doubt of its angle": ("apart", lambda d: plane_body(d)["uncertainty"].update(angle=1e-300)),
    "floor in doubt of its angle": ("first", lambda d: plane_body(d)["uncertainty"].update(angle=1e-300)),
    "plane in doubt of its place": ("apart", lambda d: plane_body(d)["uncertainty"].update(position=0.1)),
    "plane that goes on": ("apart", lambda d: plane_body(d).update(max_speed=1.0, age_s=1.0)),
    "plane that follows": ("apart", follow),
    "plane on a joint": ("apart", hang_on_a_joint),
    "plane of another kind": ("apart", lambda d: plane(d).update(core={"kind": "cone", "size": [1, 1, 1]})),
    "plane of an unknown kind": ("apart", lambda d: plane(d)["core"].update(kind="plane")),
    "plane as its vertex": ("apart", lambda d: plane(d).pop("core")),
    "point above the plane": ("apart", dig),
    "point above the plane, in a depth": ("depth", dig),
    "within it, but said to be apart": ("sunk", call_apart([[0, 0], [0, 0], [-1, 0]])),
    "within it, but said to be apart by b": ("sunk", call_apart(None)),
    "point deep below the plane": ("apart", lambda d: points(d)[0].__setitem__(2, [-0.01, 0.0])),
    "points left out": ("apart", lambda d: row(d)["witness"].pop("points")),
    "points of none": ("apart", lambda d: row(d)["witness"]["vertices"].clear()),
    "another vertex": ("apart", lambda d: row(d)["witness"]["vertices"][0].__setitem__(0, 0 if
                       row(d)["witness"]["vertices"][0][0] else 1)),
    "overlap said of bodies apart": ("apart", lambda d: row(d).update(status="overlap", lower=0.0, upper=0.0)),
    "overlap of a box that is moved out": ("overlap", lambda d: other_body(d)["pose"].__setitem__(2, 1.0)),
    "padding": ("apart", lambda d: other_body(d).update(padding=0.01)),
    "beyond the cut-off, but said to be farther": ("beyond", lower_by(0.5)),
    "motion: lower raised": ("motion", lower_by(1e-3)),
    "motion: bends ignored": ("motion", lambda d: [c.update(order=1) for c in claims(d)]),
    "motion: directions turned to a's axis": ("motion", lambda d: [c.update(direction=[[0, 0], [0, 0], [1, 0]])
                                                                   for c in claims(d)]),
    "motion: before a body that turns": ("motion", lambda d: [c.update(seer=row(d)["bodies"][0]) for c in claims(d)]),
    "motion: a plane that turns": ("motion", move_plane(at(-0.7, 0.1, 0, TILTED), at(-0.7, 0.1, 0, (1, 0.1, 0.8, 0)))),
    "motion: a plane that slides nearer": ("motion", move_plane(at(-0.7, 0.1, 0, TILTED), at(2.3, 0.1, 3, TILTED))),
    "motion: plane raised": ("motion", raise_plane(1e-3)),
}  # fmt: skip


#: Mutations after which the document is no certificate.
WHOLE = {"plane of an unknown kind", "plane thinner than its doubt", "plane in doubt of its place", "padding",
         "plane of another kind"}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_tampering_is_found(checker, documents, name):
    kind, mutate = MUTATIONS[name]
    document = copy.deepcopy(documents[kind])
    mutate(document)
    assert document != documents[kind]
    try:
        [(is_proved, why)] = checker.verdicts(document)
    except checker.MALFORMED as error:
        assert name in WHOLE, error
    else:
        assert not is_proved, why


def test_what_changes_nothing_is_still_good(checker, documents):
    """Another point of the plane; one above it, compensated elsewhere; a vertex, which is not part of it; a longer or
    shorter direction."""

    def changed(name, change):
        document = copy.deepcopy(documents[name])
        change(document)
        return document

    good = [changed(name, lambda d: points(d)[0].__setitem__(0, [1e9, 0.5])) for name in ("apart", "depth")]
    good += [changed(name, lambda d: points(d)[0].__setitem__(2, [0.01, 0.0])) for name in ("apart", "depth")]
    good += [changed("apart", lambda d: plane(d)["vertices"].__setitem__(0, [0.0, 0.0, 1.0]))]
    good += [changed("first", lambda d: claims(d)[0]["direction"].__setitem__(2, [1e-200, 0.0]))]
    for document in good:
        ((is_proved, why),) = checker.verdicts(document)
        assert is_proved, why


def test_any_junk_is_answered(checker, documents):
    chosen = [document for name, document in documents.items() if name != "motion"]
    assert 75 < junk_rejected(checker, chosen, random.Random(5), 150) < 150
