"""Certificates of half-spaces: rows and motions above floors and in front of walls are proved, and both checkers detect
tampering."""

import copy
import json
import random
import subprocess
import sys

import numpy as np
import pytest

import clearance
import test_certificates
import test_motion_certificates
import test_surface_certificates
from certificates import NAMES, junk_rejected
from scenes import at, box_vertices, random_poses

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")
TWO_BOXES = """<robot name="r"><link name="two">
  <collision><origin xyz="0.4 0 0.1"/><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  <collision><origin xyz="-0.2 0 0" rpy="0.1 0.2 0.3"/><geometry><box size="0.1 0.3 0.2"/></geometry></collision>
</link></robot>"""
TWO_RINGS = """<robot name="r"><link name="two">
  <collision><origin xyz="0.1 0 0.2"/><geometry><mesh filename="ring.obj"/></geometry></collision>
  <collision><origin xyz="-0.2 0 -0.3" rpy="0.1 0.2 0.3"/><geometry><mesh filename="ring.obj"/></geometry></collision>
</link></robot>"""
TILTED = (0.9, 0.1, 0.8, 0.05)


def add_planes(scene):
    """A horizontal plane, and one rotated arbitrarily and with every kind of growth."""
    scene.add_half_space("floor", pose=at(0, 0, -0.4))
    scene.add_half_space("wall", pose=at(-0.5, 0.1, 0, TILTED), padding=0.01, radius=0.02,
                         uncertainty={"position": 0.005})  # fmt: skip
    return scene


def checked(checker, engine, **arguments):
    """Checks that all rows are proved, and equal those of distances(). Returns the document."""
    document = engine.certificate(**arguments).document
    inputs = (arguments.pop("configurations"),) if "configurations" in arguments else ()
    result = engine.prepare("distances", **arguments).run(*inputs)
    for name in ("lower", "upper"):
        assert [float(row[name]) for row in document["rows"]] == getattr(result, name).ravel().tolist(), name
    assert [row["status"] for row in document["rows"]] == [NAMES[s] for s in result.status.ravel()]
    for (is_proved, why), row in zip(checker.verdicts(document), document["rows"]):
        assert is_proved, (why, row["bodies"], row["status"], row["lower"], row["upper"])
    return document


def both_sides(engine, names):
    """Each body with the floor and the wall, once as a and once as b."""
    ids = {body.name: k for k, body in enumerate(engine.bodies)}
    return np.array([pair for k in map(ids.get, names) for pair in ((ids["floor"], k), (k, ids["wall"]))])


def claims(document, row=0):
    return [claim for pair in document["rows"][row]["pairs"] for span in pair["spans"] for claim in span["lower"]]


ARGUMENTS = [
    ({}, {"ok", "overlap"}),
    ({"signed_distance": True}, {"ok", "overlap"}),
    ({"max_distance": 0.3}, {"ok", "overlap", "beyond"}),
    ({"precision": "f32", "max_distance": 0.8}, {"ok", "overlap", "beyond"}),
    ({"rel_tol": 0.0}, {"unconverged", "overlap"}),
    ({"signed_distance": True, "rel_tol": 0.0}, {"unconverged"}),
]


@pytest.mark.parametrize(("arguments", "seen"), ARGUMENTS, ids=str)
def test_rows_are_proved(checker, tmp_path, arguments, seen):
    """Each body from both sides; one direction suffices for all parts, and depths need no surface."""
    scene = add_planes(test_certificates.zoo())
    (tmp_path / "two.urdf").write_text(TWO_BOXES)
    scene.add_robot("r", tmp_path / "two.urdf")
    engine = clearance.Engine(scene, backend="cpu", covers="off")
    movable = [body.name for body in engine.bodies if body.name not in ("follower", "floor", "wall", "r", "r/two")]
    arguments = {**arguments, "bodies": movable}
    rng = np.random.default_rng(3)
    arguments["configurations"] = np.stack([random_poses(rng, len(movable), spread) for spread in (0.4, 0.8)])
    document = checked(checker, engine, **arguments, pairs=both_sides(engine, [*movable, "follower", "r/two"]))
    assert {row["status"] for row in document["rows"]} >= seen
    assert {len(claims(document, k)) for k in range(len(document["rows"]))} <= {0, 1}
    planes = {body["id"] for body in document["bodies"] if body["name"] in ("floor", "wall")}
    sides = {planes & set(row["bodies"][:1]) != set() for row in document["rows"]}
    assert sides == {True, False}, "half-spaces come as a and as b"
    assert not any("faces" in row["witness"] for row in document["rows"] if row["witness"])


