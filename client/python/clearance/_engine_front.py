"""The engine in this process."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Optional, Union

import numpy as np

import clearance._engine as _engine

from ._arguments import ShapeArgument, to_bool, to_count, to_integer, to_list, to_word
from ._device_plan import DevicePlan
from ._errors import TimeoutError
from ._front import BodyState, Front, Pairs
from ._future import EngineFuture, Worker
from ._joints import JointsRef
from ._names import BodyRef, NameTable
from ._plan_arguments import plan_query
from ._query import POINTS_BY_DEFAULT, Query
from ._scene import Scene, name_table
from ._scene_changes import NewBody
from ._updates import UpdateResult
from ._words import BACKENDS, DEFAULT_FIELDS, NONE, BackendWord, ReduceWord, Status


class Engine(Front):
    """A scene in memory with the poses of its bodies, which answers batched distance queries.

    backend: "auto", "cpu", "reference" (brute force, the fast path's oracle), or another of Engine.backends(). An
        unavailable one raises. "auto" is the CPU or, with a device, the faster of both for similar queries.
    threads: number of threads. The default, 0, uses all cores.
    max_rows: maximum rows of an answer; larger ones raise QueryError.
    device_memory: maximum memory of each device for backend "cuda", in bytes. The default, 0, sets no limit.
    devices: numbers of the CUDA devices for backends "cuda" and "auto", as in [0, 1]. Each holds the scene, and queries
        are distributed among them. Default: the current device. Raises ValueError for a repeated number and
        RuntimeError for an absent device.
    device_fallback: whether the CPU answers if the device fails or runs out of memory; otherwise QueryError.

    Thread-safe; releases the GIL during queries. Not usable in a forked child (RuntimeError).
    """

    _module = _engine
    _instead = "send its Scene, or the scene file's path, and make an Engine of it in each process"

    def __init__(
        self,
        scene: Scene,
        backend: BackendWord = "auto",
        threads: int = 0,
        max_rows: int = 1 << 28,
        device_memory: int = 0,
        device_fallback: bool = True,
        devices: Sequence[int] = (),
    ):
        super().__init__()
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: expected a clearance.Scene, got {type(scene).__name__}")
        if not 0 <= to_integer(threads, "threads") <= 1 << 16:
            raise ValueError(f"threads: expected 0 (all cores) or more, got {threads}")
        devices = to_list(devices, "devices", "a list of device numbers")
        with scene._lock:
            self._engine = _engine.Engine(
                scene._scene,
                to_word(backend, BACKENDS, "backend"),
                int(threads),
                to_count(max_rows, "max_rows"),
                to_count(device_memory, "device_memory"),
                to_bool(device_fallback, "device_fallback"),
                [to_count(device, f"devices[{i}]") for i, device in enumerate(devices)],
            )
        self._worker: Optional[Worker] = None

    @staticmethod
    def backends() -> list[str]:
        """Returns the backends available on this machine."""
        return _engine.Engine.backends()

    @property
    def backend(self) -> str:
        """The backend in use. For "auto", a result's `backend` is the one that answered it."""
        return self._engine.backend

    @property
    def device_error(self) -> str:
        """The device's most recent error, or empty."""
        return self._engine.device_error

    @property
    def pose_revision(self) -> int:
        """Revision of the newest snapshot of the poses."""
        return self._engine.pose_revision

    def body_states(self) -> list[BodyState]:
        """Returns the current state of each body, by id."""
        return [_state(*row) for row in self._engine.body_states()]

    def plan_on_device(
        self,
        configurations: int = 0,
        bodies: Optional[Sequence[BodyRef]] = None,
        pairs: Pairs = None,
        fields: Union[str, Sequence[str], None] = None,
        *,
        joints: Optional[JointsRef] = None,
        reduce: ReduceWord = "none",
        **more: Any,
    ) -> DevicePlan:
        """Returns a callable query that reads its input from GPU memory and writes its columns to GPU memory.

        configurations: K, the number of configurations in each call; 0 for one configuration, the current poses.
        bodies: (M,) names or ids of the bodies that they move, as in distances(). Default: every movable body, or none
            with `joints`.
        joints: the joints that they move, as in distances(): the result of joints(), the name of a robot or of a
            group of its joints, or names or ids. The uncertainty of links still applies.
        reduce: "none" for a row per configuration and pair; "min" for a row per configuration with its least distance;
            "any" for a row per configuration with the status BEYOND if every pair is farther than its `margin`.
        fields: names of columns. Default: lower and upper; the status for "any". "gradient_joints" requires joints;
            reductions also have the column "pair".
        pairs, and `more` (max_distance, abs_tol, rel_tol, margin, precision, ...): as in distances().

        Other bodies keep their current poses. Raises as distances(); QueryError for unsupported queries (depths, other
        reductions, bodies with a max_speed, limits on the age of poses, surfaces); and QueryError for an engine without
        a GPU or with several.
        """
        query, count = plan_query(self, configurations, bodies, pairs, fields, joints, reduce, more)
        plan = self._engine.plan_on_device(query.raw, count)
        table = self._table(query.pairs, query.bodies, query.joints)
        return DevicePlan(_engine, plan, query.bodies, table, query.joints, reduced=query.reduce != 0)

    def stats(self) -> dict[str, int]:
        """Returns the engine's counters."""
        return dict(self._engine.stats())

    # ---- required by Front ----------------------------------------------------------------------------------------

    @property
    def _names(self) -> NameTable:
        # Another thread may have changed the scene while this one loaded the names.
        names = self._names_cache
        if names is None or names.revision != self._engine.scene_revision:
            names = self._names_cache = self._load_names()
        return names

    def _load_names(self) -> NameTable:
        scene, revision, parents = self._engine.scene_state()
        table = name_table(scene, revision)  # with the parents at load
        bodies = [replace(b, parent=None if p == NONE else p) for b, p in zip(table.bodies, parents)]
        return NameTable(revision, bodies, table.groups)

    def _parse(self, *arguments: Any, **more: Any) -> Query:
        revision = self._names.revision  # before names are resolved, so that a later change of their ids is found
        query = super()._parse(*arguments, **more)
        query.raw.scene_revision = revision
        return query

    def _scene_revision(self) -> int:
        return self._engine.scene_revision

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        return self._engine.pairs(raw)

    def _certify(self, query: Query, rows: Optional[np.ndarray]) -> str:
        return self._engine.certificate(query.raw, rows)

    def _default_fields(self, query: Query, configurations: int) -> int:
        return DEFAULT_FIELDS | POINTS_BY_DEFAULT

    def _answer(self, query: Query) -> Any:
        timeout = math.inf if query.timeout_s is None else query.timeout_s
        answer = self._engine.answer(query.raw, query.out_list(), timeout)
        if answer is None:
            raise TimeoutError(f"no answer within {query.timeout_s} s")
        return answer

    def _start(self, query: Query) -> EngineFuture:
        if self._worker is None:
            self._worker = Worker()
        job = self._engine.start(query.raw, query.out_list())
        return EngineFuture(self._worker.submit(job, lambda done: self._result(query, done.answer())), query.timeout_s)

    def _send_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._engine.set_poses(ids, poses, stamp_ns, sequence, revision))

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        return self._engine.joints()

    def _send_joints(self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int) -> UpdateResult:
        return UpdateResult(*self._engine.set_joints(ids, positions, stamp_ns, sequence))

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._engine.set_points(body, xyz, radius, stamp_ns, sequence, revision))

    def _send_attach(
        self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray, revision: int
    ) -> UpdateResult:
        row = None if pose is None else pose.reshape(1, 7)
        return UpdateResult(*self._engine.attach(child, parent, row, allow, revision))

    def _send_allow(self, a: int, b: int, allow: bool, revision: int) -> UpdateResult:
        return UpdateResult(*self._engine.allow(a, b, allow, revision))

    def _send_body(self, body: NewBody, revision: int) -> tuple[int, int, int, float]:
        return self._engine.add_body(*body, revision)

    def _send_shape(self, name: str, shape: ShapeArgument, radius: float) -> tuple[int, int, int, float]:
        return self._engine.replace(name, shape.kind, shape.numbers, radius, *shape[2:])

    def _send_removal(self, name: str) -> tuple[int, int, int, float]:
        return self._engine.remove_body(name)

    def __repr__(self) -> str:
        return f"<clearance.Engine {self.backend}: {len(self.bodies)} bodies>"


def _state(pose: Any, status: int, parent: int, stamp_ns: int, age_ns: int) -> BodyState:
    return BodyState(
        np.array(pose), Status(status), None if parent == NONE else parent, stamp_ns, None if age_ns < 0 else age_ns
    )
