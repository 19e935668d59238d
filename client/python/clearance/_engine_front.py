"""The engine in this process."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Optional, Union

import numpy as np

import clearance._engine as _engine

from ._arguments import to_bool, to_count, to_integer, to_list, to_word
from ._device_plan import DevicePlan
from ._errors import TimeoutError
from ._front import BodyState, Front, Pairs
from ._future import EngineFuture, Worker
from ._joints import JointsRef
from ._names import BodyRef, NameTable
from ._plan_arguments import plan_query
from ._query import POINTS_BY_DEFAULT, Query
from ._scene import Scene, name_table
from ._updates import PosesDone
from ._words import BACKENDS, DEFAULT_FIELDS, NONE, BackendWord, ReduceWord, Status


class Engine(Front):
    """A scene resident in memory, the poses of its bodies, and answers to batched distance queries.

    backend: "auto", "cpu", "reference" (brute force, the fast path's oracle), or another that Engine.backends() names;
        asking for an absent one raises. "auto": the CPU, or where there is a device whichever was
        faster for queries like it.
    threads: 0: all cores.
    max_rows: larger answers are refused with QueryError.
    device_memory: bytes of each device's memory that backend "cuda" may take; 0: what there is.
    devices: CUDA devices of backends "cuda" and "auto", by number, as in [0, 1]: each holds the scene, and queries are
        shared out among them; empty: the current one. Naming one twice raises ValueError, one that is absent
        RuntimeError.
    device_fallback: whether the CPU answers where the device fails or has no room; if not, QueryError says why.

    May be used from several threads; the GIL is released while it works. Not usable in a forked child (RuntimeError).
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
        """Backends that can be asked for on this machine."""
        return _engine.Engine.backends()

    @property
    def backend(self) -> str:
        """The backend in use; "auto": a reply's `backend` says which one answered it."""
        return self._engine.backend

    @property
    def device_error(self) -> str:
        """What the device said last where it did not answer; empty: there was nothing."""
        return self._engine.device_error

    @property
    def pose_revision(self) -> int:
        """Of the newest snapshot."""
        return self._engine.pose_revision

    def body_states(self) -> list[BodyState]:
        """Where each body is now, by id."""
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
        """A query that a GPU answers from numbers in its memory to columns in its memory, as often as it is called.

        configurations: K, how many each call has; 0: the current poses, answered as one.
        bodies: (M,) names or ids of the bodies that they move, as in distances(); None: every movable body, or none
            where there are `joints`.
        joints: of the positions that they have, as in distances(): what joints() gave, the name of a robot or of a
            group of its joints, or names or ids. Slack of links counts as ever.
        reduce: "none": a row for each configuration and pair; "min": one for each configuration, of its least distance;
            "any": one that says whether every pair is farther than its `margin` (BEYOND: free).
        fields: names of columns; None: lower and upper, of "any" the status, of the format "compact" its row and the
            status. "gradient_joints" is for plans with joints; reductions have the column "pair" as well.
        pairs, and `more` (max_distance, abs_tol, rel_tol, margin, precision, format, ...): as in distances().

        What is not moved stays where it is now. Raises as distances(), and QueryError for what a plan does not answer
        (depths, the other reductions, bodies with a max_speed, poses that may be too old, surfaces), and for an engine
        without a GPU or of several.
        """
        query, count = plan_query(self, configurations, bodies, pairs, fields, joints, reduce, more)
        plan = self._engine.plan_on_device(query.raw, count)
        table = self._table(query.pairs, query.bodies, query.joints)
        return DevicePlan(_engine, plan, query.bodies, table, query.joints, reduced=query.reduce != 0)

    def stats(self) -> dict[str, int]:
        """Counters that the engine keeps about itself."""
        return dict(self._engine.stats())

    # ---- what Front asks for --------------------------------------------------------------------------------------

    def _load_names(self) -> NameTable:
        table = name_table(self._engine.scene, self._engine.scene_revision)
        # The scene knows the parents at load, the states those of now.
        bodies = [replace(body, parent=state.parent) for body, state in zip(table.bodies, self.body_states())]
        return NameTable(table.revision, bodies, table.groups)

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

    def _send_poses(self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int) -> PosesDone:
        return PosesDone(*self._engine.set_poses(ids, poses, stamp_ns, sequence))

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        return self._engine.joints()

    def _send_joints(self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int) -> PosesDone:
        return PosesDone(*self._engine.set_joints(ids, positions, stamp_ns, sequence))

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int
    ) -> PosesDone:
        return PosesDone(*self._engine.set_points(body, xyz, radius, stamp_ns, sequence))

    def _send_attach(self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray) -> PosesDone:
        return PosesDone(*self._engine.attach(child, parent, None if pose is None else pose.reshape(1, 7), allow))

    def _send_allow(self, a: int, b: int, allow: bool) -> PosesDone:
        return PosesDone(*self._engine.allow(a, b, allow))

    def __repr__(self) -> str:
        return f"<clearance.Engine {self.backend}: {len(self.bodies)} bodies>"


def _state(pose: Any, status: int, parent: int, stamp_ns: int, age_ns: int) -> BodyState:
    return BodyState(
        np.array(pose), Status(status), None if parent == NONE else parent, stamp_ns, None if age_ns < 0 else age_ns
    )
