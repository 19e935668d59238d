"""The methods of Front that a client answers over its connection to the daemon."""

from __future__ import annotations

import functools
from typing import Any, Optional

import numpy as np

from .._arguments import ShapeArgument
from .._device.remote_plan import RemotePlan
from .._errors import ConnectionError, QueryError, TimeoutError
from .._names import BodyInfo, NameTable
from .._query.future import Future, Task, Worker
from .._query.query import Query, Run
from .._words import DEFAULT_FIELDS, DEFAULT_POINTS_ROWS, FIELD_MASKS, NONE, Reduce
from ..wire import ErrorCode
from .front import Front
from .scene_changes import NewBody
from .updates import UpdateResult, Velocities


class RemoteFront(Front):
    """A Front whose queries and updates are requests to a daemon."""

    _connection: Any  #: of the extension module; None once closed
    _url: str
    _backend: str
    _pair_count: int
    _worker: Worker

    def _use(self) -> Any:
        if self._connection is None:
            raise ConnectionError(f"{self._url}: this client is closed")
        return self._connection

    def _fetch_names(self, refresh: bool) -> NameTable:
        revision, self._backend, self._pair_count, bodies, groups = self._use().scene(refresh)
        infos = [
            BodyInfo(name, i, None if parent == NONE else parent, *rest)
            for i, (name, parent, *rest) in enumerate(bodies)
        ]
        return NameTable(revision, infos, {name: np.array(ids, dtype=np.uint32) for name, ids in groups})

    def _load_names(self) -> NameTable:
        return self._fetch_names(False)

    def _scene_revision(self) -> int:
        return self._names.revision

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        return self._guarded(self._use().pairs, raw)

    def _refresh_names(self) -> None:
        self._names_cache = self._fetch_names(True)

    def _certify(
        self, rows: Optional[np.ndarray], run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]
    ) -> str:
        return self._guarded(self._use().certificate, run.raw, poses, positions, rows)

    def _default_fields(self, query: Query, moves: bool, count: int) -> int:
        rows = count
        if query.reduce not in (Reduce.MIN, Reduce.ANY):
            each = query.rows_each.get(moves)
            if each is None:
                each = query.rows_each[moves] = self._rows_each(query, moves)
            rows *= each
        if query.reduce == Reduce.WITHIN:
            rows = min(rows, query.max_results)
        few = rows <= DEFAULT_POINTS_ROWS
        return DEFAULT_FIELDS | (FIELD_MASKS["points"] | FIELD_MASKS["normal"] if few else 0)

    def _rows_each(self, query: Query, moves: bool) -> int:
        if query.reduce == Reduce.NEAREST and not query.k:
            return len(self._names.bodies)
        pairs = self._pairs_each(query, moves)
        return min(query.k, pairs) if query.reduce == Reduce.NEAREST else pairs

    def _pairs_each(self, query: Query, moves: bool) -> int:
        if query.pairs is None and not moves:
            return self._pair_count
        if query.pairs is not None and not query.selects:
            return len(query.pairs)
        return len(self._table(query.pairs, *query.moved(moves)))

    def _answer(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        connection = self._use()
        timeout = connection.timeout_s if run.timeout_s is None else run.timeout_s
        answer = self._guarded(connection.ask, run.raw, poses, positions, run.copy, timeout)
        if answer is None:
            raise TimeoutError(f"{self._url}: no answer within {timeout:g} s")
        return answer

    def _ask_rows(self, query: Query) -> Any:
        if query.mask is None and query.reduce not in (Reduce.MIN, Reduce.ANY):
            return None  # its columns depend on the number of rows

        def ask(raw: Any, *rows: np.ndarray) -> Any:
            connection = self._use()
            timeout = connection.timeout_s if query.timeout_s is None else query.timeout_s
            answer = self._guarded(connection.ask_rows, raw, query.copy, timeout, *rows)
            if answer is False:
                raise TimeoutError(f"{self._url}: no answer within {timeout:g} s")
            return answer

        return ask

    def _open_plan(self, configurations: int, run: Run, *no_input: None) -> RemotePlan:
        table = self._table(run.pairs, run.bodies, run.joints)
        plan = self._guarded(self._use().plan_on_device, run.raw, configurations)
        return RemotePlan(plan, run.bodies, table, run.joints, reduced=run.reduce != 0)

    def _find_path(self, run: Run, ends: np.ndarray, **options: Any) -> tuple[np.ndarray, int, int]:
        return self._guarded(functools.partial(self._use().find_path, **options), run.raw, ends[0], ends[1])

    def _start(self, task: Task, timeout_s: Optional[float]) -> Future:
        seconds = self._use().timeout_s if timeout_s is None else timeout_s
        return self._worker.add(Future(self._worker, task, seconds, is_driven_by_caller=True))

    def _check(self, run: Run, *no_input: None) -> None:
        for name, (*_, least, most, range_text) in self._module.OPTIONS.items():
            value = getattr(run.raw, name)
            if range_text and not least <= value <= most:
                raise QueryError(ErrorCode.BAD_QUERY, f"query: {name} must be {range_text}, got {value}")
        self._use().check_options(run.raw)

    def _begin(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        return self._guarded(self._use().submit, run.raw, poses, positions, run.copy)

    def _poll(self, job: Any, seconds: float) -> bool:
        return job.wait(seconds)

    def _take(self, job: Any) -> Any:
        return self._guarded(job.answer)

    def _abandon(self, job: Any) -> None:
        job.cancel()

    # The connection sends the scene revision of its own copy of the scene, and needs none of these.

    def _send_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_poses, ids, poses, stamp_ns, sequence, velocities))

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        return self._use().joints()

    def _send_joints(
        self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities
    ) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_joints, ids, positions, stamp_ns, sequence, velocities))

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_points, body, xyz, radius, stamp_ns, sequence))

    def _send_attach(
        self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray, revision: int
    ) -> UpdateResult:
        return UpdateResult(
            *self._guarded(self._use().attach, child, parent, None if pose is None else pose.reshape(1, 7), allow)
        )

    def _send_allow(self, a: int, b: int, allow: bool, revision: int) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().allow, a, b, allow))

    def _send_body(self, body: NewBody, revision: int) -> tuple[int, int, int, float]:
        return self._guarded(self._use().add_body, *body, False)

    def _send_shape(self, name: str, shape: ShapeArgument, radius: float) -> tuple[int, int, int, float]:
        kind, numbers, triangles, mesh_as, cloud = shape
        rest = NONE, False, None, (0.0, 0.0, 0.0, 0.0)
        return self._guarded(self._use().add_body, name, kind, numbers, radius, *rest, triangles, mesh_as, cloud, True)

    def _send_removal(self, name: str) -> tuple[int, int, int, float]:
        return self._guarded(self._use().remove_body, name)

    def _guarded(self, call: Any, *args: Any) -> Any:
        """Calls, and discards the cached names if the daemon rejects the request for its scene."""
        try:
            return call(*args)
        except QueryError as error:
            if error.code == ErrorCode.WRONG_SCENE:
                self._names_cache = None
            raise
