"""Memory of prepared queries' results: reused once no array over it exists, and never while one does."""

import gc
import pickle
import random
import threading

import numpy as np
import pytest

import clearance
from robots import rows_of
from scenes import random_hulls, random_poses

PAIRS = ("arm", "cup")  # seldom in contact, unlike the links
LARGE = 4096  # configurations, so that a result has more than 128 KiB


@pytest.fixture
def front(arm_front):
    return arm_front


def queries(front):
    arm = front.joints("arm")
    return {
        "none": (front.prepare(joints=arm, fields=("default", "points", "flags")), arm),
        "min": (front.prepare(joints=arm, reduce="min", pairs=PAIRS), arm),
        "check": (front.prepare("check", joints=arm, margin=0.02, pairs=PAIRS), arm),
        "free_scale": (front.prepare("free_scale", joints=arm, pairs=("arm", "cup")), arm),
    }


def arrays_of(result):
    """Arrays over a result's memory, of all kinds that a caller may keep instead of the result."""
    if isinstance(result, np.ndarray):
        return [result, result[1:]]
    if isinstance(result, clearance.Check):
        return [result.free, result.pair[..., 0], result.verdict]
    columns = list(result.columns.values())
    return [*columns, columns[0].reshape(-1)[::2], columns[-1].view(np.uint8), np.asarray(memoryview(columns[1]))]


@pytest.mark.parametrize("kind", ["none", "min", "check", "free_scale"])
def test_arrays_that_are_kept_never_change(front, kind):
    prepared, arm = queries(front)[kind]
    rng, order = np.random.default_rng(7), random.Random(7)
    most, kept = 0, []  # (array, its bytes when the result came)
    for i in range(60):
        count = order.choice((1, 1, 2, 7))
        result = prepared.run(rows_of(arm, count, seed=i))
        for array in order.sample(arrays_of(result), 2):
            kept.append((array, array.tobytes()))
        del result, array
        most = max(most, len(kept))
        order.shuffle(kept)
        del kept[order.randrange(40) :]
        if rng.random() < 0.1:
            gc.collect()
        assert all(array.tobytes() == then for array, then in kept), i
    assert most > 15


def test_large_blocks_are_reused_once_their_arrays_are_gone():
    scene, poses = random_hulls(4, seed=5)
    engine = clearance.Engine(scene, backend="cpu", threads=1, covers="off")
    engine.set_poses(poses)
    X = np.stack([random_poses(np.random.default_rng(i), 4, 2.0) for i in range(LARGE)])
    prepared = engine.prepare(fields=("lower", "upper"))
    first = prepared.run(X)
    lower, address = first.lower, first.lower.ctypes.data
    part = lower[5:7, :2]
    del first, lower
    others = {prepared.run(X).lower.ctypes.data for _ in range(4)}
    assert len(others) == 1 and address not in others, "a slice keeps its block; the others share one"
    before = part.copy()
    del part
    again = {prepared.run(X[::-1].copy()).lower.ctypes.data for _ in range(2)} | others
    assert address in again, "it is free now"
    assert np.array_equal(before, prepared.run(X).lower[5:7, :2])


def test_copies_and_pickles_are_memory_of_their_own(front):
    prepared, arm = queries(front)["none"]
    result = prepared.run(rows_of(arm, 3))
    copies = [pickle.loads(pickle.dumps(result)), pickle.loads(pickle.dumps(result.lower)), result.upper.copy()]
    then = [copies[0].lower.tobytes(), copies[1].tobytes(), copies[2].tobytes()]
    result.lower[...] = -1.0  # the result's columns are the caller's
    result.upper[...] = -1.0
    assert [copies[0].lower.tobytes(), copies[1].tobytes(), copies[2].tobytes()] == then
    assert prepared.run(rows_of(arm, 3)).lower.tobytes() == then[0]


def test_input_that_changes_after_a_call_changes_no_result(front):
    prepared, arm = queries(front)["check"]
    Q = rows_of(arm, 3)
    Q[0, np.flatnonzero(np.isfinite(arm.upper))[0]] += 50.0
    with pytest.warns(clearance.JointLimitWarning):
        check = prepared.run(Q)
    then = check.limit_violations, check.free.tobytes()
    future = prepared.submit(rows_of(arm, 3))
    expected = prepared.run(rows_of(arm, 3))
    Q[...] = 0.0
    assert (check.limit_violations, check.free.tobytes()) == then and then[0][0].configuration == 0
    assert future.result().free.tobytes() == expected.free.tobytes()


def test_views_of_the_transport(front):
    if not isinstance(front, clearance.Client):
        pytest.skip("for clients")
    prepared = front.prepare(pairs=[("cup", "table")], fields="default", copy=False)
    expected = front.distances([("cup", "table")], fields="default")
    for _ in range(40):  # more than there are slots: each result releases its own
        result = prepared.run()
        assert result.lower.tobytes() == expected.lower.tobytes() and not result.lower.flags.writeable
    kept = [prepared.run().lower for _ in range(3)]
    assert all(lower.tobytes() == expected.lower.tobytes() for lower in kept)


def test_threads_keep_their_results(front):
    prepared, arm = queries(front)["min"]
    Q = rows_of(arm, 40)
    expected = [prepared.run(q[None]).lower.tobytes() for q in Q]
    assert len(set(expected)) > 10
    wrong = []

    def work(seed):
        order, kept = random.Random(seed), []
        for _ in range(100):
            i = order.randrange(len(Q))
            kept.append((prepared.run(Q[i : i + 1]).lower, expected[i]))
            del kept[order.randrange(1, 12) :]
            wrong.extend(i for lower, then in kept if lower.tobytes() != then)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_calls_leave_no_garbage(front):
    arm = front.joints("arm")
    prepared, Q = front.prepare("check", joints=arm), rows_of(arm, 2)

    def evaluate():
        for call in (
            lambda: front.check(Q, joints=arm),
            lambda: front.distances(reduce="min"),
            lambda: prepared.run(Q),
        ):
            bool(call() is None)
        front.motions(Q[:1], Q[1:], joints=arm)
        front.check_path(Q, joints=arm)
        front.submit(reduce="min", fields="lower").result().pairs.sum()

    evaluate()
    gc.collect()
    gc.disable()
    try:
        for _ in range(5):
            evaluate()
        assert gc.collect() == 0
    finally:
        gc.enable()
