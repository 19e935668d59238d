"""Workers as processes on this machine, each started as a program, since an engine does not survive a fork."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections import deque
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Union

from ._run import Event, Lost, Ready, Result
from ._scenes import Packed
from ._work import Failed, Outcome, Performs, Spec, Task, Worker, machine


class Processes:
    """A pool of processes, which end with this process because their socket closes."""

    def __init__(self, spec: Spec, packed: Packed, count: int):
        self.size = count
        self._start_with = (spec, packed)
        self._next = 0
        self._children: dict[int, tuple[subprocess.Popen[bytes], Connection]] = {}
        self._events: deque[Event] = deque()
        for _ in range(count):
            self._start()

    def pids(self) -> list[int]:
        return [process.pid for process, _ in self._children.values()]

    def submit(self, worker: int, task: Task) -> None:
        with contextlib.suppress(OSError):  # a lost worker is handled by wait()
            self._children[worker][1].send(task)

    def wait(self) -> Event:
        while not self._events:
            numbers = {connection: worker for worker, (_, connection) in self._children.items()}
            for connection in wait(list(numbers)):
                self._receive(numbers[connection])  # type: ignore[index]
        return self._events.popleft()

    def close(self) -> None:
        for process, connection in self._children.values():
            connection.close()
            process.kill()
        for process, _ in self._children.values():
            process.wait()
        self._children.clear()

    def _receive(self, worker: int) -> None:
        process, connection = self._children[worker]
        try:
            message = connection.recv()
        except (EOFError, OSError):
            connection.close()
            del self._children[worker]
            self._events.append(Lost(worker, _end_of(process)))
            self._start()
            return
        self._events.append(Ready(worker, message) if isinstance(message, str) else Result(worker, message))

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        path = os.pathsep.join(filter(None, [importable_from(), os.environ.get("PYTHONPATH", "")]))
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-c", f"from {__name__} import serve; serve({theirs.fileno()})"],
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": path},
            )
        connection = Connection(ours.detach())
        self._children[self._next] = process, connection
        self._next += 1
        with contextlib.suppress(OSError):
            connection.send(self._start_with)


def importable_from() -> str:
    """Returns the folder that contains this package."""
    return str(Path(str(sys.modules[__name__.partition(".")[0]].__file__)).absolute().parent.parent)


def _end_of(process: Any) -> str:
    code = process.wait()
    return f"ended by signal {-code} ({signal.Signals(-code).name})" if code < 0 else f"ended with exit code {code}"


def serve(number: int) -> None:
    """Main function of a worker's process, at the other end of a socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the driver handles Ctrl-C, and closes the socket
    connection = Connection(number)
    with contextlib.suppress(EOFError, OSError):
        spec, packed = connection.recv()
        started = _started(spec, packed)
        if isinstance(started, Failed):
            connection.send(started)
            return
        connection.send(machine())
        while True:
            outcome: Outcome = started.perform(connection.recv())
            connection.send(outcome)


def _started(spec: Spec, packed: Packed) -> Union[Performs, Failed]:
    try:
        return Worker(spec, packed)
    except Exception as error:
        return Failed(f"{machine()} cannot start: {error}")
