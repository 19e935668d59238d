"""Repeated arguments are not parsed again: results are equal, and changes are detected."""

import numpy as np
import pytest

import clearance
from clearance import _front
from robots import arm_scene
from scenes import at, random_poses, same, same_bits


def engine_of(root):
    return clearance.Engine(arm_scene(str(root / "tests" / "engine" / "robot" / "arm.urdf")), backend="cpu", threads=1)


@pytest.fixture
def engine(root):
    return engine_of(root)


@pytest.fixture
def parsed(monkeypatch):
    """Number of times that arguments were parsed."""
    calls = []
    parse = _front.Front._parse

    def counted(self, *args, **more):
        calls.append(1)
        return parse(self, *args, **more)

    monkeypatch.setattr(_front.Front, "_parse", counted)
    return calls


def rows(seed, count, joints):
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, joints))


def again(engine):
    return engine.stats()["engine.queries_from_cache"]


ASKED = [
    {"reduce": "min"},
    {"reduce": "min", "fields": ["lower", "upper", "pair", "gradient_joints"]},
    {"reduce": "any", "margin": 0.02},
    {"reduce": "any", "margin": {("arm", "*"): 0.02, ("cup", "*"): 0.0}},
    {"reduce": "within", "max_distance": 0.5},
    {"reduce": "nearest", "precision": "f32"},
    {"reduce": "none"},
    {"pairs": [("arm", "cup")], "reduce": "none", "signed_distance": True, "fields": "default"},
]


@pytest.mark.parametrize("arguments", ASKED, ids=str)
def test_answers_are_those_of_a_batch(engine, parsed, arguments):
    arm = engine.joints("arm")
    Q = rows(1, 6, len(arm))
    batch = engine.distances(joints=arm, positions=Q, **arguments)
    del parsed[:]
    before = again(engine)
    ones = [engine.distances(joints=arm, positions=q[None], **arguments) for q in Q]
    assert len(parsed) == 1 and again(engine) - before == len(Q) - 1
    for name, column in batch.columns.items():
        if name != "configuration":
            found = np.concatenate([one.columns[name] for one in ones])
            assert np.array_equal(found, column, equal_nan=column.dtype.kind == "f"), name


def test_check_and_poses_as_well(engine, parsed):
    arm = engine.joints("arm")
    Q = rows(2, 40, len(arm))
    pairs = [("arm", "cup"), ("arm", "table")]
    batch = engine.check(Q, joints=arm, pairs=pairs)
    assert 0 < batch.free.sum() < len(Q)
    del parsed[:]
    assert np.array_equal(np.concatenate([engine.check(q[None], joints=arm, pairs=pairs).free for q in Q]), batch.free)
    assert len(parsed) == 1
    X = random_poses(np.random.default_rng(3), 10, 1.0).reshape(10, 1, 7)
    batch = engine.distances(configurations=X, bodies=["cup"], reduce="min")
    del parsed[:]
    ones = [engine.distances(configurations=x[None], bodies=["cup"], reduce="min").lower for x in X]
    assert np.array_equal(np.concatenate(ones), batch.lower) and len(parsed) == 1


# Contents are compared each time, not only the identity of the object.
def test_what_has_changed_is_parsed_again(engine, parsed):
    arm = engine.joints("arm")
    q = rows(4, 1, len(arm))
    margin, fields, pairs = {("arm", "*"): 0.0}, ["lower"], np.array([[0, 3]], dtype=np.uint32)

    def evaluate(**more):
        requested = {"pairs": ("arm", "cup"), "joints": arm, "positions": q, "reduce": "any", "margin": margin}
        return engine.distances(**{**requested, **more})

    assert evaluate().status[0] == clearance.Status.BEYOND
    margin[("arm", "*")] = 50.0
    assert evaluate().status[0] != clearance.Status.BEYOND
    assert list(evaluate(fields=fields).columns) == ["lower", "pair"]
    fields.append("upper")
    assert list(evaluate(fields=fields).columns) == ["lower", "upper", "pair"]
    assert len(parsed) == 4
    least = [engine.distances(pairs, reduce="min", joints=arm, positions=q).lower[0]]
    pairs[...] = [[1, 3]]
    least.append(engine.distances(pairs, reduce="min", joints=arm, positions=q).lower[0])
    assert least[0] != least[1]


def test_wrong_values_are_refused_after_right_ones(engine):
    arm = engine.joints("arm")
    q = rows(5, 1, len(arm))
    engine.distances(joints=arm, positions=q, signed_distance=True, max_results=1)
    for wrong in ({"signed_distance": 1}, {"max_results": True}, {"max_results": 1.0}):
        with pytest.raises(TypeError):
            engine.distances(**{"joints": arm, "positions": q, "signed_distance": True, "max_results": 1, **wrong})
    for few in (q[:, 1:], q[0], np.zeros((0, len(arm)))):
        with pytest.raises(ValueError, match="positions: expected"):
            engine.distances(joints=arm, positions=few, signed_distance=True, max_results=1)


def test_another_scene_is_seen(engine, root):
    arm = engine.joints("arm")
    q = rows(6, 1, len(arm))
    fresh = engine_of(root)
    tables = set()
    for change in (
        lambda e: e.set_poses({"cup": at(0.1, 0.1, 2)}),
        lambda e: e.attach("cup", "table"),
        lambda e: e.attach("cup", None),
        lambda e: e.allow("arm", "table"),
    ):
        for e in engine, fresh:
            change(e)
        answer = engine.distances(joints=arm, positions=q)
        anew = fresh.distances(joints=list(arm.ids), positions=q)  # numpy's integers are not recognised
        assert same_bits(answer, anew)
        tables.add(answer.pairs.tobytes())
    assert len(tables) > 1


# A prepared query may be changed, because it has one owner.
def test_prepared_queries_are_their_own(engine):
    arm = engine.joints("arm")
    Q = rows(7, 3, len(arm))
    row = Q[:1].copy()
    prepared = engine.prepare(joints=arm, positions=row, reduce="min")
    for q in Q:
        row[0] = q
        assert same(prepared(), engine.distances(joints=arm, positions=q[None], reduce="min"))


# A call with the very objects of the previous call is answered without reading their contents.
def test_the_same_objects_are_the_same_question_and_others_are_not(engine, parsed):
    arm = engine.joints("arm")
    q = rows(8, 1, len(arm))
    near, far = 0.0, 50.0
    requested = {"pairs": ("arm", "cup"), "joints": arm, "positions": q, "reduce": "any", "max_results": 1}
    for margin in (near, near, near, far, far, far, near, far):
        free = engine.distances(margin=margin, **requested).status[0] == clearance.Status.BEYOND
        assert free == (margin == near)
    assert len(parsed) == 2
    for wrong in ({"max_results": 1.0}, {"max_results": True}, {"signed_distance": 0}):
        with pytest.raises(TypeError):
            engine.distances(margin=far, **{**requested, **wrong})
    assert engine.distances(**requested).status[0] == clearance.Status.BEYOND, "without the option: its default"
    other = {**requested, "positions": rows(9, 2, len(arm))}
    assert len(engine.distances(margin=far, **other).status) == 2
