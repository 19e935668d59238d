"""Progress of a run: completed share, rate and remaining time."""

from __future__ import annotations

import time
from typing import Optional, TextIO

_EVERY_S = {True: 0.5, False: 10.0}  # terminals, files


class Progress:
    """Writes lines to a stream, or updates one line on a terminal. Without a stream, writes nothing."""

    def __init__(self, stream: Optional[TextIO]):
        self._stream = stream
        self._terminal = stream is not None and stream.isatty()
        self._rows = self._done = self._made = 0
        self._start = self._shown = time.monotonic()

    def start(self, rows: int, done: int) -> None:
        self._rows, self._done = rows, done
        if done:
            self.say(f"goes on: {done:,} of {rows:,} rows are done")

    def add(self, rows: int) -> None:
        self._done += rows
        self._made += rows
        now = time.monotonic()
        if now - self._shown >= _EVERY_S[self._terminal] or self._done == self._rows:
            self._shown = now
            self._show(self.text(now - self._start))

    def text(self, seconds: float) -> str:
        """Returns the line after so many seconds of this run."""
        rate = self._made / max(seconds, 1e-9)
        left = (self._rows - self._done) / max(rate, 1e-9)
        return f"{self._done:,} of {self._rows:,} rows, {rate:,.0f} rows/s, {_duration(left)} left"

    def say(self, text: str) -> None:
        """Writes an event."""
        if self._stream is not None:
            print(f"\r\033[K{text}" if self._terminal else text, file=self._stream, flush=True)

    def end(self) -> None:
        if self._terminal:
            print(file=self._stream, flush=True)

    def _show(self, text: str) -> None:
        if self._stream is not None:
            print(
                f"\r\033[K{text}" if self._terminal else text,
                end="" if self._terminal else "\n",
                file=self._stream,
                flush=True,
            )


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
