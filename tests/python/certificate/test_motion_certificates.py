"""Certificates of motions: every kind of proof is accepted by a program that shares nothing with the engine, and every
tampering is detected."""

import copy
import random

import numpy as np
import pytest

import clearance
from certificates import NAMES, junk_rejected, turned
from clearance import Status
from scenes import at

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")
ARM = """<robot name="arm">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0 0 0.3" rpy="0.1 0 0.2"/><geometry><box size="0.1 0.1 0.5"/></geometry>
  </collision></link>
  <link name="fore"><collision><origin xyz="0 0 0.3"/><geometry><box size="0.06 0.08 0.4"/></geometry></collision>
  </link>
  <link name="rod"><collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.03"/></geometry></collision></link>
  <link name="finger"><collision><origin xyz="0.02 0 0.05"/><geometry><box size="0.02 0.02 0.1"/></geometry></collision>
  </link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1" rpy="0.1 -0.2 0.3"/>
    <axis xyz="0.1 1 0.2"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j2" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.6"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="j3" type="prismatic"><parent link="fore"/><child link="rod"/><origin xyz="0 0 0.5"/><axis xyz="0 0.2 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="j4" type="revolute"><parent link="rod"/><child link="finger"/><origin xyz="0 0 0.15"/><axis xyz="0 1 0"/>
    <mimic joint="j2" multiplier="-0.7" offset="0.1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """Joints of four kinds, bodies that move and follow, and bodies with uncertain poses."""
    urdf = tmp_path_factory.mktemp("arm") / "arm.urdf"
    urdf.write_text(ARM)
    scene = clearance.Scene()
    scene.add_box("cart", [0.3, 0.3, 0.1], pose=at(0, 0, -0.2), uncertainty={"position": 0.001, "angle": 0.002})
    scene.add_robot("arm", urdf, base=at(0, 0, 0.2), parent="cart")
    scene.add_box("wall", [0.1, 2, 2], static=True, pose=at(1.4))
    scene.add_cylinder("post", 0.05, 1.0, static=True, pose=at(0.3, 0.9, 0.5))
    scene.add_box("vague", [0.2, 0.2, 0.2], static=True, pose=at(-0.9, 0.2, 0.8),
                  uncertainty={"position": 0.01, "angle": 0.02})  # fmt: skip
    scene.add_ellipsoid("egg", (0.1, 0.2, 0.15), pose=at(0.2, -1.2, 0.9))
    return clearance.Engine(scene, backend="cpu", covers="off")


def moves(count, seed, spread=0.6):
    """Joints and a cart that carries them; an egg that moves by itself."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (count, 3)) * [1, 1.5, 0.1]
    end = start + rng.uniform(-spread, spread, (count, 3)) * [1, 1, 0.2]

    def poses():
        q = rng.normal(size=(count, 2, 4)) * 0.2 + [1, 0, 0, 0]
        return np.concatenate([rng.uniform(-0.1, 0.1, (count, 2, 3)) + [[0, 0, -0.2], [0.2, -1.2, 0.9]], q], axis=2)

    return {"joints": "arm", "bodies": ["cart", "egg"], "start": (start, poses()), "end": (end, poses())}


def check(checker, engine, seen, **requested):
    """Checks that all rows are proved, and equal those of motions(); counts kinds of proofs."""
    requested = {"fields": ("default", "first_contact"), **requested}
    result, document = engine.motions(**requested), engine.certificate(**requested).document
    rows = document["rows"]
    for name in ("lower", "upper"):
        assert np.array_equal([float(row[name]) for row in rows], getattr(result, name).ravel()), name
    assert [row["status"] for row in rows] == [NAMES[s] for s in result.status.ravel()]
    first = [row["first_contact"] for row in rows]
    times = [[float(contact["free_until"]), float(contact["hit_at"])] for contact in first]
    assert np.array_equal(times, result.first_contact.reshape(-1, 2))
    for (is_proved, why), row in zip(checker.verdicts(document), rows):
        assert is_proved, (why, row["row"], row["status"], row["lower"], row["upper"])
        seen.add(row["status"])
        for span in (span for pair in row["pairs"] for span in pair["spans"]):
            seen |= {"half" if span["at"] in (span["begin"], span["end"]) else "whole"}
            seen |= {(p["order"], "all" if p["pieces"] is None else "pieces", p["seer"] is None) for p in span["lower"]}
    return document