@pytest.mark.parametrize("signed_distance", [False, True])
def test_bodies_that_are_not_convex(checker, tmp_path, signed_distance):
    scene = add_planes(test_surface_certificates.zoo())
    vertices, triangles = test_surface_certificates.torus(8, 5, 0.3, 0.1)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in triangles]
    (tmp_path / "ring.obj").write_text("\n".join(lines))
    (tmp_path / "rings.urdf").write_text(TWO_RINGS)
    scene.add_robot("r", tmp_path / "rings.urdf", mesh_as="solid")
    engine = clearance.Engine(scene, backend="cpu", covers="off")
    planes, clouds = (
        {"floor", "wall"},
        test_surface_certificates.CLOUDS if signed_distance else set(),
    )  # clouds have no depth
    movable = [body.name for body in engine.bodies if body.name not in planes | {"follower", "r", "r/two"}]
    pairs = both_sides(engine, [name for name in [*movable, "r/two"] if name not in clouds])
    rng = np.random.default_rng(4)
    places = np.stack([random_poses(rng, len(movable), spread) for spread in (0.3, 0.8, 1.5)])
    document = checked(
        checker, engine, signed_distance=signed_distance, pairs=pairs, bodies=movable, configurations=places
    )
    assert {row["status"] for row in document["rows"]} >= {"ok", "overlap"}
    if signed_distance:  # depths of several surfaces are also proved by one direction
        assert {len(claims(document, k)) for k in range(len(document["rows"]))} == {1}


def test_two_half_spaces_prove_nothing(checker):
    engine = clearance.Engine(add_planes(clearance.Scene()), covers="off")
    document = checked(checker, engine, pairs=[("floor", "wall")])
    assert document["rows"][0]["upper"] == "inf" and document["rows"][0]["witness"] is None


def test_hard_places(checker):
    """Grazing at 1e-9 m and in exact contact, far from the origin and far along the plane, large and small."""
    scene, pairs = clearance.Scene(), []
    for i, (size, origin) in enumerate([(1.0, 0.0), (1.0, 1e6), (1e-6, 0.0), (1e6, 1e7)]):
        for j, gap in enumerate([1e-9, 0.0, -1e-9, 0.3]):
            q = (0.7, 0.1 * j, 0, 0)
            scene.add_half_space(f"plane{i}{j}", pose=at(-1e3 * size, origin, 0, q))
            up = np.array([0.0, -2 * q[0] * q[1], q[0] ** 2 - q[1] ** 2]) / (q[0] ** 2 + q[1] ** 2)
            x, y, z = up * size * (0.5 + gap)
            scene.add_hull(f"box{i}{j}", box_vertices(size, size, size), pose=at(x, origin + y, z, q))
            pairs.append((f"plane{i}{j}", f"box{i}{j}") if (i + j) % 2 else (f"box{i}{j}", f"plane{i}{j}"))
    engine = clearance.Engine(scene, covers="off")
    for signed_distance in (False, True):
        document = checked(checker, engine, pairs=pairs, signed_distance=signed_distance)
        assert {row["status"] for row in document["rows"]} >= {"ok", "contact", "overlap"}


# ---- motions ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """An arm on a cart above a floor and in front of an oblique wall."""
    urdf = tmp_path_factory.mktemp("arm") / "arm.urdf"
    urdf.write_text(test_motion_certificates.ARM)
    scene = clearance.Scene()
    scene.add_box("cart", [0.3, 0.3, 0.1], pose=at(0, 0, -0.2), uncertainty={"position": 0.001, "angle": 0.002})
    scene.add_robot("arm", urdf, base=at(0, 0, 0.2), parent="cart")
    scene.add_body("ring", mesh=test_surface_certificates.torus(8, 5, 0.2, 0.05), mesh_as="solid")
    scene.add_points("cloud", np.random.default_rng(1).normal(size=(40, 3)) * 0.1)
    scene.add_half_space("floor", pose=at(0, 0, -0.35))
    scene.add_half_space("wall", pose=at(-0.7, 0.1, 0, TILTED), padding=0.01)
    return clearance.Engine(scene, backend="cpu", covers="off")


def moves(count, seed, spread=0.6):
    requested = test_motion_certificates.moves(count, seed, spread)
    rng = np.random.default_rng(seed)

    def poses(ends):
        joints, places = ends
        other = np.concatenate([places[:, 1:], places[:, 1:]], axis=1) + rng.normal(size=(count, 2, 7)) * 0.1
        return joints, np.concatenate([places[:, :1], other], axis=1)

    return {
        **requested,
        "bodies": ["cart", "ring", "cloud"],
        "start": poses(requested["start"]),
        "end": poses(requested["end"]),
    }


