"""Failures of the client: daemons that end or hang, invalid URLs and timeouts, forks."""

import gc
import os
import pathlib
import signal
import sys
import threading
import traceback

import numpy as np
import pytest

import clearance
from clearance.wire import ErrorCode
from patience import PATIENCE_S
from scenes import same_bits


@pytest.mark.parametrize("kind", ["shm", "ipc"])
def test_a_client_finds_the_next_daemon(start_daemon, cell, kind):
    first = start_daemon(cell, [kind])
    client = clearance.connect(first.urls[kind], timeout_s=PATIENCE_S)
    expected = client.distances(pairs=("cup", "*"))
    os.kill(first.process.pid, signal.SIGSTOP)
    future = client.submit(pairs=("cup", "*"))
    first.process.kill()
    first.process.wait()
    with pytest.raises(clearance.ConnectionError):
        future.result()
    with pytest.raises(clearance.ConnectionError):
        client.distances(pairs=("cup", "*"))
    second = type(first)(pathlib.Path(first.urls[kind].partition("://")[2]).parent, cell, [kind])
    try:
        known = client.epoch
        for _ in range(2):
            with pytest.raises(clearance.NewEpoch, match="was restarted or replaced") as rejected:
                client.distances(pairs=("cup", "*"))
            assert rejected.value.code == ErrorCode.NEW_EPOCH and client.epoch == known
        with pytest.raises(clearance.NewEpoch):
            client.set_poses({"cup": [0, 0, 0, 1, 0, 0, 0]})
        assert client.acknowledge_epoch() == client.epoch != known
        assert same_bits(client.distances(pairs=("cup", "*")), expected)
        with pytest.raises(clearance.ConnectionError):
            future.result()  # the first daemon's unanswered requests stay so
    finally:
        second.stop()


def test_a_hung_daemon_is_noticed_and_the_next_one_asked(start_daemon, cell, kinds):
    one, two = ("ipc", "ipc") if kinds["shm"] else ("shm", "ipc")
    first, second = start_daemon(cell, [one]), start_daemon(cell, [two])
    urls = [first.urls[one], second.urls[two]]
    client = clearance.connect(urls, timeout_s=PATIENCE_S, hang_s=0.3)
    expected = client.distances(pairs=("cup", "*"))
    assert client.url == urls[0]
    os.kill(first.process.pid, signal.SIGSTOP)
    try:
        with pytest.raises(clearance.DaemonHung, match=r"been blocked for 0\.3 s"):
            client.distances(pairs=("cup", "*"))
        with pytest.raises(clearance.NewEpoch):
            client.distances(pairs=("cup", "*"))
        assert client.url == urls[1]
        client.acknowledge_epoch()
        assert same_bits(client.distances(pairs=("cup", "*")), expected)
    finally:
        os.kill(first.process.pid, signal.SIGCONT)


def test_timeout_and_recovery(start_daemon, cell, kind):
    daemon = start_daemon(cell, [kind])
    client = clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S)
    expected = client.distances(pairs=("cup", "*"))
    os.kill(daemon.process.pid, signal.SIGSTOP)
    with pytest.raises(clearance.TimeoutError, match=r"no answer within 0\.05 s"):
        client.distances(pairs=("cup", "*"), timeout_s=0.05)
    future = client.submit(pairs=("cup", "*"), timeout_s=0.05)
    with pytest.raises(TimeoutError):
        future.result()
    assert not future.done()
    client.timeout_s = 0.05
    assert client.timeout_s == 0.05
    with pytest.raises(clearance.TimeoutError):
        client.stats()
    os.kill(daemon.process.pid, signal.SIGCONT)
    client.timeout_s = PATIENCE_S
    assert same_bits(future.result(timeout=PATIENCE_S), expected), "result() may be called again"
    assert same_bits(client.distances(pairs=("cup", "*")), expected)