def kind_of_contact(row):
    """Time until which it is free, the kind of that proof, and the proof of the hit."""
    first = row["first_contact"]
    until = first["free_until"] if first["free_until"] in (0, "inf") else "a while"
    by = {"spans of its own" if pair["free"] else "spans of all" for pair in row["pairs"]} if until else ()
    hit = first["witness"] and ("surface" if "faces" in first["witness"] else "points")
    return until, " and ".join(sorted(by)), hit


def test_first_contact(checker, engine):
    """It equals that of motions(), and is proved for each reduction: by spans until then, and by a witness at that
    time.
    """
    kinds = set()
    pairs = [("arm/finger", "egg"), ("arm/fore", "wall"), ("arm/upper", "vague")]
    for seed, reduce in ((3, "min"), (6, "min"), (3, "any"), (7, "any"), (3, "none")):
        requested = {**moves(2, seed, spread=1.2), "pairs": pairs, "margin": [0.4, 0.01, 0.4], "reduce": reduce}
        for row in check(checker, engine, set(), **requested, abs_tol=0.1)["rows"]:
            kinds.add((reduce, *kind_of_contact(row)))
            until, hit = (float(row["first_contact"][name]) for name in ("free_until", "hit_at"))
            assert until <= hit and (hit < np.inf) == (row["first_contact"]["witness"] is not None)
    assert {("min", "inf", "spans of all", None), ("min", 0, "", "points"), ("none", "inf", "spans of all", None),
            ("min", "a while", "spans of all and spans of its own", "points"), ("any", "inf", "spans of all", None),
            ("any", "a while", "spans of all and spans of its own", "points"),
            ("none", "a while", "spans of its own", "points")} <= kinds  # fmt: skip
    through = {"bodies": ["egg"], "start": [[at(0.8, 0, 0.5)]], "end": [[at(2, 0.3, 0.5, (1, 0, 0, 1))]]}
    document = check(checker, engine, set(), **through, pairs=[("egg", "wall")])
    assert [kind_of_contact(row) for row in document["rows"]] == [("a while", "spans of its own", "surface")]


def test_first_contact_that_nobody_asks_for(checker, engine):
    requested = {**moves(2, 6, spread=1.2), "pairs": [("arm/finger", "egg")], "margin": 0.3}
    rows = engine.certificate(**requested, fields="default").document["rows"]
    assert [row["first_contact"] for row in rows] == [None, None]
    whole = engine.certificate(**requested).document["rows"]
    assert [(r["lower"], r["upper"]) for r in rows] == [(r["lower"], r["upper"]) for r in whole]
    assert not any(pair["free"] for row in rows for pair in row["pairs"])


def test_every_kind_of_proof(checker, engine):
    seen: set = set()
    pairs = [("arm/finger", "egg"), ("arm/fore", "wall"), ("arm/rod", "arm/base"), ("arm/finger", "arm/upper"),
             ("arm/fore", "post"), ("arm/upper", "vague")]  # fmt: skip
    check(checker, engine, seen, **moves(1, 1), reduce="min", pairs=pairs)
    check(checker, engine, seen, **moves(2, 2), reduce="any", pairs=pairs, margin=0.02)
    check(checker, engine, seen, **moves(1, 4), reduce="none", pairs=pairs[2:], abs_tol=5e-3)
    still = moves(1, 5)
    still["end"] = still["start"]
    check(checker, engine, seen, **still, pairs=pairs)
    through = {"bodies": ["egg"], "start": [[at(0.8, 0, 0.5)]], "end": [[at(2, 0.3, 0.5, (1, 0, 0, 1))]]}
    check(checker, engine, seen, **through, pairs=[("egg", "wall")])
    assert {"ok", "overlap", "beyond", "half", "whole"} <= seen
    assert {(order, what) for order, what, *_ in (x for x in seen if isinstance(x, tuple))} == {
        (1, "all"), (1, "pieces"), (2, "all"), (2, "pieces")}  # fmt: skip
    assert {x[2] for x in seen if isinstance(x, tuple)} == {True, False}, "seen from the world, and from a body"


