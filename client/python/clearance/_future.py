"""Futures of queries that are under way."""

from __future__ import annotations

import concurrent.futures
import threading
from collections import deque
from typing import Any, Callable, Optional

from ._arguments import to_number_from_0
from ._errors import TimeoutError
from ._result import Result

_SLICE_NS = 2_000_000


class Future:
    """The result of a query to come."""

    def __reduce__(self) -> Any:
        raise TypeError("a future cannot be pickled or copied: send its result()")

    def result(self, timeout: Optional[float] = None) -> Result:
        """Waits for the answer, at most `timeout` seconds (None: the query's timeout_s).

        Raises TimeoutError, after which it may be called again, and what distances() raises.
        """
        raise NotImplementedError

    def done(self) -> bool:
        """Whether result() would return or raise at once."""
        raise NotImplementedError

    def cancel(self) -> bool:
        """Gives up on the answer. Returns False if it is already there."""
        raise NotImplementedError


class EngineFuture(Future):
    """A query on an in-process engine; `concurrent` is its concurrent.futures.Future, for asyncio.wrap_future()."""

    def __init__(self, concurrent: concurrent.futures.Future[Result], timeout_s: Optional[float]):
        self.concurrent = concurrent
        self._timeout_s = timeout_s

    def result(self, timeout: Optional[float] = None) -> Result:
        timeout = self._timeout_s if timeout is None else to_number_from_0(timeout, "timeout")
        try:
            return self.concurrent.result(timeout)
        except concurrent.futures.TimeoutError as error:
            if self.concurrent.done():
                raise
            raise TimeoutError(f"no answer within {timeout} s") from error

    def done(self) -> bool:
        return self.concurrent.done()

    def cancel(self) -> bool:
        return self.concurrent.cancel()


class Worker:
    """One thread that works on all submitted jobs in turn, a slice of each, so that a long one blocks none."""

    def __init__(self) -> None:
        self._executor = concurrent.futures.ThreadPoolExecutor(1, thread_name_prefix="clearance")
        self._jobs: deque[tuple[Any, Callable[[Any], Result], concurrent.futures.Future[Result]]] = deque()
        self._lock = threading.Lock()
        self._running = False

    def submit(self, job: Any, finish: Callable[[Any], Result]) -> concurrent.futures.Future[Result]:
        """Works on `job` until it is done; the future's result is then finish(job)."""
        future: concurrent.futures.Future[Result] = concurrent.futures.Future()
        with self._lock:
            self._jobs.append((job, finish, future))
            if not self._running:
                self._executor.submit(self._drain)
                self._running = True
        return future

    def _drain(self) -> None:
        while True:
            with self._lock:
                if not self._jobs:
                    self._running = False
                    return
                job, finish, future = self._jobs.popleft()
            # Cancelled between slices: the job is dropped here. The state stays PENDING to the end, so that it can be.
            if future.cancelled():
                future.set_running_or_notify_cancel()
                continue
            try:
                if not job.advance(_SLICE_NS):
                    with self._lock:
                        self._jobs.append((job, finish, future))
                    continue
                result = finish(job)
            except BaseException as error:
                if future.set_running_or_notify_cancel():
                    future.set_exception(error)
                continue
            if future.set_running_or_notify_cancel():
                future.set_result(result)
