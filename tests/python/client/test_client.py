"""The client through a daemon, on every transport, compared with the engine in this process."""

import concurrent.futures
import contextlib
import dataclasses
import gc
import os
import signal
import threading

import numpy as np
import pytest

import clearance
from clearance import Status
from clearance.wire import ErrorCode
from patience import PATIENCE_S
from scenes import at, random_poses, same_bits
from threads import end_with_daemon_threads, turns_beside

EVERY_FIELD = ("default", "points", "normal", "pieces", "flags", "gradient")


@pytest.fixture(scope="module")
def engine(cell):
    return clearance.Engine(clearance.Scene.load(cell))


@pytest.fixture
def client(daemon, kind):
    with clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        yield client


ARM = ["shoulder", "upper_arm", "forearm"]


def queries():
    rng = np.random.default_rng(21)
    configurations = random_poses(rng, 12, 0.8).reshape(4, 3, 7) + [0.4, 0, 1, 0, 0, 0, 0]
    moved = {"configurations": configurations, "bodies": ARM}
    return {
        "default": {},
        "all fields": {"fields": EVERY_FIELD},
        "ids": {"pairs": [[1, 9], [9, 1], [1, 999]], "fields": EVERY_FIELD},
        "no pairs": {"pairs": []},
        "groups": {"pairs": [("arm", "clutter"), ("cup", "*")], "max_distance": 0.3},
        "configurations": {**moved, "max_distance": 0.2, "fields": ("default", "pair", "configuration")},
        "matrices": {"configurations": np.tile(np.eye(4), (2, 1, 1, 1)), "bodies": ["cup"], "pairs": ("cup", "*")},
        "within": {**moved, "reduce": "within", "max_distance": 0.2, "fields": EVERY_FIELD},
        "within few": {**moved, "reduce": "within", "max_distance": 0.2, "max_results": 5},
        "nearest": {"reduce": "nearest"},
        "nearest of some": {**moved, "reduce": "nearest", "pairs": ("arm", "clutter"), "fields": EVERY_FIELD},
        "min": {**moved, "reduce": "min", "fields": EVERY_FIELD},
        "float32": {"fields": ("bounds", "points32", "status", "flags")},
        "float32 within": {**moved, "reduce": "within", "max_distance": 0.2, "fields": ("bounds", "points32")},
        "bounds": {**moved, "reduce": "within", "max_distance": 0.2, "fields": ("bounds", "lower", "flags")},
        "wide": {"rel_tol": 0.5, "abs_tol": 0.01},
        "f32": {"precision": "f32"},
        "signed_distance": {"signed_distance": True, "fields": EVERY_FIELD},
    }


@pytest.mark.parametrize("name", queries())
def test_answers_equal_those_of_the_engine_bit_for_bit(client, engine, name):
    query = queries()[name]
    inputs = (query.pop("configurations"),) if "configurations" in query else ()
    expected = engine.prepare("distances", **query).run(*inputs)
    assert len(expected.pairs) or name == "no pairs"
    prepared = client.prepare("distances", **query)
    assert same_bits(prepared.run(*inputs), expected)
    assert same_bits(prepared.submit(*inputs).result(), expected)
    assert same_bits(client.prepare("distances", **query, copy=False).run(*inputs), expected)
    if not {"max_results", "precision"} & set(query):
        query = queries()[name]
        assert same_bits(engine.distances(**query), expected)
        assert same_bits(client.distances(**query), expected)
        assert same_bits(client.submit(**query).result(), expected)


def test_one_transport_sees_the_poses_that_another_set(daemon, engine):
    poses = {"bottle": at(0.3, -0.1, 0.9), "ball": at(0.1, 0.2, 1.5), "book": [np.nan] * 7}
    clients = {kind: clearance.connect(url, timeout_s=PATIENCE_S) for kind, url in daemon.urls.items()}
    one = next(iter(clients.values()))
    before = one.body_states()
    try:
        done, here = one.set_poses(poses, stamp_ns=77, sequence=5), engine.set_poses(poses, stamp_ns=77, sequence=5)
        assert (done.applied, done.bad, done.unknown, done.fixed) == (here.applied, here.bad, here.unknown, here.fixed)
        expected = engine.distances(fields=EVERY_FIELD)
        assert Status.BAD_POSE in expected.status
        for client in clients.values():
            answer = client.distances(fields=EVERY_FIELD)
            assert same_bits(answer, expected)
            assert answer.snapshot_revision == done.revision and answer.snapshot_stamp_ns == 77
            assert answer.snapshot_sequence == expected.snapshot_sequence == 5
            assert answer.pose_age_ns > 0 and expected.pose_age_ns > 0
            assert answer.backend == expected.backend and answer.server_ns >= answer.engine_ns > 0
            states = client.body_states()
            for mine, theirs in zip(states, engine.body_states()):
                assert (
                    mine.status == theirs.status and mine.parent == theirs.parent and mine.stamp_ns == theirs.stamp_ns
                )
                assert np.array_equal(mine.pose, theirs.pose, equal_nan=True)
            assert states[client.body_id("bottle")].age_ns > 0
    finally:
        back = {client_id: before[client_id].pose for client_id in map(one.body_id, poses)}
        one.set_poses(back)
        engine.set_poses(back)


