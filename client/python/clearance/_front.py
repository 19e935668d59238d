"""The methods that an in-process engine and a client of the daemon share: arguments in, results out.

Engine and Client differ only in where a query runs: each implements the few methods marked "for subclasses".
"""

from __future__ import annotations

import inspect
import math
import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional, Union

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
from ._scene_changes import SceneChanges
from ._updates import Updates
from ._words import Field, ModelWord, PrecisionWord, ReduceWord, Status

if TYPE_CHECKING:
    from typing_extensions import ParamSpec

    _Arguments = ParamSpec("_Arguments")

Margin = Union[float, np.ndarray, Sequence[float], Mapping[tuple[BodyRef, BodyRef], float]]
Pairs = Union[np.ndarray, Sequence[tuple[BodyRef, BodyRef]], tuple[BodyRef, BodyRef], None]

_TableKey = tuple[int, Optional[bytes], Optional[bytes], Optional[bytes]]  #: scene revision, pairs, bodies, joints
_TABLES_KEPT = 16
_CHECKED: Any = int(Field.LOWER | Field.UPPER | Field.STATUS | Field.PAIR)  #: columns of check()


@dataclass(frozen=True)
class BodyState:
    """The current pose of a body."""

    pose: np.ndarray  #: (7,) X_wb; valid if status is OK
    status: Status  #: OK, NO_POSE or BAD_POSE
    parent: Optional[int]
    stamp_ns: int  #: publisher's clock
    age_ns: Optional[int]  #: since the pose, or the points of a cloud if older, were received; None if never


def _takes_the_arguments_of(
    query: Callable[_Arguments, Result],
) -> Callable[[Callable[..., Future]], Callable[_Arguments, Future]]:
    """Decorates a method that returns a future of the same query: gives it the signature of `query`."""

    def decorate(method: Callable[..., Future]) -> Callable[..., Future]:
        method.__signature__ = inspect.signature(query).replace(return_annotation="Future")  # type: ignore[attr-defined]
        method.__annotations__ = {**query.__annotations__, "return": "Future"}
        return method

    return decorate