def test_half_turns_and_long_ways(checker):
    scene = clearance.Scene()
    scene.add_box("bar", [1.0, 0.05, 0.05])
    scene.add_box("block", [0.2, 0.2, 0.2], static=True, pose=at(0.2, 0.8, 0.1))
    engine, seen = clearance.Engine(scene, covers="off"), set()
    start = [[at(0)], [at(0)], [at(-1, 2, 0)]]
    end = [[at(0, 0, 0, (0, 0, 0, 1))], [at(0, 0, 0, (0.1, 0, 0, -1))], [at(3, 2, 0, (-0.5, 0.5, 0.5, 0.5))]]
    check(checker, engine, seen, bodies=["bar"], start=start, end=end, margin=0.01)
    assert "ok" in seen


@pytest.fixture(scope="module")
def document(engine):
    """A row that is apart, proved by several spans of moving bodies."""
    requested = {"pairs": [("arm/finger", "egg")], "reduce": "none"}
    for seed in range(10, 40):
        found = engine.certificate(**moves(1, seed), **requested).document
        (row,) = found["rows"]
        orders = {p["order"] for span in row["pairs"][0]["spans"] for p in span["lower"]}
        if row["status"] == "ok" and 2 in orders and len(row["pairs"][0]["spans"]) > 1:
            return found
    raise AssertionError("no such row")


def spans(d):
    return d["rows"][0]["pairs"][0]["spans"]


def claims(d):
    return [claim for span in spans(d) for claim in span["lower"]]


def body(d, name):
    return next(b for b in d["bodies"] if b["name"] == name)


def position(d, k):
    return d["configurations"][0]["positions"][sorted(d["configurations"][0]["positions"])[k]]


def raise_lower(d):
    d["rows"][0]["lower"] *= 1.02
    d["rows"][0]["pairs"][0]["lower"] *= 1.02
    d["rows"][0]["upper"] = max(d["rows"][0]["upper"], d["rows"][0]["lower"])


