"""The engine in this process."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

import clearance._engine as _engine

from .._arguments import ShapeArgument, to_bool, to_count, to_integer, to_list, to_number_from_0, to_word
from .._device.plan import DevicePlan
from .._errors import TimeoutError
from .._names import NameTable
from .._query.future import Future, Task, Worker
from .._query.query import POINTS_BY_DEFAULT, Query, Run
from .._scene.scene import Scene, name_table
from .._words import BACKENDS, COVERS, DEFAULT_FIELDS, NONE, BackendWord, CoversWord, Status
from .front import BodyState, Front
from .scene_changes import NewBody
from .updates import UpdateResult, Velocities


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
    device_fallback: whether the CPU answers queries that the device does not support, or when it fails or runs out of
        memory; otherwise QueryError.
    covers: when covers are made, which make decisions about bodies that move faster: "background" (on a thread of
        lowest priority, after the engine is ready) or "off". Rows have the same bits either way at the default
        tolerance; at wider ones the interval may be another within the tolerance. Covers may decide a state that is
        unresolved without them.

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
        covers: CoversWord = "background",
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
                to_word(covers, COVERS, "covers"),
            )
        self._worker = Worker(slice_s=0.002, pause_s=0.0)

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

    def stats(self) -> dict[str, int]:
        """Returns the engine's counters."""
        return dict(self._engine.stats())

    def wait_covers(self, timeout_s: float = 60.0) -> bool:
        """Waits until all covers are made, which make decisions faster, and returns whether they are.

        Works on them meanwhile, and so may take about a second longer than timeout_s (seconds).
        """
        return self._engine.wait_covers(to_number_from_0(timeout_s, "timeout_s"))

    # ---- required by Front ----------------------------------------------------------------------------------------

    @property
    def _names(self) -> NameTable:
        # Another thread may have changed the scene while this one loaded the names.
        names = self._names_cache
        if names is None or names.revision != self._engine.scene_revision:
            names = self._names_cache = self._load_names()
        return names

    def _load_names(self) -> NameTable:
        return name_table(*self._engine.scene_state())

    def _scene_revision(self) -> int:
        return self._engine.scene_revision

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        return self._engine.pairs(raw)

    def _refresh_names(self) -> None:
        names = self._names_cache
        if names is not None and names.revision != self._engine.scene_revision:
            self._names_cache = None

    def _certify(
        self, rows: Optional[np.ndarray], run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]
    ) -> str:
        return self._engine.certificate(run.raw, poses, positions, rows)

    def _default_fields(self, query: Query, moves: bool, count: int) -> int:
        return DEFAULT_FIELDS | POINTS_BY_DEFAULT

    def _answer(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        timeout_s = run.timeout_s
        answer = self._engine.answer(run.raw, poses, positions, math.inf if timeout_s is None else timeout_s)
        if answer is None:
            raise TimeoutError(f"no answer within {timeout_s} s")
        return answer

    def _ask_rows(self, query: Query) -> Any:
        return self._engine.answer_rows if query.timeout_s is None else None

    def _open_plan(self, configurations: int, run: Run, *no_input: None) -> DevicePlan:
        plan = self._engine.plan_on_device(run.raw, configurations)
        table = self._table(run.pairs, run.bodies, run.joints)
        return DevicePlan(_engine, plan, run.bodies, table, run.joints, reduced=run.reduce != 0)

    def _find_path(self, run: Run, ends: np.ndarray, **options: Any) -> tuple[np.ndarray, int, int]:
        return self._engine.find_path(run.raw, ends[0], ends[1], **options)

    def _start(self, task: Task, timeout_s: Optional[float]) -> Future:
        return self._worker.add(Future(self._worker, task, timeout_s, is_driven_by_caller=False))

    def _check(self, run: Run, *no_input: None) -> None:
        self._engine.check(run.raw)

    def _begin(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        return self._engine.start(run.raw, poses, positions)

    def _poll(self, job: Any, seconds: float) -> bool:
        return job.advance(round(1e9 * seconds))

    def _take(self, job: Any) -> Any:
        return job.answer()

    def _abandon(self, job: Any) -> None:
        pass

    def _send_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._engine.set_poses(ids, poses, stamp_ns, sequence, velocities, revision))

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        return self._engine.joints()

    def _send_joints(
        self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities
    ) -> UpdateResult:
        return UpdateResult(*self._engine.set_joints(ids, positions, stamp_ns, sequence, velocities))

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