def test_a_client_waits_for_poses(daemon, engine):
    """Over every transport, for poses that arrive over another one."""
    clients = {kind: clearance.connect(url, timeout_s=PATIENCE_S) for kind, url in daemon.urls.items()}
    mover = clearance.connect(next(iter(daemon.urls.values())), timeout_s=PATIENCE_S)
    before = mover.body_states()[mover.body_id("bottle")].pose
    stamp = 1_000_000_000_000
    try:
        for client in clients.values():
            stamp += 2
            with concurrent.futures.ThreadPoolExecutor(1) as thread:
                waiting = thread.submit(client.wait_for_poses, stamp, of="bottle")
                assert mover.stats()["frames"] > 0 and not waiting.done()  # the daemon serves others meanwhile
                mover.set_poses({"bottle": at(0.1, 0.2, 0.3)}, stamp_ns=stamp, sequence=stamp // 2)
                waiting.result(timeout=PATIENCE_S)
            answer = client.distances([("bottle", "ball")])
            assert answer.snapshot_stamp_ns == stamp and answer.snapshot_sequence == stamp // 2
            client.wait_for_poses(1)
            client.wait_for_poses(stamp)
            with pytest.raises(clearance.RequestError, match=r"no poses with stamp .* came within 1.0* ms") as late:
                client.wait_for_poses(stamp + 1, of="bottle", timeout_s=0.001)
            assert late.value.code == ErrorCode.POSES_LATE
            with pytest.raises(ValueError, match=r"of: .*did you mean 'bottle'"):
                client.wait_for_poses(1, of="bottel")
        assert not hasattr(engine, "wait_for_poses"), "set_poses() returns once the poses are there"
    finally:
        mover.set_poses({"bottle": before}, stamp_ns=stamp + 2)


def test_scene_and_pairs(client, engine):
    # The uncertainty of bodies is only available in their own process.
    assert client.bodies == tuple(dataclasses.replace(body, model_inner=0.0) for body in engine.bodies)
    assert {name: ids.tolist() for name, ids in client.groups.items()} == {
        name: ids.tolist() for name, ids in engine.groups.items()
    }
    assert client.scene_revision == engine.scene_revision and client.backend == engine.backend
    assert np.array_equal(client.pairs, engine.pairs) and client.pairs is client.pairs
    for pairs, bodies in [(("arm", "*"), None), (None, ["cup"]), ([("cup", "arm"), (1, 9)], ["cup"])]:
        assert np.array_equal(client.pair_table(pairs, bodies), engine.pair_table(pairs, bodies))
    stats = client.stats()
    assert stats["engine.bodies"] == len(client.bodies)
    assert 0 < client.ping(b"x" * 100) < 30
    assert repr(client) == f"<clearance.Client {client.url}>"


def test_points_come_by_default_as_they_do_in_process(client, engine):
    few = np.tile(at(0.5), (20, 1, 1))
    for query in (
        {"configurations": few, "bodies": ["ball"]},
        {"pairs": ("ball", "*")},
        {"reduce": "nearest"},
        {"reduce": "min"},
    ):
        assert set(client.distances(**query).columns) == set(engine.distances(**query).columns) >= {"point_a", "normal"}
    if client.url.startswith("udpm"):
        return  # large requests take seconds there
    movable = sum(not body.is_static for body in engine.bodies)
    count = 100000 // len(engine.pairs) + 1
    assert len(engine.pairs) * count > 100000
    many = {"configurations": np.tile(at(0.5), (count, movable, 1)), "reduce": "within", "max_distance": 0.01}
    many["configurations"][:, :, 0] += np.arange(movable) * 3
    assert set(client.distances(**many).columns) == set(engine.distances(**many).columns)
    assert "point_a" not in engine.distances(**many).columns
    at_most = {"reduce": "within", "max_distance": 0.01, "max_results": 1000}
    of_client, of_engine = (
        one.prepare("distances", **at_most).run(many["configurations"]).columns for one in (client, engine)
    )
    assert set(of_client) == set(of_engine) >= {"point_a"}


@pytest.mark.parametrize("query", [
    {"pairs": [(1, 1)]},
    {"configurations": np.zeros((1, 1, 7)), "bodies": ["table"]},
    {"configurations": np.zeros((1, 2, 7)), "bodies": ["cup", "cup"]},
    {"configurations": np.zeros((1, 1, 7)), "bodies": [999]},
    {"pairs": np.array([[0x80000077, 1]], dtype=np.uint32)},
    {"max_distance": -1},
    {"abs_tol": -1},
    {"rel_tol": 3},
])  # fmt: skip
def test_refusals_are_those_of_the_engine(client, engine, query):
    with pytest.raises(clearance.QueryError) as theirs:
        engine.distances(**query)
    with pytest.raises(clearance.QueryError) as ours:
        client.distances(**query)
    assert ours.value.code == theirs.value.code == ErrorCode.BAD_QUERY
    future = client.submit(fields=("lower",), **query)
    with pytest.raises(clearance.QueryError):
        future.result()
    assert future.done()
    with pytest.raises(clearance.QueryError):
        future.result()
    assert client.distances(pairs=("cup", "ball")).status.size == 1, "the daemon answers a good query after it"


@pytest.mark.parametrize("arguments, error, text", [
    ({"pairs": ("gripr", "*")}, ValueError,
     r"pairs\[0\]\[0\]: no body or group is named 'gripr'; did you mean 'gripper'"),
    ({"fields": "lowr"}, ValueError, r"fields: no column is named 'lowr'"),
    ({"configurations": np.zeros((1, 7))}, ValueError, r"configurations: expected shape \(K, M, 7\)"),
])  # fmt: skip
def test_wrong_arguments_are_named(client, arguments, error, text):
    with pytest.raises(error, match=text):
        client.distances(**arguments)
    assert client.distances(pairs=("cup", "ball")).status.size == 1


def test_an_option_that_travels_in_a_record(client, engine):
    """Over every transport."""
    whole = client.distances(fields=["lower", "upper"])
    query = client.prepare("distances", fields=["lower", "upper"], deadline_ns=60 * 10**9)
    assert same_bits(query.run(), whole)
    with pytest.raises(TypeError, match=r"deadline_ns: expected an integer, got 1\.5"):
        client.prepare("distances", deadline_ns=1.5)
    with pytest.raises(TypeError, match="'deadline_ns'"):
        engine.prepare("distances", deadline_ns=1)


def test_a_deadline_that_cannot_be_kept(client):
    with pytest.raises(clearance.RequestError, match="no answer within the 1e-06 ms of its deadline_ns") as rejection:
        client.prepare("distances", deadline_ns=1).run()
    assert rejection.value.code == ErrorCode.DEADLINE
    assert len(client.prepare("distances", deadline_ns=3_600_000_000_000).run().lower) > 0
    with pytest.raises(ValueError, match="deadline_ns must be 0 to 3600000000000, got -1"):
        client.prepare("distances", deadline_ns=-1).run()


def test_a_client_of_the_class_planning(client):
    with clearance.connect(client.url, PATIENCE_S, service_class="planning") as planner:
        assert same_bits(planner.distances(), client.distances())
        assert same_bits(planner.prepare("distances").run(), client.distances())
    with pytest.raises(ValueError, match="service_class: expected 'control' or 'planning', got 'batch'"):
        clearance.connect(client.url, PATIENCE_S, service_class="batch")


# ---- answers that are views -----------------------------------------------------------------------------------------


def test_views_are_read_only_and_outlive_result_and_client(daemon, kind):
    client = clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S)
    expected = client.distances()
    views = client.prepare("distances", copy=False)
    result = views.run()
    lower, points = result.lower, result.point_a
    assert not lower.flags.writeable and lower.base is not None
    with pytest.raises(ValueError):
        lower[0, 0] = 1
    for _ in range(3):  # others are allocated and released
        views.run()
    client.close()
    del result, views, client
    gc.collect()
    assert np.array_equal(lower, expected.lower) and np.array_equal(points, expected.point_a)


