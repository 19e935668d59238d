"""Futures of calls under way, and the threads that advance them."""

from __future__ import annotations

import concurrent.futures
import math
import threading
import time
import weakref
from collections.abc import Generator
from typing import Any, Optional, Protocol

from .._arguments import to_number_from_0
from .._errors import QueryError, TimeoutError

_WRONG_SCENE = 2
_SLICE_S = 0.1  # of a caller in result()
_YIELD_S = 0.0005  # for other threads with the same future, between slices


class Runner(Protocol):
    """The members of an Engine or a Client that calls under way use."""

    def _poll(self, job: Any, seconds: float) -> bool: ...
    def _take(self, job: Any) -> Any: ...
    def _abandon(self, job: Any) -> None: ...


class Preparation(Protocol):
    """The members of a prepared query that calls under way use."""

    @property
    def _runner(self) -> Any: ...
    def _begin(self, request: Any) -> Any: ...


class Task:
    """A call under way, which answers one query after another. Not thread-safe."""

    result: Any = None  #: valid once advance() has returned True

    def __init__(self, prepared: Preparation, steps: Generator[Any, Any, Any]):
        self._prepared, self._steps = prepared, steps
        self._runner: Runner = prepared._runner
        self._request = next(steps)
        self._job: Any = prepared._begin(self._request)

    def advance(self, seconds: float) -> bool:
        """Works, or waits for the daemon, for about that long. Returns True once the call is complete."""
        if not self._runner._poll(self._job, seconds):
            return False
        try:
            answer = self._runner._take(self._job)
        except QueryError as error:
            if error.code != _WRONG_SCENE:
                raise
            self._job = self._prepared._begin(self._request)  # raises StaleQuery if the ids mean something else
            return False
        try:
            self._request = self._steps.send(answer)
        except StopIteration as done:
            self.result = done.value
            return True
        self._job = self._prepared._begin(self._request)
        return False

    def abandon(self) -> None:
        self._runner._abandon(self._job)


class Future(concurrent.futures.Future):  # type: ignore[type-arg]  # generic from Python 3.9 on, for checkers only
    """The future result of a call: a concurrent.futures.Future that can also be awaited."""

    def __init__(self, worker: Worker, task: Task, timeout_s: Optional[float], is_driven_by_caller: bool):
        super().__init__()
        self._worker, self._task, self._timeout_s = worker, task, timeout_s
        self._is_driven_by_caller = is_driven_by_caller
        self._turn = threading.RLock()  # held while the task advances
        self._is_over = False
        self._is_given_up = False  # by cancel(), which waits for the turn

    def __reduce__(self) -> Any:
        raise TypeError("a future cannot be pickled or copied: send its result()")

    def __await__(self) -> Any:
        import asyncio  # a quarter of the time to import this package

        return asyncio.wrap_future(self).__await__()

    def result(self, timeout: Optional[float] = None) -> Any:
        """Waits for the result for at most `timeout` seconds. Default: the call's timeout_s, else the client's.

        Raises TimeoutError, after which you can call it again, and the errors of the call.
        """
        return self._within(timeout, super().result)

    def exception(self, timeout: Optional[float] = None) -> Any:
        """Waits as result() does, and returns the error of the call, or None."""
        return self._within(timeout, super().exception)

    def done(self) -> bool:
        """Whether result() returns or raises immediately."""
        if self._is_driven_by_caller and not self._is_over:
            self._advance(0.0)
        return super().done()

    def cancel(self) -> bool:
        """Cancels the call. Returns False if its result is there."""
        if self.done():
            return self.cancelled()
        self._is_given_up = True  # so that the worker does not take the turn again and again before this thread
        with self._turn:
            if self._is_over:
                return self.cancelled()
            self._is_over = True
            super().cancel()
            self.set_running_or_notify_cancel()
            self._task.abandon()
        return True

    def add_done_callback(self, fn: Any) -> None:
        """Calls `fn` with this future once it is done, which keeps the future alive until then."""
        self._worker.keep(self)
        super().add_done_callback(fn)

    def _within(self, timeout: Optional[float], wait: Any) -> Any:
        seconds = self._timeout_s if timeout is None else to_number_from_0(timeout, "timeout")
        left = seconds
        if self._is_driven_by_caller:
            self._drive(seconds)
            left = 0
        try:
            return wait(left)
        except concurrent.futures.TimeoutError as error:
            if super().done():
                raise
            raise TimeoutError(f"no answer within {seconds:g} s") from error

    def _drive(self, seconds: Optional[float]) -> None:
        """Advances the call on this thread until it is over, or for so long. Other threads may do that as well."""
        end = math.inf if seconds is None else time.monotonic() + seconds
        while True:
            left = min(max(end - time.monotonic(), 0.0), _SLICE_S)
            if self._turn.acquire(timeout=left):
                try:
                    self._advance(left)
                    if self._is_over:
                        return
                finally:
                    self._turn.release()
            if time.monotonic() >= end:
                return
            time.sleep(_YIELD_S)

    def _advance(self, seconds: float) -> bool:
        """Advances the call, unless another thread does. Returns whether it is over."""
        if not self._turn.acquire(blocking=False):
            return False
        try:
            if self._is_over or self._is_given_up:
                return self._is_over
            try:
                is_complete, error = self._task.advance(seconds), None
            except Exception as raised:
                is_complete, error = True, raised
            if not is_complete:
                return False
            self._is_over = True
            self.set_running_or_notify_cancel()
            if error is None:
                self.set_result(self._task.result)
            else:
                self.set_exception(error)
            return True
        finally:
            self._turn.release()


class Worker:
    """A thread that advances all calls under way in turn, so that none blocks another. Ends when none is left.

    Calls whose future is not referenced are abandoned, except those with callbacks.
    """

    def __init__(self, slice_s: float, pause_s: float):
        self._slice_s, self._pause_s = slice_s, pause_s
        self._lock = threading.Lock()
        self._futures: list[weakref.ref[Future]] = []
        self._kept: set[Future] = set()
        self._is_running = False

    def add(self, future: Future) -> Future:
        with self._lock:
            self._futures.append(weakref.ref(future))
            if not self._is_running:
                self._is_running = True
                threading.Thread(target=self._run, name="clearance", daemon=True).start()
        return future

    def keep(self, future: Future) -> None:
        """Keeps a future alive until it is over."""
        with self._lock:
            if not future._is_over:
                self._kept.add(future)

    def _run(self) -> None:
        while True:
            with self._lock:
                self._futures = [ref for ref in self._futures if not _is_over(ref())]
                self._kept = {future for future in self._kept if not future._is_over}
                if not self._futures:
                    self._is_running = False
                    return
                refs = list(self._futures)
            is_over = False
            for ref in refs:
                future = ref()
                if future is not None:
                    is_over |= future._advance(self._slice_s)
                del future
            if not is_over and self._pause_s:
                time.sleep(self._pause_s)


def _is_over(future: Optional[Future]) -> bool:
    return future is None or future._is_over