def test_a_daemon_that_ends_is_noticed(start_daemon, cell, kinds):
    kind = "ipc" if kinds["shm"] else "shm"
    daemon = start_daemon(cell, [kind])
    client = clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S)
    client.distances()
    future = client.submit()
    future.result()
    assert daemon.stop() == 0
    with pytest.raises(clearance.ConnectionError) as info:
        client.distances()
    assert isinstance(info.value, ConnectionError) and daemon.urls[kind] in str(info.value)
    with pytest.raises(clearance.ConnectionError):
        clearance.connect(daemon.urls[kind], timeout_s=1)


@pytest.mark.parametrize("url, error, text", [
    ("ipc://{folder}/none", clearance.ConnectionError, r"ipc://{folder}/none: no such socket"),
    ("shm://{folder}/none", clearance.ConnectionError, r"shm://{folder}/none: there is no socket"),
    ("http://localhost", ValueError, r'"http://localhost" is not a url of a daemon: expected shm:///path'),
    ("", ValueError, r"is not a url of a daemon"),
    (b"ipc:///x", TypeError, r"url: expected a string, got b'ipc:///x'"),
    (None, TypeError, r"url: expected a string, got None"),
])  # fmt: skip
def test_bad_urls(url, error, text, tmp_path):
    if isinstance(url, str):
        url = url.format(folder=tmp_path)
    with pytest.raises(error, match=text.format(folder=tmp_path)):
        clearance.connect(url, timeout_s=0.2)


@pytest.mark.parametrize(
    "timeout, error", [(-1, ValueError), (float("nan"), ValueError), ("1", TypeError), (None, TypeError)]
)
def test_bad_timeouts(timeout, error):
    with pytest.raises(error, match="timeout_s: expected a number"):
        clearance.connect("ipc:///nowhere", timeout_s=timeout)


def test_closed_client(ipc):
    client = clearance.connect(ipc.urls["ipc"])
    client.close()
    assert repr(client).endswith("(closed)>")
    for call in (client.distances, client.stats, client.body_states, client.refresh):
        with pytest.raises(clearance.ConnectionError, match="this client is closed"):
            call()


def test_a_forked_child_must_connect_anew(daemon, kind):
    url = daemon.urls[kind]
    client = clearance.connect(url, timeout_s=PATIENCE_S)
    expected = client.distances(pairs=("cup", "*"))
    view = client.prepare("distances", pairs=("cup", "*"), copy=False).run()
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            texts = []
            for call in (client.distances, client.stats):
                try:
                    call()
                    texts.append("no error")
                except clearance.ConnectionError as error:
                    texts.append(str(error))
            del view, client
            gc.collect()
            fresh = clearance.connect(url, timeout_s=PATIENCE_S)
            texts.append(fresh.distances(pairs=("cup", "*")).lower.tobytes().hex())
            os.write(write, "\n".join(texts).encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        lines = pipe.read().splitlines()
    os.waitpid(child, 0)
    assert len(lines) == 3 and all("must open a new one" in line for line in lines[:2]), lines
    assert lines[2] == expected.lower.tobytes().hex()
    assert same_bits(client.distances(pairs=("cup", "*")), expected), "the parent's connection is as it was"
    assert np.array_equal(view.lower, expected.lower)


def test_a_fork_while_another_thread_waits(ipc):
    """A lock held by the other thread does not block the child."""
    client = clearance.connect(ipc.urls["ipc"], timeout_s=PATIENCE_S)
    view = client.prepare("distances", copy=False).run()
    os.kill(ipc.process.pid, signal.SIGSTOP)
    thread = threading.Thread(target=client.distances)
    thread.start()
    while "_guarded" not in [frame.name for frame in traceback.extract_stack(sys._current_frames()[thread.ident])]:
        pass
    for _ in range(20):
        child = os.fork()
        if child == 0:
            signal.alarm(PATIENCE_S)
            try:
                client.distances()
            except clearance.ConnectionError as error:
                del view
                os._exit(0 if "must open a new one" in str(error) else 1)
            os._exit(2)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    os.kill(ipc.process.pid, signal.SIGCONT)
    thread.join()
    assert client.distances().lower.tobytes() == view.lower.tobytes()