def test_a_leased_slot_returns_when_its_arrays_are_gone(daemon, kinds):
    if kinds["shm"]:
        pytest.skip(kinds["shm"])
    client = clearance.connect(daemon.urls["shm"], timeout_s=PATIENCE_S)
    query = {"pairs": ("cup", "ball"), "fields": ("lower", "upper")}
    expected = client.distances(**query).lower.tolist()
    views, held = client.prepare("distances", **query, copy=False), []
    with pytest.raises(clearance.ConnectionError, match=r"all \d+ slots are taken"):
        for _ in range(1000):
            held.append(views.run())
    assert 2 <= len(held) < 1000
    arrays = [result.lower for result in held]
    del held
    with pytest.raises(clearance.ConnectionError, match="slots are taken"):
        client.distances(**query)
    kept = arrays.pop()
    del arrays
    for _ in range(1000):  # far more than there are slots
        assert views.run().lower.tolist() == expected
    assert kept.tolist() == expected


def test_views_die_on_another_thread_while_the_client_works(daemon, kinds):
    """Slots are released by any thread that drops the last array, even during a call."""
    kind = "ipc" if kinds["shm"] else "shm"
    client = clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S)
    views, expected = client.prepare("distances", copy=False), client.distances().lower.tobytes()
    boxes, stop, failures = [], threading.Event(), []

    def drop():
        while not stop.is_set():
            with contextlib.suppress(IndexError):
                boxes.pop()

    thread = threading.Thread(target=drop)
    thread.start()
    try:
        for _ in range(500):
            result = views.run()
            failures += [] if result.lower.tobytes() == expected else [result]
            boxes.append(result)
            del result
            if len(boxes) > 4:
                boxes.clear()
    finally:
        stop.set()
        thread.join()
    assert not failures


