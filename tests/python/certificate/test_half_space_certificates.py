"""Certificates of half-spaces: rows and motions above floors and in front of walls are proved."""

import json
import subprocess
import sys

import numpy as np
import pytest

import clearance
import test_certificates
import test_motion_certificates
import test_surface_certificates
from certificates import NAMES
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


def arm_on_a_cart(folder):
    """An arm on a cart above a floor and in front of an oblique wall."""
    urdf = folder / "arm.urdf"
    urdf.write_text(test_motion_certificates.ARM)
    scene = clearance.Scene()
    scene.add_box("cart", [0.3, 0.3, 0.1], pose=at(0, 0, -0.2), uncertainty={"position": 0.001, "angle": 0.002})
    scene.add_robot("arm", urdf, base=at(0, 0, 0.2), parent="cart")
    scene.add_body("ring", mesh=test_surface_certificates.torus(8, 5, 0.2, 0.05), mesh_as="solid")
    scene.add_points("cloud", np.random.default_rng(1).normal(size=(40, 3)) * 0.1)
    scene.add_half_space("floor", pose=at(0, 0, -0.35))
    scene.add_half_space("wall", pose=at(-0.7, 0.1, 0, TILTED), padding=0.01)
    return clearance.Engine(scene, backend="cpu", covers="off")


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return arm_on_a_cart(tmp_path_factory.mktemp("arm"))


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
    """As in docs/trust/certificates.md, in the cell, with a half-space as floor."""
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
