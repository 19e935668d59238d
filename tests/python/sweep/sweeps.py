"""Shared by tests of sweeps: a small job, results as bytes, and a pool without processes."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
from collections import deque

import numpy as np

from patience import PATIENCE_S
from robots import ARM_YAML

JOINTS = ["arm/joint1", "arm/joint2", "arm/joint3", "arm/joint4"]


def arm_job(folder, urdf, **keys):
    """A job on the arm of robots.py, as a dict; writes its scene into `folder`."""
    shutil.copy(urdf, folder / "arm.urdf")
    (folder / "scene.yaml").write_text(ARM_YAML)
    job = {"scene": "scene.yaml", "joints": list(JOINTS), "rows": {"uniform": {"count": 1000, "seed": 5}}}
    job["pairs"] = [["arm", "table"], ["arm", "cup"]]
    return {**job, "part_rows": 130, "output": "result", **keys}


def motion_job(folder, urdf, parts=40, part_rows=50, **keys):
    """A job with this many parts of motions, drawn from a file; each part takes some tenths of a second."""
    rng = np.random.default_rng(3)
    start = rng.uniform([-2.9, -1.7, -2.9, -3.0], [2.9, 1.7, 2.9, -0.1], (parts * part_rows, 4))
    np.save(folder / "motions.npy", np.stack([start, start + rng.normal(0, 0.6, start.shape)], axis=1))
    rows = {"file": {"path": "motions.npy", "motions": True}}
    return arm_job(folder, urdf, rows=rows, part_rows=part_rows, answer="least", abs_tol=1e-5, **keys)


def result_of(folder):
    """A result: the bytes of its manifest and of every part, by name. The folder of the parts contains nothing else."""
    folder = pathlib.Path(folder)
    found = {path.name: path.read_bytes() for path in (folder / "parts").iterdir()}
    return {**found, "manifest.json": (folder / "manifest.json").read_bytes()}


def table_of(folder):
    """All rows of a result in order, as {column: array}, according to its manifest."""
    import pyarrow.parquet as pq

    folder = pathlib.Path(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    parts = [pq.read_table(folder / part["file"]) for part in manifest["parts"]]
    assert [len(part) for part in parts] == [part["rows"] for part in manifest["parts"]]
    return {name: np.concatenate([part[name].to_numpy() for part in parts]) for name in parts[0].column_names}


def journal_of(folder):
    """The complete lines of a result's journal."""
    path = pathlib.Path(folder) / "journal.jsonl"
    text = path.read_text() if path.exists() else ""
    return [json.loads(line) for line in text.split("\n")[:-1]]


def parts_done(folder):
    """Number of parts in the journal."""
    return sum("done" in entry for entry in journal_of(folder))


def workers_of(folder, first=0):
    """Process numbers in the journal from a line on; the last line's is last."""
    return [int(entry["by"].rpartition(" ")[2][:-1]) for entry in journal_of(folder)[first:] if "by" in entry]


def start(job, *options):
    """Starts the command on a job file, in its own session."""
    command = [sys.executable, "-m", "clearance.sweep", str(job), *map(str, options)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True)


def finish(process):
    """Its exit code and output."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out + err


def until(condition, process):
    """Waits for a condition while a process runs; fails if the process ends first."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert process.poll() is None, "ended too early: " + process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.002)


def kill(process):
    """kill -9, and waits for the end of the process."""
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=PATIENCE_S)


class InProcess:
    """A pool of workers that alternate in this process. A worker that raises SystemExit is lost.

    make(number) makes a worker; each has its own machine.
    """

    def __init__(self, size, make):
        self.size, self._make, self._next = size, make, 0
        self.workers, self.queues, self.events = {}, {}, deque()
        self.most_tasks = 0
        for _ in range(size):
            self._start()

    def _start(self):
        from clearance.sweep._run import Ready

        number, self._next = self._next, self._next + 1
        self.workers[number], self.queues[number] = self._make(number), deque()
        self.events.append(Ready(number, f"machine {number}"))

    def submit(self, worker, task):
        self.queues[worker].append(task)
        self.most_tasks = max(self.most_tasks, sum(map(len, self.queues.values())))

    def wait(self):
        from clearance.sweep._run import Lost, Result

        if self.events:
            return self.events.popleft()
        worker = max(self.queues, key=lambda number: (len(self.queues[number]), -number))
        task = self.queues[worker].popleft()
        try:
            return Result(worker, self.workers[worker].perform(task))
        except SystemExit as end:
            del self.workers[worker], self.queues[worker]
            self._start()
            return Lost(worker, str(end))

    def close(self):
        self.workers.clear()