class Front(MotionQueries, Certificates, Updates, SceneChanges, Parser):
    """Methods of both clearance.Engine and clearance.Client."""

    _instead: str  #: how to use one in another process, for the error of pickling

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
        signed_distance: bool = False,
        reduce: ReduceWord = "none",
        fields: Union[str, Sequence[str], None] = None,
        out: Out = None,
        timeout_s: Optional[float] = None,
        max_results: int = 1 << 20,
        max_pose_age_ns: int = 0,
        copy: bool = True,
        min_pose_stamp_ns: int = 0,
        pose_wait_s: float = 0.0,
        wait_for: BodyRef = "*",
        joints: Optional[JointsRef] = None,
        positions: Any = None,
        model: ModelWord = "truth",
        **more: Any,
    ) -> Result:
        """Returns the distances of pairs of bodies and their nearest points, on one consistent snapshot of the poses.

        pairs: (P, 2) ids; or pairs of names or ids; or pairs of groups such as ("arm", "*"), for all their enabled
            pairs. Default: all enabled pairs, or with configurations those with at least one moved body.
        configurations: (K, M, 7) or (K, M, 4, 4) poses that replace the current ones of M bodies. Children follow.
        bodies: (M,) names or ids of those bodies. Default: every movable body, in the order of ids.
        max_distance: metres; a pair proved farther is BEYOND and not refined.
        abs_tol, rel_tol: the tolerance: upper - lower <= max(abs_tol, rel_tol |distance|). The default of rel_tol is
            1e-6, or 1e-4 for "f32".
        precision: "f64" or "f32" iterations; the bounds are valid in both. Reductions and signed distances always
            iterate in float64, since float32 is no faster there; "f32" changes only their default rel_tol.
        signed_distance: adds the penetration depth of overlapping pairs; for a solid or a surface, an interval that
            contains it.
        reduce: "none", "within" (pairs nearer than max_distance), "nearest" (per body), "min" (per configuration) or
            "any" (per configuration: BEYOND if every pair is proved farther than its margin, otherwise a pair that is
            not). "any" takes no max_distance but a `margin`: metres, or (P,) metres for each pair, or
            {("arm", "*"): 0.02, ...}, where later entries win and other pairs have a margin of 0. Its column
            "free_scale" takes `weights` (J,), the motion of each joint at a scale of 1, as in free_scale().
        fields: names of the columns to return; "points" is both points, "default" is distance, lower, upper and
            status, "bounds" is lower and upper in float32, rounded outward, "points32" both points in
            float32 from their body's origin, in world axes. The default is "default", plus points and
            normal for at most 100,000 rows.
        out: a dict of arrays or an earlier result to write into; its columns set `fields`.
        timeout_s: seconds. Default: the client's timeout; no limit in process.
        max_results: maximum number of rows of reduce="within".
        max_pose_age_ns: pairs with an older pose have no distance, but Status.STALE_POSE. 0 accepts any age.
        copy: if False, a client's columns are read-only views of the transport's memory, which is released with the
            last array. In process, the result always owns its columns.
        min_pose_stamp_ns: waits for poses with this stamp or a newer one (publisher's clock); 0 to not wait. Raises
            ValueError in process, where poses are current once set_poses() returns.
        pose_wait_s: maximum wait in seconds, at most 10; then RequestError with the code POSES_LATE.
        wait_for: body or group whose poses to wait for. Bodies without any stamp are ignored, but at least one must
            have a stamp.
        joints: the result of joints(), the name of a robot or of a group of its joints, or names or ids of joints.
            Other joints and bodies keep their poses; attached bodies move with their links.
        positions: (K, J) radians and metres of those joints, for K configurations (the K of `configurations` if both
            are given). NaN or a position beyond 1e6 makes its rows BAD_POSE; one beyond the joint's limits sets
            Flag.BEYOND_LIMITS.
        model: "truth", or "pieces": a body with convex parts (mesh_as="decompose") is replaced by these, and its
            triangles are not read. The interval widens by the parts' deviation from the mesh and still contains its
            distance; containment of one body in another is tested on the mesh. Negative values of signed_distance=True
            are those of the parts (Flag.PIECES). Other bodies are unaffected.
        more: further options by name; docs/wire.md lists them. An option that is unknown to an older daemon raises
            RequestError naming it.

        Raises TypeError or ValueError naming the argument; QueryError for a query that cannot be answered;
        TimeoutError; and from a client ConnectionError and RequestError. A bad pose or an unknown id only sets the
        status of its rows.
        """
        arguments = (
            max_distance, abs_tol, rel_tol, precision, signed_distance, reduce, fields, out, timeout_s,
            max_results,
            max_pose_age_ns, copy, min_pose_stamp_ns, pose_wait_s, wait_for, joints,
        )  # fmt: skip
        rows = None if positions is None else to_floats(positions, "positions", "(K, J) numbers")
        requested = (pairs, bodies, model, *arguments)
        known, key = self._asked.find(self._scene_revision(), configurations, rows, requested, more)
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
        """Returns the configurations that are free: every pair is proved farther apart than its margin.

        configurations: as in distances(); with `joints`, and neither bodies nor positions, (K, J) joint positions.
        margin: metres >= 0; or (P,) metres, one for each pair; or {(body or group, body or group): metres}, "*" for
            every body, where later entries win and other pairs have a margin of 0.
        The other arguments are those of distances() with reduce="any". `more`: precision, rel_tol, ...

        Returns .free (K,) bool and, for configurations that are not free, .pair (K, 2) and .status (K,). Unproved
        configurations are not free: contact, an invalid pose, or a distance equal to the margin within the tolerance.
        Distances ignore joint limits: .ok (K,) bool is free and within limits, and .limit_violations lists the joints
        that are not, with their excess. Limits are those of the query's joints; without configurations, those of all
        joints at their current positions. Warns (JointLimitWarning) of positions that look like degrees. Raises as
        distances().
        """
        if joints is not None and bodies is None and positions is None:
            configurations, positions = None, configurations
        if positions is not None:
            positions = to_floats(positions, "positions", "(K, J) numbers")
        more = {"fields": _CHECKED, "timeout_s": timeout_s, **more}
        requested = {"joints": joints, "positions": positions, "margin": margin}
        result = self.distances(pairs, configurations, bodies, reduce="any", **requested, **more)
        if joints is not None:
            return Check(result, beyond_limits(positions, self._joint_table.limits(joints), "positions"))
        return Check(result, self._beyond_now(result) if configurations is None else None)

    def _beyond_now(self, result: Result) -> Optional[Beyond]:
        """Returns the joints of the scene beyond their limits. Cached until the poses change."""
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
        """Returns the size of a region of joint space around each configuration that is proved to be free.

        positions: (K, J) radians and metres of the joints, as in distances().
        weights: (J,) >= 0, radians and metres: the motion of each joint at a scale of 1. Default: 1 each.
        margin: as in check(). `more`: timeout_s, rel_tol, max_pose_age_ns, ...

        Returns (K,) float64, rounded down: the largest s for which all pairs are proved to stay beyond their margins
        while no joint moves by more than s times its weight. The value is 0 if the configuration itself is not proved
        free, and inf if no motion can reduce a distance. Ignores joint limits. Raises as distances() does, and
        QueryError for robots mounted on links that these joints move.
        """
        if joints is None:
            raise ValueError("joints: expected some, that move")
        table = self._joint_table
        rows, ids = table.rows(positions, joints)
        each = np.ones(len(ids)) if weights is None else to_floats(weights, "weights")
        requested = {"pairs": pairs, "joints": joints, "positions": rows, "margin": margin, "weights": each, **more}
        return self.distances(reduce="any", fields="free_scale", **requested).free_scale

    def prepare(self, **arguments: Any) -> Prepared:
        """Parses a query once, for a control loop that repeats it.

        arguments: those of distances(), by name. Each call reads `configurations` again if they are float64, of shape
            (K, M, 7) and in C order, and `positions` if they are float64, of shape (K, J) and in C order, so you can
            update these arrays in place between calls.

        Raises as distances() does. Names are resolved here, so prepare the query again after the scene changes.
        """
        if isinstance(arguments.get("pairs"), np.ndarray):
            arguments["pairs"] = arguments["pairs"].copy()
        return Prepared(self, self._parse_named(arguments))

    def _parse_named(self, arguments: dict[str, Any]) -> Query:
        """Parses some of the arguments of distances(), by name."""
        return self._parse(**{**_DEFAULTS, **arguments})

    @_takes_the_arguments_of(distances)
    def submit(self, *arguments: Any, **more: Any) -> Future:
        """Starts the query of distances() and returns a future: .result(timeout=None), .done(), .cancel().

        In process, the poses are those at this call; through a daemon, those at the request's arrival.
        """
        if len(arguments) > len(_DEFAULTS):
            raise TypeError(f"submit() takes at most {len(_DEFAULTS)} positional arguments, got {len(arguments)}")
        return self._start(self._parse_named(dict(**dict(zip(_DEFAULTS, arguments)), **more)))

    def _result(self, query: Query, answer: Any) -> Result:
        return Result(answer, query.reduce, query.out, query.known_pairs(), TableOf(self, query))


_DEFAULTS = {
    name: p.default for name, p in inspect.signature(Front.distances).parameters.items() if name not in ("self", "more")
}
