"""Futures, threads, processes and interrupts on an engine in this process."""

import contextlib
import itertools
import os
import threading
import time

import numpy as np
import pytest

import clearance
from clearance import Status
from patience import PATIENCE_S
from scenes import ARM_PAIRS, ARM_POSES, arm, at, random_hulls, random_poses, same
from threads import end_with_daemon_threads, turns_beside


def big_query():
    """A query that takes seconds: 80 bodies of 300 vertices, many configurations."""
    scene, poses = random_hulls(80, seed=3, vertices=300, spread=2.0)
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses(poses)
    rng = np.random.default_rng(4)
    return engine, {"configurations": np.stack([random_poses(rng, 80, 2.0) for _ in range(1000)]), "fields": "lower"}


def test_submit_answers_the_snapshot_of_its_call(engine):
    expected = engine.distances()
    future = engine.submit()
    engine.set_poses({"link1": at(0, 0, 3)})
    r = future.result(timeout=PATIENCE_S)
    assert same(r, expected) and r.snapshot_revision == expected.snapshot_revision and future.done()
    assert future.result() is r
    assert r.pairs.tolist() == ARM_PAIRS
    assert not future.cancel(), "too late"


def test_many_futures_in_turn(crowd):
    engine, configurations = crowd
    big = engine.submit(configurations=np.concatenate([configurations] * 30))
    small = [engine.submit(configurations=configurations[k : k + 1]) for k in range(3)]
    dense = engine.distances(configurations=configurations)
    for k, future in enumerate(small):
        assert np.array_equal(future.result(timeout=PATIENCE_S).lower[0], dense.lower[k])
    assert np.array_equal(big.result(timeout=PATIENCE_S).lower, np.concatenate([dense.lower] * 30))


def test_a_coroutine_awaits_a_query(engine):
    import asyncio

    async def evaluate():
        return await engine.submit()

    assert same(asyncio.run(evaluate()), engine.distances())


def test_timeouts_and_cancelling():
    engine, query = big_query()
    with pytest.raises(clearance.TimeoutError, match=r"no answer within 0\.0 s"):
        engine.distances(**query, timeout_s=0.0)
    with pytest.raises(TimeoutError):  # the built-in one, too
        engine.distances(**query, timeout_s=0)
    future = engine.submit(**query, timeout_s=0.01)
    with pytest.raises(clearance.TimeoutError, match=r"no answer within 0\.01 s"):
        future.result()
    assert not future.done()
    assert future.cancel() and future.done()
    assert (engine.submit(pairs=(0, 1)).result(timeout=PATIENCE_S).status != Status.NO_POSE).all(), "the worker goes on"


def test_the_gil_is_released():
    engine, query = big_query()

    def evaluate():
        with contextlib.suppress(clearance.TimeoutError):
            engine.distances(**query, timeout_s=0.5)

    assert turns_beside(evaluate) > 1000, "this thread ran while the other was in the engine"


def test_two_threads_on_one_engine(crowd):
    engine, configurations = crowd
    expected = [engine.distances(configurations=configurations[k : k + 1]) for k in range(3)]
    failures = []

    def evaluate(first):
        try:
            for i in range(30):
                k = (first + i) % 3
                r = engine.distances(configurations=configurations[k : k + 1])
                assert same(r, expected[k]) and r.pairs.shape == (780, 2)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=evaluate, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_poses_while_other_threads_ask(engine):
    """Each answer belongs to one snapshot: link2 and the cup on it are never seen apart."""
    stop = threading.Event()
    failures = []

    def move():
        i = 0
        while not stop.is_set():
            i += 1
            engine.set_poses({"link1": at(i % 7, 0, 0), "link2": at(i % 7 + 2, 0, 0)})

    thread = threading.Thread(target=move)
    thread.start()
    revisions = set()
    try:
        # On a busy machine the other thread may be delayed: wait for it, up to a limit.
        deadline = time.monotonic() + PATIENCE_S
        for i in itertools.count():
            if i >= 300 and (len(revisions) > 10 or time.monotonic() > deadline):
                break
            r = engine.distances(pairs=("link1", "link2"))
            revisions.add(r.snapshot_revision)
            failures += [] if r.upper[0, 0] == pytest.approx(1.9, abs=1e-9) or r.snapshot_revision <= 2 else [r.upper]
    finally:
        stop.set()
        thread.join()
    assert not failures and len(revisions) > 10


