"""Requirements of docs/trust/certificate_format.md on a document in addition to its proofs: the checker and the oracle
each reject violations by themselves."""

import copy

import numpy as np
import pytest

import clearance
from certificates import NAMES
from scenes import at
from test_surface_certificates import ball, claims, torus, witness

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


@pytest.fixture(scope="module")
def documents(checker, urdf):
    scene = clearance.Scene()
    for name, shape in (("ring", torus(8, 5, 0.3, 0.1)), ("ball", ball(0.5))):
        scene.add_body(name, mesh=shape, mesh_as="solid")
    scene.add_box("box", [0.2, 0.3, 0.4])
    scene.add_cylinder("can", 0.1, 0.3)
    scene.add_sphere("lost", 0.1)
    scene.add_robot("arm", urdf, home={"joint4": -1.5})
    engine = clearance.Engine(scene, backend="cpu", covers="off")
    engine.set_poses({"ring": at(0), "ball": at(3), "box": at(0, 3, 0.1), "can": at(0, 3, 1)})
    sweep = dict(
        bodies=["box"], start=[[at(-1, 3, 1)]], end=[[at(-0.3, 3, 1)]], pairs=[("box", "can"), ("box", "ball")]
    )
    arm = dict(joints=["arm/joint1"], start=[[0.1]], end=[[1.5]], pairs=[("arm/flange", "ball")])
    certificates = {
        "solids": engine.certificate(pairs=[("ring", "ball")]),
        "solid and box": engine.certificate(pairs=[("ball", "box")]),
        "cores": engine.certificate(pairs=[("box", "can")]),
        "beyond": engine.certificate(pairs=[("ring", "ball"), ("ring", "box")], max_distance=0.1),
        "nothing": engine.certificate(pairs=[("lost", "box")]),
        "motion": engine.certificate(**sweep),
        "any": engine.certificate(**sweep, reduce="any", margin=0.5),
        "joints": engine.certificate(**arm),
    }
    made = {name: certificate.document for name, certificate in certificates.items()}
    for name, document in made.items():
        assert checker.each_rejects(document) == [False, False], name
    statuses = {name: [row["status"] for row in document["rows"]] for name, document in made.items()}
    assert statuses["beyond"] == ["beyond"] * 2 and statuses["nothing"] == ["no_pose"] and statuses["any"] == ["ok"]
    assert set(statuses["motion"]) == set(statuses["joints"]) == {"ok"} < set(NAMES)
    assert all(claim["pieces"] is None for claim in claims(made["solids"])), "else a triangle less is found by others"
    assert made["solid and box"]["pieces"][1].get("elements") is None
    return made


def row(document, k=0):
    return document["rows"][k]


def span(document):
    return row(document)["pairs"][0]["spans"][0]


def claim(document, **changes):
    span(document)["lower"][0].update(changes)


def renamed(document, name):
    """Changes the format of the only key of one of the configuration's tables."""
    table = document["configurations"][0][name]
    [(key, ends)] = table.items()
    document["configurations"][0][name] = {"0" + key: ends}


def without_a_triangle(document, piece):
    """Removes a triangle of a solid that the witness does not name, so that only the border is wrong."""
    elements, named = document["pieces"][piece]["elements"], witness(document)["pieces"]
    if named[piece] == len(elements) - 1:
        elements[-2:] = elements[:-3:-1]
        named[piece] -= 1
    elements.pop()


def pair_of_another_row(document):
    """Gives the row of two bodies the proof of two others; no witness shows that."""
    first, second = document["rows"]
    assert first["upper"] == second["upper"] == "inf" and first["bodies"] != second["bodies"]
    first["pairs"] = copy.deepcopy(second["pairs"])
    first["lower"] = second["lower"]


def free_of_no_spans(document):
    row(document)["first_contact"]["free_until"] = 0
    row(document)["pairs"][0]["free"] = {"lower": 1000.0, "spans": []}


