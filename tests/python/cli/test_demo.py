"""The demo ends by itself, shows that the transports agree, and leaves nothing behind, however it ends."""

import os
import re
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

from patience import PATIENCE_S  # noqa: E402
from service import ROUTE, free_udp_port, multicast_works  # noqa: E402

MULTICAST = multicast_works(free_udp_port())


def start(tmp_path, *options, prefix=()):
    command = [
        *prefix,
        sys.executable,
        "tools/demo.py",
        "--move",
        "0.5",
        "--seconds",
        "0.2",
        "--samples",
        "1",
        "--picture",
        str(tmp_path / "demo.png"),
        *options,
    ]
    return subprocess.Popen(
        command,
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def read_until(process, pattern):
    """The match of a line, and all lines up to it; fails if the demo ends first."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if found := re.search(pattern, line):
            return found, "".join(lines)
    pytest.fail("the demo ended too early:\n" + "".join(lines) + process.stderr.read())


def assert_nothing_is_left(tmp_path, output):
    assert "Left behind: nothing" in output
    assert not [path for path in tmp_path.iterdir() if path.name != "demo.png"]
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                command = (entry / "cmdline").read_bytes().decode(errors="replace")
            except OSError:
                continue
            assert str(tmp_path) not in command, f"process {entry.name} is still there: {command}"


def test_it_runs_to_its_end(tmp_path):
    output, errors = start(tmp_path).communicate(timeout=PATIENCE_S)
    assert "The demo failed" not in errors, errors
    # A row for each body, with an interval that contains its distance.
    rows = re.findall(
        r"^  ([\w/]+) +([\w/]+) +(\d+\.\d+) +(\d+\.\d+) +(\d+\.\d+)  (ok|overlap|contact)$", output, re.MULTILINE
    )
    assert len(rows) == len({row[0] for row in rows}) == 19, output
    assert {"arm/forearm", "cup", "table"} < {row[0] for row in rows}, "and none for the arm's frame"
    assert all(float(lower) <= float(upper) for _, _, _, lower, upper, _ in rows)
    assert "ok" in {row[5] for row in rows}
    by = r"joint_publisher.py \(process \d+\) moves 7" if MULTICAST else "7 of them are moved by this process"
    assert re.search(f"^Joints +{by} ", output, re.MULTILINE), output
    assert output.count("the same bits in every column") == (2 if MULTICAST else 1)
    assert len(re.findall(r"p50 +[\d.]+ us +p99 +[\d.]+ us", output)) == (3 if MULTICAST else 2)
    sampled = re.search(r"^Edge .* all 31 samples, 0.02 rad apart, are free, by ([\d.]+) mm or more$", output, re.M)
    contact = re.search(r"free until ([\d.]+) of the way, and at ([\d.]+) probe and sheet overlap", output)
    assert sampled and contact and float(sampled[1]) > 1, output
    assert 15 / 30 < float(contact[1]) <= float(contact[2]) < 16 / 30, "between two samples"
    header = (tmp_path / "demo.png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n" and struct.unpack(">II", header[16:]) == (1600, 1000)
    assert_nothing_is_left(tmp_path, output)


@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_and_all_it_started(tmp_path, number, code):
    process = start(tmp_path, "--move", "60")
    read_until(process, "^Joints ")
    process.send_signal(number)
    output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code
    assert_nothing_is_left(tmp_path, output)


def test_a_daemon_that_dies_is_reported(tmp_path):
    process = start(tmp_path, "--move", "60")
    daemon = int(read_until(process, r"^Daemon .*process (\d+)")[0].group(1))
    read_until(process, "^Joints ")
    os.kill(daemon, signal.SIGKILL)
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "The demo failed" in errors
    assert_nothing_is_left(tmp_path, output)


def test_a_scene_that_is_not_there_is_named(tmp_path):
    process = start(tmp_path, "--scene", str(tmp_path / "absent.yaml"))
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "absent.yaml" in errors and "Traceback" not in errors
    assert_nothing_is_left(tmp_path, output)


def test_without_multicast_it_goes_on(tmp_path):
    """In its own network namespace, whose loopback is down."""
    prefix = ["unshare", "--net"] if os.getuid() == 0 else ["unshare", "--map-root-user", "--net"]
    if not shutil.which("unshare") or subprocess.run([*prefix, "true"], capture_output=True).returncode:
        pytest.skip("no network namespaces on this machine")
    process = start(tmp_path, prefix=prefix)
    _, output = read_until(process, "^Picture ")  # takes most of the time, and is the same with multicast
    process.terminate()
    rest, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 143, errors
    assert "no multicast route" in output and ROUTE in output
    assert "shared memory" in output and "ZeroMQ" in output and output.count("the same bits") == 1
    assert_nothing_is_left(tmp_path, rest)
