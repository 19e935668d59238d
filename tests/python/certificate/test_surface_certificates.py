"""Certificates of non-convex bodies: surfaces, solids and clouds. Rows of every status are proved, and both checkers
detect tampering."""

import copy
import json
import random

import numpy as np
import pytest

import clearance
from certificates import NAMES, junk_rejected, turned
from scenes import at, random_poses

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


def torus(around, across, radius=1.0, thick=0.4):
    vertices = [
        [(radius + thick * np.cos(v)) * np.cos(u), (radius + thick * np.cos(v)) * np.sin(u), thick * np.sin(v)]
        for u in 2 * np.pi * np.arange(around) / around
        for v in 2 * np.pi * np.arange(across) / across
    ]
    triangles = []
    for i in range(around):
        for j in range(across):
            p, q = i * across, (i + 1) % around * across
            k = (j + 1) % across
            triangles += [(p + j, q + j, q + k), (p + j, q + k, p + k)]
    return np.array(vertices), np.array(triangles)


def ball(radius, faces=4):
    """A sphere of triangles, outward."""
    points, places, triangles = [], {}, []
    corners = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]

    def place(p):
        p = tuple(np.round(radius * np.array(p) / np.linalg.norm(p), 12))
        if p not in places:
            places[p] = len(points)
            points.append(p)
        return places[p]

    for x, y, z in corners:
        for i in range(faces):
            for j in range(faces - i):
                at_ = [
                    (x * (i + a), y * (j + b), z * (faces - i - j - a - b)) for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))
                ]
                for t in ([0, 1, 2], [1, 3, 2])[: 1 if i + j == faces - 1 else 2]:
                    t = [place(at_[k]) for k in t]
                    triangles.append(t if x * y * z > 0 else t[::-1])
    vertices = np.array(points)
    outward = [np.linalg.det(vertices[t]) > 0 for t in triangles]
    return vertices, np.array([t if out else t[::-1] for t, out in zip(triangles, outward)])


def shell():
    """A ball with a hollow ball in it, and redundant triangles: a duplicate, a pair of opposite orientation, and one
    without area."""
    outer, outside = ball(1.0)
    inner, inside = ball(0.7)
    triangles = [*outside, *(len(outer) + inside[:, ::-1])]
    return np.concatenate([outer, inner]), np.array([*triangles, outside[0], outside[0][::-1], [0, 0, 1], [0, 1, 0]])


def zoo():
    rng = np.random.default_rng(7)
    scene = clearance.Scene()
    scene.add_body("shell", mesh=shell(), mesh_as="solid")
    scene.add_body("ring", mesh=torus(12, 8), mesh_as="solid")
    vertices, triangles = torus(8, 5, 0.3, 0.1)
    both = np.concatenate([vertices, vertices + [0, 0, 0.5]]), np.concatenate([triangles, triangles + len(vertices)])
    scene.add_body("two rings", mesh=both, mesh_as="solid", radius=0.01, uncertainty={"angle": 0.01})
    vertices, triangles = torus(10, 6)
    scene.add_body("cut ring", mesh=(vertices, triangles[:-9]), mesh_as="surface")
    scene.add_points("cloud", rng.normal(size=(60, 3)) * 0.6)
    scene.add_points("voxels", rng.normal(size=(20, 3)) * 0.6, voxel=0.05, radius=0.01)
    scene.add_sphere("ball", 0.1)
    scene.add_box("box", [0.2, 0.3, 0.4])
    scene.add_cylinder("can", 0.1, 0.3)
    scene.add_body("follower", mesh=torus(6, 4, 0.1, 0.03), mesh_as="solid", parent="box", pose=at(0.3, 0.1, 0.1))
    return scene


CLOUDS = {"cloud", "voxels"}


def proved(checker, document):
    for (is_proved, why), row in zip(checker.verdicts(document), document["rows"]):
        assert is_proved, (why, row["bodies"], row["status"], row["lower"], row["upper"])


def claims(document, row=0):
    return [claim for pair in document["rows"][row]["pairs"] for span in pair["spans"] for claim in span["lower"]]


