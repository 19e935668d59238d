"""The queries of an engine or a client: arguments in, results out."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Optional, Union

import numpy as np

from .._arguments import to_count, to_list, to_word
from .._joints import JointsRef
from .._names import Bodies, Margin, Pairs
from .._words import ReduceWord
from .calls import CALLS
from .certificate import Certificate
from .check import Check
from .future import Future
from .meanwhile import Meanwhile
from .path import PathCheck
from .prepared import Prepared, check_arguments
from .query import Run
from .result import Result
from .stop import Others, StopCheck

Fields = Union[str, Sequence[str], None]
MotionReduceWord = Literal["none", "min", "any"]


class Queries:
    """The methods of Front for queries. A parameter with the name of a row in wire/query_options.h is that option."""

    _module: Any
    _prepared_only: frozenset[str] = frozenset()  #: arguments of prepare() in addition to options of queries

    # ---- for subclasses -------------------------------------------------------------------------------------------

    def _certify(
        self, rows: Optional[np.ndarray], run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]
    ) -> str:
        raise NotImplementedError

    # ---- calls ----------------------------------------------------------------------------------------------------

    def distances(
        self,
        pairs: Pairs = None,
        configurations: Any = None,
        bodies: Bodies = None,
        joints: Optional[JointsRef] = None,
        reduce: ReduceWord = "none",
        margin: Margin = 0.0,
        max_distance: float = math.inf,
        abs_tol: float = 0.0,
        rel_tol: Optional[float] = None,
        signed_distance: bool = False,
        fields: Fields = None,
        timeout_s: Optional[float] = None,
    ) -> Result:
        """Returns the distances of pairs of bodies and their nearest points, on one consistent snapshot of the poses.

        Every call parses its arguments, which takes 15 to 40 us: prepare() a query that repeats.

        pairs: (P, 2) ids; or pairs of names or ids; or pairs of groups such as ("arm", "*"), for all their enabled
            pairs. Default: all enabled pairs, or with configurations those with at least one moved body. The time grows
            with their number.
        configurations: (K, M, 7) or (K, M, 4, 4) poses that replace the current ones of M bodies, metres. Children
            follow. With `joints`, (K, J) radians and metres; with joints and bodies, a pair (positions, poses).
            Default: the current poses. NaN or a position beyond 1e6 makes its rows BAD_POSE; one beyond the joint's
            limits sets Flag.BEYOND_LIMITS.
        bodies: (M,) names or ids of those bodies. Default: every movable body, in the order of ids; with joints, none.
        joints: the result of joints(), the name of a robot or of a group of its joints, or names or ids of joints.
            Other joints and bodies keep their poses; attached bodies move with their links. Default: none.
        reduce: rows of the answer: "none" for each pair, "within" for the pairs nearer than max_distance, "nearest" for
            each body, "min" for each configuration the nearest pair, "any" for each configuration BEYOND if every pair
            is proved farther than its margin, otherwise a pair that is not. Default: "none", the most expensive.
        margin: metres >= 0 that "any" decides by, as in check(). Default: 0.
        max_distance: metres; a pair proved farther is BEYOND and not refined, which saves most of the time in large
            scenes. Not for "any". Default: inf, which refines every pair.
        abs_tol, rel_tol: metres, ratio: the tolerance: upper - lower <= max(abs_tol, rel_tol |distance|). Defaults: 0
            and 1e-6 (1e-4 with precision="f32"); curved shapes take longer with smaller tolerances.
        signed_distance: adds the penetration depth of overlapping pairs; for a solid or a surface, an interval that
            contains it. Default: False, since depths take several times the time of the pair.
        fields: names of the columns to return; "points" is both points, "default" is distance, lower, upper and
            status, "bounds" is lower and upper in float32, rounded outward, "points32" is both points in float32, each
            relative to its body's origin in world axes. The default is "default", plus points and normal for at most
            100,000 rows, which cost up to a third more time.
        timeout_s: seconds. Default: the client's timeout; no limit in process.

        Raises TypeError or ValueError naming the argument; QueryError for a query that cannot be answered;
        TimeoutError; and from a client ConnectionError and RequestError. A bad pose or an unknown id only sets the
        status of its rows.
        """
        return self._once("distances", locals())

    def check(
        self,
        configurations: Any = None,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        bodies: Bodies = None,
        joints: Optional[JointsRef] = None,
        timeout_s: Optional[float] = None,
    ) -> Check:
        """Returns the configurations that are free: every pair is proved farther apart than its margin.

        configurations, pairs, bodies, joints, timeout_s: as in distances().
        margin: metres >= 0; or (P,) metres, one for each pair; or {(body or group, body or group): metres}, "*" for
            every body, where later entries win and other pairs have a margin of 0. Default: 0, which proves that
            nothing touches.

        Returns .free (K,) bool and, for configurations that are not free, .pair (K, 2) and .verdict (K,). Unproved
        configurations are not free: contact, an invalid pose, or a distance equal to the margin within the tolerance.
        For distances of the pairs use distances(reduce="any", margin=...).
        Distances ignore joint limits: .ok (K,) bool is free and within limits, and .limit_violations lists the joints
        that are not, with their excess. Limits are those of the query's joints; without configurations, those of all
        joints at their current positions, which costs a client a request after each change of poses. Warns
        (JointLimitWarning) of positions that look like degrees. Raises as distances().
        """
        return self._once("check", locals())

    def motions(
        self,
        start: Any,
        end: Any = None,
        joints: Optional[JointsRef] = None,
        bodies: Bodies = None,
        pairs: Pairs = None,
        reduce: MotionReduceWord = "min",
        margin: Margin = 0.0,
        max_distance: float = math.inf,
        abs_tol: Optional[float] = None,
        rel_tol: Optional[float] = None,
        max_evaluations: int = 256,
        fields: Fields = None,
        timeout_s: Optional[float] = None,
        meanwhile: Meanwhile = None,
    ) -> Result:
        """Returns the least distances of bodies along whole continuous motions, with certified bounds, not samples.

        start, end: (K, J) radians and metres of `joints` for K motions, which are straight lines. A continuous joint
            does not wrap: from 3.1 to -3.1, it turns by 6.2 radians. Without `joints`, (K, M, 7) or (K, M, 4, 4) poses
            of `bodies`, which move linearly and turn at a constant speed in the shorter direction (flag HALF_TURN if
            both are nearly equal). With joints and bodies, a pair (positions, poses) each. Without `end`, the default,
            `start` is a Trajectory, or (K, D + 1, J) Bezier control points of joints, with D from 1 to 7.
        joints, bodies, pairs, timeout_s: as in distances().
        reduce: "min" for a row per motion, the minimum of all pairs; "none" for a row per motion and pair; "any" for a
            row per motion, BEYOND if every pair is proved farther than its margin throughout, otherwise another pair.
            Default: "min"; "any" takes a fraction of its time.
        margin: the margin of `first_contact` and reduce="any", as in check(). Default: 0.
        max_distance: as in distances(). Default: inf.
        abs_tol, rel_tol: metres, ratio: the tolerance of upper - lower. The defaults are 1 mm and 0 for distances; 0
            and 1e-6 for reduce="any", which decide nearly every motion.
        max_evaluations: maximum evaluations per motion. Beyond it the status is UNCONVERGED; the bounds remain valid.
            Default: 256; most motions need fewer than 20.
        fields: as in distances(). The columns `time`, `first_contact` and `steps` exist for motions only, and are
            returned by default. For reduce="any" the default is status, verdict, flags, pair and time: bounds and steps
            take several times as long where a motion is free, and `first_contact` where it is not. `gradient` and
            signed distances are not available.
        meanwhile: {body: (2, 7) poses at the ends of all motions, (K, D + 1, 7) Bezier control poses or a BodyPath} of
            bodies that move meanwhile. Witness points are on bodies as they are without growth. Default: none.

        Columns begin with (K,), or (K, P) for reduce="none". [lower, upper] contains the least distance of the whole
        motion, both ends included. `time`, 0 to 1, is the time of the witness points. `first_contact` (..., 2) is the
        time until which all pairs are proved farther than the margin, and a time at which a pair is proved within it;
        inf if there is none.

        Raises as distances() does.
        """
        return self._once("motions", locals())

    def check_path(
        self,
        path: Any,
        joints: Optional[JointsRef] = None,
        bodies: Bodies = None,
        pairs: Pairs = None,
        margin: Margin = 0.0,
        max_evaluations: int = 256,
        timeout_s: Optional[float] = None,
        meanwhile: Meanwhile = None,
    ) -> PathCheck:
        """Returns whether a path is free: every pair is proved farther than its margin along the whole path.

        path: (N, J) positions of `joints`, (N, M, 7) poses of `bodies`, or a pair of both, for N - 1 motions in a row;
            or a Trajectory of `joints`, for its segments.
        joints, bodies, pairs, margin, max_evaluations: as in motions() with reduce="any".
        timeout_s: as in distances(), of each of the queries, which have up to 1024 motions.
        meanwhile: {body: poses or a BodyPath} of bodies that move over the seconds of the Trajectory, or of waypoints a
            second apart. Default: none.

        Stops at the first motion that is not proved free. `ok` of the result includes the joints' limits, `free` does
        not. Warns (JointLimitWarning) of positions that look like degrees. Raises ValueError for fewer than two
        waypoints, and as motions() does.
        """
        return self._once("check_path", locals())

    def check_stop(
        self,
        positions: Any,
        velocities: Any,
        joints: JointsRef,
        deceleration: Any,
        reaction_s: float = 0.0,
        others: Others = None,
        pairs: Pairs = None,
        margin: float = 0.0,
        together: bool = True,
        timeout_s: Optional[float] = None,
    ) -> StopCheck:
        """Returns whether a robot that brakes stops before any contact, and the greatest speed for which it does.

        positions, velocities: (J,) of `joints` now: radians and metres, rad/s and m/s.
        deceleration: (J,) or a number, rad/s^2 and m/s^2: what every brake reaches at least.
        reaction_s: seconds from the measurement of `positions` until the brakes act, at these velocities. Default: 0.
        others: {body or group: m/s}: bodies that may move, anywhere, and the greatest speed of their points and of
            those of bodies that follow them. Each must have received a pose. Its age counts, and so does the time to
            standstill. Only pairs of the query count: others that have none are passed over. Default: none, all stand
            still.
        pairs, joints, timeout_s: as in check_path().
        margin: metres >= 0 that are kept from everything, such as an intrusion distance. Default: 0.
        together: True, the default: all joints stop at one time, on a straight line, as a stop that keeps the path. The
            proof then covers harder braking along the line, too. If False, each joint stops as soon as it can, at
            exactly its deceleration.

        Others have their whole reach until standstill at every state of the path, as in S_h of ISO 10218-2; their
        motion after standstill is not considered. Raises ValueError also for others without a received pose, and
        otherwise as check_path() does.
        """
        return self._once("check_stop", locals())

    def free_scale(
        self,
        positions: Any,
        joints: JointsRef,
        weights: Any = None,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        timeout_s: Optional[float] = None,
    ) -> np.ndarray:
        """Returns the size of a region of joint space around each configuration that is proved to be free.

        positions: (K, J) radians and metres of `joints`, as `configurations` of distances().
        weights: (J,) >= 0, radians and metres: the motion of each joint at a scale of 1. Default: 1 each.
        joints, margin, pairs, timeout_s: as in check().

        Returns (K,) float64, rounded down: the largest s for which all pairs are proved to stay beyond their margins
        while no joint moves by more than s times its weight. The value is 0 if the configuration itself is not proved
        free, and inf if no motion can reduce a distance. Ignores joint limits. Raises as distances() does, and
        QueryError for robots mounted on links that these joints move.
        """
        return self._once("free_scale", locals())

    def certificate(self, rows: Optional[Sequence[int]] = None, **arguments: Any) -> Certificate:
        """Evaluates rows of a query on the current poses, and returns them with proofs of their bounds.

        rows: row numbers: k * P + p for pair p in configuration or motion k, or k for reduced motions. Default: all.
        arguments: those of distances(), by name, with reduce="none". The bounds have the bits of distances() on the
            same poses, unless their uncertainty grows with age, or covers answer at a wide tolerance. Or those of
            motions(), including `start` and `end`, with any reduction; `first_contact` is proved, too, unless `fields`
            excludes it. Options of prepare(), too.

        Takes ten times as long as the query. The rows of a configuration's pairs prove its reduction. Raises as
        distances() and motions(), and QueryError for a row outside the answer; a daemon also for a document of more
        than 64 MiB.
        """
        call = "motions" if "start" in arguments or "end" in arguments else "distances"
        inputs = [arguments.pop(name, None) for name in CALLS[call].inputs]
        prepared = self.prepare(call, **arguments)
        numbers = None
        if rows is not None:
            each = [to_count(row, f"rows[{i}]") for i, row in enumerate(to_list(rows, "rows", "row numbers"))]
            numbers = np.array(each, dtype=np.uint64)
        certify = functools.partial(self._certify, numbers)
        return Certificate(prepared._retried(certify, prepared._call.read(*inputs)))

    # ---- prepared and submitted -----------------------------------------------------------------------------------

    def prepare(self, call: str = "distances", **arguments: Any) -> Prepared:
        """Parses a call once, for a planner or a control loop: run() costs about 1 us more than the engine.

        call: "distances" (the default), "check", "motions", "check_path", "check_stop" or "free_scale".
        arguments: those of that method by name, without its inputs (`configurations`; `start` and `end`; `path`;
            `positions`; `positions` and `velocities`), which run() takes. And these, which only prepared queries have:

            precision: "f64" or "f32" iterations; the bounds are valid in both. Reductions and signed distances always
                iterate in float64, since float32 is no faster there; "f32" changes only their default rel_tol.
            max_results: maximum number of rows of reduce="within". Default: 1,048,576, for which memory is reserved.
            k: with reduce="nearest", rows of the min(k, P) nearest pairs of each configuration, in the order of the
                query's pairs, so that a pair keeps its place among the others from cycle to cycle. A pair without
                usable poses counts as the nearest. Default: 0, the nearest pair of each body.
            speed_errors: of distances(), for the column "rate_bounds": (J + 2 M,) bounds >= 0 on the errors of a run's
                velocities, in rad/s and m/s of each joint, and of its twists, in rad/s and m/s of each body.
            max_pose_age_ns: pairs with an older pose have no distance, but Status.STALE_POSE. Default: 0, any age.
            abs_tol, rel_tol: as in distances(), also for check(), check_path() and free_scale().
            deadline_ns (Client): the daemon rejects a query that it cannot answer in this time. Default: 0, no limit.
            copy (Client): if False, columns are read-only views of the transport's memory, which is released with the
                last array. Over shared memory there are few slots; if all are in use, the next call raises
                ConnectionError. Default: True.

        Names become ids here, and the query keeps these: see Prepared. Raises as that method does, and TypeError for an
        argument that it does not take. Errors of the arguments alone are raised here; from a client, those that need
        the daemon's scene are raised by run().
        """
        to_word(call, CALLS, "call")
        everyday = _everyday(call)
        check_arguments(call, everyday, self._module, self._prepared_only, arguments)
        return Prepared(self, call, {**everyday, **arguments})._checked()  # type: ignore[arg-type]

    def submit(self, *arguments: Any, **named: Any) -> Future:
        """Starts distances(), with its arguments, and returns a future: .result(), .done(), .cancel(), or await it.

        In process, the poses are those at this call; through a daemon, those at the request's arrival.
        """
        bound = _SIGNATURES["distances"].bind(self, *arguments, **named)
        bound.apply_defaults()
        prepared, inputs = self._parsed("distances", bound.arguments)
        return prepared.submit(*inputs)

    def _once(self, call: str, arguments: dict[str, Any]) -> Any:
        """Answers a call. arguments: all of them by name, and self."""
        prepared, inputs = self._parsed(call, arguments)
        return prepared._run(*inputs)

    def _parsed(self, call: str, arguments: Mapping[str, Any]) -> tuple[Prepared, list[Any]]:
        given = dict(arguments)
        del given["self"]
        inputs = [given.pop(name) for name in CALLS[call].inputs if name in given]
        return Prepared(self, call, given), inputs  # type: ignore[arg-type]  # subclasses have the other members


_SIGNATURES = {call: inspect.signature(getattr(Queries, call)) for call in CALLS}


@functools.cache
def _everyday(call: str) -> dict[str, Any]:
    """Returns the defaults of a call's parameters that are no inputs; None for those without one."""
    parameters = [p for name, p in _SIGNATURES[call].parameters.items() if name not in ("self", *CALLS[call].inputs)]
    return {p.name: None if p.default is p.empty else p.default for p in parameters}


# submit() has the signature of distances(), and returns a future.
Queries.submit.__signature__ = _SIGNATURES["distances"].replace(return_annotation="Future")  # type: ignore[attr-defined]
Queries.submit.__annotations__ = {**Queries.distances.__annotations__, "return": "Future"}