PAIRS = [("arm", "floor"), ("wall", "arm"), ("ring", "floor"), ("wall", "cloud"), ("floor", "cart")]
EACH = [("arm/finger", "floor"), ("wall", "arm/upper"), *PAIRS[2:]]


@pytest.mark.parametrize(
    ("reduce", "seen"),
    [("none", {"ok", "overlap"}), ("min", {"ok", "overlap"}), ("any", {"beyond", "overlap"})],
)
def test_motions_are_proved(checker, robot, reduce, seen):
    found, statuses = set(), set()
    for seed, spread in ((1, 0.3), (2, 0.6), (5, 1.2)):
        pairs = {"any": PAIRS[:2], "none": EACH, "min": PAIRS}[reduce]
        requested = {**moves(2, seed, spread), "reduce": reduce, "pairs": pairs}
        document = test_motion_certificates.check(checker, robot, found, **requested, margin=0.01, abs_tol=5e-3)
        statuses |= {row["status"] for row in document["rows"]}
    assert statuses >= seen, statuses
    kinds = {x[:2] for x in found if isinstance(x, tuple)}
    assert kinds >= {(2, "all")} and {order for order, _ in kinds} == {1, 2}
    assert "half" in found


def test_an_edge_over_a_floor_is_proved_free(checker, root):
    """As in docs/certificates.md, in the cell, with a half-space as floor."""
    scene = clearance.Scene.load(root / "scenes" / "cell" / "robot.yaml")
    scene.add_half_space("ground", pose=at(0, 0, -2))
    engine = clearance.Engine(scene, covers="off")
    engine.allow("arm/wrist_1", "arm/flange")
    home = [[joint.position for joint in engine.joint_states()]]
    requested = {"joints": "arm", "start": home, "end": [[home[0][0] + 0.1, *home[0][1:]]], "reduce": "any"}
    document = engine.certificate(**requested, margin=0.01, pairs=[("arm", "*")]).document
    assert document["rows"][0]["status"] == "beyond"
    ground = next(body["id"] for body in document["bodies"] if body["name"] == "ground")
    assert sum(ground in pair["bodies"] for pair in document["rows"][0]["pairs"]) > 3
    ((is_proved, why),) = checker.verdicts(document)
    assert is_proved, why


def test_motions_before_two_half_spaces_that_say_nothing(checker, robot):
    requested = {**moves(1, 1), "pairs": [("arm/finger", "floor"), ("wall", "floor")], "reduce": "none"}
    document = test_motion_certificates.check(checker, robot, set(), **requested)
    assert [row["status"] for row in document["rows"]][1] == "unconverged"


def test_a_path_over_a_floor(start_daemon, root, tmp_path):
    """From a shell: the proof that an arm stays off the floor, or until when it does."""
    (tmp_path / "arm.urdf").write_text(test_motion_certificates.ARM)
    scene = tmp_path / "scene.yaml"
    scene.write_text("bodies:\n  - {name: floor, half_space: true, pose: [0, 0, -0.2, 1, 0, 0, 0]}\n"
                     "robots:\n  - {name: arm, urdf: arm.urdf}\n")  # fmt: skip
    url = next(iter(start_daemon(scene, ["shm"]).urls.values()))
    for rows, code in (("0,0,0\n0.5,0.3,0\n0,0.5,0\n", 0), ("0,0,0\n0.5,0.3,0\n3,0.5,0\n", 1)):
        path, proofs = tmp_path / "path.csv", tmp_path / "proofs.json"
        path.write_text("arm/j1,arm/j2,arm/j3\n" + rows)
        options = ["--pairs", "arm,floor", "--connect", url, "--certificate", proofs]
        done = subprocess.run([root / "build/bin/clearance", "path", path, *options], capture_output=True, text=True)
        assert done.returncode == code, done
        check = [sys.executable, root / "tools" / "check_certificate.py", proofs]
        said = subprocess.run(check, capture_output=True, text=True)
        assert said.returncode == 0 and "2 of 2 rows are proved" in said.stdout, said
        made = json.loads(proofs.read_text())["rows"]
        assert [row["status"] for row in made] == ["beyond", "overlap" if code else "beyond"]


# ---- tampering -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def documents(checker, robot):
    """One proved row each, as inputs of mutations. The half-space is b; in `first` it is a."""
    scene = add_planes(test_certificates.zoo())
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
