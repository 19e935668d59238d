"""`clearance record` and `clearance replay`: an LCM log holds what was on the network, and gives it back."""

import random
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest

import clearance
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S, wait_until

lcm = pytest.importorskip("lcm")

PROGRAM = shutil.which("clearance") if INSTALLED else str(BUILD / "bin" / "clearance")
DAEMONS_OWN = {"CLEARANCE_SCENE", "CLEARANCE_STATES", "CLEARANCE_STATUS", "CLEARANCE_DISTANCES", "CLEARANCE_REPLY"}


@pytest.fixture(autouse=True)
def multicast(kinds):
    if kinds["udpm"]:
        pytest.skip(kinds["udpm"])


def network():
    """An LCM network that nobody else is on."""
    return f"udpm://239.255.76.67:{random.SystemRandom().randrange(20000, 60000)}?ttl=0"


def events(file):
    return [(e.channel, e.timestamp, e.data) for e in lcm.EventLog(str(file))]


class Recorder:
    """`clearance record` that listens already."""

    def __init__(self, file, url, *options):
        command = [PROGRAM, "record", str(file), "--lcm", url, *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.first_line = self.process.stderr.readline()
        assert self.first_line.startswith("recording"), self.first_line + self.process.stderr.read()

    def stop(self):
        """Ends it as Ctrl-C does; returns {channel: count} as it said."""
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=PATIENCE_S)
        assert self.process.returncode == 0, err
        return {line.split()[0]: int(line.split()[1]) for line in out.splitlines()}


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S)


def pose_message(sequence, poses):
    from clearance_lcm import named_pose_update_t

    message = named_pose_update_t()
    message.publisher_id, message.sequence, message.stamp_ns = 77, sequence, time.time_ns()
    message.names = list(poses)
    message.poses = [list(map(float, pose)) for pose in poses.values()]
    message.count = len(poses)
    return message.encode()


def test_a_daemons_day_goes_into_a_log_and_to_another_daemon(start_daemon, cell, tmp_path):
    first = start_daemon(cell, ["ipc", "udpm"])
    log, url = tmp_path / "day.lcm", first.urls["udpm"]
    recorder = Recorder(log, url)
    bus = lcm.LCM(url)
    sent = []
    client = clearance.connect(first.urls["ipc"])
    for i in range(1, 21):
        sent.append(pose_message(i, {"ball": [0.9, 0.36, 1.1 + 0.01 * i, 1, 0, 0, 0]}))
        bus.publish("CLEARANCE_POSES_NAMED", sent[-1])
        wait_until(lambda i=i: client.distances(reduce="min").snapshot_sequence == i)
    bus.publish("SOMEBODY_ELSES", b"not ours")
    with clearance.connect(url) as over_lcm:  # frames of a client of ours
        over_lcm.distances(reduce="min")
    wait_until(lambda: {"CLEARANCE_STATUS", "CLEARANCE_FRAME_OUT"} <= {channel for channel, *_ in events(log)})
    counts = recorder.stop()

    found = events(log)
    assert [data for channel, _, data in found if channel == "CLEARANCE_POSES_NAMED"] == sent
    assert DAEMONS_OWN & {channel for channel, *_ in found} and "CLEARANCE_FRAME_IN" in counts
    assert "SOMEBODY_ELSES" not in counts
    assert counts == {c: sum(channel == c for channel, *_ in found) for c in counts} and sum(counts.values()) == len(
        found
    )
    times = [at for _, at, _ in found]
    assert times == sorted(times) and abs(times[-1] * 1e-6 - time.time()) < PATIENCE_S

    second = start_daemon(cell, ["ipc", "udpm"])
    other = clearance.connect(second.urls["ipc"])
    before = other.distances(pairs=("ball", "*"))
    done = run("replay", log, "--lcm", second.urls["udpm"], "--speed", "100", "--inputs")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "CLEARANCE_POSES_NAMED 20\n"
    wait_until(lambda: other.distances(reduce="min").snapshot_sequence == 20)
    expected, have = (each.distances(pairs=("ball", "*")) for each in (client, other))
    np.testing.assert_array_equal(have.lower, expected.lower)
    np.testing.assert_array_equal(have.upper, expected.upper)
    assert not np.array_equal(before.lower, have.lower)


def write_log(file, messages):
    log = lcm.EventLog(str(file), "w", overwrite=True)
    for at, channel, data in messages:
        log.write_event(at, channel, data)
    log.close()


def listen(url):
    bus, got = lcm.LCM(url), []
    bus.subscribe(".*", lambda channel, data: got.append((channel, data))).set_queue_capacity(10000)
    return bus, got


def replay_to(url, got, bus, *arguments):
    process = subprocess.Popen(
        [PROGRAM, "replay", *map(str, arguments), "--lcm", url], stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None:
        bus.handle_timeout(20)
    while bus.handle_timeout(100):
        pass
    return process, process.stderr.read()


def test_replay_publishes_everything_as_it_was(tmp_path):
    rng = random.Random(4)
    messages = [
        (1_000_000 * i, rng.choice(["CLEARANCE_POSES", "cell2_CLEARANCE_STATES", "OTHER"]), rng.randbytes(1 + 3 * i))
        for i in range(200)
    ]
    assert len({channel for _, channel, _ in messages}) == 3
    write_log(tmp_path / "log", messages)
    url = network()
    bus, got = listen(url)
    began = time.monotonic()
    process, error = replay_to(url, got, bus, tmp_path / "log", "--speed", "400")
    assert process.returncode == 0, error
    assert [each for each in got if each[0] != "LCM_SELF_TEST"] == [(channel, data) for _, channel, data in messages]
    assert time.monotonic() - began >= 199 / 400, "faster than it was asked to be"  # and in time: it is 199 s of log


def test_what_cannot_be_done_is_said(tmp_path):
    write_log(tmp_path / "log", [(5, "CLEARANCE_POSES", b"x" * 50)] * 3)
    there = run("record", tmp_path / "log", "--lcm", network())
    assert there.returncode == 1 and "is there already; --force writes over it" in there.stderr
    assert len(events(tmp_path / "log")) == 3
    assert Recorder(tmp_path / "log", network(), "--force", "--seconds", "0.05").process.wait(timeout=PATIENCE_S) == 0
    assert events(tmp_path / "log") == []

    gone = run("replay", tmp_path / "nowhere", "--lcm", network())
    assert gone.returncode == 1 and "nowhere: No such file" in gone.stderr
    prefix = run("replay", tmp_path / "log", "--lcm", network() + "&prefix=cell2_")
    assert prefix.returncode == 2 and "leave prefix=cell2_ out" in prefix.stderr
    assert run("replay", tmp_path / "log", "--speed", "0").returncode == 2
    (tmp_path / "text").write_bytes(b"this is no log at all" * 10)
    damaged = run("replay", tmp_path / "text", "--lcm", network())
    assert damaged.returncode == 1 and "is damaged, or no LCM log" in damaged.stderr
    write_log(tmp_path / "cut", [(5, "CLEARANCE_POSES", b"x" * 50)] * 3)
    (tmp_path / "cut").write_bytes((tmp_path / "cut").read_bytes()[:-60])
    cut = run("replay", tmp_path / "cut", "--lcm", network())
    assert (cut.returncode, cut.stdout) == (1, "CLEARANCE_POSES 2\n") and "damaged" in cut.stderr