@pytest.mark.parametrize(
    ("arguments", "seen"),
    [
        ({}, {"ok", "overlap"}),
        ({"precision": "f32", "max_distance": 0.3}, {"ok", "overlap", "beyond"}),
        ({"signed_distance": True}, {"ok", "unconverged"}),
    ],
    ids=str,
)
def test_rows_are_proved_and_are_those_of_distances(checker, arguments, seen):
    engine = clearance.Engine(zoo(), backend="cpu", covers="off")
    names = [body.name for body in engine.bodies]
    movable = [name for name in names if name != "follower"]
    rng = np.random.default_rng(3)
    arguments = {**arguments, "bodies": movable}
    configurations = np.stack([random_poses(rng, len(movable), spread) for spread in (0.3, 0.8, 1.5)])
    if "signed_distance" in arguments:  # clouds have no depth
        pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :] if {a, b} != {"box", "follower"}]
        arguments["pairs"] = [pair for pair in pairs if not CLOUDS & set(pair)]
    result = engine.prepare("distances", **arguments).run(configurations)
    document = engine.certificate(configurations=configurations, **arguments).document
    for name in ("lower", "upper"):
        assert [float(row[name]) for row in document["rows"]] == getattr(result, name).ravel().tolist(), name
    assert [row["status"] for row in document["rows"]] == [NAMES[s] for s in result.status.ravel()]
    proved(checker, document)
    assert {row["status"] for row in document["rows"]} >= seen
    counts = [len(claims(document, k)) for k in range(len(document["rows"]))]
    assert max(counts) > 10, "no direction did for few"
    assert 1 in counts
    if "signed_distance" not in arguments:
        assert any(
            type(side) is list for k in range(len(counts)) for c in claims(document, k) for side in c["pieces"] or ()
        )
        assert any(row["witness"] and "within" in row["witness"] for row in document["rows"])


def test_what_is_in_a_hollow_is_apart(checker):
    """In the hollow of a shell, in its wall, and around all of it; a component of several in the wall."""
    scene = clearance.Scene()
    scene.add_body("shell", mesh=shell(), mesh_as="solid", pose=at(0))
    scene.add_body("in the hollow", mesh=torus(8, 5, 0.2, 0.05), mesh_as="solid", pose=at(0.1))
    scene.add_body("in the wall", mesh=torus(8, 5, 0.02, 0.005), mesh_as="solid", pose=at(0.85))
    scene.add_body("around", mesh=torus(8, 5, 2.0, 0.05), mesh_as="solid", pose=at(0))
    vertices, triangles = torus(8, 5, 0.02, 0.005)
    both = np.concatenate([vertices, vertices + [0.85, 0, 0]]), np.concatenate([triangles, triangles + len(vertices)])
    scene.add_body("in both", mesh=both, mesh_as="solid", pose=at(0))
    scene.add_points("points in the wall", [[0.85, 0, 0], [3, 0, 0]], pose=at(0))
    scene.add_cylinder("can in the wall", 0.01, 0.02, pose=at(0, 0.85))
    scene.add_sphere("ball in the hollow", 0.1, pose=at(0, 0, -0.4))
    engine = clearance.Engine(scene, covers="off")
    document = engine.certificate(pairs=[("shell", body.name) for body in list(engine.bodies)[1:]]).document
    assert [row["status"] for row in document["rows"]] == ["ok", "overlap", "ok", *["overlap"] * 3, "ok"]
    assert [row["witness"].get("within") for row in document["rows"]] == [None, 0, None, 0, 0, 0, None]
    proved(checker, document)
    # The same triangles as a surface: all but the cut are apart. A claim that it is a solid must then fail.
    scene = clearance.Scene()
    scene.add_body("shell", mesh=shell(), mesh_as="surface", pose=at(0))
    scene.add_body("in the wall", mesh=torus(8, 5, 0.02, 0.005), mesh_as="surface", pose=at(0.85))
    document = clearance.Engine(scene, covers="off").certificate().document
    assert document["rows"][0]["status"] == "ok"
    proved(checker, document)
    document["pieces"][0]["solid"] = True
    [(is_proved, why)] = checker.verdicts(document)
    assert not is_proved and "within 'shell'" in why


def test_links_that_are_solids(checker, tmp_path):
    """Placed with rounding, and with slack."""
    vertices, triangles = torus(8, 5, 0.3, 0.1)
    rows = "".join(f"v {x} {y} {z}\n" for x, y, z in vertices)
    (tmp_path / "ring.obj").write_text(rows + "".join(f"f {i + 1} {j + 1} {k + 1}\n" for i, j, k in triangles))
    (tmp_path / "arm.urdf").write_text("""<robot name="arm">
  <link name="base"><collision><geometry><mesh filename="ring.obj"/></geometry></collision></link>
  <link name="hand"><collision><origin xyz="0 0 0.6"/><geometry><mesh filename="ring.obj"/></geometry></collision>
    <collision><geometry><box size="0.05 0.05 0.5"/></geometry></collision></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="hand"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>""")
    scene = clearance.Scene()
    scene.add_robot("arm", tmp_path / "arm.urdf", base=at(0.1, 0, 0.5))
    scene.add_body("shell", mesh=shell(), mesh_as="solid", static=True, pose=at(0.9, 0, 1.6))
    engine = clearance.Engine(scene, covers="off")
    certificate = engine.certificate(joints="arm", configurations=[[-0.9], [0.3], [2.8]])
    assert {body.triangle_count for body in engine.bodies} >= {80}
    assert {row["status"] for row in certificate.document["rows"]} >= {"ok", "overlap"}
    proved(checker, certificate.document)