MUTATIONS = {
    "lower raised": raise_lower,
    "lower of the pair less than the row's": lambda d: d["rows"][0]["pairs"][0].update(lower=0.0),
    "upper lowered": lambda d: d["rows"][0].update(upper=d["rows"][0]["upper"] * (1 - 1e-3)),
    "span left out": lambda d: spans(d).pop(),
    "span said to be longer": lambda d: (spans(d)[0].update(end=1), spans(d).__delitem__(slice(1, None))),
    "looked at elsewhere": lambda d: [s.update(at=s["begin"]) for s in spans(d)],
    "looked at beyond its ends": lambda d: spans(d)[-1].update(at=0.0),
    "bends ignored": lambda d: [c.update(order=1) for c in claims(d)],
    "directions turned round": lambda d: [c.update(direction=turned(c["direction"])) for c in claims(d)],
    "directions left out": lambda d: [s["lower"].clear() for s in spans(d)],
    "unknown seer": lambda d: claims(d)[0].update(seer=99),
    "a longer way of a joint": lambda d: position(d, 0).__setitem__(1, position(d, 0)[1] + 2),
    "another place of the cart": lambda d: [X.__setitem__(0, X[0] + 0.3) for X in d["configurations"][0]["poses"]["0"]],
    "a motion without an end": lambda d: [x.pop() for x in d["configurations"][0]["positions"].values()],
    "witness at another time": lambda d: d["rows"][0]["witness"].update(time=1 - d["rows"][0]["witness"]["time"] / 3),
    "witness after the end": lambda d: d["rows"][0]["witness"].update(time=1.5),
    "mimic joint that does not": lambda d: body(d, "arm/finger")["moves"][-1].update(multiplier=0.9),
    "joint elsewhere": lambda d: body(d, "arm/upper")["pose"].__setitem__(2, 0.5),
    "axis": lambda d: body(d, "arm/upper")["moves"][-1].update(axis=[0, 0.3, 1]),
    "slide farther": lambda d: body(d, "arm/rod")["moves"][-1].update(multiplier=9),
    "cart known less well": lambda d: body(d, "cart")["uncertainty"].update(angle=0.5),
    "slack dropped": lambda d: [s["slack"]["terms"].clear() for s in spans(d)],
    "larger": lambda d: [p.update(core={**p["core"], "size": [2 * x for x in p["core"]["size"]]})
                         for p in d["pieces"] if "core" in p],
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_tampering_is_found(checker, document, name):
    mutated = copy.deepcopy(document)
    MUTATIONS[name](mutated)
    assert mutated != document
    try:
        [(is_proved, why)] = checker.verdicts(mutated)
    except checker.MALFORMED as error:
        assert name == "a motion without an end", error
    else:
        assert not is_proved, why


@pytest.fixture(scope="module")
def touching(checker, engine):
    """A row that is free for a while, by its own spans, some of which are halves of others, and then hit."""
    requested = {"pairs": [("arm/finger", "egg")], "reduce": "none", "margin": 0.2, "abs_tol": 0.1}
    for seed in range(10, 90):
        found = engine.certificate(**moves(1, seed, spread=1.2), **requested).document
        (row,) = found["rows"]
        if kind_of_contact(row) == ("a while", "spans of its own", "points") and 2 < len(free(found)["spans"]) < 6:
            assert next(checker.verdicts(found))[0]
            return found
    raise AssertionError("no such row")


def free(d):
    return d["rows"][0]["pairs"][0]["free"]


def first(d):
    return d["rows"][0]["first_contact"]


def free_claims(d):
    return [claim for span in free(d)["spans"] for claim in span["lower"]]


def last_free(d):
    return max(free(d)["spans"], key=lambda span: span["end"])


def free_longer(d):
    """Until it is within its margin, also in the spans."""
    last_free(d)["end"] = first(d)["free_until"] = first(d)["hit_at"]


def hit_at(time):
    def mutate(d):
        first(d)["witness"]["time"] = first(d)["hit_at"] = time

    return mutate


def margin(d, value):
    d["rows"][0]["pairs"][0]["margin"] = value


CONTACT_MUTATIONS = {
    "free for longer": lambda d: first(d).update(free_until=first(d)["free_until"] + 2**-12),
    "free for longer, in spans as well": free_longer,
    "free for a shorter time than spans say": lambda d: first(d).update(free_until=first(d)["free_until"] / 2),
    "free all along": lambda d: first(d).update(free_until="inf"),
    "never free, but by spans": lambda d: first(d).update(free_until=0),
    "free until before it begins": lambda d: first(d).update(free_until=-0.5),
    "free until after the end": lambda d: first(d).update(free_until=1.5),
    "free by more": lambda d: (margin(d, 0.21), free(d).update(lower=0.21000001)),
    "free by no more than is proved": lambda d: free(d).update(lower=0.2),
    "a larger margin": lambda d: margin(d, 0.21),
    "a smaller margin": lambda d: margin(d, 0.15),
    "spans left out": lambda d: d["rows"][0]["pairs"][0].update(free=None),
    "a span left out": lambda d: free(d)["spans"].pop(),
    "the first span begins later": lambda d: free(d)["spans"][0].update(begin=free(d)["spans"][0]["at"] / 2),
    "looked at elsewhere": lambda d: [span.update(at=span["begin"]) for span in free(d)["spans"]],
    "bends ignored": lambda d: [claim.update(order=1) for claim in free_claims(d)],
    "directions turned round": lambda d: [c.update(direction=turned(c["direction"])) for c in free_claims(d)],
    "directions left out": lambda d: [span["lower"].clear() for span in free(d)["spans"]],
    "slack dropped": lambda d: [span["slack"]["terms"].clear() for span in free(d)["spans"]],
    "hit earlier": hit_at(0.0),
    "hit before it begins": hit_at(-0.25),
    "hit after the end": hit_at(1.25),
    "hit at another time than its witness": lambda d: first(d).update(hit_at=first(d)["hit_at"] + 2**-12),
    "witness at another time than the hit": lambda d: first(d)["witness"].update(time=first(d)["hit_at"] - 2**-12),
    "never hit, but by a witness": lambda d: first(d).update(hit_at="inf"),
    "hit without a witness": lambda d: first(d).update(witness=None),
    "hit by another pair": lambda d: first(d)["bodies"].reverse(),
    "hit by another piece": lambda d: first(d)["witness"].update(pieces=[0, 7]),
    "other weights": lambda d: first(d)["witness"].update(weights=[[-1.0, 0.0]] * len(first(d)["witness"]["weights"])),
    "another way of a joint": lambda d: position(d, 0).__setitem__(1, position(d, 0)[1] + 2),
    "another version": lambda d: d.update(version=2),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTACT_MUTATIONS)
def test_tampering_with_first_contact_is_found(checker, touching, name):
    mutated = copy.deepcopy(touching)
    CONTACT_MUTATIONS[name](mutated)
    assert mutated != touching
    try:
        [(is_proved, why)] = checker.verdicts(mutated)
    except checker.MALFORMED as error:
        assert name == "another version", error
    else:
        assert not is_proved, why


def test_decisions(checker, engine):
    """`beyond` needs all pairs beyond their own margins, and a hit needs a witness within its margin."""
    requested = {**moves(1, 3, spread=0.2), "reduce": "any"}
    pairs = [("arm/upper", "wall"), ("arm/upper", "egg")]
    document = engine.certificate(**requested, pairs=pairs, margin=[0.001, 0.3]).document
    (row,) = document["rows"]
    assert row["status"] == "beyond" and [p["margin"] for p in row["pairs"]] == [0.001, 0.3]
    assert next(checker.verdicts(document))[0]
    for change in (lambda r: r["pairs"][0].update(margin=0.5), lambda r: r["pairs"][1].update(lower=0.3),
                   lambda r: r.update(lower=0.0), lambda r: r["pairs"][1]["spans"].clear()):  # fmt: skip
        mutated = copy.deepcopy(document)
        change(mutated["rows"][0])
        assert not next(checker.verdicts(mutated))[0]
    hit = engine.certificate(**requested, pairs=pairs, margin=2.0).document
    (row,) = hit["rows"]
    assert row["status"] == "ok" and row["witness"] and next(checker.verdicts(hit))[0]
    for pair in row["pairs"]:
        pair["margin"] = row["upper"] / 2
    assert not next(checker.verdicts(hit))[0]


def test_rows_by_number_and_what_has_none(engine):
    requested = moves(2, 1)
    each = {**requested, "reduce": "none", "pairs": [("arm/upper", "*")]}
    all_rows = engine.certificate(**each).document["rows"]
    some = engine.certificate([len(all_rows) - 1, 0], **each).document["rows"]
    assert some == [all_rows[-1], all_rows[0]]
    with pytest.raises(clearance.QueryError, match=r"rows\[0\]: expected one of 2 rows, got 2"):
        engine.certificate([2], **requested)
    with pytest.raises(ValueError, match=r"end: expected .* got none"):
        engine.certificate(joints="arm", start=[[0, 0, 0]])


def test_motions_from_nowhere(checker):
    scene = clearance.Scene()
    scene.add_sphere("a", 0.1)
    scene.add_sphere("b", 0.1, pose=at(1))
    engine = clearance.Engine(scene, covers="off")
    document = engine.certificate(bodies=["a"], start=[[at(np.nan)]], end=[[at(0)]]).document
    (row,) = document["rows"]
    assert row["status"] == NAMES[Status.BAD_POSE]
    assert next(checker.verdicts(document))[0]
    for claim in ({"free_until": 0.5}, {"free_until": "inf"}, {"hit_at": 0.5}):
        row["first_contact"] = {"free_until": 0, "hit_at": "inf", "bodies": [None, None], "witness": None, **claim}
        assert not next(checker.verdicts(document))[0]


def test_any_junk_is_answered(checker, document, touching):
    assert 6 < junk_rejected(checker, [document, touching], random.Random(7), 30) < 30  # names may be anything
