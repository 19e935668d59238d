"""Prepared queries, which are parsed once and run many times."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, Callable, Optional, Protocol

import numpy as np

from .._arguments import did_you_mean, to_count
from .._errors import QueryError, StaleQuery
from .._names import NameTable
from .._words import DEFAULT_FIELDS, FIELD_MASKS, Reduce
from .call import Call, Request, Steps
from .calls import CALLS, Checks
from .conversions import NO_ARGUMENTS
from .future import Future, Task
from .query import Query, Run, Source
from .result import Result

_WRONG_SCENE = 2
_MOST_RENEWALS = 100  # of one run, while other threads change the scene

#: Hints on arguments that a call does not take, by name.
_INSTEAD = {"model": "; set abs_tol or rel_tol for faster answers with wider intervals"}

#: Answers a query of joints alone for arrays that need no conversion; None for others.
AskRows = Callable[..., Any]


class Runner(Source, Protocol):
    """The members of an Engine or a Client that a prepared query uses."""

    _names_cache: Optional[NameTable]

    def _answer(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any: ...
    def _check(self, run: Run, *no_input: None) -> None: ...
    def _ask_rows(self, query: Query) -> Optional[AskRows]: ...
    def _begin(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any: ...
    def _start(self, task: Task, timeout_s: Optional[float]) -> Future: ...
    def _open_plan(self, configurations: int, run: Run, *no_input: None) -> Any: ...
    def _refresh_names(self) -> None: ...
    def _beyond_now(self, result: Result) -> Any: ...


class Prepared:
    """A call with parsed arguments, which runs many times with different inputs. Thread-safe.

    Created by prepare(). The memory of a result is reused once no array of that result exists any more, never before.
    Survives changes of the scene in which its ids keep their meaning; otherwise calls raise StaleQuery.
    """

    def __init__(self, runner: Runner, call: str, arguments: dict[str, Any]):
        kind = CALLS[call]
        self._runner = runner
        self._query = Query(runner, call, kind.options(arguments))
        self._call = kind(self._query)
        self._name = call
        self._in_steps = kind.steps is not Call.steps
        self._takes_rows = self._query.joints is not None and self._query.bodies is None
        self._by_rows: Optional[tuple[Run, AskRows]] = None  # for arrays of the usual type
        if isinstance(self._call, Checks):
            self._call.current_limits = runner._beyond_now

    def _checked(self) -> Prepared:
        """Raises QueryError for arguments that are wrong with any inputs. Returns this query."""
        query = self._query
        moves = query.bodies is not None or query.joints is not None or "configurations" not in self._call.inputs
        run = query.made(moves, DEFAULT_FIELDS if query.mask is None else query.mask)
        self._retried(self._runner._check, (run, None, None))
        return self

    def __reduce__(self) -> Any:
        raise TypeError("a prepared query cannot be pickled or copied: send its arguments, and prepare it there")

    def run(self, *inputs: Any) -> Any:
        """Answers the call for the current poses, and returns the result of the method of that name.

        inputs: the call's inputs in their order: `configurations` (optional) of distances() and check(), `start` and
            `end` of motions(), `path` of check_path(), `positions` of free_scale(). float64 arrays in C order are read
            in place; others are converted first, which costs about 1 us and more.

        After `configurations` of distances() may come velocities, for the columns "rate", "rate_bounds" and
        "curvature": (K, J) rad/s and m/s of `joints`, and then twists, (K, M, 6) of `bodies`: rad/s, and m/s of the
        origin, world axes; of a body with a parent, relative to it. None, the default, stands still. Without
        configurations, velocities are those of set_joints() and set_poses().

        Raises as that method does, and StaleQuery.
        """
        by_rows, call = self._by_rows, self._call
        if by_rows is not None and call.least_rows <= len(inputs) <= call.most_rows and inputs[-1] is not None:
            run, ask = by_rows
            if self._in_steps and not _is_motion(inputs[0]):
                return self._run(*inputs)
            if run.names is self._runner._names_cache:
                try:
                    answer = ask(run.raw, *inputs)
                except QueryError as error:
                    if error.code != _WRONG_SCENE:
                        raise
                    answer = None
                result = None if answer is None else call.result(run, answer, inputs[0])
                if result is not None:
                    return result
        result = self._run(*inputs)
        if self._takes_rows:
            ask_rows = self._runner._ask_rows(self._query)
            self._by_rows = None if ask_rows is None else (self._query.run(True, 1), ask_rows)
        return result

    def _run(self, *inputs: Any) -> Any:
        if self._in_steps:
            return self._run_steps(self._call.steps(*inputs))
        if self._runner._names_cache is not self._query.names:
            self._query.renew()
        run, poses, positions = self._call.read(*inputs)
        try:
            answer = self._runner._answer(run, poses, positions)
        except QueryError as error:
            if error.code != _WRONG_SCENE:
                raise
            return self._run_steps(self._call.steps(*inputs))
        return self._call.result(run, answer, positions)

    def submit(self, *inputs: Any) -> Future:
        """Starts the call, and returns a future of its result, which can also be awaited.

        In process, the poses are those at this call; through a daemon, those at the request's arrival.
        """
        return self._runner._start(Task(self, self._call.steps(*inputs)), self._query.timeout_s)

    def on_device(self, configurations: int = 0) -> Any:
        """Returns a query that reads its input from GPU memory and writes its columns to GPU memory (docs/cuda.md).

        configurations: K, the number of configurations in each run; 0 for one configuration, the current poses.

        For the call "distances" with reduce "none", "min" or "any". The default of `fields` is lower and upper, and the
        status for "any". Other bodies keep their current poses. A Client's query runs in the memory of the daemon's
        GPU, mapped into this process without host copies, over shm:// and ipc:// on the daemon's machine.

        Raises QueryError for unsupported queries (depths, other reductions, bodies with a max_speed, limits on the age
        of poses, surfaces) and for an engine without a GPU or with several; from a client also RequestError (BUSY)
        beyond the daemon's limits, and ConnectionError if this process has no driver or does not see that GPU.
        """
        if self._name != "distances":
            raise TypeError(f"on_device: only for the call 'distances', not for {self._name!r}")
        count, query = to_count(configurations, "configurations"), self._query
        if count == 0 and (query.bodies is not None or query.joints is not None):
            raise ValueError("configurations: expected 1 or more, since bodies or joints move")
        mask = query.mask
        if mask is None:
            by_default = ("status",) if query.reduce == Reduce.ANY else ("lower", "upper")
            mask = sum(FIELD_MASKS[name] for name in by_default)
        open_plan = functools.partial(self._runner._open_plan, count)
        return self._retried(open_plan, (query.with_columns(count > 0, mask), None, None))

    @property
    def is_stale(self) -> bool:
        """Whether run() would raise StaleQuery. A client fetches the daemon's scene for that, as refresh() does."""
        self._runner._refresh_names()
        try:
            self._query.renew()
        except StaleQuery:
            return True
        return False

    def __repr__(self) -> str:
        return f"<clearance.Prepared {self._name}({', '.join(self._call.inputs)})>"

    # ---- scenes that change ---------------------------------------------------------------------------------------

    def _run_steps(self, steps: Steps) -> Any:
        try:
            request = next(steps)
            while True:
                request = steps.send(self._retried(self._runner._answer, request))
        except StopIteration as done:
            return done.value

    def _begin(self, request: Request) -> Any:
        return self._retried(self._runner._begin, request)

    def _retried(self, call: Any, request: Request) -> Any:
        """Calls with a query for the current scene, again if another thread or client changes it meanwhile."""
        run, poses, positions = request
        for again in range(_MOST_RENEWALS):
            run = self._current(run)
            try:
                return call(run, poses, positions)
            except QueryError as error:
                if error.code != _WRONG_SCENE or again == _MOST_RENEWALS - 1:
                    raise
                self._runner._refresh_names()
        raise AssertionError

    def _current(self, run: Run) -> Run:
        """Returns the same query for the current scene."""
        query = self._query
        if self._runner._names_cache is not query.names:
            query.renew()
        if run.names.revision == query.names.revision:
            return run
        if run.growths is not None:
            return query.growing(run.mask, run.points, run.growths)
        if run.margins is not None:
            return query.widened(run.mask, run.points, run.margins)
        now = query.with_columns(run.bodies is not None or run.joints is not None, run.mask, run.points)
        return now if run.speeds is None else now.at_speeds(*run.speeds)


def _is_motion(path: Any) -> bool:
    """Whether a path has two waypoints, which one query answers."""
    return type(path) is np.ndarray and path.shape[:1] == (2,)


def check_arguments(
    call: str, everyday: Iterable[str], module: Any, extra: Iterable[str], arguments: Iterable[str]
) -> None:
    """Raises TypeError for an argument that a call does not take.

    everyday: the parameters of the method. extra: arguments of any prepared query, in addition to the options of
        wire/query_options.h.
    """
    kind = CALLS[call]
    options = set(module.OPTIONS) - NO_ARGUMENTS - {"max_evaluations"} - set(kind.fixed)
    known = options.union(everyday, extra, kind.extra)
    for name in arguments:
        if name not in known:
            hint = _INSTEAD.get(name, did_you_mean(name, known))
            raise TypeError(f"prepare({call!r}) got an unexpected argument {name!r}{hint}")