@pytest.fixture(scope="module")
def documents():
    """One row each, by its content."""
    scene = clearance.Scene()
    scene.add_body("ring", mesh=torus(9, 6), mesh_as="solid")
    scene.add_body("link", mesh=torus(9, 6), mesh_as="solid")
    scene.add_body("small", mesh=torus(6, 4, 0.05, 0.02), mesh_as="solid")
    scene.add_points("cloud", np.random.default_rng(1).normal(size=(40, 3)))
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses(
        {"ring": at(0), "link": at(1.0, 0, 0, (0.7, 0.7, 0, 0.1)), "small": at(1.0, 0, 0.01), "cloud": at(3.3, 0.3, 0)}
    )
    found = {
        "linked": engine.certificate(pairs=[("ring", "link")]).document,
        "held": engine.certificate(pairs=[("ring", "small")]).document,
        "holder": engine.certificate(pairs=[("small", "ring")]).document,
        "cloud": engine.certificate(pairs=[("ring", "cloud")]).document,
    }
    engine.set_poses({"link": at(1.4, 0.1, 0.03)})
    found["crossing"] = engine.certificate(pairs=[("ring", "link")]).document
    found["deep"] = engine.certificate(pairs=[("small", "ring")], signed_distance=True).document
    assert [document["rows"][0]["status"] for document in found.values()] == [
        *("ok", "overlap", "overlap", "ok", "overlap", "unconverged")
    ]
    return found


def several(document):
    """A claim about several parts of a or b, and the index of that body."""
    return next((c, k) for c in claims(document) for k in (0, 1) if c["pieces"] and type(c["pieces"][k]) is list)


def end_earlier(document):
    claim, k = several(document)
    claim["pieces"][k][1] -= 1


def begin_later(document):
    claim, k = several(document)
    claim["pieces"][k][0] += 1


def run_of(*ends):
    def change(document):
        claim, k = several(document)
        claim["pieces"][k] = list(ends)

    return change


def more(name, by):
    def change(document):
        document["rows"][0][name] += by
        document["rows"][0]["pairs"][0]["lower"] += by

    return change


def witness(document):
    return document["rows"][0]["witness"]


def vertices_moved(document):
    document["pieces"][0]["vertices"] = [[x + 0.6, y, z] for x, y, z in document["pieces"][0]["vertices"]]


def larger(document):
    document["pieces"][0]["vertices"] = [[1.05 * x for x in v] for v in document["pieces"][0]["vertices"]]


def one_for_all(document):
    del claims(document)[1:]
    document["rows"][0]["pairs"][0]["spans"][0]["lower"] = [{**claims(document)[0], "pieces": None}]


def without_a_direction(document):
    document["rows"][0]["pairs"][0]["spans"][0]["lower"].pop(3)


