"""Futures of running queries."""

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
    """The future result of a query."""

    def __reduce__(self) -> Any:
        raise TypeError("a future cannot be pickled or copied: send its result()")

    def result(self, timeout: Optional[float] = None) -> Result:
        """Waits for the answer for at most `timeout` seconds. Default: the query's timeout_s.

        Raises TimeoutError, after which you can call it again, and the errors of distances().
        """
        raise NotImplementedError

    def done(self) -> bool:
        """Whether result() returns or raises immediately."""
        raise NotImplementedError

    def cancel(self) -> bool:
        """Cancels the query. Returns False if the answer has arrived."""
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
    """One thread that runs time slices of all submitted jobs in turn, so that a long job blocks no other."""

    def __init__(self) -> None:
        self._executor = concurrent.futures.ThreadPoolExecutor(1, thread_name_prefix="clearance")
        self._jobs: deque[tuple[Any, Callable[[Any], Result], concurrent.futures.Future[Result]]] = deque()
        self._lock = threading.Lock()
        self._running = False

    def submit(self, job: Any, finish: Callable[[Any], Result]) -> concurrent.futures.Future[Result]:
        """Runs `job` to completion and sets the future's result to finish(job)."""
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
            # The state stays PENDING until the end, so that the job can be cancelled between slices.
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
