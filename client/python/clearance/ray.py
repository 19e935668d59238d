"""Sweeps on Ray: each worker is an actor that uses a few cores or a GPU of any machine of a cluster.

    job = clearance.sweep.Job.load("reach.yaml")
    clearance.ray.run(job, address="auto")

The result has the bytes of clearance.sweep.run(). Requires the packages ray and pyarrow, this package in the same
version on every machine, and an output folder with the same path on every machine.
"""

from __future__ import annotations

import contextlib
import os
from collections import deque
from pathlib import Path
from typing import Any, Callable, Optional, TextIO, Union

import ray

from ._words import BackendWord
from .sweep import Job, Plan, Summary, SweepError, prepare
from .sweep._processes import importable_from
from .sweep._progress import Progress
from .sweep._run import Event, Lost, Ready, Result, drive
from .sweep._scenes import Packed
from .sweep._work import Failed, Outcome, Performs, Spec, Task, Worker, machine

__all__ = ["Actors", "run"]

_GONE = (ray.exceptions.RayActorError, ray.exceptions.ObjectLostError, ray.exceptions.WorkerCrashedError)
_LOOK_S = 5.0  # of silence before a check that the cluster has machines

#: Creates a worker in an actor's process. Tests replace it.
MakeWorker = Callable[[Spec, Packed], Performs]


class _Actor:
    """A worker's process. Reports an error at its start as its first result."""

    def start(self, spec: Spec, packed: Packed, make: MakeWorker) -> Union[str, Failed]:
        try:
            self._worker = make(spec, packed)
        except Exception as error:
            return Failed(f"{machine()} cannot start: {error}")
        return machine()

    def perform(self, task: Task) -> Outcome:
        return self._worker.perform(task)

    def pid(self) -> int:
        return os.getpid()


class Actors:
    """A pool of actors on this process's Ray cluster. The scene is stored there once.

    count: number of actors. gpus: GPUs per actor; may be a fraction.
    """

    def __init__(self, plan: Plan, count: int, gpus: float = 0.0, make: MakeWorker = Worker):
        self.size = count
        self._spec = plan.spec
        self._make = make
        # Each machine fetches the scene once; its workers share that copy.
        self._packed = ray.put(plan.packed)
        # This class replaces lost workers, instead of Ray, since it knows their tasks.
        options = {"num_cpus": plan.spec.threads, "num_gpus": gpus, "max_restarts": 0, "max_task_retries": 0}
        self._class = ray.remote(**options)(_Actor)
        self._next = 0
        self._actors: dict[int, Any] = {}
        self._waiting: dict[Any, int] = {}  #: pending results, with their workers
        self._events: deque[Event] = deque()
        for _ in range(count):
            self._start()

    def submit(self, worker: int, task: Task) -> None:
        self._waiting[self._actors[worker].perform.remote(task)] = worker

    def wait(self) -> Event:
        while not self._events:
            ready, _ = ray.wait(list(self._waiting), num_returns=1, timeout=_LOOK_S)
            if ready:
                # A worker performs its tasks in order, but Ray may return the result of a later one first.
                worker = self._waiting[ready[0]]
                self._receive(next(answer for answer, whose in self._waiting.items() if whose == worker))
            elif not any(node["Alive"] for node in ray.nodes()):
                raise SweepError("Ray has no machine left that is alive; the job goes on when it is started again")
        return self._events.popleft()

    def close(self) -> None:
        for actor in self._actors.values():
            with contextlib.suppress(Exception):  # Ray itself may be gone
                ray.kill(actor)
        self._actors.clear()

    def pids(self) -> list[int]:
        """Returns the process ids of the workers, each on its machine."""
        pids: list[int] = ray.get([actor.pid.remote() for actor in self._actors.values()])
        return pids

    def _receive(self, answer: Any) -> None:
        worker = self._waiting.pop(answer)
        try:
            message = ray.get(answer)
        except _GONE as error:
            self._lose(worker, " ".join(str(error).split()))
            return
        except ray.exceptions.RayTaskError as error:  # an error of transmission, not of the worker
            message = Failed(f"Ray: {error}")
        self._events.append(Ready(worker, message) if isinstance(message, str) else Result(worker, message))

    def _lose(self, worker: int, text: str) -> None:
        with contextlib.suppress(Exception):
            ray.kill(self._actors.pop(worker))  # it may be alive but unreachable
        self._waiting = {answer: whose for answer, whose in self._waiting.items() if whose != worker}
        self._events.append(Lost(worker, text))
        self._start()

    def _start(self) -> None:
        actor = self._class.remote()
        self._actors[self._next] = actor
        self._waiting[actor.start.remote(self._spec, self._packed, self._make)] = self._next
        self._next += 1


def run(
    job: Job,
    output: Union[str, Path, None] = None,
    address: Optional[str] = None,
    workers: int = 0,
    threads: int = 1,
    gpus: Optional[float] = None,
    backend: BackendWord = "cpu",
    progress: Optional[TextIO] = None,
) -> Summary:
    """Runs a job, or the rest of it, with actors of Ray.

    address: address of a cluster, as in ray.init() ("auto" for the one on this machine). By default, starts a cluster
        on this machine for the duration of the run. Ignored if the program is connected already.
    workers: number of actors. The default, 0, fills the cluster's CPUs and GPUs.
    threads: CPUs of each actor and its engine. gpus: GPUs of each actor. Default: 1 with backend "cuda", otherwise 0.
    output, backend, progress: as in clearance.sweep.run().

    Raises as clearance.sweep.run() does, and SweepError without a cluster.
    """
    plan = prepare(job, None if output is None else Path(output), backend, threads)
    each = (1.0 if backend == "cuda" else 0.0) if gpus is None else gpus
    ours = not ray.is_initialized()
    if ours:
        _connect(address, len(plan.packed.data))
    try:
        count = workers or _room(threads, each)
        return drive(plan, lambda: Actors(plan, count, each), Progress(progress))
    finally:
        if ours:
            ray.shutdown()


def _connect(address: Optional[str], scene_bytes: int) -> None:
    # Workers import this package from the same path as this process; on other machines it may be installed.
    path = os.pathsep.join(filter(None, [importable_from(), os.environ.get("PYTHONPATH", "")]))
    more: dict[str, Any] = {} if address else {"object_store_memory": max(1 << 27, 4 * scene_bytes)}
    for again in (True, True, False):
        try:
            ray.init(
                address=address or "local",
                include_dashboard=None if address else False,
                log_to_driver=False,
                logging_level="error",
                runtime_env={"env_vars": {"PYTHONPATH": path}},
                **more,
            )
            return
        except Exception as error:  # ray.init() raises many types
            ray.shutdown()
            if address or not again:
                where = address or "this machine"
                raise SweepError(f"Ray at {where} cannot be reached or started: {error}") from error
            # Ray gives its processes half a minute to start, which can be too short on a busy machine.


def _room(threads: int, gpus: float) -> int:
    there = ray.cluster_resources()
    room = int(there.get("CPU", 0) // max(threads, 1))
    if gpus > 0:
        room = min(room, int(there.get("GPU", 0) / gpus))
    return max(room, 1)