MUTATIONS = {
    "run that ends earlier": ("linked", end_earlier),
    "run that begins later": ("linked", begin_later),
    "run of nothing": ("linked", run_of(3, 3)),
    "run backwards": ("linked", run_of(9, 3)),
    "run beyond the end": ("linked", run_of(0, 1000)),
    "run from before the first": ("linked", run_of(-5, 3)),
    "run of one number": ("linked", run_of(0)),
    "run of texts": ("linked", run_of("0", "1")),
    "a direction left out": ("linked", without_a_direction),
    "a direction for all": ("linked", one_for_all),
    "direction turned round": ("linked", lambda d: claims(d)[0].update(direction=turned(claims(d)[0]["direction"]))),
    "lower too large": ("linked", more("lower", 1e-9)),
    "larger triangles": ("linked", larger),
    "upper too small": ("linked", lambda d: d["rows"][0].update(upper=d["rows"][0]["lower"])),
    "witness on another triangle": ("linked", lambda d: witness(d).update(pieces=witness(d)["pieces"][::-1])),
    "witness on no triangle": ("linked", lambda d: witness(d).update(pieces=[108, 0])),
    "element of no such vertex": ("linked", lambda d: d["pieces"][0]["elements"][5].__setitem__(1, 10000)),
    "element of a vertex from behind": ("linked", lambda d: d["pieces"][0]["elements"][5].__setitem__(1, -1)),
    "element of nothing": ("linked", lambda d: d["pieces"][0]["elements"].__setitem__(5, [])),
    "no elements": ("linked", lambda d: d["pieces"][0].update(elements=[])),
    "the hull in their place": ("linked", lambda d: [d["pieces"][0].pop(k) for k in ("elements", "solid")]),
    "point of a cloud left out": ("cloud", lambda d: [c["pieces"].__setitem__(1, 0) for c in claims(d)]),
    "cloud moved": ("cloud", lambda d: d["bodies"][1]["pose"].__setitem__(0, 1.0)),
    "other side": ("held", lambda d: witness(d).update(within=1)),
    "no such side": ("held", lambda d: witness(d).update(within=-1)),
    "side that is true": ("held", lambda d: witness(d).update(within=True)),
    "other side, as b": ("holder", lambda d: witness(d).update(within=0)),
    "in a surface": ("held", lambda d: d["pieces"][0].update(solid=False)),
    "solid of a truth": ("held", lambda d: d["pieces"][0].update(solid="yes")),
    "triangle turned round": ("held", lambda d: d["pieces"][0]["elements"][7].reverse()),
    "triangle left out": ("held", lambda d: (d["pieces"][0]["elements"].pop(), witness(d)["normals"].pop())),
    "normal left out": ("held", lambda d: witness(d)["normals"].pop()),
    "normal turned round": ("held", lambda d: witness(d)["normals"].__setitem__(3, turned(witness(d)["normals"][3]))),
    "two vertices": ("held", lambda d: witness(d)["vertices"].append([0, 0])),
    "no vertex": ("held", lambda d: witness(d).update(vertices=[])),
    "no such vertex": ("held", lambda d: witness(d)["vertices"][0].__setitem__(1, 3)),
    "beside the solid": ("held", vertices_moved),
    "in the middle of the ring": ("holder", lambda d: d["bodies"][0]["pose"].__setitem__(0, 0.0)),
    "shape that reaches less far": ("held", lambda d: d["bodies"][0]["shape"].update(outer=0.5)),
    "deeper": ("deep", lambda d: d["rows"][0].update(upper=d["rows"][0]["upper"] * 1.01)),
    "less deep": ("deep", more("lower", 0.01)),
    "depth by several directions": ("deep", lambda d: claims(d)[0].update(pieces=[[0, 48], [0, 100]])),
    "crossing moved apart": ("crossing", lambda d: d["bodies"][1]["pose"].__setitem__(0, 9.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_tampering_is_found(checker, documents, name):
    kind, mutate = MUTATIONS[name]
    document = copy.deepcopy(documents[kind])
    mutate(document)
    assert document != documents[kind]
    try:
        [(is_proved, why)] = checker.verdicts(document)
    except checker.MALFORMED:
        assert "element" in name or "triangle" in name
    else:
        assert not is_proved, why


def test_any_junk_is_answered(checker, documents):
    chosen = [documents[name] for name in ("linked", "held", "cloud")]
    assert 30 < junk_rejected(checker, chosen, random.Random(5), 60) <= 60


def test_the_documents_are_good_and_name_each_vertex_once(checker, documents):
    for document in documents.values():
        proved(checker, document)
        for piece in document["pieces"]:
            assert piece["count"] == len(piece["vertices"]) == len({tuple(v) for v in piece["vertices"]})
            assert {k for element in piece["elements"] for k in element} == set(range(piece["count"]))
            assert all(len(json.dumps(element)) < 40 for element in piece["elements"])


def test_motions_are_proved(checker):
    """Through a ring and into it, of a solid, and past a cloud; also until first contact."""
    scene = clearance.Scene()
    scene.add_body("ring", mesh=torus(12, 8), mesh_as="solid", static=True, pose=at(0))
    scene.add_body("hand", mesh=torus(6, 4, 0.2, 0.06), mesh_as="solid")
    scene.add_points("cloud", np.random.default_rng(2).normal(size=(30, 3)), static=True, pose=at(0, 2.5, 0))
    engine = clearance.Engine(scene, covers="off")
    through = at(0.05, 0, -0.8, (0.9, 0.3, 0, 0))
    requested = dict(
        bodies=["hand"], start=[[at(0, 0, 1.0)], [at(0, 0, 1.5)]], end=[[through], [at(1.0, 0, 0)]], abs_tol=3e-2
    )
    for reduce, margin, seen in (("none", 0.0, {"ok", "overlap"}), ("any", 0.01, {"beyond", "contact"})):
        document = engine.certificate(
            reduce=reduce, margin=margin, fields=("default", "first_contact"), **requested
        ).document
        proved(checker, document)
        rows = document["rows"]
        assert {row["status"] for row in rows} >= seen
        hit = [row for row in rows if row["first_contact"]["hit_at"] != "inf"]
        assert hit and all(0.3 < row["first_contact"]["free_until"] < 1 for row in hit)
        spans = [span for row in rows for pair in row["pairs"] for span in pair["spans"]]
        assert any(len(span["lower"]) > 3 for span in spans)
    changed = next(span for span in spans if len(span["lower"]) > 3)
    changed["lower"].pop()
    assert not all(is_proved for is_proved, _ in checker.verdicts(document))