# ---- many requests, many threads ------------------------------------------------------------------------------------


def test_futures_in_any_order(client, engine):
    configurations = [np.array([[at(0.1 * k, 0.2, 1.3)]]) for k in range(5)]
    query = {"bodies": ["ball"], "max_distance": 0.5}
    futures = [client.submit(configurations=c, **query) for c in configurations]
    for k in (4, 0, 2, 3, 1):
        answer = futures[k].result(timeout=PATIENCE_S)
        assert same_bits(answer, engine.distances(configurations=configurations[k], **query))
        assert futures[k].done() and not futures[k].cancel()
    assert futures[2].result() is futures[2].result()
    cancelled = client.submit(reduce="min")
    if cancelled.cancel():
        with pytest.raises(concurrent.futures.CancelledError):
            cancelled.result()
        assert cancelled.done()
    assert client.distances(pairs=("cup", "ball")).status.size == 1


def test_two_threads_on_one_client(client, engine):
    expected = [engine.distances(pairs=(name, "*"), fields=EVERY_FIELD) for name in ("cup", "ball")]
    failures = []

    def evaluate(name, answer):
        try:
            for _ in range(20):
                assert same_bits(client.distances(pairs=(name, "*"), fields=EVERY_FIELD), answer)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=evaluate, args=pair) for pair in zip(("cup", "ball"), expected)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_the_gil_is_released_while_waiting(ipc):
    client = clearance.connect(ipc.urls["ipc"], timeout_s=PATIENCE_S)
    client.distances()
    os.kill(ipc.process.pid, signal.SIGSTOP)

    def evaluate():
        with pytest.raises(clearance.TimeoutError):
            client.distances(timeout_s=0.3)

    assert turns_beside(evaluate) > 1000


def test_a_program_ends_while_daemon_threads_are_in_the_client(daemon, kind):
    prepare = f"""
import contextlib, clearance
url = {daemon.urls[kind]!r}
clients = [clearance.connect(url, timeout_s={PATIENCE_S}) for _ in range(3)]

def refused():
    with contextlib.suppress(clearance.QueryError):
        clients[2].distances([(1, 1)])

def submitted():
    return clients[1].submit(fields="lower").result()
"""
    calls = [
        "clients[0].distances()",
        "clients[0].distances()",
        "submitted()",
        "clients[1].ping(b'1234')",
        "refused()",
        f"clearance.connect(url, timeout_s={PATIENCE_S}).close()",
    ]
    assert end_with_daemon_threads(prepare, calls) == (3, "")