def test_use_after_fork_is_refused(engine):
    engine.distances()
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            texts = []
            for call in (engine.distances, engine.submit, engine.body_states, lambda: engine.set_poses(ARM_POSES)):
                try:
                    call()
                    texts.append("no error")
                except RuntimeError as error:
                    texts.append(str(error))
            fresh = clearance.Engine(arm(), threads=1)  # with a thread of its own for covers
            fresh.set_poses(ARM_POSES)
            texts.append(repr(float(fresh.distances(pairs=(1, 2)).upper[0, 0])))
            os.write(write, "\n".join(texts).encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        lines = pipe.read().splitlines()
    os.waitpid(child, 0)
    rejection = (
        f"this Engine was made by process {os.getpid()} and cannot be used after a fork; make a new one in the child"
    )
    assert lines[:4] == [rejection] * 4
    assert lines[4] == repr(float(engine.distances(pairs=(1, 2)).upper[0, 0])), "a new engine works in the child"


def test_interrupt():
    """Ctrl-C ends a long query; it is sent once the main thread is inside the engine."""
    import subprocess
    import sys

    code = """
import os, signal, sys, threading
sys.path[:0] = sys.argv[1:]
from test_engine_concurrency import big_query
engine, query = big_query()
main = threading.get_ident()

def interrupt():
    while sys._current_frames()[main].f_code.co_name != "_answer":
        pass
    os.kill(os.getpid(), signal.SIGINT)

thread = threading.Thread(target=interrupt)
try:
    thread.start()
    engine.distances(**query)
    print("answered")
except KeyboardInterrupt:
    print("interrupted")
"""
    folder = os.path.dirname(__file__)
    command = [sys.executable, "-c", code, folder, os.path.dirname(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.stdout == "interrupted\n", done.stderr


def test_a_program_ends_while_daemon_threads_are_in_the_engine(tmp_path):
    prepare = f"""
import contextlib, itertools, numpy as np, clearance
from scenes import arm, random_hulls, random_poses
scene, poses = random_hulls(40, seed=9)
engine = clearance.Engine(scene, covers="off")
many = np.stack([random_poses(np.random.default_rng(10), 40, 2.5) for _ in range(100)])
some, numbers, folder = many[:4, :2], itertools.count(), {str(tmp_path)!r}
arm().save(folder + "/arm")

def refused():
    with contextlib.suppress(clearance.QueryError):
        engine.distances([(1, 1)])

def submitted():
    with contextlib.suppress(RuntimeError):  # of concurrent.futures, once the program ends
        engine.submit(configurations=many, fields="lower").result()
"""
    calls = [
        "engine.distances(configurations=many, fields='lower')",
        "engine.distances(configurations=many[:1], fields='lower')",
        "engine.distances(reduce='min')",
        "engine.check(many)",
        "engine.motions(bodies=[0, 1], start=some, end=some + [0, 1, 0, 0, 0, 0, 0], pairs=[(0, 1)])",
        "submitted()",
        "engine.certificate(pairs=[(0, 1)])",
        "engine.set_poses(poses)",
        "engine.allow(0, 1 + next(numbers) % 39)",
        "clearance.Engine(arm(), threads=1)",
        "clearance.Scene.load(folder + '/arm/scene.yaml').save(f'{folder}/{next(numbers)}')",
        "refused()",
    ]
    assert end_with_daemon_threads(prepare, calls) == (3, "")
