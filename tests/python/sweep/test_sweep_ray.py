"""Sweeps on Ray: the bytes of a sweep without it, after any kills; and its simulated cluster of many machines."""

import json
import os
import pathlib
import signal
import sys
import threading
import time
from typing import Any

import pytest

from clearance.sweep import Job, prepare, run
from clearance.sweep._progress import Progress
from clearance.sweep._run import DEPTH, drive
from clearance.sweep._work import Done
from patience import PATIENCE_S
from sweeps import arm_job, finish, journal_of, kill, motion_job, parts_done, result_of, start, until, workers_of

pytest.importorskip("pyarrow", reason="pyarrow is not installed; make test-extras EXTRAS=ray has it")
ray = pytest.importorskip("ray", reason="ray is not installed; make test-extras EXTRAS=ray has it")
clearance_ray: Any = pytest.importorskip("clearance.ray")

OPTIONS = ("--ray", "--workers", 2, "--quiet")


@pytest.fixture
def job(tmp_path, urdf, request):
    """A job file of 40 parts, of 50 rows or as many as a test specifies, and the result of a run without Ray."""
    job = motion_job(tmp_path, urdf, part_rows=getattr(request, "param", 50), check=0.05)
    (tmp_path / "job.json").write_text(json.dumps(job))
    run(Job.load(tmp_path / "job.json"), output=tmp_path / "undisturbed", workers=2)
    return tmp_path / "job.json"


def results(job):
    return result_of(job.parent / "result"), result_of(job.parent / "undisturbed")


def assert_once(job):
    """Nothing lost, nothing twice: each part noted once, and the bytes of an undisturbed run."""
    made = [entry["done"]["part"] for entry in journal_of(job.parent / "result") if "done" in entry]
    assert sorted(made) == list(range(40))
    ours, undisturbed = results(job)
    assert ours == undisturbed


def children(pid):
    """Process numbers and names of all descendants of a process."""
    parents, names = {}, {}
    for path in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            before, _, after = path.read_text().rpartition(")")
        except OSError:
            continue
        number, _, name = before.partition(" (")
        parents[int(number)], names[int(number)] = int(after.split()[1]), name
    found, waiting = {}, [pid]
    while waiting:
        parent = waiting.pop()
        for child in (number for number, its in parents.items() if its == parent and number not in found):
            found[child] = names[child]
            waiting.append(child)
    return found


def test_ray_makes_the_same_bytes(job):
    code, text = finish(start(job, *OPTIONS))
    assert code == 0, text
    assert len(set(workers_of(job.parent / "result"))) == 2
    assert_once(job)


def test_a_worker_that_is_killed(job):
    process = start(job, *OPTIONS)
    until(lambda: parts_done(job.parent / "result") >= 3, process)
    os.kill(workers_of(job.parent / "result")[-1], signal.SIGKILL)
    code, text = finish(process)
    assert code == 0 and "1 workers lost" in text, text
    assert_once(job)


def test_the_driver_is_killed(job):
    process = start(job, *OPTIONS)
    until(lambda: parts_done(job.parent / "result") >= 3, process)
    kill(process)
    assert not (job.parent / "result/manifest.json").exists()
    code, text = finish(start(job, *OPTIONS))
    assert code == 0, text
    assert_once(job)


@pytest.mark.parametrize("job", [1500], indirect=True)  # Ray takes some ten seconds to notice the loss
def test_the_store_is_killed(job):
    """The raylet, whose process holds the only object store. The next run completes the rest."""
    process = start(job, *OPTIONS)
    until(lambda: parts_done(job.parent / "result") >= 3, process)
    (raylet,) = (number for number, name in children(process.pid).items() if name == "raylet")
    os.kill(raylet, signal.SIGKILL)
    assert not (job.parent / "result/manifest.json").exists()  # interrupted in mid-run
    code, text = finish(process)
    if code:  # otherwise its workers, which the driver addresses directly, finished before they noticed the loss
        assert not (job.parent / "result/manifest.json").exists(), text
        code, text = finish(start(job, *OPTIONS))
    assert code == 0, text
    assert_once(job)


# ---- many machines ---------------------------------------------------------------------------------------------------


@pytest.fixture
def cluster():
    """Ray's simulated cluster: each node is a raylet with its own store. The head has no CPUs, so no workers."""
    from ray.cluster_utils import Cluster

    store = {"object_store_memory": 1 << 27}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **store})
    cluster.node_arguments = store
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def connect(cluster):
    ray.init(address=cluster.address, log_to_driver=False, logging_level="error")


@pytest.mark.parametrize("job", [4000], indirect=True)
def test_a_machine_with_its_store_is_killed(job, cluster):
    """Of two nodes one is killed; its workers are lost, and others start on the remaining node."""
    cluster.add_node(num_cpus=3, **cluster.node_arguments)
    second = cluster.add_node(num_cpus=1, **cluster.node_arguments)
    connect(cluster)
    plan = prepare(Job.load(job))
    pools = []

    def start_pool():
        pools.append(clearance_ray.Actors(plan, 3))
        return pools[0]

    def kill_soon():
        deadline = time.monotonic() + PATIENCE_S
        while len(set(workers_of(plan.output))) < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
        cluster.remove_node(second, allow_graceful=False)

    killer = threading.Thread(target=kill_soon)
    killer.start()
    summary = drive(plan, start_pool, Progress(None))
    killer.join()
    assert summary.lost >= 1
    assert_once(job)


class Sleeping:
    """Takes the time of an engine without using the processor."""

    def __init__(self, spec, packed):
        assert packed.data  # the scene has arrived

    def perform(self, task):
        time.sleep(1.0)
        return Done(task.part, 1, os.getpid(), ray.get_runtime_context().get_node_id())


def test_thirty_two_workers_on_four_machines(tmp_path, urdf, cluster):
    """Each part is done once, by one of 32 workers, all of which get work; few are in progress at a time."""
    for _ in range(4):
        cluster.add_node(num_cpus=8, **cluster.node_arguments)
    connect(cluster)
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers do not find this file
    plan = prepare(Job.from_dict(arm_job(tmp_path, urdf, rows={"uniform": {"count": 320}}, part_rows=1), tmp_path))
    most = []

    actors: Any = clearance_ray.Actors

    class Counting(actors):
        def submit(self, worker, task):
            super().submit(worker, task)
            most.append(len(self._waiting))

    begin = time.monotonic()
    summary = drive(plan, lambda: Counting(plan, 32, make=Sleeping), Progress(None))
    print(f"32 workers: 320 parts of 1 s in {time.monotonic() - begin:.1f} s, with the start of Ray's processes")
    assert summary.made == 320 and summary.lost == 0 and max(most) <= 32 * DEPTH
    done = [entry["done"] for entry in journal_of(plan.output) if "done" in entry]
    assert sorted(each["part"] for each in done) == list(range(320))
    assert len({each["size"] for each in done}) == 32 and len({each["digest"] for each in done}) == 4