MUTATIONS = {
    # Non-convex bodies.
    "a border far from the other body": ("solids", lambda d: without_a_triangle(d, 1)),
    "a border of the first": ("solids", lambda d: without_a_triangle(d, 0)),
    "a border beside a box": ("solid and box", lambda d: without_a_triangle(d, 0)),
    "a triangle turned round": ("solids", lambda d: d["pieces"][0]["elements"][0].reverse()),
    "a triangle there twice": ("solids", lambda d: d["pieces"][0]["elements"].append(d["pieces"][0]["elements"][0])),
    "an element of four corners": ("solids", lambda d: d["pieces"][0]["elements"][0].append(0)),
    "a solid without triangles": ("solid and box", lambda d: d["pieces"][1].update(solid=True)),
    "a surface without elements": ("solid and box", lambda d: d["pieces"][1].update(elements=[])),
    "a core with elements": ("cores", lambda d: d["pieces"][1].update(elements=[[0]])),
    # Rows.
    "the pair of another row": ("beyond", pair_of_another_row),
    "two pairs in a row": ("beyond", lambda d: row(d)["pairs"].append(row(d, 1)["pairs"][0])),
    "bodies of another row": ("beyond", lambda d: row(d).update(bodies=row(d, 1)["bodies"])),
    "a reduction without motions": (
        "beyond",
        lambda d: (d["query"].update(reduce="min"), row(d).update(bodies=[None, None])),
    ),
    "ok of any without an upper bound": ("any", lambda d: row(d).update(upper="inf", witness=None)),
    "contact without an upper bound": (
        "cores",
        lambda d: row(d).update(status="contact", lower=0.0, upper="inf", witness=None),
    ),
    "a row without a claim and not proved": ("nothing", lambda d: row(d).update(proved=False)),
    "free for no time by no spans": ("motion", free_of_no_spans),
    # Claims.
    "order 0": ("solids", lambda d: claim(d, order=0)),
    "order 3": ("motion", lambda d: claim(d, order=3)),
    "order of a text": ("motion", lambda d: claim(d, order="2")),
    "pieces of nothing": ("solids", lambda d: claim(d, pieces=[])),
    "pieces of three bodies": ("cores", lambda d: claim(d, pieces=[0, 0, 0])),
    "points of three bodies": ("cores", lambda d: witness(d)["points"].append(None)),
    # Numbers.
    "a vertex of four numbers": ("cores", lambda d: d["pieces"][0]["vertices"][0].append(0.0)),
    "a direction of three terms": ("cores", lambda d: span(d)["lower"][0]["direction"][0].append(0.0)),
    "a weight of one term": ("solids", lambda d: witness(d)["weights"][0].pop()),
    "an end of eight numbers": (
        "motion",
        lambda d: next(iter(d["configurations"][0]["poses"].values()))[1].append(0.0),
    ),
    "an end of eight numbers before it": (
        "motion",
        lambda d: next(iter(d["configurations"][0]["poses"].values()))[0].insert(0, 0.0),
    ),
    "a body of another name": ("motion", lambda d: renamed(d, "poses")),
    "a column of another name": ("joints", lambda d: renamed(d, "positions")),
    "motions of a number": ("motion", lambda d: d["query"].update(motions=2)),
    "motions of a text": ("motion", lambda d: d["query"].update(motions="yes")),
}


@pytest.mark.parametrize("name", MUTATIONS)
def test_each_refuses(checker, documents, name):
    kind, mutate = MUTATIONS[name]
    document = copy.deepcopy(documents[kind])
    mutate(document)
    assert document != documents[kind]
    assert checker.each_rejects(document) == [True, True]


def test_what_the_page_leaves_open_is_taken(checker, documents):
    """Spans in any order of time, and a position as a list of one."""
    document = copy.deepcopy(documents["joints"])
    spans = [pair["spans"] for r in document["rows"] for pair in r["pairs"]]
    assert max(map(len, spans)) > 1
    for each in spans:
        each.reverse()
    assert checker.each_rejects(document) == [False, False]
    document = copy.deepcopy(documents["joints"])
    ends = [len(x) for x in document["configurations"][0]["positions"].values()]
    assert ends == [2]
    moves = [move for body in document["bodies"] for move in body["moves"]]
    fixed = [move for move in moves if move["column"] is None]
    assert fixed and all((move["stands"], move["multiplier"]) == (0, 0) for move in fixed)
    for move in fixed:
        move["stands"] = 12.5  # times 0
    assert checker.each_rejects(document) == [False, False]
    for move in moves:
        move["offset"] += np.pi / 2
    assert checker.each_rejects(document) == [True, True]
