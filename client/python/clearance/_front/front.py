"""The members that an in-process engine and a client of the daemon share: the scene, queries and updates.

Engine and Client differ only in where a query runs: each implements the few methods marked "for subclasses".
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np

from .._joints import Joints, JointsRef, JointState, JointTable
from .._names import BodyInfo, BodyRef, NameTable, Pairs
from .._query.future import Future, Task
from .._query.limits import Beyond, beyond_limits
from .._query.plan import Plans
from .._query.queries import Queries
from .._query.query import Query, Run
from .._words import Status
from .scene_changes import SceneChanges
from .updates import Updates

_TableKey = tuple[int, Optional[bytes], Optional[bytes], Optional[bytes]]  #: scene revision, pairs, bodies, joints
_TABLES_KEPT = 16


@dataclass(frozen=True)
class BodyState:
    """The current pose of a body."""

    pose: np.ndarray  #: (7,) X_wb; valid if status is OK
    status: Status  #: OK, NO_POSE or BAD_POSE
    parent: Optional[int]
    stamp_ns: int  #: publisher's clock
    age_ns: Optional[int]  #: since the pose, or the points of a cloud if older, were received; None if never


class Front(Queries, Plans, Updates, SceneChanges):
    """Methods of both clearance.Engine and clearance.Client."""

    _instead: str  #: how to use one in another process, for the error of pickling
    _is_remote = False

    def __init__(self) -> None:
        self._names_cache: Optional[NameTable] = None
        self._joints_cache: Optional[JointTable] = None
        self._tables: OrderedDict[_TableKey, np.ndarray] = OrderedDict()
        self._tables_lock = threading.Lock()
        self._beyond_then: Optional[tuple[tuple[int, int], Optional[Beyond]]] = None  # of the revisions of an answer

    def __reduce__(self) -> Any:
        raise TypeError(f"a clearance.{type(self).__name__} cannot be pickled or copied: {self._instead}")

    # ---- for subclasses -------------------------------------------------------------------------------------------

    def _load_names(self) -> NameTable:
        raise NotImplementedError

    def _scene_revision(self) -> int:
        """Returns the revision of the scene of the names and pair tables."""
        raise NotImplementedError

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        raise NotImplementedError

    def _default_fields(self, query: Query, moves: bool, count: int) -> int:
        """Returns the default column bits: points and normal are included if there are few rows."""
        raise NotImplementedError

    def _answer(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        raise NotImplementedError

    def _check(self, run: Run, *no_input: None) -> None:
        """Raises QueryError for a query that is wrong with any configurations."""
        raise NotImplementedError

    def _begin(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        """Starts a query, for the methods of _future.Runner."""
        raise NotImplementedError

    def _start(self, task: Task, timeout_s: Optional[float]) -> Future:
        raise NotImplementedError

    def _open_plan(self, configurations: int, run: Run, *no_input: None) -> Any:
        raise NotImplementedError

    def _refresh_names(self) -> None:
        """Discards names of a scene that has changed."""
        raise NotImplementedError

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        raise NotImplementedError

    # ---- scene ----------------------------------------------------------------------------------------------------

    @property
    def _names(self) -> NameTable:
        names = self._names_cache
        if names is None:
            names = self._names_cache = self._load_names()
        return names

    @property
    def _joint_table(self) -> JointTable:
        revision = self._scene_revision()
        table = self._joints_cache
        if table is None or table.revision != revision:
            table = self._joints_cache = JointTable(revision, *self._load_joints())
        return table

    @property
    def bodies(self) -> tuple[BodyInfo, ...]:
        """The scene's bodies; a body's id is its index."""
        return self._names.bodies

    @property
    def groups(self) -> dict[str, np.ndarray]:
        """(n,) uint32 body ids of each group."""
        return dict(self._names.groups)

    def body_id(self, name: BodyRef) -> int:
        """Returns the id of a body. Raises ValueError, with similar names, for an unknown name."""
        return self._names.body(name, "name")

    @property
    def scene_revision(self) -> int:
        """Revision of this scene: its geometry, bodies, groups and attachments."""
        return self._scene_revision()

    @property
    def pairs(self) -> np.ndarray:
        """(P, 2) uint32: all enabled pairs, in the row order of a query with pairs=None and no configurations.

        Excludes static-static pairs, pairs of a parent and its child, and the scene's ignore list.
        """
        return self.pair_table()

    def pair_table(self, pairs: Pairs = None, bodies: Optional[Sequence[BodyRef]] = None) -> np.ndarray:
        """Returns the pairs of a query with these arguments, in row order: (P, 2) uint32, read-only."""
        parsed_pairs = None if pairs is None else self._names.pairs_array(pairs)
        parsed_bodies = None if bodies is None else self._names.bodies_array(bodies, "bodies")
        return self._table(parsed_pairs, parsed_bodies)

    def _table(
        self, pairs: Optional[np.ndarray], bodies: Optional[np.ndarray], joints: Optional[np.ndarray] = None
    ) -> np.ndarray:
        raw = self._module.Query(pairs, bodies, joints, 0)
        while True:
            key = self._table_key(pairs, bodies, joints)
            with self._tables_lock:
                table = self._tables.get(key)
                if table is not None:
                    self._tables.move_to_end(key)
                    return table
            table = self._fetch_pairs(raw)
            if self._scene_revision() == key[0]:  # otherwise another thread has changed the scene
                break
        table.flags.writeable = False
        with self._tables_lock:
            self._tables[key] = table
            while len(self._tables) > _TABLES_KEPT:
                self._tables.popitem(last=False)
        return table

    def _table_key(self, *named: Optional[np.ndarray]) -> _TableKey:
        pairs, bodies, joints = (None if ids is None else ids.tobytes() for ids in named)
        return self._scene_revision(), pairs, bodies, joints

    def joints(self, group: JointsRef) -> Joints:
        """Returns joints of robots with their limits, for queries and updates.

        group: a robot's name ("panda"), a group of its SRDF ("panda/panda_arm"), or names or ids of joints
            ("panda/panda_joint1") in the order of the result.

        Raises ValueError, with similar names, for an unknown name.
        """
        table = self._joint_table
        return table.joints(table.ids_of(group, "group"))

    def joint_states(self) -> list[JointState]:
        """Returns the current state of each joint of the scene's robots, by id."""
        return [
            JointState(name, position, Status(status), beyond, stamp, None if age < 0 else age)
            for name, _, _, position, status, beyond, stamp, age in self._load_joints()[0]
        ]

    def _beyond_now(self, answer: Any) -> Optional[Beyond]:
        """Returns the joints of the scene beyond their limits. Cached until the poses change."""
        if not self._joint_table.names:
            return None
        key = answer.scene_revision, answer.snapshot_revision
        then = self._beyond_then
        if then is None or then[0] != key:
            rows, groups = self._load_joints()
            table = JointTable(answer.scene_revision, rows, groups)
            positions = np.array([[row[3] if row[4] == Status.OK else math.nan for row in rows]])
            joints = table.joints(np.arange(len(rows), dtype=np.uint32))
            then = self._beyond_then = key, beyond_limits(positions, joints, "joints")
        return then[1]
