"""The calls that an in-process engine and a client of the daemon share: arguments in, results out.

Engine and Client differ only in who answers: each gives the few methods marked "for subclasses".
"""

from __future__ import annotations

import inspect
import math
import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from ._arguments import to_floats
from ._asked import Asked
from ._certificate import Certificates
from ._future import Future
from ._joints import Joints, JointsRef, JointState, JointTable
from ._limits import Beyond, beyond_limits
from ._motions import MotionQueries
from ._names import BodyInfo, BodyRef, NameTable
from ._prepared import Prepared, TableOf
from ._query import Parser, Query
from ._result import Check, Out, Result
from ._updates import Updates
from ._words import Field, FormatWord, ModelWord, PrecisionWord, ReduceWord, Status

Margin = Union[float, np.ndarray, Sequence[float], Mapping[tuple[BodyRef, BodyRef], float]]
Pairs = Union[np.ndarray, Sequence[tuple[BodyRef, BodyRef]], tuple[BodyRef, BodyRef], None]

_TableKey = tuple[int, Optional[bytes], Optional[bytes], Optional[bytes]]  #: scene revision, pairs, bodies, joints
_TABLES_KEPT = 16
_CHECKED: Any = int(Field.LOWER | Field.UPPER | Field.STATUS | Field.PAIR)  #: columns of check()


@dataclass(frozen=True)
class SceneChanged:
    """The scene that replaced another."""

    scene_revision: int
    body_count: int
    body: Optional[int]  #: the id of the body that was added
    seconds: float  #: time that making the scene took


@dataclass(frozen=True)
class BodyState:
    """Where a body is now."""

    pose: np.ndarray  #: (7,) X_wb; meaningful if status is OK
    status: Status  #: OK, NO_POSE or BAD_POSE
    parent: Optional[int]
    stamp_ns: int  #: publisher's clock
    age_ns: Optional[int]  #: since the pose was received, or the points of a cloud if they are older; None: never


