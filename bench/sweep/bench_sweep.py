#!/usr/bin/env python3
"""Overhead of Ray in a sweep: the engine alone in this process, then one and two actors; and 32 sleeping workers.

    bench/run.py sweep [--rounds 5] [--parts 8]

Each round computes the same parts with the engine alone, with one actor, and with two, whose processes persist. Parts,
journal and manifest are written. `wall` is the median over rounds of the ratio within a round, which is meaningful only
on an idle machine. `cpu_over_alone` is the processor time of this process and the actors relative to the engine alone,
which other programs affect less. `daemons_cores` is the share of a core that Ray's other processes use throughout.
"""

import os
import pathlib
import shutil
import statistics
import tempfile
import time

import ray
from ray.cluster_utils import Cluster

from clearance.ray import Actors
from clearance.sweep import Job, prepare
from clearance.sweep._progress import Progress
from clearance.sweep._run import drive
from clearance.sweep._work import Done, Part, Worker
from harness import ROOT, parser, shown, write

SLEEP_S, SLEEPERS, SLEEPS = 1.0, 32, 320


def cpu_of_tree(pid, ours):
    """Processor seconds of the processes `ours`, and of all other living descendants of the process `pid`."""
    stats = {}
    for path in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            before, _, after = path.read_text().rpartition(")")
        except OSError:
            continue
        fields = after.split()
        stats[int(before.split()[0])] = int(fields[1]), int(fields[11]) + int(fields[12])
    ticks, waiting = [0, 0], [pid]
    while waiting:
        one = waiting.pop()
        ticks[one not in ours] += stats[one][1] if one in stats else 0
        waiting += [child for child, (parent, _) in stats.items() if parent == one]
    return [each / os.sysconf("SC_CLK_TCK") for each in ticks]


def timed(what, workers=()):
    """Wall seconds, processor seconds of this process and the workers, and those of Ray's other processes."""
    ours = {os.getpid(), *workers}
    wall, before = time.perf_counter(), cpu_of_tree(os.getpid(), ours)
    what()
    wall, after = time.perf_counter() - wall, cpu_of_tree(os.getpid(), ours)
    return wall, after[0] - before[0], after[1] - before[1]


class Sleeping:
    """A worker without an engine."""

    def __init__(self, spec, packed):
        pass

    def perform(self, task):
        time.sleep(SLEEP_S)
        return Done(task.part, 1, 0, "")


def kept(plan, count, **more):
    """Actors that outlive a run, all ready, and a function that begins the next run."""
    class Kept(Actors):
        def close(self):
            self._events.extend(ready)

    pool = Kept(plan, count, **more)
    ready = [pool.wait() for _ in range(count)]
    pool.close()
    return pool


def fresh(plan):
    """The emptied output folder."""
    shutil.rmtree(plan.output)
    plan.spec.folder.mkdir(parents=True)


def overhead(options):
    """Seconds of each way in each round: {way: [(wall, cpu, daemons'), ...]}."""
    rows = {"uniform": {"count": options.parts * options.part_rows, "seed": 1}}
    said = {"scene": str(ROOT / "scenes/cell/robot.yaml"), "joints": "arm", "rows": rows}
    said["part_rows"] = options.part_rows
    with tempfile.TemporaryDirectory() as folder:
        plan = prepare(Job.from_dict({**said, "output": "out"}, folder))
        worker = Worker(plan.spec, plan.packed)
        pools = {count: kept(plan, count) for count in (1, 2)}
        pids = {count: pool.pids() for count, pool in pools.items()}
        times = {"engine": [], 1: [], 2: []}
        for _ in range(options.rounds):
            fresh(plan)
            times["engine"].append(timed(lambda: [worker.perform(Part(part)) for part in range(plan.parts)]))
            for count, pool in pools.items():
                fresh(plan)
                times[count].append(timed(lambda pool=pool: drive(plan, lambda: pool, Progress(None)), pids[count]))
    return times


def asleep():
    """Wall seconds of 32 workers on four simulated machines for sleeps of 320 s in total."""
    store = {"object_store_memory": 1 << 27}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **store})
    for _ in range(4):
        cluster.add_node(num_cpus=SLEEPERS // 4, **store)
    ray.init(address=cluster.address, log_to_driver=False, logging_level="error")
    said = {"scene": str(ROOT / "scenes/cell/robot.yaml"), "joints": "arm", "part_rows": 1, "output": "out"}
    with tempfile.TemporaryDirectory() as folder:
        plan = prepare(Job.from_dict({**said, "rows": {"uniform": {"count": SLEEPS}}}, folder))
        pool = kept(plan, SLEEPERS, make=Sleeping)
        seconds, *_ = timed(lambda: drive(plan, lambda: pool, Progress(None)))
    ray.shutdown()
    cluster.shutdown()
    return seconds


def main():
    made = parser(__doc__)
    made.add_argument("--rounds", type=int, default=5)
    made.add_argument("--parts", type=int, default=8)
    made.add_argument("--part-rows", type=int, default=65536)
    options = made.parse_args()
    quiet = {"include_dashboard": False, "log_to_driver": False, "logging_level": "error"}
    ray.init(num_cpus=3, object_store_memory=1 << 27, **quiet)
    load = os.getloadavg()[0]
    times = overhead(options)
    ray.shutdown()
    rows = options.parts * options.part_rows
    table = []
    for way, seconds in times.items():
        walls = [here[0] / alone[0] for here, alone in zip(seconds, times["engine"])]
        cpu = sum(each[1] for each in seconds) / sum(each[1] for each in times["engine"])
        daemons = sum(each[2] for each in seconds) / sum(each[0] for each in seconds)
        rate = rows / statistics.median(each[0] for each in seconds)
        name = "engine alone" if way == "engine" else f"Ray, {way} worker{'s' * (way > 1)}"
        table.append([name, rows, options.rounds, f"{rate:.0f}", f"{1 / statistics.median(walls):.3f}",
                      f"{1 / max(walls):.3f}", f"{1 / min(walls):.3f}", f"{cpu:.3f}", f"{daemons:.3f}",
                      f"{load:.1f}"])  # fmt: skip
    seconds = asleep()
    ideal = SLEEPS * SLEEP_S / SLEEPERS
    name = f"{SLEEPERS} workers asleep, {SLEEPS} parts of {SLEEP_S:g} s: {seconds:.2f} s of {ideal:g}"
    times_alone = f"{SLEEPS * SLEEP_S / seconds:.2f}"
    table.append([name, SLEEPS, 1, f"{SLEEPS / seconds:.1f}", times_alone, "", "", "", "", f"{load:.1f}"])
    head = ["way", "rows", "rounds", "rows_per_s", "times_alone", "least", "most", "cpu_over_alone", "daemons_cores",
            "load"]  # fmt: skip
    write(shown(dict(zip(head, row)) for row in table), options.csv)


if __name__ == "__main__":
    main()
