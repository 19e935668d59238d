"""Futures: concurrent.futures.Future that can be awaited, of an engine's and of clients' queries."""

import asyncio
import concurrent.futures
import gc
import pickle
import signal
import time

import numpy as np
import pytest

import clearance
from conftest import PATIENCE_S
from robots import rows_of
from scenes import random_hulls, random_poses, same_bits


@pytest.fixture
def front(arm_front):
    return arm_front


def until(condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


@pytest.fixture
def long():
    """An engine, and arguments of a query that takes ten seconds or more."""
    scene, poses = random_hulls(80, seed=3, vertices=300, spread=2.0)
    engine = clearance.Engine(scene, backend="cpu", threads=1, covers="off")
    engine.set_poses(poses)
    rng = np.random.default_rng(4)
    some = np.stack([random_poses(rng, 80, 2.0) for _ in range(1000)])
    return engine, {"configurations": np.tile(some, (10, 1, 1)), "fields": "lower"}


def test_result_and_state(front):
    future = front.submit(("cup", "table"))
    assert isinstance(future, clearance.Future) and isinstance(future, concurrent.futures.Future)
    result = future.result(timeout=PATIENCE_S)
    assert same_bits(result, front.distances(("cup", "table")))
    assert future.done() and not future.cancelled() and future.result() is result and future.exception() is None
    assert not future.cancel(), "too late"
    with pytest.raises(TypeError, match="a future cannot be pickled"):
        pickle.dumps(future)


def test_awaiting(front):
    arm = front.joints("arm")
    Q = rows_of(arm, 12)
    check, path = front.prepare("check", joints=arm, pairs=("arm", "table")), front.prepare("check_path", joints=arm)

    async def evaluate():
        one = await front.submit(reduce="min")
        many = await asyncio.gather(*(check.submit(q[None]) for q in Q))
        return one, many, await path.submit(Q)

    one, many, whole = asyncio.run(evaluate())
    assert same_bits(one, front.distances(reduce="min"))
    assert [bool(each) for each in many] == check.run(Q).ok.tolist()
    assert repr(whole) == repr(front.check_path(Q, joints=arm))


def test_functions_of_concurrent_futures(front):
    arm = front.joints("arm")
    least = front.prepare(joints=arm, reduce="min", fields="lower", pairs=("arm", "cup"))
    Q = rows_of(arm, 8)
    expected = [least.run(q[None]).lower[0] for q in Q]
    assert len(set(expected)) > 3
    futures = [least.submit(q[None]) for q in Q]
    done, pending = concurrent.futures.wait(futures, timeout=PATIENCE_S)
    assert len(done) == len(Q) and not pending
    assert [future.result(0).lower[0] for future in futures] == expected
    again = {least.submit(q[None]): i for i, q in enumerate(Q)}
    order = [again[future] for future in concurrent.futures.as_completed(again, timeout=PATIENCE_S)]
    assert sorted(order) == list(range(len(Q)))


def test_callbacks_keep_a_future_alive(front):
    called = []
    front.submit(reduce="min").add_done_callback(lambda future: called.append(future.result().lower[0]))
    gc.collect()
    until(lambda: called)
    assert called == [front.distances(reduce="min").lower[0]]
    until(lambda: not front._worker._kept)


def test_errors(front):
    def start():
        return front.submit(reduce="any", max_distance=0.5)

    if isinstance(front, clearance.Engine):
        with pytest.raises(clearance.QueryError, match="max_distance"):
            start()
    else:
        future = start()
        with pytest.raises(clearance.QueryError, match="max_distance"):
            future.result()
        assert isinstance(future.exception(), clearance.QueryError) and future.done()
    with pytest.raises(ValueError, match="reduce: expected"):
        front.submit(reduce="least")
    with pytest.raises(TypeError):
        front.submit(*[None] * 20)


def test_timeouts_and_cancelling(long):
    engine, query = long
    future = engine.submit(**query, timeout_s=0.01)
    with pytest.raises(clearance.TimeoutError, match=r"no answer within 0\.01 s"):
        future.result()
    with pytest.raises(TimeoutError):
        future.result(timeout=0)
    assert not future.done() and future.cancel() and future.cancelled() and future.done()
    with pytest.raises(concurrent.futures.CancelledError):
        future.result()

    async def give_up():
        task = asyncio.ensure_future(asyncio.wait_for(engine.submit(**query), 0.01))
        with pytest.raises(asyncio.TimeoutError):
            await task

    asyncio.run(give_up())
    until(lambda: not engine._worker._is_running)
    assert engine.distances(reduce="min").lower.shape == (1,)


def test_a_future_that_nothing_holds_is_abandoned(long):
    engine, query = long
    begin = time.monotonic()
    for _ in range(3):
        engine.submit(**query)
    gc.collect()
    until(lambda: not engine._worker._is_running)
    took = time.monotonic() - begin
    small = engine.submit(reduce="min", fields="lower")
    assert small.result(PATIENCE_S).lower.shape == (1,)
    assert engine.stats()["engine.queries"] >= 4 and took < PATIENCE_S


def test_a_client_cancels(front):
    future = front.submit(reduce="min")
    if future.cancel():
        with pytest.raises(concurrent.futures.CancelledError):
            future.result()
    assert future.done()
    assert front.distances(reduce="min").lower.shape == (1,), "the connection still works"


def test_threads_wait_for_one_future(front):
    expected = front.distances(reduce="min").lower[0]
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        for _ in range(20):
            future = front.submit(reduce="min")
            results = [pool.submit(future.result, PATIENCE_S) for _ in range(3)]
            assert [result.result().lower[0] for result in results] == [expected] * 3


def test_threads_with_timeouts_of_their_own_and_one_that_cancels(start_daemon, cell):
    daemon = start_daemon(cell, ["ipc"])
    client = clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S, hang_s=0)
    client.check()
    daemon.process.send_signal(signal.SIGSTOP)
    try:
        future = client.submit(reduce="min")
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            waiting = pool.submit(future.result, PATIENCE_S)
            until(waiting.running)
            begin = time.monotonic()
            with pytest.raises(clearance.TimeoutError, match=r"no answer within 0\.01 s"):
                future.result(timeout=0.01)
            assert future.cancel() and time.monotonic() - begin < PATIENCE_S / 2
            with pytest.raises(concurrent.futures.CancelledError):
                waiting.result()
    finally:
        daemon.process.send_signal(signal.SIGCONT)
    assert client.distances(reduce="min").lower.shape == (1,), "the connection still works"


def test_a_daemon_that_goes_away(start_daemon, cell):
    daemon = start_daemon(cell, ["ipc"])
    client = clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S)
    client.check()
    daemon.process.kill()
    daemon.process.wait()

    async def evaluate():
        await client.submit(reduce="min")

    with pytest.raises(clearance.ConnectionError):
        asyncio.run(evaluate())
