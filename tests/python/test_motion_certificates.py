"""Certificates of motions: every kind of proof is found good by a program that shares nothing with the engine, and
every tampering with one is found."""

import copy
import random

import numpy as np
import pytest

import clearance
from certificates import NAMES, junk_refused, turned
from clearance import Status
from scenes import at

pytestmark = pytest.mark.filterwarnings("ignore::clearance.HullWarning")
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
    """Joints of four kinds, bodies that move and follow, and those that are known less well than their poses say."""
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
    return clearance.Engine(scene, backend="cpu")


def moves(count, seed, spread=0.6):
    """Joints and a cart that carries them; an egg that goes by itself."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (count, 3)) * [1, 1.5, 0.1]
    end = start + rng.uniform(-spread, spread, (count, 3)) * [1, 1, 0.2]

    def poses():
        q = rng.normal(size=(count, 2, 4)) * 0.2 + [1, 0, 0, 0]
        return np.concatenate([rng.uniform(-0.1, 0.1, (count, 2, 3)) + [[0, 0, -0.2], [0.2, -1.2, 0.9]], q], axis=2)

    return {"joints": "arm", "bodies": ["cart", "egg"], "start": (start, poses()), "end": (end, poses())}


def check(checker, engine, seen, **asked):
    """All rows are proved, and are those of motions(); counts kinds of proofs."""
    result, document = engine.motions(**asked), engine.certificate(**asked).document
    rows = document["rows"]
    for name in ("lower", "upper"):
        assert np.array_equal([float(row[name]) for row in rows], getattr(result, name).ravel()), name
    assert [row["status"] for row in rows] == [NAMES[s] for s in result.status.ravel()]
    for (is_proved, why), row in zip(checker.verdicts(document), rows):
        assert is_proved, (why, row["row"], row["status"], row["lower"], row["upper"])
        seen.add(row["status"])
        for span in (span for pair in row["pairs"] for span in pair["spans"]):
            seen |= {"half" if span["at"] in (span["begin"], span["end"]) else "whole"}
            seen |= {(p["order"], "all" if p["pieces"] is None else "pieces", p["seer"] is None) for p in span["lower"]}
    return document


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
    engine, seen = clearance.Engine(scene), set()
    start = [[at(0)], [at(0)], [at(-1, 2, 0)]]
    end = [[at(0, 0, 0, (0, 0, 0, 1))], [at(0, 0, 0, (0.1, 0, 0, -1))], [at(3, 2, 0, (-0.5, 0.5, 0.5, 0.5))]]
    check(checker, engine, seen, bodies=["bar"], start=start, end=end, margin=0.01)
    assert "ok" in seen


@pytest.fixture(scope="module")
def document(engine):
    """A row that is apart, by several spans that are looked at as bodies move."""
    asked = {"pairs": [("arm/finger", "egg")], "reduce": "none"}
    for seed in range(10, 40):
        found = engine.certificate(**moves(1, seed), **asked).document
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


def test_decisions(checker, engine):
    """`beyond` needs all pairs beyond their own margins, and a hit a witness within its margin."""
    asked = {**moves(1, 3, spread=0.2), "reduce": "any"}
    pairs = [("arm/upper", "wall"), ("arm/upper", "egg")]
    document = engine.certificate(**asked, pairs=pairs, margin=[0.001, 0.3]).document
    (row,) = document["rows"]
    assert row["status"] == "beyond" and [p["margin"] for p in row["pairs"]] == [0.001, 0.3]
    assert next(checker.verdicts(document))[0]
    for change in (lambda r: r["pairs"][0].update(margin=0.5), lambda r: r["pairs"][1].update(lower=0.3),
                   lambda r: r.update(lower=0.0), lambda r: r["pairs"][1]["spans"].clear()):  # fmt: skip
        mutated = copy.deepcopy(document)
        change(mutated["rows"][0])
        assert not next(checker.verdicts(mutated))[0]
    hit = engine.certificate(**asked, pairs=pairs, margin=2.0).document
    (row,) = hit["rows"]
    assert row["status"] == "ok" and row["witness"] and next(checker.verdicts(hit))[0]
    for pair in row["pairs"]:
        pair["margin"] = row["upper"] / 2
    assert not next(checker.verdicts(hit))[0]


def test_rows_by_number_and_what_has_none(engine):
    asked = moves(2, 1)
    each = {**asked, "reduce": "none", "pairs": [("arm/upper", "*")]}
    all_rows = engine.certificate(**each).document["rows"]
    some = engine.certificate([len(all_rows) - 1, 0], **each).document["rows"]
    assert some == [all_rows[-1], all_rows[0]]
    with pytest.raises(clearance.QueryError, match=r"rows\[0\]: expected one of 2 rows, got 2"):
        engine.certificate([2], **asked)
    with pytest.raises(ValueError, match="end: expected positions of joints"):
        engine.certificate(joints="arm", start=[[0, 0, 0]])


def test_motions_from_nowhere(checker):
    scene = clearance.Scene()
    scene.add_sphere("a", 0.1)
    scene.add_sphere("b", 0.1, pose=at(1))
    engine = clearance.Engine(scene)
    document = engine.certificate(bodies=["a"], start=[[at(np.nan)]], end=[[at(0)]]).document
    assert document["rows"][0]["status"] == NAMES[Status.BAD_POSE]
    assert next(checker.verdicts(document))[0]


def test_any_junk_is_answered(checker, document):
    assert 4 < junk_refused(checker, [document], random.Random(7), 20) < 20  # names may be anything