class Front(MotionQueries, Certificates, Updates, Parser):
    """Methods of both clearance.Engine and clearance.Client."""

    _instead: str  #: what a program does that wants to send one to another process

    def __init__(self) -> None:
        self._names_cache: Optional[NameTable] = None
        self._joints_cache: Optional[JointTable] = None
        self._asked = Asked()
        self._tables: OrderedDict[_TableKey, np.ndarray] = OrderedDict()
        self._tables_lock = threading.Lock()
        self._beyond_then: Optional[tuple[tuple[int, int], Optional[Beyond]]] = None  # of the revisions of an answer

    def __reduce__(self) -> Any:
        raise TypeError(f"a clearance.{type(self).__name__} cannot be pickled or copied: {self._instead}")

    # ---- for subclasses -------------------------------------------------------------------------------------------

    def _load_names(self) -> NameTable:
        raise NotImplementedError

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        raise NotImplementedError

    def _answer(self, query: Query) -> Any:
        raise NotImplementedError

    def _start(self, query: Query) -> Future:
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
        """The scene's bodies; a body's id is its place here."""
        return self._names.bodies

    @property
    def groups(self) -> dict[str, np.ndarray]:
        """(n,) uint32 body ids of each group."""
        return dict(self._names.groups)

    def body_id(self, name: BodyRef) -> int:
        """Id of a body. Raises ValueError, with near misses, for an unknown name."""
        return self._names.body(name, "name")

    @property
    def scene_revision(self) -> int:
        """A number that stands for this scene: its geometry, bodies, groups and attachments."""
        return self._scene_revision()

    @property
    def pairs(self) -> np.ndarray:
        """(P, 2) uint32: all enabled pairs, in the order of answers to pairs=None without configurations.

        Left out are static-static pairs, pairs of a parent and its child, and those on the scene's ignore list.
        """
        return self.pair_table()

    def pair_table(self, pairs: Pairs = None, bodies: Optional[Sequence[BodyRef]] = None) -> np.ndarray:
        """(P, 2) uint32: the pairs that a query with these arguments answers, in order. Read-only."""
        parsed_pairs = None if pairs is None else self._names.pairs_array(pairs)
        parsed_bodies = None if bodies is None else self._names.bodies_array(bodies, "bodies")
        return self._table(parsed_pairs, parsed_bodies)

    def _table(
        self, pairs: Optional[np.ndarray], bodies: Optional[np.ndarray], joints: Optional[np.ndarray] = None
    ) -> np.ndarray:
        poses = None if bodies is None else np.zeros((1, len(bodies), 7))
        positions = None if joints is None else np.zeros((1, len(joints)))
        raw = self._module.Query(pairs, bodies, poses, False, joints, positions)
        while True:
            key = self._table_key(pairs, bodies, joints)
            with self._tables_lock:
                table = self._tables.get(key)
                if table is not None:
                    self._tables.move_to_end(key)
                    return table
            table = self._fetch_pairs(raw)
            if self._scene_revision() == key[0]:  # else another thread has attached a body meanwhile
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
        """Joints of robots, with their limits, as queries and updates take them.

        group: a robot's name ("panda"), a group of its SRDF ("panda/panda_arm"), or names or ids of joints
            ("panda/panda_joint1"), whose order is kept.

        Raises ValueError, with near misses, for an unknown name.
        """
        table = self._joint_table
        return table.joints(table.ids_of(group, "group"))

    def joint_states(self) -> list[JointState]:
        """Where each joint of the scene's robots is now, by id."""
        return [
            JointState(name, position, Status(status), beyond, stamp, None if age < 0 else age)
            for name, _, _, position, status, beyond, stamp, age in self._load_joints()[0]
        ]

    # ---- queries --------------------------------------------------------------------------------------------------

    def distances(
        self,
        pairs: Pairs = None,
        configurations: Any = None,
        bodies: Optional[Sequence[BodyRef]] = None,
        max_distance: float = math.inf,
        abs_tol: float = 0.0,
        rel_tol: Optional[float] = None,
        precision: PrecisionWord = "f64",
        signed: bool = False,
        reduce: ReduceWord = "none",
        fields: Union[str, Sequence[str], None] = None,
        format: FormatWord = "full",
        out: Out = None,
        timeout_s: Optional[float] = None,
        max_results: int = 1 << 20,
        max_pose_age_ns: int = 0,
        warm: bool = False,
        copy: bool = True,
        min_pose_stamp_ns: int = 0,
        pose_wait_s: float = 0.0,
        wait_for: BodyRef = "*",
        joints: Optional[JointsRef] = None,
        positions: Any = None,
        model: ModelWord = "truth",
        **more: Any,
    ) -> Result:
        """Answers how far apart bodies are, and where, on one consistent snapshot of the poses.

        pairs: (P, 2) ids; or name or id pairs; or pairs of groups such as ("arm", "*"), which stand for their enabled
            pairs. None: all enabled pairs; with configurations those with at least one moved body.
        configurations: (K, M, 7) or (K, M, 4, 4) poses of M bodies that replace their current ones (children follow).
        bodies: (M,) names or ids of those bodies; None: every movable body, in the order of ids.
        max_distance: metres; a pair proved farther is BEYOND and not refined.
        abs_tol, rel_tol: asks for upper - lower <= max(abs_tol, rel_tol |distance|). rel_tol None: 1e-6 (f32: 1e-4).
        precision: "f64" or "f32" iterations; the bounds are valid in either. Reductions and signed distances are
            iterated in float64 in any case, since float32 gains nothing there; of "f32" they take the default rel_tol.
        signed: also the penetration depth of overlapping pairs; of a solid or a surface an interval that holds it.
        reduce: "none", "within" (pairs nearer than max_distance), "nearest" (per body), "min" (per configuration) or
            "any" (per configuration: BEYOND where every pair is proved farther than its margin, else one that is not).
            For "any" `margin` says how far: metres, or (P,) metres for each pair, or {("arm", "*"): 0.02, ...}, where
            later entries win and pairs that no entry names have 0. It takes no max_distance. With its column
            "free_scale" `weights` (J,) says how far each joint goes at a scale of 1, as free_scale() asks it.
        fields: names of the columns that come back; "points" is both points, "default" is distance, lower, upper and
            status, "bounds" lower and upper in float32, rounded outward. None: "default", with points and normal
            too if there are at most 100,000 rows.
        format: "full", or "compact": float32 bounds rounded outward, points relative to each body's origin.
        out: a dict of arrays or an earlier result to write into; `fields` then follows from its columns.
        timeout_s: seconds; None: the client's own; in process no limit.
        max_results: the most rows that reduce="within" returns.
        max_pose_age_ns: poses older than this set Flag.STALE; 0: never.
        warm: keep warm state between calls (faster; bits then depend on earlier calls). The CPU reduces cold.
        copy: False: the columns of a client's answer are read-only views of the transport's own memory, given back when
            the arrays are gone. In process the columns are always the result's own.
        min_pose_stamp_ns: wait for poses with this stamp or a newer one (publisher's clock); 0: do not wait. In process
            poses are there when set_poses() returns, so nothing needs to wait: such a query is a ValueError.
        pose_wait_s: seconds to wait for them, at most 10; then a RequestError with the code POSES_LATE.
        wait_for: the body or group whose poses to wait for. Bodies that have never had a stamp do not count, but at
            least one must have one.
        joints: what joints() gave, the name of a robot or of a group of its joints, or names or ids of joints. Joints
            that are not named, and bodies, stay as they are; what follows a link moves with it.
        positions: (K, J) radians and metres of those joints: K configurations, as many as `configurations` has if it is
            given as well. A position that is no number, or beyond 1e6, makes its rows BAD_POSE; one beyond the joint's
            limits sets Flag.BEYOND_LIMITS.
        model: "truth", or "pieces": a body with convex pieces (convexify="decompose") is answered by these alone, and
            no triangle is looked at. The interval is wider by how far the pieces may miss the mesh, and holds its
            distance all the same; whether one body lies within another comes from the mesh. Negative values of
            signed=True are the pieces' (Flag.PIECES). Other bodies are answered as ever.
        more: options that came later, by name; docs/wire.md has a table of them all. An option that the daemon is too
            old for is a RequestError that names it.

        Raises TypeError or ValueError naming the argument; QueryError for a query that cannot be answered;
        TimeoutError; and from a client ConnectionError and RequestError. A bad pose or an unknown id is a status of its
        rows.
        """
        arguments = (
            max_distance, abs_tol, rel_tol, precision, signed, reduce, fields, format, out, timeout_s, max_results,
            max_pose_age_ns, warm, copy, min_pose_stamp_ns, pose_wait_s, wait_for, joints,
        )  # fmt: skip
        rows = None if positions is None else to_floats(positions, "positions", "(K, J) numbers")
        asked = (pairs, bodies, model, *arguments)
        known, key = self._asked.find(self._scene_revision(), configurations, rows, asked, more)
        if known is not None:
            query = known.at(configurations, rows)
        else:
            query = self._parse(pairs, configurations, bodies, *arguments, rows, model, **more)
            self._asked.keep(key, query)
        return self._result(query, self._answer(query))

    def check(
        self,
        configurations: Any = None,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        bodies: Optional[Sequence[BodyRef]] = None,
        timeout_s: Optional[float] = None,
        joints: Optional[JointsRef] = None,
        positions: Any = None,
        **more: Any,
    ) -> Check:
        """Says which configurations are free: whether every pair is proved farther apart than its margin.

        configurations: as in distances(); with `joints`, and neither bodies nor positions, (K, J) positions of these.
        margin: metres >= 0; or (P,) metres, one for each pair; or {(body or group, body or group): metres}, "*" for
            every body, where later entries win and pairs that no entry names have 0.
        The other arguments are those of distances(), which reduce="any" answers. `more`: precision, rel_tol, ...

        Returns .free (K,) bool, and of the others .pair (K, 2) and .status (K,). What is not proved is not free:
        touching, an unusable pose, or a distance that is the margin to within the tolerance. Distances do not depend on
        joint limits: .ok (K,) bool is free and within them, and .limit_violations says which joint is beyond, and by
        how much. Limits are those of the query's joints; without configurations, of all joints where they are. Warns
        (JointLimitWarning) of positions that look like degrees. Raises as distances().
        """
        if joints is not None and bodies is None and positions is None:
            configurations, positions = None, configurations
        if positions is not None:
            positions = to_floats(positions, "positions", "(K, J) numbers")
        more = {"fields": _CHECKED, "timeout_s": timeout_s, **more}
        asked = {"joints": joints, "positions": positions, "margin": margin}
        result = self.distances(pairs, configurations, bodies, reduce="any", **asked, **more)
        if joints is not None:
            return Check(result, beyond_limits(positions, self._joint_table.limits(joints), "positions"))
        return Check(result, self._beyond_now(result) if configurations is None else None)

    def _beyond_now(self, result: Result) -> Optional[Beyond]:
        """Which joints of the scene are beyond their limits; looked up again if the answer saw other poses."""
        if not self._joint_table.names:
            return None
        key = result.scene_revision, result.snapshot_revision
        then = self._beyond_then
        if then is None or then[0] != key:
            rows, groups = self._load_joints()
            table = JointTable(result.scene_revision, rows, groups)
            positions = np.array([[row[3] if row[4] == Status.OK else math.nan for row in rows]])
            joints = table.joints(np.arange(len(rows), dtype=np.uint32))
            then = self._beyond_then = key, beyond_limits(positions, joints, "joints", stacklevel=4)
        return then[1]

    def free_scale(
        self,
        positions: Any,
        joints: JointsRef,
        weights: Any = None,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        **more: Any,
    ) -> np.ndarray:
        """How far joints may move: a region of joint space around each configuration that is proved to be free.

        positions: (K, J) radians and metres of the joints, as in distances().
        weights: (J,) >= 0, radians and metres, of how far each joint may go; None: 1 each.
        margin: as in check(). `more`: timeout_s, rel_tol, max_pose_age_ns, ...

        Returns (K,) float64, rounded down: the largest s that is proved such that all pairs stay beyond their margins
        while no joint moves by more than s times its weight. 0: not even the configuration itself is proved free; inf:
        nothing that moves can come nearer. Joint limits are not looked at. Raises as distances() does, and QueryError
        for robots that stand on links that these joints move.
        """
        if joints is None:
            raise ValueError("joints: expected some, that move")
        table = self._joint_table
        rows, ids = table.rows(positions, joints)
        each = np.ones(len(ids)) if weights is None else to_floats(weights, "weights")
        asked = {"pairs": pairs, "joints": joints, "positions": rows, "margin": margin, "weights": each, **more}
        return self.distances(reduce="any", fields="free_scale", **asked).free_scale

    def prepare(self, **arguments: Any) -> Prepared:
        """Parses a query once, for a control loop that asks it again and again.

        arguments: those of distances(), by name. Each call reads `configurations` again if they are float64, of shape
            (K, M, 7) and in C order, and `positions` if they are float64, of shape (K, J) and in C order: you may write
            new numbers into them in between.

        Raises as distances() does. Names are looked up here: prepare again after the scene has changed.
        """
        if isinstance(arguments.get("pairs"), np.ndarray):
            arguments["pairs"] = arguments["pairs"].copy()
        return Prepared(self, self._parse_named(arguments))

    def _parse_named(self, arguments: dict[str, Any]) -> Query:
        """Some of the arguments of distances(), by name."""
        return self._parse(**{**DEFAULTS, **arguments})

    def submit(
        self,
        pairs: Pairs = None,
        configurations: Any = None,
        bodies: Optional[Sequence[BodyRef]] = None,
        max_distance: float = math.inf,
        abs_tol: float = 0.0,
        rel_tol: Optional[float] = None,
        precision: PrecisionWord = "f64",
        signed: bool = False,
        reduce: ReduceWord = "none",
        fields: Union[str, Sequence[str], None] = None,
        format: FormatWord = "full",
        out: Out = None,
        timeout_s: Optional[float] = None,
        max_results: int = 1 << 20,
        max_pose_age_ns: int = 0,
        warm: bool = False,
        copy: bool = True,
        min_pose_stamp_ns: int = 0,
        pose_wait_s: float = 0.0,
        wait_for: BodyRef = "*",
        joints: Optional[JointsRef] = None,
        positions: Any = None,
        model: ModelWord = "truth",
        **more: Any,
    ) -> Future:
        """Begins a query as distances() asks it; returns a future: .result(timeout=None), .done(), .cancel().

        In process the poses are those at this call; through a daemon, those at the request's arrival.
        """
        given = locals()
        return self._start(self._parse(**{name: given[name] for name in DEFAULTS}, **more))

    def _result(self, query: Query, answer: Any) -> Result:
        return Result(answer, query.reduce, query.out, query.known_pairs(), TableOf(self, query))


#: Of distances().
DEFAULTS = {
    name: p.default for name, p in inspect.signature(Front.distances).parameters.items() if name not in ("self", "more")
}
